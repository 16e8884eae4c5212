"""`touchstone tune`: the cheapest setting of an engine within limits, in the engine's own words."""

from __future__ import annotations

import sys
from functools import partial
from os import cpu_count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli.cheapest import limits_of, margins, setting_row, words_of
from touchstone.reports.cli.options import (
    BAD_INPUT,
    LIMIT_BROKEN,
    Format,
    FormatOption,
    PrintedOutOption,
    QuietOption,
    engine_installed,
    measuring,
    output_to,
    require_judge,
    require_new,
    resumable,
    stop,
)
from touchstone.reports.cli.scenes.chosen import AllowPathsOption, scenarios_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    from touchstone.reports.studies.tuning import Asked, Found
    from touchstone.reports.studies.work_precision.cheapest import MeasuredSetting
    from touchstone.scenarios.scenario import Scenario

PLAYS, QUICK_PLAYS = 240, 60
"""Settings that are tried."""
TIMINGS, QUICK_TIMINGS = 3, 2
"""Rounds of timing at the end."""


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
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    dask: Annotated[str, typer.Option(help="Play on this Dask scheduler (tcp://host:8786), or local.")] = "",
    store: Annotated[
        Path, typer.Option(help="Folder of all cells; what it holds is not measured again.")
    ] = Path("runs/sweep"),
    allow_paths: AllowPathsOption = False,
    out: PrintedOutOption = None,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Search an engine's settings for the cheapest within limits; print the lines that set it in the engine.

    Exit code 1: no setting reaches the limits; the nearest is printed.
    """
    from touchstone.adapters.contract import AdapterError
    from touchstone.reports.studies.study import RefusedError
    from touchstone.reports.studies.tuning import Asked, Search
    from touchstone.reports.studies.work_precision.cheapest import TIME
    from touchstone.reports.sweep.dask_pool import ClusterError, DaskPool
    from touchstone.reports.sweep.store import StoreError

    if not engine:
        stop("tune: name the engine whose settings are searched, such as --engine mujoco", BAD_INPUT)
    limits = limits_of(
        position=position,
        friction=friction,
        overlap=overlap,
        energy=energy,
        events=events,
        budget=frame_budget,
    )
    if not limits.keys() - {TIME}:
        stop("tune: give a limit on an error, such as --position 1mm --friction 2%", BAD_INPUT)
    chosen = scenes_of(scenario, scenes, allow_paths)
    name = engine_installed(engine)
    if out is not None:
        require_new(out)
    require_judge()
    executor = partial(DaskPool, dask, jobs or cpu_count() or 1) if dask else None
    tried, rounds = (QUICK_PLAYS, QUICK_TIMINGS) if quick else (plays, TIMINGS)
    asked = Asked(name, chosen, limits, tried, rounds, seed, store, jobs, executor)
    for line in [] if quiet else cost_lines(asked):
        print(line, file=sys.stderr, flush=True)
    with (
        resumable(store),
        measuring(tried * len(chosen), quiet, StoreError, ClusterError, RefusedError) as progress,
    ):
        found = Search(asked, progress).run()
    try:
        pasted = lines_to_paste(asked, found)
    except AdapterError as error:
        pasted = [f"none: {error}"]
    with output_to(out):
        if output is Format.table:
            if not quiet or out is not None:
                print("\n".join(lines(asked, found, pasted)))
        else:
            from touchstone.reports.cli.listing import show_rows

            show_rows(rows(asked, found, pasted), output)
    if not found.met:
        if quiet:
            print(f"no setting reaches the limits; nearest: {margins(found.best, limits)}", file=sys.stderr)
        raise typer.Exit(LIMIT_BROKEN)


def scenes_of(scenario: str, tag: str, allow_paths: bool) -> dict[str, Scenario]:
    """Name in the catalogue, or file -> scene; a wrong name exits with one line."""
    from touchstone.scenarios.files.named import path_of

    if bool(scenario) == bool(tag):
        stop("tune: name one scene, or a tag by --scenes", BAD_INPUT)
    if tag:
        return {one.name: one for one in scenarios_for([], tag)}
    chosen, *others = scenarios_for([scenario], allow_paths=allow_paths)
    if others:
        stop(f"{scenario}: {1 + len(others)} scenes; tune takes a file of one", BAD_INPUT)
    path = path_of(scenario)
    return {str(path.resolve()) if path else chosen.name: chosen}


def cost_lines(asked: Asked) -> list[str]:
    """What is about to be played."""
    from touchstone.reports.studies.tuning import Search

    seconds = sum(scenario.duration for scenario in asked.scenes.values())
    truths = len(Search(asked, lambda label, cells: None).truths)
    also = f", {truths} plays of the reference for what is true" if truths else ""
    scenes = (
        f"{len(asked.scenes)} scenes" if len(asked.scenes) > 1 else next(iter(asked.scenes.values())).name
    )
    return [
        f"tune {scenes} on {asked.engine}: {asked.plays} settings of {seconds:g} simulated seconds{also}; "
        f"Ctrl-C keeps what was played in {asked.store}"
    ]


def lines_to_paste(asked: Asked, found: Found) -> list[str]:
    """Lines that set the best setting in the engine's own API, as in the scripts of `reproduce`."""
    from touchstone.adapters.scripts.process import settings_lines

    several = [
        settings_lines(scene, asked.engine, [found.candidate.settings])[0] for scene in asked.scenes.values()
    ]
    return list(dict.fromkeys(line for part in several for line in part))


