"""`touchstone study stability` and `relations`, and `touchstone soak`."""

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
    columns_for,
    ended,
    folder_of_now,
    known,
    measuring,
    require_judge,
    resumable,
    stop,
)
from touchstone.reports.cli.studies import study

MOST_MINUTES = 100_000.0
"""Longest soak [min]: seventy days."""
STORE = Path("runs/stability")
"""Default store of the study `stability`."""


@study.command("stability")
def stability(
    family: Annotated[
        list[str] | None, typer.Argument(help="Families of hard scenes (default: all).", show_default=False)
    ] = None,
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    profile: Annotated[list[str] | None, typer.Option(help="Profiles (default: the usual ones).")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Three levels each, at the profiles' own steps.")
    ] = False,
    sheet: Annotated[
        int,
        typer.Option(min=0, help="Also draw pictures of this many cells at random, without their classes."),
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the cells that --sheet draws.")] = 0,
    store: Annotated[Path, typer.Option(help="Store of measured cells, which are not played again.")] = STORE,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/stability-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Play hard scenes at growing difficulty and step: how far each engine goes, and how it fails."""
    from touchstone.reports.studies.stability.cells import PROFILES, QUICK, Plan, chosen
    from touchstone.reports.studies.stability.study import run
    from touchstone.reports.studies.stability.table import show
    from touchstone.reports.sweep.store import StoreError
    from touchstone.scenarios.difficulty.family import families

    names = [known("family", name, families()) for name in family or ()]
    columns = columns_for(engine or [], profile or [], QUICK if quick else PROFILES)
    if quick and not profile and ("reference", "balanced") in columns:
        columns = (columns[0], ("reference", "accurate"), *columns[1:])
    plan = Plan(columns, chosen(names), quick)
    folder = out or folder_of_now("stability-")
    require_judge()
    with resumable(store), measuring(len(plan.cells()), quiet, StoreError) as progress:
        frame, results = run(plan, folder, store, progress, jobs=jobs)
    if sheet:
        from touchstone.reports.studies.stability.sheet import write_sheets

        with measuring(sheet, quiet, StoreError) as progress:
            write_sheets(results.played, sheet, seed, folder / "sheet", progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))


@study.command("relations")
def relations(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Scenes (default: the smaller probes).", show_default=False)
    ] = None,
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    profile: Annotated[
        list[str] | None, typer.Option(help="Profiles (default: balanced, recommended).")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Six scenes.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/relations-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Turn, mirror, move, scale and split scenes: does the motion change accordingly, and not otherwise?"""
    from touchstone.reports.studies.relations.study import QUICK, default_scenes, run, tasks
    from touchstone.reports.studies.relations.table import show
    from touchstone.scenarios.catalogue import all_names, catalogue, find

    valid = all_names()
    names = list(dict.fromkeys(scenario or (QUICK if quick else ())))
    for name in names:
        if name not in valid:
            known("scenario", name, catalogue())
    scenes = [find(name) for name in names] or default_scenes()
    columns = columns_for(engine or [], profile or [], ("balanced", "recommended"))
    folder = out or folder_of_now("relations-")
    with measuring(len(tasks(columns, scenes)), quiet) as progress:
        frame = run(columns, scenes, folder, progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))


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
