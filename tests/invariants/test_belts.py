"""Every engine on every scene with a moving surface: loads move by their closed forms, and the belt pays."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics.contacts.overlap import contact_gap
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import energy_drive, energy_rise
from touchstone.scenarios.catalogue import catalogue, tagged

SCENES = [scenario.name for scenario in tagged("belt")]
FARTHEST = {"reference": 1e-9, "dart": 7e-2, "bullet": 5e-3, "mujoco": 2.5e-2}
"""Largest distance of a load from its closed form [m]: steps of first order, friction along two axes in
DART, and sliding loads that the stiff contacts of MuJoCo's `recommended` lift for a moment."""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scene", SCENES)
def test_loads_follow_the_closed_form(registry, engine, scene):
    """Loads slide at mu g against the slip, then move with the belt, which pays for it."""
    try:
        context = Context(registry.played(scene, engine), catalogue()[scene])
    except Unsupported as reason:
        pytest.skip(str(reason))
    for load, truth in context.truths.items():
        away = np.linalg.norm(context.mass_centers[:, load] - truth.position, axis=1)
        assert away.max() < FARTHEST[engine]
    # the belt's impulse on a load that ends with its velocity is known, and so is the work
    speeds = [body.linear_velocity for body in context.scenario.bodies[1:]]
    gained = sum((1.0, 0.0, 0.0) @ -np.array(speed) + 1.0 for speed in speeds)
    if scene != "belt_ramp":
        assert energy_drive(context)["belt"] == pytest.approx(gained, rel=1e-3)
    # a load that moves with the belt counts as one at rest on it
    assert contact_gap(context).keys() == {f"belt-{body.name}" for body in context.scenario.bodies[1:]}
    if engine == "reference":
        assert max(map(abs, contact_gap(context).values())) < 1e-6
        assert max(rise.max() for rise in energy_rise(context).values()) < 1e-9
