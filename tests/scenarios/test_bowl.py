"""The closed form of the ball in a hollow of flat pieces: geometry, energy and angular momentum."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import Box

SCENE = catalogue()["bowl"]
TRUTH = SCENE.truths[0]
STARTS = np.array([arc.start for arc in TRUTH.arcs])
RADIUS, INERTIA, MASS = 0.1, SCENE.bodies[1].inertia[0][0], 1.0


def gaps(place: np.ndarray) -> np.ndarray:
    """Distance of points from the face of each piece (n, pieces), from the scene's own boxes."""
    found = []
    for piece in SCENE.bodies[0].pieces:
        assert isinstance(piece.shape, Box)
        local = Rotation.from_quat(piece.orientation, scalar_first=True).inv().apply(place - piece.position)
        half = np.array(piece.shape.half_extents)
        found.append(np.linalg.norm(local - np.clip(local, -half, half), axis=1))
    return np.stack(found, axis=1)


def test_the_ball_touches_one_piece_and_cuts_none() -> None:
    """The nearest piece is at the ball's radius, two of them where it passes from one to the next."""
    m = motion(SCENE, TRUTH, np.linspace(0, SCENE.duration, 3000))
    np.testing.assert_allclose(gaps(m.position).min(axis=1), RADIUS, atol=1e-12)
    meets = np.sort(gaps(motion(SCENE, TRUTH, STARTS[1:]).position), axis=1)
    np.testing.assert_allclose(meets[:, :2], RADIUS, atol=1e-12)
    assert len(STARTS) > 10


def test_it_rolls_and_keeps_energy_on_each_piece() -> None:
    """No slip against the nearest piece, and no loss between meetings; the scene loses at each of them."""
    last = np.inf
    for start, end in pairwise([*STARTS, SCENE.duration]):
        m = motion(SCENE, TRUTH, np.linspace(start, end - 1e-12, 20))
        speed = np.linalg.norm(m.velocity, axis=1)
        np.testing.assert_allclose(np.abs(m.angular_velocity[:, 1]) * RADIUS, speed, atol=1e-12)
        kinetic = (MASS * speed**2 + INERTIA * m.angular_velocity[:, 1] ** 2) / 2
        energy = kinetic + MASS * 9.81 * m.position[:, 2]
        np.testing.assert_allclose(energy, energy[0], atol=1e-12)
        assert energy[0] < last
        last = energy[0]


def test_meetings_keep_the_angular_momentum_about_the_new_contact() -> None:
    """The impulse acts at the piece that the ball rolls on afterwards, pushes, and is far from slipping."""
    shift = 1e-9
    before, after = (motion(SCENE, TRUTH, STARTS[1:] + s) for s in (-shift, shift))
    later = motion(SCENE, TRUTH, STARTS[1:] + 1e-3)
    along = (later.position - after.position) / np.linalg.norm(
        later.position - after.position, axis=1, keepdims=True
    )
    # the normal of the new piece is across its way, and points up
    n = np.stack([-along[:, 2], 0 * along[:, 0], along[:, 0]], axis=1)
    n *= np.sign(n[:, 2:])
    momenta = [
        INERTIA * m.angular_velocity + MASS * np.cross(RADIUS * n, m.velocity) for m in (before, after)
    ]
    np.testing.assert_allclose(momenta[1], momenta[0], atol=1e-7)
    push = MASS * (after.velocity - before.velocity)
    normal = np.einsum("ni,ni->n", push, n)
    assert (normal > 0).all()
    assert (np.linalg.norm(push - normal[:, None] * n, axis=1) < 0.1 * normal).all()
