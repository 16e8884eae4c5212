"""Cells of the reference's own ladder: its other profiles as a whole, and each setting of `balanced` changed
alone."""

from __future__ import annotations

from collections.abc import Sequence

from touchstone.adapters.knobs import Choice
from touchstone.adapters.registry import settings_of
from touchstone.reports.studies.work_precision.definitions import REFERENCE
from touchstone.reports.sweep.cells import Cell, grid

BASE, WHOLE = "balanced", ("paper", "accurate")
"""Profile in which one setting changes at a time, and profiles that are compared with it as a whole."""
NOWHERE = "-"
"""Stands for the profile of a value that no profile has."""


def changes() -> dict[str, str]:
    """Change of one setting of `balanced` -> the profile that has its value: of a choice every other value,
    of a number that of `accurate`."""
    table = settings_of(REFERENCE)
    found: dict[str, str] = {}
    for setting in table.values():
        base, other = (setting.profiles[table.column(profile)] for profile in (BASE, "accurate"))
        values = list(setting.values) if isinstance(setting, Choice) else [other]
        for value in values:
            if value != base:
                found[f"{setting.name}={value}"] = "accurate" if value == other else NOWHERE
    return found


def ladder_cells(names: Sequence[str]) -> list[Cell]:
    """Cells of the other profiles, and of `balanced` with one change each."""
    whole = grid(names, [(REFERENCE, profile) for profile in WHOLE])
    single = [
        cell
        for change in changes()
        for cell in grid(names, [(REFERENCE, BASE)], changes=[f"{REFERENCE}.{change}"])
    ]
    return [*whole, *single]
