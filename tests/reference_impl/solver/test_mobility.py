"""Mobility at a contact against finite differences of the impulses themselves."""

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.core.world import PAIR
from touchstone.reference_impl.solver.mobility import apply_impulse, contact_mobility, surface_velocity
from touchstone.scenarios.catalogue import catalogue


@pytest.fixture
def world(lab: SimpleNamespace):
    """`ball_snip`, everything in random motion."""
    world = lab.build(catalogue()["ball_snip"])
    rng = np.random.default_rng(5)
    world.bodies["velocity"], world.bodies["omega"] = rng.normal(size=(2, len(world.bodies), 3))
    world.drivers["velocity"], world.drivers["omega"] = rng.normal(size=(2, 1, 3))
    return world


def velocity(world, body: int, point: np.ndarray) -> np.ndarray:
    """Surface velocity of a body at a world point."""
    out = np.zeros(3)
    surface_velocity(world.bodies[body], point, out)
    return out


def push(world, body: int, point: np.ndarray, impulse) -> None:
    """One impulse on a body."""
    apply_impulse(world.bodies, world.joints, world.drivers, body, point, *map(float, impulse))


def index(name: str) -> int:
    """Index of a body of `ball_snip`."""
    return catalogue()["ball_snip"].body_index(name)


@pytest.mark.parametrize(
    ("a", "b"),
    [("table", "ball"), ("index_distal", "ball"), ("ball", "thumb_proximal"), ("floor", "palm")],
)
def test_mobility_is_the_velocity_per_impulse(world, a: str, b: str) -> None:
    """Match the change of relative velocity by unit impulses on B and against A."""
    pair, point, mobility = np.zeros(1, PAIR), np.array([0.13, 0.02, 0.79]), np.zeros((3, 3))
    pair["body_a"], pair["body_b"] = index(a), index(b)
    # links take their velocity from the driver at the first push
    push(world, index("palm"), point, (0, 0, 0))
    pair["lever_a"] = pair["lever_b"] = point
    contact_mobility(world.bodies, world.drivers, pair[0], mobility)
    for axis in np.eye(3):
        before = velocity(world, index(b), point) - velocity(world, index(a), point)
        push(world, index(b), point, axis)
        push(world, index(a), point, -axis)
        after = velocity(world, index(b), point) - velocity(world, index(a), point)
        # linear: the difference is exact but for rounding of speeds of about 1e3 m/s
        np.testing.assert_allclose(after - before, mobility @ axis, atol=1e-10 * np.abs(mobility).max())
    np.testing.assert_allclose(mobility, mobility.T, atol=1e-12 * np.abs(mobility).max())


def test_an_impulse_changes_angular_momentum_by_its_moment(world) -> None:
    """Give the hand and the ball the linear and angular momentum of the impulse."""
    point, impulse = np.array([0.13, 0.02, 0.79]), np.array([0.01, -0.02, 0.03])
    for name, row in (("index_distal", world.drivers[0]), ("ball", world.bodies[index("ball")])):
        center, inverse = row["center"].copy(), row["inverse_inertia"].copy()
        push(world, index(name), point, (0, 0, 0))
        before, spin = velocity(world, index(name), center), row["omega"].copy()
        push(world, index(name), point, impulse)
        moved = (velocity(world, index(name), center) - before) * row["mass"]
        np.testing.assert_allclose(moved, impulse, atol=1e-14)
        turned = np.linalg.solve(inverse, row["omega"] - spin)
        np.testing.assert_allclose(turned, np.cross(point - center, impulse), atol=1e-14)
