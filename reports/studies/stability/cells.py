"""The cells of the study `stability`: families, levels, columns and steps, in full or quickly."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import ENGINES, installed
from touchstone.reports.studies.stability.play import Cell
from touchstone.scenarios.difficulty.family import Family, families

PROFILES = ("balanced", "accurate", "paper", "recommended")
"""Default profiles."""
QUICK = ("balanced", "recommended")
"""Profiles of a quick study, beside the reference's `accurate`."""
STEPS = (1 / 30, 1 / 240, 1 / 1920)
"""Native steps [s] of all engines beside the own step of each profile."""
BUDGET, QUICK_BUDGET = 2.0, 1.5
"""Time of the engine's steps in a cell, without reading and recording, after which it counts as slow [s]."""
Column = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Plan:
    """What a study plays: columns (engine, profile), families, and whether quickly."""

    columns: tuple[Column, ...]
    families: tuple[Family, ...]
    quick: bool = False

    def cells(self) -> list[Cell]:
        """All cells, those of one scene together; engines that are not installed have none."""
        budget = QUICK_BUDGET if self.quick else BUDGET
        return [
            Cell(family.scene_name(level), engine, Settings(profile, dt), budget)
            for family in self.families
            for level in levels_of(family, self.quick)
            for engine, profile in self.columns
            if installed(engine)
            for dt in steps_of(engine, profile, self.quick)
        ]


def chosen(names: Iterable[str]) -> tuple[Family, ...]:
    """Families by name; none: all."""
    every = families()
    return tuple(every[name] for name in dict.fromkeys(names)) or tuple(every.values())


def levels_of(family: Family, quick: bool) -> Sequence[float]:
    """Levels to play: all, or the easiest, the middle and the most absurd one."""
    levels = family.levels
    return tuple(dict.fromkeys((levels[0], levels[len(levels) // 2], levels[-1]))) if quick else levels


def steps_of(engine: str, profile: str, quick: bool) -> tuple[float, ...]:
    """Native steps [s]: the profile's own one first."""
    own = own_step(engine, profile)
    return (own,) if quick else tuple(dict.fromkeys((own, *STEPS)))


def own_step(engine: str, profile: str) -> float:
    """Native step of a profile [s]."""
    return ENGINES[engine].profiles[profile]
