"""`ratio.time`: the reference's time over an engine's, judged on the frames in which one has a contact.

Ratio of the reference's time to an engine's as a product: steps x articulated dynamics x time per step.

With r the reference at its own step and q at the common step, R an engine at its own step, E at the common
step and P there with kinematic links, all over the same frames: r / R = (r / q * E / R) * (P / E) * (q / P).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isfinite, isnan, nan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import own_environment
from touchstone.reports.bootstrap import RATIO, STATISTICS, Indices, mean, restart_ratio
from touchstone.reports.metrics.context import ROUNDING
from touchstone.reports.results import UNJUDGED, Row
from touchstone.reports.run.time_limits import AIMING, POSED_LABEL, judged_time, kind_of
from touchstone.reports.runner.request import EQUAL_PROFILE, MACHINE_PROFILE, REFERENCE, reproduce
from touchstone.reports.verdict.judge import is_own_step
from touchstone.reports.verdict.limits import is_foreign
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario

CONTACTING = "pairs.contacting"
"""Counter of the reference: pairs that touch in the driven loop, which resolves them without impulses."""


def contact_frames(recording: Recording) -> NDArray[np.bool_]:
    """Frames (f,) in which a contact bears an impulse, or a driven body is kept off an obstacle."""
    found = np.zeros(len(recording.time_frame), dtype=bool)
    rows: Any = recording.contacts[np.abs(recording.contacts["impulse"]).max(axis=1, initial=0.0) > 0]
    rate = 1 / recording.time[1] if len(recording.time) > 1 else 1.0
    frames = np.floor(rows["time"] * rate + ROUNDING).astype(int)
    found[frames[frames < len(found)]] = True
    names = recording.work_names.tolist()
    if CONTACTING in names:
        found |= recording.work[:, names.index(CONTACTING)] > 0
    return found


FRAMES, MEDIAN = "ratio.frames", f"{RATIO}.median"
"""Metrics: number of frames in which one of the two has a contact; ratio of the medians over all frames."""
DEEPER, NO_DEEPER, UNCOMPARED = "deeper", "no-deeper", "uncompared"
"""Reason codes of a ratio of times: the reference overlaps more than the other, no more, or nobody knows."""
SAME_DEPTH = 1e-8
"""Overlap below which two values are equal [m]: the oracle's tolerance."""


@dataclass(frozen=True, slots=True)
class Timed:
    """Times (r, f) [s] of a column's frames in each restart; which frames have a contact (f,); its overlap
    row; where its time goes, in words."""

    engine: str
    label: str
    dt: float
    times: Array
    contact: NDArray[np.bool_]
    overlap: Row | None = None
    stages: str = ""

    @property
    def profile(self) -> str:
        """The profile without changes of it."""
        return self.label.partition(",")[0]

    @property
    def at_own_step(self) -> bool:
        """Whether the step is that of the profile."""
        return is_own_step(self.engine, self.profile, self.dt)


def timed(
    engine: str, label: str, first: Recording, times: Sequence[Array], overlap: Row | None = None
) -> Timed:
    """A column from the recording of the first restart, with its contacts and stages, and all times, over the
    frames that every restart played."""
    contact = contact_frames(first)
    count = min(len(contact), *map(len, times))
    rows = np.array([restart[:count] for restart in times])
    return Timed(engine, label, first.facts["dt"], rows, contact[:count], overlap, _stages(first, contact))


def _stages(recording: Recording, contact: NDArray[np.bool_]) -> str:
    """Shares of the stages in the time of the frames with contact, the largest first."""
    some = recording.stage_seconds[contact[: len(recording.stage_seconds)]].sum(axis=0)
    if not some.sum() > 0:
        return ""
    stages = sorted(zip(some / some.sum(), recording.stage_names.tolist()), reverse=True)
    return "with contact its time goes to " + ", ".join(f"{name} {100 * part:.0f} %" for part, name in stages)


def ratio_rows(study: str, scenario: Scenario, columns: Sequence[Timed], one_run: bool) -> list[Row]:
    """All statistics of the reference over every engine, at steps that can be compared. Of each kind of
    comparison, the ratio to the fastest engine is judged, of those without an environment of their own, with
    which the limits were measured.

    Args:
        one_run: the times are from one run, which leaves some ratios without verdict (`judged_time`).
    """
    found: list[tuple[str, Row, str, float]] = []
    ours = [column for column in columns if column.engine == REFERENCE]
    for mine, theirs in product(ours, (column for column in columns if column.engine != REFERENCE)):
        if (mine.profile == EQUAL_PROFILE) == (theirs.profile == EQUAL_PROFILE):
            own = mine.at_own_step and theirs.at_own_step and own_environment(theirs.engine) is None
            kind = kind_of(mine.label, theirs.label) if own else ""
            code, said = compared(mine.overlap, theirs.overlap)
            frames = len(pair_frames(mine, theirs)[2]) if one_run else inf
            for row in _statistics(study, scenario, mine, theirs):
                remark = "; ".join(filter(None, (row.reason, said, "one run" if one_run else "")))
                row = replace(row, reason=remark, reason_code=code, reproduce=reproduce(row))
                found.append((kind or theirs.label, row, mine.stages, frames))
    if is_foreign(scenario):
        return [row for _, row, _, _ in found]
    fastest: dict[tuple[str, str, str], float] = {}
    for kind, row, _, _ in found:
        key = (row.profile, kind, row.metric)
        fastest[key] = max(fastest.get(key, 0.0), row.value)
    medians = {(row.profile, row.subject): row.low for _, row, _, _ in found if row.metric == MEDIAN}
    return [
        _judged(kind, row, stages, scenario, frames, medians.get((row.profile, row.subject), inf))
        if row.value == fastest[row.profile, kind, row.metric]
        else row
        for kind, row, stages, frames in found
    ]


