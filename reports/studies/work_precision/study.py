"""The study `work-precision`: cells, their sweep, the table of errors over time, and its verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite, log
from pathlib import Path
from time import perf_counter
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.registry import ENGINES
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress, quietly
from touchstone.reports.results import illustrate, save_manifest, write_beside
from touchstone.reports.runner.cells import ACCURACY, Cell
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.request import step_text
from touchstone.reports.runner.sweep import InTurns, sweep
from touchstone.reports.studies.work_precision.points import (
    BAND,
    QUANTITIES,
    QUICK_LADDER,
    QUICK_REPEATS,
    REFERENCE,
    REPEATS,
    STUDY,
    fronts,
    ladder,
    ladder_cells,
    measured_cells,
    points,
    timing_cell,
    truth_cells,
)
from touchstone.reports.views.pictures import NOTHING, PALE, ends, grid, log_axis, looks, rule, save
from touchstone.reports.views.render import Part
from touchstone.scenarios.avatar.number_checks import number_of
from touchstone.scenarios.catalogue import catalogue

UNITS = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "1": {"%": 1e-2, "": 1.0},
}
"""Units of a quantity and their sizes in SI."""
TIME = "frame time"
"""Name of the budget among the tolerances [s per displayed frame]."""
KEYS = ["engine", "profile", "settings", "dt"]


class ToleranceError(ValueError):
    """A tolerance that cannot be read; the message names the valid units."""


@dataclass(frozen=True, slots=True)
class MeasuredSetting:
    """A measured setting of one scene.

    Attributes:
        time: wall time per displayed frame [s]: the median of the rounds.
        time_low, time_high: least and largest time of the rounds [s].
        errors: by quantity.
        excess: the largest ratio of an error, or of the time, to its limit; at most 1 meets all.
        tightest: the quantity with that ratio.
        command: the line that plays it again.
    """

    engine: str
    profile: str
    settings: str
    dt: float
    time: float
    time_low: float
    time_high: float
    errors: Mapping[str, float]
    excess: float
    tightest: str
    command: str

    def overlaps(self, other: MeasuredSetting) -> bool:
        """Whether the intervals of both times overlap: the rounds do not say which is faster."""
        return self.time_low <= other.time_high and other.time_low <= self.time_high


@dataclass(frozen=True, slots=True)
class Answer:
    """The answer of a query: `met` says whether `best` meets the tolerances or is the nearest miss.

    `runner_up` is the next cheapest that meets them, of another engine if `other_engine` is one; `tied` are
    all that meet them and whose times cannot be told apart from that of `best`.
    """

    met: bool
    best: MeasuredSetting
    runner_up: MeasuredSetting | None
    other_engine: MeasuredSetting | None
    tied: tuple[MeasuredSetting, ...] = ()


def tolerance(text: str, unit: str, option: str) -> float:
    """A tolerance such as "1mm" or "1%" in SI; raises ToleranceError with the valid units."""
    stripped = text.strip()
    number = stripped.rstrip("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ%")
    name = stripped[len(number) :].strip()
    valid = ", ".join(f"{one}" for one in UNITS[unit] if one)
    if name not in UNITS[unit]:
        found = f"unit {name!r}" if name else "no unit"
        raise ToleranceError(f"{option} {text}: {found}; valid: {valid}, such as 1{next(iter(UNITS[unit]))}")
    try:
        value = number_of(number) * UNITS[unit][name]
    except ValueError:
        value = -1.0
    if not 0 <= value < inf:
        raise ToleranceError(f"{option} {text}: expected a number of {valid} that is not negative")
    return value


def settings_of_scene(table: pd.DataFrame, frame_rate: float) -> list[MeasuredSetting]:
    """All settings of a scene that were timed, by their time.

    Args:
        table: rows of one scene (`points`).
        frame_rate: displayed frames per second.
    """
    found = []
    usable = table[(table.quantity != "") & table.time.notna()]
    for _, part in usable.groupby(KEYS, sort=False):
        first = part.iloc[0]
        errors = dict(zip(part.quantity, part.error))
        label = (first.engine, first.profile, first.settings, float(first["dt"]))
        time, low, high = (float(first[name]) / frame_rate for name in ("time", "time_low", "time_high"))
        found.append(MeasuredSetting(*label, time, low, high, errors, 0.0, "", first.reproduce))
    return sorted(found, key=lambda one: one.time)


def cheapest(
    known: Sequence[MeasuredSetting], limits: Mapping[str, float], engine: str = ""
) -> Answer | None:
    """The cheapest setting within all limits, or the one that misses them by the least factor.

    Args:
        known: settings of a scene, by their time.
        limits: by quantity, and TIME for the budget [s].
        engine: of which settings; "": of all.
    Returns:
        None if no timed setting has all quantities of the limits.
    """
    quantities = limits.keys() - {TIME}
    mine = [
        rated(one, limits)
        for one in known
        if (not engine or one.engine == engine) and quantities <= one.errors.keys()
    ]
    if not mine:
        return None
    within = [one for one in mine if one.excess <= 1]
    if not within:
        ranked = sorted(mine, key=lambda one: (one.excess, one.time))
        return Answer(False, ranked[0], ranked[1] if len(ranked) > 1 else None, None)
    best = within[0]
    others = [one for one in within if one.engine != best.engine]
    tied = tuple(one for one in within[1:] if best.overlaps(one))
    return Answer(True, best, within[1] if len(within) > 1 else None, others[0] if others else None, tied)


def rated(setting: MeasuredSetting, limits: Mapping[str, float]) -> MeasuredSetting:
    """The setting with its largest ratio to a limit."""
    values = {**setting.errors, TIME: setting.time}
    over = {name: inf if values[name] else 0.0 for name in limits}  # a limit of 0 is met by 0 only
    ratios = {name: values[name] / limit if limit else over[name] for name, limit in limits.items()}
    tightest = max(ratios, key=lambda name: ratios[name])
    return replace(setting, excess=ratios[tightest], tightest=tightest)


def missing_quantities(table: pd.DataFrame, limits: Mapping[str, float]) -> list[str]:
    """Quantities of the limits that no setting of the scene has."""
    return [name for name in limits if name in QUANTITIES and name not in set(table.quantity)]


def answer_rows(answer: Answer, limits: dict[str, float]) -> list[dict[str, object]]:
    """The settings of the answer, the cheapest first, each with its place."""
    places = [("cheapest" if answer.met else "nearest miss", answer.best)]
    places += [("cannot tell apart", one) for one in answer.tied]
    others = (("runner-up" if answer.met else "next", answer.runner_up), ("next engine", answer.other_engine))
    places += [(place, one) for place, one in others if one is not None]
    found: dict[tuple[object, ...], dict[str, object]] = {}
    for place, one in places:
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


def answer_lines(answer: Answer, limits: dict[str, float]) -> list[str]:
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
    label = f"{setting.engine} {setting.profile} {setting.settings}".strip()
    low, high = number(setting.time_low, "s"), number(setting.time_high, "s")
    return f"{label} at {step_text(setting.dt)} s: {number(setting.time, 's')} a frame ({low} to {high})"


def margins(setting: MeasuredSetting, limits: Mapping[str, float]) -> str:
    """Each error beside its limit."""
    parts = []
    for name, limit in limits.items():
        value = setting.time if name == TIME else setting.errors[name]
        unit = "s" if name == TIME else QUANTITIES[name].unit
        over = "" if value <= limit else f", {value / limit:.3g} times too much" if limit else ", too much"
        if name == TIME and (setting.time_low <= limit) != (setting.time_high <= limit):
            over += ", within noise"
        parts.append(f"{name} {number(value, unit)} of {number(limit, unit)}{over}")
    return "; ".join(parts)


class StudyCells:
    """Cells of the study: measured ones (accuracy and time), ladder (the same), truths (accuracy only)."""

    def __init__(
        self, names: Sequence[str], engines: Sequence[str] = (), quick: bool = False, with_ladder: bool = True
    ) -> None:
        self.names, self.quick = tuple(names), quick
        self.rounds = QUICK_REPEATS if quick else REPEATS
        self.measured = measured_cells(names, engines or tuple(ENGINES), quick)
        climbed = [name for name in names if not quick or name in QUICK_LADDER]
        self.ladder = ladder_cells(climbed) if with_ladder and REFERENCE in (engines or ENGINES) else []
        self.truths = [cell for name in names for cell in truth_cells(name)]

    @property
    def accuracy(self) -> list[Cell]:
        """All accuracy cells: longest scenes first, so that all processes end at about the same time, and
        smallest steps first; scene by scene, because processes keep what they derive from a scene."""
        cells = dict.fromkeys([*self.truths, *self.measured, *self.ladder])
        scenes = {cell.scenario: catalogue()[cell.scenario] for cell in cells}
        sizes = {name: len(one.bodies) * one.duration for name, one in scenes.items()}
        return sorted(cells, key=lambda cell: (-sizes[cell.scenario], cell.scenario, cell.dt))

    @property
    def timing(self) -> list[Cell]:
        """All timing cells; the ladder has one round."""
        timed = [timing_cell(cell, repeat) for repeat in range(self.rounds) for cell in self.measured]
        return list(dict.fromkeys([*timed, *(timing_cell(cell, 0) for cell in self.ladder)]))

    @property
    def size(self) -> int:
        """Number of cells."""
        return len(self.accuracy) + len(self.timing)


def measure(
    asked: StudyCells, store: Path, jobs: int | None = None, progress: Progress = quietly
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measure what the store lacks; returns the tables of points and of the ladder.

    `attrs["seconds"]` of the first has the wall time of each part [s].
    """
    starts = [perf_counter()]
    accuracy = sweep(asked.accuracy, store, jobs=jobs, progress=progress, series=True)
    starts.append(perf_counter())
    ended = set(accuracy[(accuracy.metric == "run") & (accuracy.outcome == "done")].cell)
    done = {cell for cell in asked.accuracy if hash_of(cell) in ended}
    timed = [cell for cell in asked.timing if replace(cell, measure=ACCURACY, repeat=0) in done]
    timing = sweep(timed, store, executor=InTurns, progress=progress, series=True)
    starts.append(perf_counter())
    frame = pd.concat([accuracy, timing], ignore_index=True)
    table, rungs = points(frame, asked.measured, asked.rounds), ladder(frame, asked.ladder)
    spent = np.diff([*starts, perf_counter()]).tolist()
    table.attrs["seconds"] = dict(zip(("accuracy", "timing", "errors"), spent))
    return table, rungs


