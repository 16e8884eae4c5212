"""`touchstone soak`: random scenes for as long as asked."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    LIMIT_BROKEN,
    Format,
    FormatOption,
    QuietOption,
    YesOption,
    folder_of_now,
    known,
    require_judge,
    stop,
)

MOST_MINUTES = 100_000.0
"""Longest soak [min]: seventy days."""


def soak(
    minutes: Annotated[
        float, typer.Option(min=0.0, max=MOST_MINUTES, help="Time after which no scene is started.")
    ] = 10.0,
    seed: Annotated[int, typer.Option(min=0, help="Of the first random scene.")] = 0,
    profile: Annotated[str, typer.Option(help="Profile of the reference.")] = "balanced",
    out: Annotated[Path | None, typer.Option(help="Folder of failures (default: runs/soak-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Play random scenes on the reference for as long as asked; shrink each failure to its smallest scene."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.cli.listing import show_rows
    from touchstone.reports.soak.soak import Extent
    from touchstone.reports.soak.soak import soak as run

    known("profile", profile, ENGINES["reference"].profiles)
    folder = out or folder_of_now("soak-")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        stop(f"--out {folder}: exists and is not an empty folder", BAD_INPUT)
    require_judge()
    said = print if output is Format.table else lambda line: print(line, file=sys.stderr)
    found = run(Extent(minutes, seed), profile, folder, said)
    counts = {"seed": seed, "scenes": found.scenes, "frames": found.frames, "broken": len(found.failures)}
    if output is not Format.table:
        show_rows([counts | {f"outcome {name}": count for name, count in found.classes.items()}], output)
    elif not quiet:
        classes = ", ".join(f"{count} {name}" for name, count in found.classes.most_common())
        print(f"{found.scenes} scenes from seed {seed}, {found.frames} frames: {classes}")
        print(f"broken invariants: {len(found.failures)}" + (f", in {folder}" if found.failures else ""))
    if found.failures:
        raise typer.Exit(LIMIT_BROKEN)
