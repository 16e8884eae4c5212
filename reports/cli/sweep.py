"""`touchstone sweep`: a grid of cells, measured in parallel and kept in a store."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    Format,
    FormatOption,
    QuietOption,
    columns_for,
    exit_for,
    known,
    measuring,
    printed,
    resumable,
    stop,
)

if TYPE_CHECKING:
    from touchstone.scenarios.scenario import Scenario

DEFAULT_STORE = Path("runs/sweep")


def sweep(
    scenario: Annotated[list[str] | None, typer.Argument(help="Scenes (default: --tag).")] = None,
    tag: Annotated[str, typer.Option(help="Every scene with this tag.")] = "gallery",
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    profile: Annotated[
        list[str] | None, typer.Option(help="Profiles (default: balanced, recommended, equal-step).")
    ] = None,
    dt: Annotated[str, typer.Option(help="Native steps [s], such as 1/60,1/240,1/960.")] = "",
    change: Annotated[
        list[str] | None,
        typer.Option("--set", help="KEY=VALUE[,VALUE...] or ENGINE.KEY=... (touchstone list settings)."),
    ] = None,
    repeats: Annotated[int, typer.Option(min=1, help="How often each cell is measured.")] = 1,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    out: Annotated[Path, typer.Option(help="Folder of the store; what it holds is skipped.")] = DEFAULT_STORE,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Measure every combination of scene, engine, profile and step, each once."""
    from touchstone.adapters.knobs import SettingError
    from touchstone.reports.run.request import DEFAULT_PROFILES
    from touchstone.reports.sweep.cells import grid
    from touchstone.reports.sweep.store import StoreError
    from touchstone.reports.sweep.sweep import sweep as run_sweep

    scenarios = scenes_for(scenario or [], tag)
    columns = columns_for(engine or [], profile or [], DEFAULT_PROFILES)
    names = [one.name for one in scenarios]
    try:
        cells = grid(names, columns, steps=steps_for(dt, scenarios), changes=change or [], repeats=repeats)
    except SettingError as error:
        stop(f"--set {error}", BAD_INPUT)
    with resumable(out), measuring(len(cells), quiet, StoreError) as progress:
        frame = run_sweep(cells, out, jobs=jobs, progress=progress)
    if not printed(frame, output) and not quiet:
        from touchstone.reports.sweep.table import show
        from touchstone.reports.views.terminal import console

        show(frame, console())
        print(f"store: {out}")
    exit_for(frame[frame.metric == "run"].verdict, bool(engine))


def scenes_for(names: list[str], tag: str) -> list[Scenario]:
    """The named scenes, or all with the tag; a wrong name exits with one line."""
    from touchstone.scenarios.catalogue import catalogue, tagged, tags

    if names:
        return [catalogue()[known("scenario", name, catalogue())] for name in dict.fromkeys(names)]
    return list(tagged(known("tag", tag, tags())))


def steps_for(text: str, scenarios: list[Scenario]) -> list[float]:
    """Steps [s] of "1/60,1/240"; each must divide the frame of every scene."""
    from touchstone.adapters.recorder import substeps

    found = []
    for part in filter(None, map(str.strip, text.split(","))):
        try:
            step = float(Fraction(part))
            for scenario in scenarios:
                substeps(scenario, step)
        except (ValueError, ZeroDivisionError, OverflowError) as error:
            stop(f"--dt {part}: {error}", BAD_INPUT)
        found.append(step)
    return list(dict.fromkeys(found))