def run(
    asked: StudyCells, store: Path, out: Path, progress: Progress = quietly, jobs: int | None = None
) -> pd.DataFrame:
    """Measure, draw and store; the folder `out` appears complete or not at all, `store` keeps every cell."""
    with output_folder(out) as folder:
        table, rungs = measure(asked, store, jobs, progress)
        found = fronts(table)
        for name, frame in (("results", table), ("fronts", found), ("ladder", rungs)):
            write_beside(folder / f"{name}.parquet", partial(frame.to_parquet, index=False))
            write_beside(folder / f"{name}.csv", partial(frame.to_csv, index=False))
        start = perf_counter()
        draw(table, folder)
        table.attrs["seconds"]["pictures"] = perf_counter() - start
        facts = {
            "study": STUDY,
            "store": str(store),
            "rounds of timing": asked.rounds,
            "seconds": {name: round(value, 1) for name, value in table.attrs["seconds"].items()},
            "quantities": {q.name: q.meaning for q in QUANTITIES.values()},
            "bands": table.attrs["bands"],
        }
        save_manifest(folder, facts)
    table.attrs |= {"fronts": found, "ladder": rungs}
    return table


LADDER_SHOWN = 1.25
"""Change of an error, up or down, from which a rung of the ladder is shown."""


def number(value: float, unit: str) -> str:
    """A value with its unit, in a readable multiple of it."""
    scales = {"m": ((1e-3, "mm"), (1e-6, "um"), (1e-9, "nm")), "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"))}
    if unit == "1":
        return f"{100 * value:.3g} %"
    if value == 0:
        return f"0 {unit}"
    for scale, name in scales[unit]:
        if value >= scale:
            return f"{value / scale:.3g} {name}"
    return f"{value / scale:.2g} {name}"


