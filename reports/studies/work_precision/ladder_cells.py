"""Cells of the reference's own ladder: each setting in which its profiles differ, toggled alone."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from touchstone.adapters.registry import settings_of
from touchstone.reports.studies.work_precision.definitions import REFERENCE
from touchstone.reports.sweep.cells import Cell, grid

RUNGS = ("paper", "balanced", "accurate")
BASE = "balanced"


def rungs() -> list[tuple[str, str, str]]:
    """("balanced", its neighbour, change): one setting takes the neighbour's value; those that do nothing in
    `balanced` are left out."""
    table = settings_of(REFERENCE)
    base = {name: setting.profiles[table.column(BASE)] for name, setting in table.items()}
    found = []
    for lower, upper in pairwise(RUNGS):
        for setting in table.values():
            values = {name: setting.profiles[table.column(name)] for name in (lower, upper)}
            if values[lower] != values[upper] and not table.is_idle(setting.name, base):
                found.append((lower, upper, f"{setting.name}={values[upper]}"))
                found.append((upper, lower, f"{setting.name}={values[lower]}"))
    return [one for one in found if one[0] == BASE]


def ladder_cells(names: Sequence[str]) -> list[Cell]:
    """Cells of `balanced` with one setting of a neighbour each."""
    return [
        cell
        for profile, _, change in rungs()
        for cell in grid(names, [(REFERENCE, profile)], changes=[f"{REFERENCE}.{change}"])
    ]
