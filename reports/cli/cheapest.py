"""`touchstone cheapest`: the cheapest setting of a scene that meets tolerances."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    LIMIT_BROKEN,
    Format,
    FormatOption,
    PrintedOutOption,
    QuietOption,
    YesOption,
    engine_installed,
    known,
    measuring,
    output_to,
    require_judge,
    resumable,
    stop,
)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from touchstone.reports.studies.work_precision.cheapest import Answer, MeasuredSetting


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
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    store: Annotated[
        Path, typer.Option(help="Folder of all cells; what it holds is not measured again.")
    ] = Path("runs/sweep"),
    out: PrintedOutOption = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Name the cheapest measured setting within tolerances, the runner-up, and the line that plays it.

    Times have the range of their rounds. Settings whose ranges overlap that of the cheapest cannot be told
    apart from it: all are named.
    """
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.cli.listing import show_rows
    from touchstone.reports.studies.work_precision.cheapest import cheapest as find
    from touchstone.reports.studies.work_precision.cheapest import (
        missing_quantities,
        settings_of_scene,
    )
    from touchstone.reports.studies.work_precision.definitions import QUANTITIES
    from touchstone.reports.studies.work_precision.study import StudyCells, measure
    from touchstone.reports.sweep.store import StoreError
    from touchstone.scenarios.catalogue import catalogue

    scene = catalogue()[known("scenario", scenario, catalogue())]
    limits = limits_of(
        overlap=overlap,
        energy=energy,
        friction=friction,
        position=position,
        events=events,
        budget=frame_budget,
    )
    if not limits:
        stop("cheapest: give a tolerance, such as --overlap 1mm --energy 1%", BAD_INPUT)
    engines = [engine_installed(engine)] if engine else list(ENGINES)
    require_judge()
    cells = StudyCells([scene.name], engines, quick, with_ladder=False)
    with resumable(store), measuring(cells.size, quiet, StoreError) as progress:
        table, _ = measure(cells, store, jobs, progress)
    if gone := missing_quantities(table, limits):
        has = ", ".join(name for name in QUANTITIES if name in set(table.quantity))
        stop(f"{scene.name}: no {' and no '.join(gone)} is measured in this scene; it has {has}", BAD_INPUT)
    answer = find(settings_of_scene(table, scene.frame_rate), limits, engine)
    if answer is None:
        stop(f"{scene.name}: no setting was measured in all of {', '.join(limits)}", BAD_INPUT)
    with output_to(out):
        if output is Format.table:
            print("\n".join(lines(answer, limits)))
        else:
            show_rows(rows(answer, limits), output)
    if not answer.met:
        raise typer.Exit(LIMIT_BROKEN)


def limits_of(*, budget: str, **asked: str) -> dict[str, float]:
    """Limits by quantity [SI]; a wrong one exits with one line."""
    from touchstone.reports.studies.work_precision.cheapest import TIME, ToleranceError, tolerance
    from touchstone.reports.studies.work_precision.definitions import QUANTITIES

    try:
        limits = {
            name: tolerance(text, QUANTITIES[name].unit, f"--{name}") for name, text in asked.items() if text
        }
        if budget:
            limits[TIME] = tolerance(budget, "s", "--frame-budget")
    except ToleranceError as error:
        stop(str(error), BAD_INPUT)
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
    from touchstone.reports.run.request import step_text
    from touchstone.reports.studies.work_precision.study import number

    label = f"{setting.engine} {setting.profile} {setting.settings}".strip()
    low, high = number(setting.time_low, "s"), number(setting.time_high, "s")
    return f"{label} at {step_text(setting.dt)} s: {number(setting.time, 's')} a frame ({low} to {high})"


def margins(setting: MeasuredSetting, limits: Mapping[str, float]) -> str:
    """Each error beside its limit."""
    from touchstone.reports.studies.work_precision.cheapest import TIME
    from touchstone.reports.studies.work_precision.definitions import QUANTITIES
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