def pair_frames(mine: Timed, theirs: Timed) -> tuple[Array, Array, Indices, bool]:
    """Times of both over the frames that both played; the indices of those in which one has a contact, or of
    all if there are none; and whether there are some."""
    count = min(mine.times.shape[1], theirs.times.shape[1])
    chosen = np.flatnonzero(mine.contact[:count] | theirs.contact[:count])
    some = len(chosen) > 0
    return mine.times[:, :count], theirs.times[:, :count], chosen if some else np.arange(count), some


def _statistics(study: str, scenario: Scenario, mine: Timed, theirs: Timed) -> Iterable[Row]:
    ours, others, chosen, some = pair_frames(mine, theirs)
    every = np.arange(ours.shape[1])
    where = f"contact in {len(chosen)} of {plural(len(every), 'frame')}" if some else "no contact: all frames"
    base = Row(study, scenario.name, REFERENCE, mine.label, mine.dt, FRAMES, unit="frames")
    base = replace(base, subject=f"{theirs.engine} {theirs.label}")
    yield replace(base, value=float(len(chosen) if some else 0))
    for suffix, statistic in STATISTICS.items():
        ratio = restart_ratio(ours, others, statistic, every if suffix else chosen)
        row = replace(base, metric=f"{RATIO}{suffix}", unit="1", reason="" if suffix else where)
        yield replace(row, **ratio._asdict())


def _judged(kind: str, row: Row, stages: str, scenario: Scenario, frames: float, median: float) -> Row:
    """The row with the verdict on its time; a profile that aims at a ratio fails where its overlap is
    larger."""
    found = judged_time(kind, row, scenario.tags, stages, frames, median)
    if isnan(found.limit):
        return found
    if row.reason_code == DEEPER and row.profile in AIMING:
        return replace(found, verdict="fail")
    unknown = row.reason_code == UNCOMPARED and found.verdict == "pass"
    return replace(found, verdict=UNJUDGED) if unknown else found


def compared(ours: Row | None, theirs: Row | None) -> tuple[str, str]:
    """Code and text of the comparison of both overlaps. Where no two bodies may touch there is nothing to
    compare; UNCOMPARED where an expected number is missing."""
    for row in (ours, theirs):
        if row is None:
            return UNCOMPARED, "overlap not measured"
        if not isfinite(row.value):
            return NO_DEEPER if row.verdict == "skipped" else UNCOMPARED, f"no overlap: {row.reason}"
    deeper = ours.value > max(theirs.value, SAME_DEPTH)  # type: ignore[union-attr]
    return (DEEPER, "overlap larger") if deeper else (NO_DEEPER, "overlap no larger")


FACTORS = ("ratio.steps", "ratio.dynamics", "ratio.step")
"""Factors by the numbers of steps, by the dynamics of links, and per step without these."""


def factor_rows(study: str, scenario: str, columns: Mapping[tuple[str, str], Timed]) -> Iterator[Row]:
    """FACTORS of the reference over every engine whose columns are complete."""
    ours, common = (columns.get((REFERENCE, name)) for name in ("balanced", EQUAL_PROFILE))
    for engine in dict.fromkeys(engine for engine, _ in columns if engine != REFERENCE):
        own, equal = (columns.get((engine, name)) for name in (MACHINE_PROFILE, EQUAL_PROFILE))
        posed = columns.get((engine, f"{EQUAL_PROFILE}, {POSED_LABEL}"))
        if ours is None or common is None or own is None or equal is None:
            continue
        r, q, big_r, e, p = _means(ours, common, own, equal, posed or equal)
        values = (r / q * e / big_r, p / e if posed else nan, q / p)
        for name, value in zip(FACTORS, values):
            reason = "" if value == value else "no driven body"
            row = Row(study, scenario, REFERENCE, ours.label, ours.dt, name, value, "1")
            yield replace(row, subject=f"{engine} {own.label}", reason=reason)


def _means(ours: Timed, *others: Timed) -> list[float]:
    """Mean frame [s] of all columns, over the frames that all played in which the first or third has a
    contact."""
    count = min(column.times.shape[1] for column in (ours, *others))
    _, _, chosen, _ = pair_frames(ours, others[1])
    chosen = chosen[chosen < count]
    return [float(mean(np.median(column.times, axis=0)[chosen])) for column in (ours, *others)]
