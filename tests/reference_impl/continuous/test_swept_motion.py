"""How a body moves over a substep: where the ways lead, and that their bounds hold."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.continuous.swept_motion import (
    carried_curl,
    flight_motion,
    most_curl,
    pose_along,
    shown_motion,
)
from touchstone.reference_impl.core import conventions
from touchstone.reference_impl.core.conventions import SIMULATED
from touchstone.reference_impl.core.world import BODY

ROUNDING = 1e-14
"""A few roundings of numbers near 1."""


def flying(rng: np.random.Generator) -> np.void:
    """A simulated body between two states."""
    body = np.zeros(1, BODY)[0]
    body["kind"] = SIMULATED
    for name in ("old_center", "old_velocity", "old_omega", "velocity", "omega", "center_of_mass"):
        body[name] = rng.normal(size=3)
    body["old_orientation"] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    return body


def test_a_flight_has_the_means_of_its_velocities() -> None:
    """Go with the mean of the velocities up to a fraction."""
    body, h = flying(np.random.default_rng(5)), 0.7
    flight_motion(body, h)
    start = Rotation.from_quat(body["old_orientation"], scalar_first=True)
    for s in (0.0, 0.3, 1.0):
        pose_along(body, s)
        means = {
            name: body[f"old_{name}"] * (1 - s / 2) + body[name] * s / 2 for name in ("velocity", "omega")
        }
        center = body["old_center"] + s * h * means["velocity"]
        turned = Rotation.from_rotvec(s * h * means["omega"]) * start
        np.testing.assert_allclose(body["center"], center, atol=ROUNDING)
        np.testing.assert_allclose(body["rotation"], turned.as_matrix(), atol=ROUNDING)
        offset = turned.apply(body["center_of_mass"])
        np.testing.assert_allclose(body["position"], center - offset, atol=ROUNDING)


def test_the_motion_between_two_shown_poses() -> None:
    """Lead from the old pose to the present one, the short way round."""
    rng = np.random.default_rng(6)
    body = np.zeros(1, BODY)[0]
    body["kind"] = conventions.DRIVEN
    for name in ("", "old_"):
        body[f"{name}center"] = rng.normal(size=3)
        body[f"{name}orientation"] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    shown = body.copy()
    shown_motion(body)
    assert np.linalg.norm(body["turn"]) <= np.pi
    for s, name in ((0.0, "old_"), (1.0, "")):
        pose_along(body, s)
        np.testing.assert_allclose(body["center"], shown[f"{name}center"], atol=ROUNDING)
        assert abs(float(body["orientation"] @ shown[f"{name}orientation"])) == pytest.approx(1, abs=ROUNDING)


numbers = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


@settings(max_examples=100, deadline=None)
@given(vectors, vectors, st.sampled_from([0.1, 2.0, 20.0]), vectors, vectors)
def test_points_bend_no_more_than_their_bound(turn, bend, size, point, n) -> None:
    """Bound the second difference of a point's height along any direction."""
    body = np.zeros(1, BODY)[0]
    body["moves"], body["old_orientation"] = 1, (1.0, 0.0, 0.0, 0.0)
    body["turn"], body["turn_bend"] = size * turn, size * bend
    n = np.array([0.0, 0.0, 1.0]) if np.linalg.norm(n) < 0.1 else n / np.linalg.norm(n)
    heights, step = [], 1e-3
    for s in np.arange(0.3, 0.5, step):
        pose_along(body, s)
        heights.append(n @ body["rotation"] @ point)
    bound = most_curl(body, float(np.linalg.norm(point)), 0.3, 0.5)
    # roundings of the heights are divided by the square of the step
    assert np.abs(np.diff(heights, 2)).max() / step**2 <= bound + 1e-15 / step**2


@settings(max_examples=100, deadline=None)
@given(st.lists(vectors, min_size=10, max_size=10), st.sampled_from([0.1, 2.0, 20.0]), st.booleans())
def test_points_bend_no_more_along_a_carried_normal(drawn, size, rests) -> None:
    """Bound the second difference of a point's height along a normal that turns with another body."""
    carrier, other = np.zeros(2, BODY)
    for body, (turn, bend, center, travel) in zip((carrier, other), (drawn[:4], drawn[4:8]), strict=True):
        body["moves"], body["old_orientation"] = 1, (1.0, 0.0, 0.0, 0.0)
        body["turn"], body["turn_bend"] = size * turn, size * bend
        body["old_center"], body["travel"], body["travel_bend"] = center, travel, travel[::-1]
    carrier["moves"] = 0 if rests else 1
    point, n = drawn[8], drawn[9]
    n = np.array([0.0, 0.0, 1.0]) if np.linalg.norm(n) < 0.1 else n / np.linalg.norm(n)
    other["reach"] = np.linalg.norm(point)
    carrier["rotation"], carrier["center"] = np.eye(3), carrier["old_center"]
    heights, step = [], 1e-3
    # backwards: the bound needs the bodies at its first fraction
    for s in np.arange(0.3, 0.5, step)[::-1]:
        pose_along(carrier, s)
        pose_along(other, s)
        away = other["rotation"] @ point + other["center"] - carrier["center"]
        heights.append(carrier["rotation"] @ n @ away)
    bound = carried_curl(carrier, other, 0.3, 0.5)
    # roundings of the heights are divided by the square of the step
    assert np.abs(np.diff(heights, 2)).max() / step**2 <= bound + 4e-15 / step**2
