"""Measures the sizes of known failings from tables of runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite

from touchstone.reports.results import Row
from touchstone.reports.verdict.failings import CHAOTIC_MARGIN, EVERY_SUBJECT, MARGIN, Failing, Key, bounded
from touchstone.reports.verdict.judge import at_own_step
from touchstone.reports.verdict.limits import limit_of
from touchstone.scenarios.catalogue import catalogue


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
