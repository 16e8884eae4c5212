"""The reference's own ladder: what its other profiles buy and cost, and each setting of `balanced` alone."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from touchstone.reports.studies.work_precision.definitions import QUANTITIES, REFERENCE
from touchstone.reports.studies.work_precision.ladder_cells import BASE, changes
from touchstone.reports.studies.work_precision.points import points
from touchstone.reports.sweep.cells import Cell, grid

COLUMNS = ("scenario", "change", "towards", "quantity", "unit", "before", "after", "time_ratio")
"""`before` and `after`: errors of `balanced` and of `balanced` with the change; `time_ratio`: its time over
that of `balanced`."""


def ladder(frame: pd.DataFrame, cells: Sequence[Cell]) -> pd.DataFrame:
    """Table of the ladder from the rows of the sweep: a row per scene, change and quantity; one round of
    timing."""
    if not cells:
        return pd.DataFrame(columns=list(COLUMNS))
    names = list(dict.fromkeys(cell.scenario for cell in cells))
    plain = points(frame, grid(names, [(REFERENCE, BASE)]), 1)
    changed = points(frame, cells, 1)
    keys = ["scenario", "quantity", "unit"]
    both = changed.merge(plain, on=keys, suffixes=("", "_plain"))
    both = both[both.quantity.isin(QUANTITIES)]
    table = both[keys].copy()
    table["change"] = both.settings.where(both.settings != "", both.profile)
    table["before"], table["after"] = both.error_plain, both.error
    table["towards"] = table.change.map(changes()).fillna(both.profile)
    table["time_ratio"] = both.time / both.time_plain
    return table[list(COLUMNS)].reset_index(drop=True)
