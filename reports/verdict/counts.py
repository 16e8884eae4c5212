"""Number of a scene's limits that each column meets, out of the same number for every column.

A metric counts once, by its worst subject. A metric that is judged in one column but not in another does not
apply in the other, with a reason; not applicable is not a pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

from touchstone.reports.results import CONSTRUCTION, UNAPPLIED, UNJUDGED, Row

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
        worst = _worst(mine.get(metric, []))
        if worst is None:
            apart[metric] = _why_not(mine.get(metric, []))
            continue
        verdicts[worst.verdict] += 1
        by_construction += worst.verdict == "pass" and worst.basis == CONSTRUCTION
    return Count(len(judged), verdicts, by_construction, apart)


def _worst(rows: Iterable[Row]) -> Row | None:
    """The row with the worst verdict; None if no row has one."""
    judged = [row for row in rows if row.verdict in WORST_LAST]
    return max(judged, key=lambda row: WORST_LAST.index(row.verdict), default=None)


def _unapplied(rows: Iterable[Row]) -> list[str]:
    """The rows' reasons why the metric's limit does not apply."""
    return [row.reason for row in rows if row.basis == UNAPPLIED]


def _why_not(rows: Sequence[Row]) -> str:
    if not rows:
        return NOT_REPORTED
    if _unapplied(rows):
        return _unapplied(rows)[0]
    return NO_LIMIT if any(isfinite(row.value) for row in rows) else rows[0].reason or NO_LIMIT
