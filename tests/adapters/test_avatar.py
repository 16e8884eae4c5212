"""One definition of the avatar, and of the arm with a hand, in every engine."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import State
from touchstone.adapters.registry import ENGINES
from touchstone.scenarios.avatar.avatar import Parts, arm_with_hand_parts, avatar_parts

PLACES = {"bullet": 1e-12, "dart": 1e-12, "mujoco": 1e-12, "reference": 1e-14}
"""Rounding of a chain of nine links [m]."""


@pytest.mark.parametrize("parts", [avatar_parts(), arm_with_hand_parts()], ids=["avatar", "arm with hand"])
@pytest.mark.parametrize("name", ENGINES)
def test_every_engine_stands_the_same(
    name: str, parts: Parts, lab: SimpleNamespace, registry: SimpleNamespace
) -> None:
    """Build, and stand at the start where the reference's forward kinematics puts every link."""
    scenario = lab.person(parts)
    world = registry.engine(name).build(scenario, registry.settings(name))
    state = State(scenario)
    world.read(state)
    wanted = lab.build(scenario)
    np.testing.assert_allclose(state.position, wanted.bodies["position"], atol=PLACES[name])
    signs = np.sign((state.orientation * wanted.bodies["orientation"]).sum(axis=1))
    turned = state.orientation * signs[:, None]
    np.testing.assert_allclose(turned, wanted.bodies["orientation"], atol=PLACES[name])
    facts = world.describe().bodies
    for body in scenario.bodies:
        assert facts[body.name].mass == pytest.approx(body.mass, rel=1e-12)
    world.close()