def lines(asked: Asked, found: Found, pasted: list[str]) -> list[str]:
    """The answer as text."""
    best = found.best
    head = "best" if found.met else "no setting reaches the limits; nearest"
    text = [f"{head} of {found.tried}: {words_of(best)}", f"  {margins(best, asked.limits)}", "to paste:"]
    text += [f"  {line}" for line in pasted]
    if found.ablation:
        text.append("what each setting does, put back to the default:")
        text += [f"  {what}: {compared(one, best, asked.limits)}" for what, one in found.ablation.items()]
    text.append("profiles as they are:")
    text += [f"  {words_of(one)}; {margins(one, asked.limits)}" for one in found.profiles]
    text.append(f"again: {best.command}")
    if len(asked.scenes) == 1:
        text.append(f"as a script: {best.command.replace('touchstone run', 'touchstone reproduce')}")
    return text


def compared(one: MeasuredSetting, best: MeasuredSetting, limits: Mapping[str, float]) -> str:
    """Errors and time of a setting, and over those of the best."""
    from math import isfinite

    from touchstone.reports.studies.work_precision.cheapest import TIME
    from touchstone.reports.studies.work_precision.definitions import QUANTITIES
    from touchstone.reports.studies.work_precision.study import number

    if not isfinite(one.excess):
        return "does not play to the end, or lets bodies pass through each other"
    parts = []
    for name in [*(name for name in limits if name != TIME), TIME]:
        value, other = (s.time if name == TIME else s.errors[name] for s in (one, best))
        unit = "s" if name == TIME else QUANTITIES[name].unit
        ratio = f" ({value / other:.3g} times)" if other else ""
        parts.append(f"{name} {number(value, unit)}{ratio}")
    return "; ".join(parts)


def rows(asked: Asked, found: Found, pasted: list[str]) -> list[dict[str, object]]:
    """The best setting, its ablation and the profiles, a row each (`setting_row`)."""
    from math import isfinite

    places = [("best" if found.met else "nearest", found.best), *found.ablation.items()]
    places += [("profile", one) for one in found.profiles]
    return [
        setting_row(place, one, asked.limits, excess=one.excess if isfinite(one.excess) else None)
        | {"paste": "\n".join(pasted) if one is found.best else ""}
        for place, one in places
    ]
