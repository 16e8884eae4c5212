"""The judge of rows: the limit of a scene, of a file or of ours, then the known failings.

With noisy trackers physical laws keep their limits; limits that follow from the ideal tracker do not apply.
With explicit torques, what only these cause is the harness' failing.

Number of a scene's limits that each column meets, out of the same number for every column; and the sizes of
known failings, measured from tables of runs.

A metric counts once, by its worst subject. A metric that is judged in one column but not in another does not
apply in the other, with a reason; not applicable is not a pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, isinf, isnan, nan

from touchstone.adapters.registry import ENGINES
from touchstone.reports.results import CONSTRUCTION, HARNESS, UNAPPLIED, UNJUDGED, Row, is_undecided
from touchstone.reports.verdict.failings import (
    CHAOTIC_MARGIN,
    EVERY_SUBJECT,
    MARGIN,
    NOISY,
    Failing,
    Key,
    bounded,
    failing_of,
    failings_in,
)
from touchstone.reports.verdict.limits import Limit, is_foreign, limit_of, own_limits
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario

OF_THE_TRACKER = (
    *("events.", "truth.", "contact.gap", "joint.speed", "posture."),
    "contact.impulse_balance.driven",
)
"""Prefixes of metrics whose limits follow from a scene's ideal tracker. The audit of driven bodies is of
first order in their jerks; it still rejects impulses."""
TORQUE = ", drive=torque"
BY_TORQUES = "explicit torques of our servo, held over a step, cause it: --drive native does not show it"
NOT_IDEAL = "its limit follows from the ideal tracker"
MEASURE = "run `touchstone failings measure`"


def judged_in(row: Row, scenario: Scenario, of_file: Iterable[Limit] = ()) -> Row:
    """The row with its limit and verdict, by the scene's and a file's limits before ours; of a foreign
    scene ours and known failings say nothing."""
    own = limit_of(row, scenario.tags, own_limits(scenario, of_file))
    if own is None or row.verdict:
        return row if is_foreign(scenario) else judged(row, scenario.tags)
    if isinf(own.largest) or is_undecided(row, own.largest):
        return row
    return replace(_limited(row, own.largest), reason=_remark(row, own.reason))


def judged(row: Row, tags: tuple[str, ...]) -> Row:
    """The row with its limit and verdict, by our limits and known failings. A row that already passed or
    failed (an expected event), or a failed run, is only looked up among the known failings; other errors
    and skipped rows stay.

    With noisy trackers a known failing excuses a row of any size, and may be gone.
    """
    if TORQUE in row.profile:
        return _of_torque(row, tags)
    ideal = replace(row, profile=row.profile.replace(NOISY, ""))
    noisy = ideal.profile != row.profile
    failing = failing_of(row) or (failing_of(ideal) if noisy and row.metric != "run" else None)
    if (row.metric, row.verdict) == ("run", "error") and failing is not None:
        reason = f"{row.reason}; {failing.reason}"
        return replace(row, verdict="known", reason=reason, reproduce=failing.reproduce)
    if row.verdict not in ("", "pass", "fail"):
        return row
    limit = None if row.verdict and not noisy else limit_of(ideal, tags)
    if limit is not None and isinf(limit.largest):
        limit = None
    # Engines may gain a share of the tracked kinetic energy; the reference may gain none.
    tracked = row.metric.startswith(OF_THE_TRACKER)
    tracked |= row.metric == "energy.injected" and row.engine != "reference"
    if noisy and tracked and (limit is not None or row.verdict):
        return replace(row, low=nan, high=nan, limit=nan, verdict="", basis=UNAPPLIED, reason=NOT_IDEAL)
    if not row.verdict and (limit is None or is_undecided(row, limit.largest)):
        return row
    found = row
    if limit is not None:
        basis = CONSTRUCTION if limit.by_construction else row.basis
        found = replace(_limited(row, limit.largest), basis=basis)
    reason = row.reason if limit is None else limit.reason
    if failing is not None:
        found, reason = _against(found, failing, reason, noisy)
    return replace(found, reason=_remark(row, reason))


def _against(row: Row, failing: Failing, reason: str, noisy: bool) -> tuple[Row, str]:
    """A row that has a verdict, and its reason, beside its known failing."""
    said = f"({failing.reason})"
    if row.verdict == "pass":
        strict = not noisy and not failing.chaotic and at_own_step(row)
        if not strict or (failing.has_size and failing.largest is None):
            return row, reason
        return replace(row, verdict="fail"), f"a known failing is gone: remove it from failings.csv {said}"
    if isnan(row.value) and not noisy and not row.metric.startswith("events."):
        return row, reason
    if failing.has_size and at_own_step(row) and not noisy:
        if failing.largest is None:
            return row, f"a known failing without a size: {MEASURE} {said}"
        if abs(row.value) > failing.largest:
            return row, f"a known failing has grown past {failing.largest:g} {said}"
    basis = HARNESS if failing.is_harness and not noisy else row.basis
    reason = f"{failing.reason} (of any size with a noisy tracker)" if noisy else failing.reason
    return replace(row, verdict="known", basis=basis, reproduce=failing.reproduce), reason


def lost(base: Row, rows: Iterable[Row]) -> Iterator[Row]:
    """A row that fails per known failing that a column played, `base`, no longer measures in its `rows`."""
    if not at_own_step(base):
        return
    rows = [row for row in rows if (row.engine, row.profile) == (base.engine, base.profile)]
    for failing in failings_in(base.engine, base.profile, base.scenario):
        if failing.chaotic or failing.metric == "run":
            continue
        if failing.has_size and failing.largest is None:  # its subjects have lines of their own
            continue
        mine = [row for row in rows if row.metric == failing.metric]
        subjects = {row.subject for row in mine if row.verdict != "skipped"}
        if not subjects or failing.subject not in (*subjects, EVERY_SUBJECT):
            why = next((f"skipped, {row.reason}" for row in mine if row.verdict == "skipped"), "no such row")
            reason = f"a known failing is no longer measured: {why} ({failing.reason})"
            found = replace(base, metric=failing.metric, subject=failing.subject.replace(EVERY_SUBJECT, ""))
            yield replace(found, verdict="fail", reason=reason, reproduce=failing.reproduce)


def _of_torque(row: Row, tags: tuple[str, ...]) -> Row:
    """The verdict under explicit torques: a row that fails, and is no known failing under the engine's own
    servos, has failed by our torques."""
    native = replace(row, profile=row.profile.replace(TORQUE, ""))
    found = judged(native, tags)
    gone = found.verdict == "fail" and abs(found.value) <= found.limit
    fails = found.verdict == "fail" or (found.metric, found.verdict) == ("run", "error")
    if not fails or gone:
        return replace(found, profile=row.profile, verdict="pass" if gone else found.verdict)
    failing = failing_of(native)
    if failing is not None:
        return replace(found, profile=row.profile, verdict="known", reason=f"{failing.reason} (of any size)")
    said = f"{found.reason}; {BY_TORQUES}".removeprefix("; ")
    return replace(found, profile=row.profile, verdict="known", basis=HARNESS, reason=said)


def at_own_step(row: Row) -> bool:
    """Whether the row has its profile's own step and settings; with others a known failing may be gone."""
    return row.dt == row.dt if row.engine not in ENGINES else is_own_step(row.engine, row.profile, row.dt)


