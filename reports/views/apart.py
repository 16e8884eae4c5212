"""The bodies that are farthest apart between two columns (`run/farthest_apart.py`), in words."""

from __future__ import annotations

from collections.abc import Sequence

from touchstone.reports.metrics import SPREAD
from touchstone.reports.results import Row

TITLE = "farthest apart"
HEADS = ("scene", "body", "distance", "")
BODIES_SHOWN = 8
"""Bodies of a table that are shown; those beyond are counted."""


def length_text(value: float) -> str:
    """A length in m, mm or um."""
    unit, size = next((one for one in (("m", 1.0), ("mm", 1e-3)) if value >= one[1]), ("um", 1e-6))
    return f"{value / size:.3g} {unit}"


def apart_table(rows: Sequence[Row]) -> list[list[str]]:
    """Lines under HEADS of the bodies that are farthest apart, over all scenes."""
    rows = sorted((row for row in rows if row.metric == SPREAD), key=lambda row: -row.value)
    lines = [[row.scenario, row.subject, length_text(row.value), row.reason] for row in rows[:BODIES_SHOWN]]
    more = len(rows) - len(lines)
    return [*lines, ["", f"and {more} more", f"at most {lines[-1][2]}", ""]] if more else lines


def headlines(scene: Sequence[Row]) -> list[str]:
    """The farthest body of a scene in one line; nothing where nothing is compared."""
    apart = [row for row in scene if row.metric == SPREAD]
    if apart and all(row.value == 0 for row in apart):
        return [f"{TITLE}: no body, all paths are equal"]
    return [f"{TITLE}: {body}, {size}: {text}" for _, body, size, text in apart_table(scene)[:1]]