def report(table: pd.DataFrame) -> list[Part]:
    """The cheapest point of each engine that meets the usual tolerance, the fronts, and the ladder."""
    fronts, ladder = table.attrs.get("fronts"), table.attrs.get("ladder")
    failed = [
        f"{row.reproduce.removeprefix('touchstone run ')}: {row.outcome}: {row.reason}"
        for row in _rows(table[table.quantity == ""])
    ]
    if seconds := table.attrs.get("seconds"):
        parts = ", ".join(f"{name} {value:.0f} s" for name, value in seconds.items())
        failed.append(f"The study took {sum(seconds.values()):.0f} s: {parts}.")
    bands = [f"{scene}: {words}" for scene, words in table.attrs.get("bands", {}).items()]
    return [
        _answers(table),
        _on_fronts(table),
        Part(lines=bands),
        *([Part(lines=[*_losses(fronts)])] if fronts is not None and len(fronts) else []),
        *([_ladder(ladder)] if ladder is not None and len(ladder) else []),
        Part(lines=failed),
    ]


def _answers(table: pd.DataFrame) -> Part:
    engines = list(dict.fromkeys(table.engine))
    title = "Cheapest measured time per simulated second within the usual tolerance"
    rows = []
    usable = table[(table.quantity != "") & table.time.notna()]
    for (scene, quantity), part in usable.groupby(["scenario", "quantity"], sort=False):
        one = QUANTITIES[str(quantity)]
        cells = []
        for engine in engines:
            mine = part[part.engine == engine]
            within = mine[mine.error <= one.tolerance]
            if not within.empty:
                best = within.loc[within.time.idxmin()]
                cells.append(f"{number(best.time, 's')} at {step_text(best['dt'])}")
            elif not mine.empty:
                cells.append(f"best {number(mine.error.min(), one.unit)}")
            else:
                cells.append("-")
        rows.append([str(scene), str(quantity), number(one.tolerance, one.unit), *cells])
    return Part(title, ["scene", "quantity", "tolerance", *engines], rows, words=2)