def is_own_step(engine: str, profile: str, dt: float) -> bool:
    """Whether a step [s] is that of a profile; of an engine or a profile that is not known none is."""
    own = ENGINES[engine].profiles.get(profile) if engine in ENGINES else None
    return own is not None and abs(own - dt) < 1e-9 * dt


def _limited(row: Row, largest: float) -> Row:
    return replace(row, limit=largest, verdict="pass" if abs(row.value) <= largest else "fail")


def _remark(row: Row, reason: str) -> str:
    return f"{row.reason}; {reason}" if row.reason and row.reason != reason else reason


WORST_LAST = ("pass", "known", UNJUDGED, "fail", "error")
"""Verdicts that count, the worst last."""
Column = tuple[str, str]
NO_LIMIT = "no limit for this column"
NOT_REPORTED = "not among the rows of this run"


@dataclass(frozen=True, slots=True)
class Count:
    """Counts of one scene and column: metrics by verdict, those met by construction, and metric -> the reason
    why it does not apply. `limits` is the number of metrics that are judged in any column, or would be with
    an ideal tracker."""

    limits: int
    verdicts: Mapping[str, int]
    by_construction: int
    not_applicable: Mapping[str, str]

    @property
    def worst(self) -> str:
        """The worst verdict other than pass, or none."""
        found = [verdict for verdict in WORST_LAST[1:] if self.verdicts[verdict]]
        return found[-1] if found else ""

    @property
    def text(self) -> str:
        """The limits met of all in the scene; in brackets, how many do not apply."""
        apart = f" ({len(self.not_applicable)})" if self.not_applicable else ""
        return f"{self.verdicts['pass']} of {self.limits}{apart}"


