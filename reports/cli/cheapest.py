"""`touchstone cheapest` and `touchstone tune`: the cheapest setting within limits."""

from __future__ import annotations

import sys
from functools import partial
from os import cpu_count
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes import AllowPathsOption, scenarios_for

if TYPE_CHECKING:
    from touchstone.scenarios.scenario import Scenario


def cheapest(
    scenario: Annotated[str, typer.Argument(help="The scene.")],
    overlap: Annotated[str, typer.Option(help="Largest overlap, such as 1mm.")] = "",
    energy: Annotated[str, typer.Option(help="Largest error of energy, such as 1%.")] = "",
    friction: Annotated[str, typer.Option(help="Largest error of friction, such as 2%.")] = "",
    position: Annotated[str, typer.Option(help="Largest error of positions, such as 1cm.")] = "",
    events: Annotated[str, typer.Option(help="Largest error of the times of events, such as 5ms.")] = "",
    frame_budget: Annotated[str, typer.Option(help="Largest time of a frame, such as 4ms.")] = "",
    engine: Annotated[str, typer.Option(help="One engine only.")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="Three steps and two rounds.")] = False,
    jobs: options.JobsOption = None,
    store: options.StoreOption = options.STORE,
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
    yes: options.YesOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Name the cheapest measured setting within tolerances, the runner-up, and the line that plays it.

    Times have the range of their rounds. Settings whose ranges overlap that of the cheapest cannot be told
    apart from it: all are named.
    """
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.docs.listing import show_rows
    from touchstone.reports.runner.store import StoreError
    from touchstone.reports.studies.work_precision.points import QUANTITIES
    from touchstone.reports.studies.work_precision.study import (
        StudyCells,
        answer_lines,
        answer_rows,
        measure,
        missing_quantities,
        settings_of_scene,
    )
    from touchstone.reports.studies.work_precision.study import cheapest as find
    from touchstone.scenarios.catalogue import catalogue

    scene = catalogue()[options.known("scenario", scenario, catalogue())]
    limits = limits_of(
        frame_budget, overlap=overlap, energy=energy, friction=friction, position=position, events=events
    )
    if not limits:
        options.stop("cheapest: give a tolerance, such as --overlap 1mm --energy 1%")
    engines = [options.engine_installed(engine)] if engine else list(ENGINES)
    options.require_judge()
    cells = StudyCells([scene.name], engines, quick, with_ladder=False)
    with options.resumable(store), options.measuring(cells.size, quiet, StoreError) as progress:
        table, _ = measure(cells, store, jobs, progress)
    if gone := missing_quantities(table, limits):
        has = ", ".join(name for name in QUANTITIES if name in set(table.quantity))
        options.stop(f"{scene.name}: no {' and no '.join(gone)} is measured in this scene; it has {has}")
    answer = find(settings_of_scene(table, scene.frame_rate), limits, engine)
    if answer is None:
        options.stop(f"{scene.name}: no setting was measured in all of {', '.join(limits)}")
    with options.output_to(out):
        if output is options.Format.table:
            print("\n".join(answer_lines(answer, limits)))
        else:
            show_rows(answer_rows(answer, limits), output)
    if not answer.met:
        raise typer.Exit(options.LIMIT_BROKEN)


def limits_of(budget: str, **asked: str) -> dict[str, float]:
    """Limits by quantity [SI], in the order asked; a wrong one exits with one line."""
    from touchstone.reports.studies.work_precision.points import QUANTITIES
    from touchstone.reports.studies.work_precision.study import TIME, ToleranceError, tolerance

    with options.refusing(ToleranceError):
        given = {name: text for name, text in asked.items() if text}
        limits = {name: tolerance(text, QUANTITIES[name].unit, f"--{name}") for name, text in given.items()}
        if budget:
            limits[TIME] = tolerance(budget, "s", "--frame-budget")
    return limits


PLAYS, QUICK_PLAYS = 240, 60
TIMINGS, QUICK_TIMINGS = 3, 2


def tune(
    scenario: Annotated[str, typer.Argument(help="Scene, or file of a scene or robot (see import).")] = "",
    engine: Annotated[str, typer.Option(help="The engine whose settings are searched.")] = "",
    position: Annotated[str, typer.Option(help="Largest error of positions, such as 1mm.")] = "",
    friction: Annotated[str, typer.Option(help="Largest error of friction, such as 2%.")] = "",
    overlap: Annotated[str, typer.Option(help="Largest overlap, such as 1mm.")] = "",
    energy: Annotated[str, typer.Option(help="Largest error of energy, such as 1%.")] = "",
    events: Annotated[str, typer.Option(help="Largest error of the times of events, such as 5ms.")] = "",
    frame_budget: Annotated[str, typer.Option(help="Largest time of a frame, such as 2ms.")] = "",
    scenes: Annotated[str, typer.Option(help="Tune for every scene with this tag.")] = "",
    plays: Annotated[int, typer.Option(min=8, help="Settings that are tried.")] = PLAYS,
    quick: Annotated[bool, typer.Option("--quick", help=f"{QUICK_PLAYS} settings, fewer timings.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of the random search.")] = 0,
    jobs: options.JobsOption = None,
    dask: options.DaskOption = "",
    store: options.StoreOption = options.STORE,
    allow_paths: AllowPathsOption = False,
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Search an engine's settings for the cheapest within limits; print the lines that set it in the engine.

    Exit code 1: no setting reaches the limits; the nearest is printed.
    """
    from touchstone.adapters.contract import AdapterError
    from touchstone.reports.docs.listing import show_rows
    from touchstone.reports.runner.store import StoreError
    from touchstone.reports.runner.sweep import ClusterError, DaskPool
    from touchstone.reports.studies import tuning
    from touchstone.reports.studies.study import RefusedError
    from touchstone.reports.studies.work_precision.study import TIME, margins

    if not engine:
        options.stop("tune: name the engine whose settings are searched, such as --engine mujoco")
    limits = limits_of(
        frame_budget, position=position, friction=friction, overlap=overlap, energy=energy, events=events
    )
    if not limits.keys() - {TIME}:
        options.stop("tune: give a limit on an error, such as --position 1mm --friction 2%")
    chosen = tuned_scenes(scenario, scenes, allow_paths)
    name = options.engine_installed(engine)
    if out is not None:
        options.require_new(out)
    options.require_judge()
    executor = partial(DaskPool, dask, jobs or cpu_count() or 1) if dask else None
    tried, rounds = (QUICK_PLAYS, QUICK_TIMINGS) if quick else (plays, TIMINGS)
    asked = tuning.Asked(name, chosen, limits, tried, rounds, seed, store, jobs, executor)
    for line in [] if quiet else tuning.cost_lines(asked):
        print(line, file=sys.stderr, flush=True)
    with (
        options.resumable(store),
        options.measuring(tried * len(chosen), quiet, StoreError, ClusterError, RefusedError) as progress,
    ):
        found = tuning.Search(asked, progress).run()
    try:
        pasted = tuning.lines_to_paste(asked, found)
    except AdapterError as error:
        pasted = [f"none: {error}"]
    with options.output_to(out):
        if output is options.Format.table:
            if not quiet or out is not None:
                print("\n".join(tuning.tuned_lines(asked, found, pasted)))
        else:
            show_rows(tuning.tuned_rows(asked, found, pasted), output)
    if not found.met:
        if quiet:
            print(f"no setting reaches the limits; nearest: {margins(found.best, limits)}", file=sys.stderr)
        raise typer.Exit(options.LIMIT_BROKEN)


def tuned_scenes(scenario: str, tag: str, allow_paths: bool) -> dict[str, Scenario]:
    """Name in the catalogue, or file -> scene; a wrong name exits with one line."""
    from touchstone.scenarios.files.named import path_of

    if bool(scenario) == bool(tag):
        options.stop("tune: name one scene, or a tag by --scenes")
    if tag:
        return {one.name: one for one in scenarios_for([], tag)}
    chosen, *others = scenarios_for([scenario], allow_paths=allow_paths)
    if others:
        options.stop(f"{scenario}: {1 + len(others)} scenes; tune takes a file of one")
    path = path_of(scenario)
    return {str(path.resolve()) if path else chosen.name: chosen}