MOST_OFTEN = 4


def _on_fronts(table: pd.DataFrame) -> Part:
    """Of how many fronts of its engine each setting is a part, the most frequent ones."""
    if "own_front" not in table:
        return Part()
    rows = []
    for engine, part in table[table.own_front.astype(bool)].groupby("engine", sort=False):
        label = (part.profile + " " + part.settings).str.strip()
        each = part.assign(label=label).drop_duplicates(["scenario", "quantity", "label"])
        count = each.label.value_counts()
        total = len(part.drop_duplicates(["scenario", "quantity"]))
        texts = [f"{name} {number}" for name, number in count.head(MOST_OFTEN).items()]
        rows.append([str(engine), str(total), ", ".join(texts)])
    return Part("Settings on the engine's own fronts", ("engine", "fronts", "settings"), rows, last=1)


def _losses(fronts: pd.DataFrame) -> Iterator[str]:
    won, total = int(fronts.dominates.sum()), len(fronts)
    yield f"The reference's front dominates {won} of {total} fronts (scene, quantity, engine)."
    lost = fronts[~fronts.dominates].sort_values("factor", ascending=False)
    for _, part in lost.groupby(["scenario", "engine", "where", "why"], sort=False):
        first = part.iloc[0]
        by = "" if first.factor == inf else f" by {first.factor:.3g}"
        quantities = ", ".join(part.quantity)
        yield f"  {first.scenario}, {quantities}: {first.engine}{by}: {first.why} ({first['where']})"


