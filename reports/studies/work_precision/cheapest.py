"""The cheapest measured setting that meets tolerances, the runner-up, or the nearest miss."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import pandas as pd

from touchstone.reports.runner.request import step_text
from touchstone.reports.studies.work_precision.points import QUANTITIES
from touchstone.reports.studies.work_precision.study import number
from touchstone.scenarios.avatar.number_checks import number_of

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
    ratios = {name: _ratio(values[name], limit) for name, limit in limits.items()}
    tightest = max(ratios, key=lambda name: ratios[name])
    return replace(setting, excess=ratios[tightest], tightest=tightest)


def _ratio(value: float, limit: float) -> float:
    """Value over limit; a limit of 0 is met by 0 only."""
    if limit == 0:
        return 0.0 if value == 0 else inf
    return value / limit


def missing_quantities(table: pd.DataFrame, limits: Mapping[str, float]) -> list[str]:
    """Quantities of the limits that no setting of the scene has."""
    return [name for name in limits if name in QUANTITIES and name not in set(table.quantity)]


def answer_rows(answer: Answer, limits: dict[str, float]) -> list[dict[str, object]]:
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
