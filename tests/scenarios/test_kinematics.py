"""Kinematics in NumPy: pinocchio's poses and inertia, boxes in closed form, no kernel of the reference."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from surface_points import surface_points

from touchstone.scenarios.avatar.kinematics import joint_space_inertia, link_poses, piece_box
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Box, Capsule, Cylinder, Ellipsoid, Hull, Piece, Shape, Sphere

SAMPLES = 5
ROUNDING = 1e-13
"""Some thirty products of rotations of order one, and lengths of metres."""


@pytest.mark.parametrize("name", ["ball_snip", "wall_push"])
def test_poses_and_inertia_are_pinocchios(name: str) -> None:
    """Pose a hand and a person anywhere, and feel the inertia that pinocchio finds there."""
    pytest.importorskip("pinocchio", reason="pinocchio is not installed")
    from touchstone.adapters.oracles.articulated import Articulated

    scenario = catalogue()[name]
    tracker = scenario.trackers[0]
    rng = np.random.default_rng(1)
    position = rng.normal(size=(SAMPLES, 3))
    orientation = Rotation.random(SAMPLES, random_state=2).as_quat(scalar_first=True)
    angle = rng.uniform(-1.0, 1.0, (SAMPLES, len(tracker.joints)))
    place, turn = link_poses(scenario, tracker, position, orientation, angle)
    referee = Articulated(scenario, tracker)
    for k in range(SAMPLES):
        posture = referee.posture(position[k], orientation[k], angle[k])
        told_place, told_turn = referee.poses(posture)
        np.testing.assert_allclose(place[:, k], told_place, atol=ROUNDING)
        np.testing.assert_allclose(turn[:, k], told_turn, atol=ROUNDING)
        mine = joint_space_inertia(scenario, tracker, place[:, k], turn[:, k])
        wanted = referee.inertia(posture)
        np.testing.assert_allclose(mine, wanted, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.3),
        Box((0.1, 0.2, 0.3)),
        Capsule(0.1, 0.4),
        Cylinder(0.2, 0.3),
        Ellipsoid((0.1, 0.2, 0.3)),
        Hull(((0.1, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.3), (-0.1, -0.1, -0.1))),
    ],
    ids=lambda shape: type(shape).__name__,
)
def test_boxes_touch_their_pieces(shape: Shape) -> None:
    """Hold a turned piece as tightly as points on its surface tell."""
    own, body = Rotation.random(2, random_state=3)
    piece = Piece("piece", shape, (0.3, -0.2, 0.1), tuple(own.as_quat(scalar_first=True)))
    place = np.array([1.0, 2.0, 3.0])
    low, high = piece_box(piece, place, body.as_matrix())
    points = place + body.apply(np.array(piece.position) + own.apply(surface_points(shape)))
    assert (points >= low - 1e-12).all()
    assert (points <= high + 1e-12).all()
    np.testing.assert_allclose(points.min(axis=0), low, atol=2e-3)
    np.testing.assert_allclose(points.max(axis=0), high, atol=2e-3)


def test_an_engines_child_loads_nothing_of_the_reference() -> None:
    """Plan, build and step a hand's scene in an engine without importing the reference or Numba."""
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    code = """
import sys
from touchstone.adapters.workers.children import _Run
from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import ready
from touchstone.adapters.registry import load
from touchstone.scenarios.catalogue import catalogue
player = ready(load("mujoco"), catalogue()["ball_snip"], Settings("recommended", 1 / 540))
player.play(2)
found = sorted(name for name in sys.modules if name.split(".")[0] in ("reference_impl", "numba"))
print(found)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
