"""Cells of the reference's own ladder: each setting in which its profiles differ, toggled alone."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from touchstone.adapters.registry import settings_of
from touchstone.reports.studies.work_precision.definitions import REFERENCE
from touchstone.reports.sweep.cells import Cell, grid

RUNGS = ("paper", "balanced", "accurate")


def rungs() -> list[tuple[str, str, str]]:
    """(profile, its neighbour, change): one setting of the profile takes the value of the neighbour."""
    table = settings_of(REFERENCE)
    found = []
    for lower, upper in pairwise(RUNGS):
        for setting in table.values():
            values = {name: setting.profiles[table.column(name)] for name in (lower, upper)}
            if values[lower] != values[upper]:
                found.append((lower, upper, f"{setting.name}={values[upper]}"))
                found.append((upper, lower, f"{setting.name}={values[lower]}"))
    return [one for one in found if one[0] == "balanced"]


def ladder_cells(names: Sequence[str]) -> list[Cell]:
    """Cells of `balanced` with one setting of a neighbour each."""
    return [
        cell
        for profile, _, change in rungs()
        for cell in grid(names, [(REFERENCE, profile)], changes=[f"{REFERENCE}.{change}"])
    ]
