"""`touchstone cheapest` and `touchstone tune`: the cheapest setting within limits."""

from __future__ import annotations

import sys
from functools import partial
from math import isfinite
from os import cpu_count
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes.chosen import AllowPathsOption, scenarios_for

if TYPE_CHECKING:
    from collections.abc import Mapping

    from touchstone.reports.studies.tuning import Asked, Found
    from touchstone.reports.studies.work_precision.cheapest import Answer, MeasuredSetting
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
    from touchstone.reports.studies.work_precision.cheapest import cheapest as find
    from touchstone.reports.studies.work_precision.cheapest import missing_quantities, settings_of_scene
    from touchstone.reports.studies.work_precision.points import QUANTITIES
    from touchstone.reports.studies.work_precision.study import StudyCells, measure
    from touchstone.scenarios.catalogue import catalogue

    scene = catalogue()[options.known("scenario", scenario, catalogue())]
    limits = limits_of(
        overlap=overlap,
        energy=energy,
        friction=friction,
        position=position,
        events=events,
        budget=frame_budget,
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
            print("\n".join(lines(answer, limits)))
        else:
            show_rows(rows(answer, limits), output)
    if not answer.met:
        raise typer.Exit(options.LIMIT_BROKEN)


def limits_of(*, budget: str, **asked: str) -> dict[str, float]:
    """Limits by quantity [SI]; a wrong one exits with one line."""
    from touchstone.reports.studies.work_precision.cheapest import TIME, ToleranceError, tolerance
    from touchstone.reports.studies.work_precision.points import QUANTITIES

    with options.refusing(ToleranceError):
        limits = {
            name: tolerance(text, QUANTITIES[name].unit, f"--{name}") for name, text in asked.items() if text
        }
        if budget:
            limits[TIME] = tolerance(budget, "s", "--frame-budget")
    return limits


def rows(answer: Answer, limits: dict[str, float]) -> list[dict[str, object]]:
    """The settings of the answer, the cheapest first, each with its place."""
    places: tuple[tuple[str, tuple[MeasuredSetting | None, ...]], ...] = (
        ("cheapest" if answer.met else "nearest miss", (answer.best,)),
        ("cannot tell apart", answer.tied),
        ("runner-up" if answer.met else "next", (answer.runner_up,)),
        ("next engine", (answer.other_engine,)),
    )
    found: dict[tuple[object, ...], dict[str, object]] = {}
    for place, settings in places:
        for one in settings:
            if one is None:
                continue
            key = (one.engine, one.profile, one.settings, one.dt)
            found.setdefault(key, setting_row(place, one, limits))
    return list(found.values())


def setting_row(
    place: str, one: MeasuredSetting, limits: Mapping[str, float], **more: object
) -> dict[str, object]:
    """A setting with its place, `more`, times [s], errors and limits [SI], and the command that plays it. An
    infinite error, such as that of a passage, is None: JSON has none."""
    row: dict[str, object] = {"place": place, "engine": one.engine, "profile": one.profile}
    row |= {"settings": one.settings, "dt": one.dt, **more}
    row |= {"time": one.time, "time_low": one.time_low, "time_high": one.time_high}
    errors = {name: one.errors[name] for name in limits if name in one.errors}
    row |= {f"error {name}": value if isfinite(value) else None for name, value in errors.items()}
    return row | {f"limit {name}": limit for name, limit in limits.items()} | {"command": one.command}


def lines(answer: Answer, limits: dict[str, float]) -> list[str]:
    """The answer as text."""
    best, second = answer.best, answer.runner_up
    cheapest = "cannot tell apart" if answer.tied else "cheapest"
    head = cheapest if answer.met else "nothing measured meets all; nearest miss"
    found = [f"{head}: {words_of(best)}", f"  {margins(best, limits)}"]
    found += [f"and: {words_of(one)}" for one in answer.tied]
    if second is not None and second not in answer.tied:
        ratio = f", {second.time / best.time:.3g} times the time" if answer.met else ""
        found.append(f"{'runner-up' if answer.met else 'next'}: {words_of(second)}{ratio}")
    if (other := answer.other_engine) is not None and other not in (second, *answer.tied):
        found.append(f"next engine: {words_of(other)}, {other.time / best.time:.3g} times the time")
    return [*found, f"again: {best.command}"]


def words_of(setting: MeasuredSetting) -> str:
    """A setting and its time, with the range of the rounds."""
    from touchstone.reports.runner.request import step_text
    from touchstone.reports.studies.work_precision.study import number

    label = f"{setting.engine} {setting.profile} {setting.settings}".strip()
    low, high = number(setting.time_low, "s"), number(setting.time_high, "s")
    return f"{label} at {step_text(setting.dt)} s: {number(setting.time, 's')} a frame ({low} to {high})"


def margins(setting: MeasuredSetting, limits: Mapping[str, float]) -> str:
    """Each error beside its limit."""
    from touchstone.reports.studies.work_precision.cheapest import TIME
    from touchstone.reports.studies.work_precision.points import QUANTITIES
    from touchstone.reports.studies.work_precision.study import number

    parts = []
    for name, limit in limits.items():
        value = setting.time if name == TIME else setting.errors[name]
        unit = "s" if name == TIME else QUANTITIES[name].unit
        over = "" if value <= limit else f", {value / limit:.3g} times too much" if limit else ", too much"
        if name == TIME and (setting.time_low <= limit) != (setting.time_high <= limit):
            over += ", within noise"
        parts.append(f"{name} {number(value, unit)} of {number(limit, unit)}{over}")
    return "; ".join(parts)


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
    from touchstone.reports.runner.executors import ClusterError, DaskPool
    from touchstone.reports.runner.store import StoreError
    from touchstone.reports.studies.study import RefusedError
    from touchstone.reports.studies.tuning import Asked, Search
    from touchstone.reports.studies.work_precision.cheapest import TIME

    if not engine:
        options.stop("tune: name the engine whose settings are searched, such as --engine mujoco")
    limits = limits_of(
        position=position,
        friction=friction,
        overlap=overlap,
        energy=energy,
        events=events,
        budget=frame_budget,
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
    asked = Asked(name, chosen, limits, tried, rounds, seed, store, jobs, executor)
    for line in [] if quiet else cost_lines(asked):
        print(line, file=sys.stderr, flush=True)
    with (
        options.resumable(store),
        options.measuring(tried * len(chosen), quiet, StoreError, ClusterError, RefusedError) as progress,
    ):
        found = Search(asked, progress).run()
    try:
        pasted = lines_to_paste(asked, found)
    except AdapterError as error:
        pasted = [f"none: {error}"]
    with options.output_to(out):
        if output is options.Format.table:
            if not quiet or out is not None:
                print("\n".join(tuned_lines(asked, found, pasted)))
        else:
            from touchstone.reports.docs.listing import show_rows

            show_rows(tuned_rows(asked, found, pasted), output)
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


def cost_lines(asked: Asked) -> list[str]:
    """What is about to be played."""
    from touchstone.reports.studies.tuning import Search
    from touchstone.scenarios.plural import plural

    seconds = sum(scenario.duration for scenario in asked.scenes.values())
    search = Search(asked, lambda label, cells: None)
    truths, plays = len(search.truths), max(asked.plays, len(search.space.profiles()))
    also = f", {plural(truths, 'play')} of the reference for what is true" if truths else ""
    scenes = (
        f"{len(asked.scenes)} scenes" if len(asked.scenes) > 1 else next(iter(asked.scenes.values())).name
    )
    return [
        f"tune {scenes} on {asked.engine}: {plays} settings of {seconds:g} simulated seconds{also}; "
        f"Ctrl-C keeps what was played in {asked.store}"
    ]


def lines_to_paste(asked: Asked, found: Found) -> list[str]:
    """Lines that set the best setting in the engine's own API, as in the scripts of `reproduce`."""
    from touchstone.adapters.scripts.process import settings_lines

    several = [settings_lines(scene, asked.engine, [found.candidate])[0] for scene in asked.scenes.values()]
    return list(dict.fromkeys(line for part in several for line in part))


def tuned_lines(asked: Asked, found: Found, pasted: list[str]) -> list[str]:
    """The answer as text."""
    best = found.best
    head = "best" if found.met else "no setting reaches the limits; nearest"
    every = "" if found.tried >= asked.plays else ", all that differ"
    text = [f"{head} of {found.tried} settings{every}: {words_of(best)}"]
    text += [f"  {margins(best, asked.limits)}", "to paste:"]
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
    from touchstone.reports.studies.work_precision.cheapest import TIME
    from touchstone.reports.studies.work_precision.points import QUANTITIES
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


def tuned_rows(asked: Asked, found: Found, pasted: list[str]) -> list[dict[str, object]]:
    """The best setting, its ablation and the profiles, a row each (`setting_row`)."""
    places = [("best" if found.met else "nearest", found.best), *found.ablation.items()]
    places += [("profile", one) for one in found.profiles]
    return [
        setting_row(place, one, asked.limits, excess=one.excess if isfinite(one.excess) else None)
        | {"paste": "\n".join(pasted) if one is found.best else ""}
        for place, one in places
    ]