def _ladder(ladder: pd.DataFrame) -> Part:
    """Changes of `balanced` that change an error or the time."""
    title = "Profiles against balanced, and one setting of balanced at a time: errors and time"
    heads, rows = ("setting", "as in", "time", "changes"), []
    for (change, towards), part in ladder.groupby(["change", "towards"], sort=False):
        moved = []
        for row in _rows(part):
            floor = QUANTITIES[row.quantity].floor
            before, after = max(row.before, floor), max(row.after, floor)
            if not 1 / LADDER_SHOWN < after / before < LADDER_SHOWN:
                values = f"{number(row.before, row.unit)} -> {number(row.after, row.unit)}"
                ratio = after / before
                size = abs(log(ratio)) if 0 < ratio < inf else inf
                moved.append((size, f"{row.scenario} {row.quantity} {values}"))
        texts = [text for _, text in sorted(moved, reverse=True)]
        more = f"; {len(texts) - 3} more" if len(texts) > 3 else ""
        times = part.drop_duplicates("scenario").time_ratio
        moves = "; ".join(texts[:3]) + more or "none"
        rows.append([str(change), str(towards), f"{times.median():.2f} x", moves])
    return Part(title, heads, rows, words=2, last=1)


def _rows(frame: pd.DataFrame) -> Iterator[Any]:
    return iter(frame.itertuples())


ACROSS = 3
APART = "truth not converged"
PANEL = {"width": 200, "height": 150}
LEGEND = "line: front over an engine's settings; faint: the others; bar: rounds of timing; dotted: tolerance"


def draw(table: pd.DataFrame, folder: Path) -> list[Path]:
    """Write a picture per quantity, with its name in the name of the file, as SVG and PNG."""
    usable = table[(table.quantity != "") & table.time.notna() & np.isfinite(table.error)]
    written = []
    for quantity in (name for name in QUANTITIES if name in set(usable.quantity)):
        for kind in ("svg", "png"):
            path = folder / f"work_precision_{quantity}.{kind}"
            illustrate(path, partial(picture_of, usable, quantity, kind))
            written.append(path)
    return written


def picture_of(table: pd.DataFrame, quantity: str, kind: str, path: Path) -> None:
    """Draw one quantity, a panel per scene."""
    mine = table[table.quantity == quantity]
    known = set(mine.scenario)
    scenes = [one for one in dict.fromkeys(table.scenario) if one in known or _apart(table, one, quantity)]
    panels = [_panel(mine[mine.scenario == scene], scene, quantity) for scene in scenes]
    unit = QUANTITIES[quantity].unit
    title = f"Error: {quantity}{'' if unit == '1' else f' [{unit}]'}"
    save(grid(panels, ACROSS), path, title, LEGEND, kind)


def _panel(part: pd.DataFrame, scene: str, quantity: str) -> Any:
    if part.empty:
        text = alt.Chart(NOTHING, title=scene).mark_text(color=PALE).encode(text=alt.value(APART))
        return text.properties(**PANEL)
    floor = QUANTITIES[quantity].floor
    part = part.assign(drawn=part.error.clip(lower=floor))
    low, high = part.drawn.min(), part.drawn.max()
    x = log_axis(alt.X, "time", "wall time per simulated second [s]", ends(part.time_low, part.time_high))
    y = log_axis(alt.Y, "drawn", "error", (max(low, floor) / 3, max(high * 3, low * 30)))
    marks = looks(dict.fromkeys(part.engine))
    every = alt.Chart(part).encode(x=x, y=y, color=marks["color"])
    front = every.transform_filter("datum.own_front")
    # the band: from the least to the largest of the rounds
    drawn = (
        rule(y=QUANTITIES[quantity].tolerance)
        + every.mark_point(filled=True, size=9, fillOpacity=0.35).encode(shape=marks["shape"])
        + front.mark_line(interpolate="step-after", strokeWidth=1.6)
        + front.mark_rule(strokeWidth=2.5, strokeOpacity=0.3).encode(x="time_low:Q", x2="time_high:Q")
        + front.mark_point(filled=True, size=25, fillOpacity=1).encode(shape=marks["shape"])
    )
    width = part.truth_width.iloc[0]
    band = part.truth.iloc[0] == BAND and width > 0
    note = f"truth: a band of {number(width, part.unit.iloc[0])}" if band else ""
    return drawn.properties(title={"text": scene, "subtitle": note}, **PANEL)


def _apart(table: pd.DataFrame, scene: str, quantity: str) -> bool:
    """Whether a quantity of a scene has no truth because the codes converge to different motions."""
    mine = table[(table.scenario == scene) & (table.quantity == quantity)]
    return mine.empty and quantity in ("position", "events") and scene in table.attrs.get("bands", {})
