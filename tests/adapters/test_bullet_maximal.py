"""Bullet's profile `maximal`: free balls and boxes as rigid bodies instead of multibodies."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings, State
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.solids import hull

pybullet = pytest.importorskip("pybullet", reason="pybullet is not installed")
from touchstone.adapters.engines.bullet.engine import BulletEngine  # noqa: E402

RIGID = "bodies in maximal coordinates"
CORNERS = ((0.1, 0.1, 0.1), (0.1, -0.1, -0.1), (-0.1, 0.1, -0.1), (-0.1, -0.1, 0.1))


def end(scenario: Scenario, profile: str, steps: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Positions and orientations after some steps, and the number of contact points."""
    world, state = BulletEngine().build(scenario, Settings(profile, 1 / 240)), State(scenario)
    for step in range(steps):
        world.drive(step)
        world.step()
    world.read(state)
    world.close()
    return state.position.copy(), state.orientation.copy(), state.contact_count


@pytest.mark.parametrize(("name", "steps"), [("collide_slips", 120), ("slip", 240), ("stack", 120)])
def test_both_representations_agree(name: str, steps: int) -> None:
    """Play collisions, rolling and resting faces as `recommended` does: equal contacts, 0.1 mm."""
    scenario = catalogue()[name]
    reduced, maximal = (end(scenario, profile, steps) for profile in ("recommended", "maximal"))
    assert reduced[2] == maximal[2]
    np.testing.assert_allclose(reduced[0], maximal[0], atol=1e-4)
    np.testing.assert_allclose(np.abs((reduced[1] * maximal[1]).sum(axis=1)), 1.0, atol=1e-4)


def test_friction_along_a_diagonal_differs() -> None:
    """A cube that slides at 45 degrees stops earlier as a rigid body: why both are profiles."""
    scenario = catalogue()["slide"]
    cube = scenario.body_index("box_45")
    way = [
        np.linalg.norm(end(scenario, profile, 480)[0][cube] - scenario.bodies[cube].position)
        for profile in ("recommended", "maximal")
    ]
    assert way[1] < 0.97 * way[0]


def test_mass_properties_are_ours() -> None:
    """Read back mass and inertia of rigid bodies as the scenario gives them."""
    scenario = catalogue()["stack"]
    reported = BulletEngine().build(scenario, Settings("maximal", 1 / 240)).describe()
    assert reported.settings[RIGID] == len(scenario.bodies)
    for body in scenario.bodies:
        if body.kind == "simulated":
            assert reported.bodies[body.name].mass == body.mass
            np.testing.assert_allclose(reported.bodies[body.name].inertia, body.inertia, rtol=1e-6)
    assert reported.pieces == {body.name: len(body.pieces) for body in scenario.bodies}


def test_other_bodies_stay_multibodies() -> None:
    """Keep hulls, driven links and inertias that are not the shape's in reduced coordinates."""
    scenario = catalogue()["stack"]
    floor, one, two, *_ = scenario.bodies
    odd = replace(one, inertia=tuple(tuple(2 * x for x in row) for row in one.inertia))
    pebble = hull("pebble", one.material, CORNERS, 1.0, (5.0, 0.0, 5.0))
    made = scenario.reduced(bodies=(floor, odd, two, pebble), truths=(), expectations=())
    reported = BulletEngine().build(made, Settings("maximal", 1 / 240)).describe()
    assert reported.settings[RIGID] == 2  # the floor and the box
    np.testing.assert_allclose(reported.bodies[odd.name].inertia, odd.inertia, rtol=1e-6)
    snip = BulletEngine().build(catalogue()["ball_snip"], Settings("maximal", 1 / 240)).describe()
    assert 0 < snip.settings[RIGID] < len(catalogue()["ball_snip"].bodies)