def counted(rows: Iterable[Row], columns: Sequence[Column]) -> dict[Column, Count]:
    """Counts of one scene per column; columns that failed or did not run are excluded."""
    found: dict[Column, dict[str, list[Row]]] = {column: {} for column in columns}
    ended = set()
    for row in rows:
        column = (row.engine, row.profile)
        if row.metric == "run":
            ended.add(column)
        else:
            found[column].setdefault(row.metric, []).append(row)
    played = [column for column in columns if column not in ended and found[column]]
    judged = dict.fromkeys(
        metric
        for column in played
        for metric, mine in found[column].items()
        if _worst(mine) is not None or _unapplied(mine)
    )
    return {column: _count(found[column], list(judged)) for column in played}


def _count(mine: Mapping[str, list[Row]], judged: Sequence[str]) -> Count:
    verdicts, by_construction, apart = dict.fromkeys(WORST_LAST, 0), 0, {}
    for metric in judged:
        rows = mine.get(metric, [])
        if worst := _worst(rows):
            verdicts[worst.verdict] += 1
            by_construction += worst.verdict == "pass" and worst.basis == CONSTRUCTION
        elif why := _unapplied(rows):
            apart[metric] = why[0]
        elif not rows or any(isfinite(row.value) for row in rows):
            apart[metric] = NO_LIMIT if rows else NOT_REPORTED
        else:
            apart[metric] = rows[0].reason or NO_LIMIT
    return Count(len(judged), verdicts, by_construction, apart)


def _worst(rows: Iterable[Row]) -> Row | None:
    judged = [row for row in rows if row.verdict in WORST_LAST]
    return max(judged, key=lambda row: WORST_LAST.index(row.verdict), default=None)


def _unapplied(rows: Iterable[Row]) -> list[str]:
    """The rows' reasons why the metric's limit does not apply."""
    return [row.reason for row in rows if row.basis == UNAPPLIED]


def measured(old: Mapping[Key, Failing], rows: Iterable[Row]) -> dict[Key, Failing]:
    """Known failings by the rows of runs: those that miss their limit get the largest size of all runs,
    those that meet it go, others stay. What no line covers stays unknown."""
    found: dict[Key, Failing] = {}
    met: set[Key] = set()
    for row in rows:
        place = (row.engine, row.profile, row.scenario, row.metric)
        line = old.get((*place, row.subject)) or old.get((*place, EVERY_SUBJECT))
        if line is None or not line.has_size or not at_own_step(row) or not isfinite(row.value):
            continue
        scene = catalogue().get(row.scenario)
        limit = limit_of(row, scene.tags if scene else ())
        if limit is None:
            continue
        if abs(row.value) <= limit.largest:
            met.add(line.key)
            continue
        if line.subject == EVERY_SUBJECT and not line.chaotic:
            line = line.model_copy(update={"subject": row.subject})
        largest = bounded(row.value, CHAOTIC_MARGIN if line.chaotic else MARGIN)
        before = found[line.key].largest if line.key in found else 0.0
        found[line.key] = line.model_copy(update={"largest": max(largest, before or 0.0)})
    gone = {key for key in met if not old[key].chaotic and old[key].subject != EVERY_SUBJECT}
    return {key: one for key, one in old.items() if key not in gone} | found


def difference(old: Mapping[Key, Failing], new: Mapping[Key, Failing]) -> Iterator[str]:
    """A line per known failing that is new, gone or of another size."""
    for key in sorted({*old, *new}):
        before, after = old.get(key), new.get(key)
        if before == after:
            continue
        place = " ".join(filter(None, key))
        if after is None:
            yield f"gone: {place}: meets its limit"
        elif before is None:
            yield f"new: {place}: {after.largest:g} ({after.cause})"
        else:
            yield f"size: {place}: {_size(before)} -> {_size(after)}"


def _size(one: Failing) -> str:
    return "none" if one.largest is None else f"{one.largest:g}"
