"""A plate of a millimetre against bullets at 100 m/s: what a ray hits is hit, and nothing else."""

from types import SimpleNamespace

import numpy as np
import pytest
from moving_pair import CLOSE, NEAR, ROUNDING, Scene, assert_true
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.core.conventions import IMPACT_TARGET, OVERLAP_TOLERANCE
from touchstone.reference_impl.frame import step
from touchstone.scenarios.scenario import ORIGIN, Box, Hull, Sphere
from touchstone.scenarios.solids import elliptic_hull

FRAME = 1 / 60
PLATE = np.array([0.5, 0.4, 5e-4])
BULLET = 5e-4
"""A bullet of a millimetre and a plate of a millimetre: half sizes [m]."""


def entry(origin: np.ndarray, way: np.ndarray, half: np.ndarray, radius: float) -> float:
    """Fraction at which a ray enters a box with rounded edges; infinite if it misses.

    The rounded box is the union of three boxes, twelve cylinders and eight balls.
    """
    found = np.inf
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    for axis in range(3):
        grown = half + radius * np.eye(3)[axis]
        with np.errstate(divide="ignore"):
            sides = np.sort([(-grown - origin) / way, (grown - origin) / way], axis=0)
        # a start inside counts as an entry at 0
        s = max(0.0, sides[0].max())
        if s <= sides[1].min():
            found = min(found, s)
        across = np.delete(np.eye(3), axis, axis=0)
        for corner in signs * half:
            for flat in (across, np.eye(3)):
                o, d = flat @ (origin - corner), flat @ way
                discriminant = (o @ d) ** 2 - (d @ d) * (o @ o - radius**2)
                if discriminant < 0 or discriminant**0.5 < o @ d:
                    continue
                s = max(0.0, (-(o @ d) - discriminant**0.5) / (d @ d))
                if len(flat) == 3 or abs(origin[axis] + s * way[axis]) <= half[axis]:
                    found = min(found, s)
    return found


def shoot(scene: Scene, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Aim a bullet at 100 m/s at a point on or near the plate, from a random side; returns start and way."""
    way = rng.normal(size=3)
    way *= 100 * FRAME / np.linalg.norm(way)
    aim = rng.uniform(-1.1, 1.1, 3) * PLATE
    origin = aim - rng.uniform(0.05, 1.05) * way
    spin = rng.normal(size=3) * rng.choice([0, 10, 1000]) * FRAME
    scene.move(1, origin, way, spin, posture=Rotation.from_quat(rng.normal(size=4)))
    return origin, way


SHOTS = [200, pytest.param(10_000, marks=pytest.mark.slow)]


@pytest.mark.parametrize("count", SHOTS)
def test_no_ball_tunnels_and_none_is_stopped_for_nothing(count: int) -> None:
    """Find for every ball the impact of a ray with the rounded plate, inside the tolerance, and no other."""
    rng = np.random.default_rng(count)
    scene, hits = Scene(Box(tuple(PLATE)), Sphere(BULLET)).move(0), 0
    for _ in range(count):
        origin, way = shoot(scene, rng)
        early, late = (entry(origin, way, PLATE, BULLET + gap) for gap in (NEAR, IMPACT_TARGET))
        fraction, _, converged = scene.impact()
        assert converged
        if late < 1:
            # rounding of the ray's fraction, grazing included: sqrt(1e-16)
            assert early - 1e-8 <= fraction <= late + 1e-8
            assert fraction == 0 or IMPACT_TARGET - CLOSE <= scene.distance(fraction) <= NEAR + CLOSE
            hits += 1
        elif early > 1:
            assert fraction == 1
    assert 0.3 * count < hits < 0.9 * count


@pytest.mark.parametrize("count", SHOTS)
def test_no_spinning_hull_tunnels(count: int) -> None:
    """Find every impact of a small hull that dense samples of its flight by the plate see, and no other."""
    rng = np.random.default_rng(count)
    hull = Hull(elliptic_hull((BULLET, 0.8 * BULLET, 0.6 * BULLET)))
    scene, hits = Scene(Box(tuple(PLATE)), hull).move(0), 0
    for _ in range(count):
        origin, way = shoot(scene, rng)
        found = scene.impact()
        # the hull can touch only after the ball round it does
        first = entry(origin, way, PLATE, BULLET + NEAR)
        start = min(first, 1.0)
        samples = np.append(np.linspace(start, start + 0.01, 60), np.linspace(start, start + 0.4, 40))
        samples = samples[samples < 1]
        if found[0] > 0:
            assert_true(scene, found, samples)
        hits += found[0] < 1
        assert found[0] >= min(first - 1e-8, 1)
    assert 0.3 * count < hits < 0.9 * count


@pytest.mark.parametrize("count", SHOTS)
def test_no_ball_tunnels_in_a_whole_frame(lab: SimpleNamespace, count: int) -> None:
    """Bounce every ball that a ray says hits the plate, at that moment, off the side it came from."""
    rng = np.random.default_rng(count)
    shot, hits = Scene(Box(tuple(PLATE)), Sphere(BULLET)), 0
    bodies = (
        lab.block("plate", tuple(PLATE), ORIGIN, kind="fixed"),
        lab.ball("bullet", (0.0, 0.0, 1.0), radius=BULLET),
    )
    world = lab.build(lab.scene(*bodies, e=0.3, mu=0.3, gravity=ORIGIN), "accurate")
    bullet = world.bodies[1]
    for _ in range(count):
        origin, way = shoot(shot, rng)
        bullet["position"] = bullet["center"] = origin
        bullet["velocity"], bullet["omega"] = way / FRAME, shot.bodies[1]["turn"] / FRAME
        # `accurate` finds impacts where they happen, up to rounding
        early, late = (entry(origin, way, PLATE, BULLET + gap) for gap in (NEAR, 0.0))
        # about one shot of 10,000 starts inside the plate: it has no side to stay on
        if early <= 0:
            continue
        step(*world)
        contact, logged = world.contacts[0], int(world.state[0]["contact_count"])
        if late < 1:
            hits += 1
            # rounding of the ray's fraction, grazing included: sqrt(1e-16)
            assert logged == 1
            assert early - 1e-8 <= contact["time"] / FRAME <= late + 1e-8
            # normals point from the plate to the ball, which leaves that way
            n = contact["normal"]
            assert n @ way < 0 <= n @ bullet["velocity"]
            assert n @ (bullet["position"] - contact["position"]) >= BULLET - OVERLAP_TOLERANCE
        elif early > 1:
            assert logged == 0
            np.testing.assert_allclose(bullet["position"], origin + way, atol=ROUNDING)
        counted = lab.counters(world)
        assert (counted["gave_up"], counted["unconverged"], counted["lost"]) == (0, 0, 0)
    assert 0.3 * count < hits < 0.9 * count
