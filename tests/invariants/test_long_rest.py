"""Ten simulated minutes of rest on the reference."""

import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.reports.metrics.context import Context
from touchstone.reports.verdict.figures import rest
from touchstone.scenarios.difficulty.family import families

CREEP = 1e-6
"""Largest displacement of a body that rests for ten minutes [m]."""


@pytest.mark.slow
@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_ten_minutes_of_rest_move_nothing(profile):
    """Leave two cubes, one on the other, where they are for 600 s."""
    scenario, checks = families()["long_rest"].scene(600.0)
    found = rest(Context(record(load("reference"), scenario, Settings(profile, 1 / 60)), scenario), checks)
    assert len(found) == 2
    creep = max(way for way, _ in found.values())
    print(f"{profile}: creep {creep:.2g} m in 600 s")
    assert creep < CREEP
