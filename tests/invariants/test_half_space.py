"""Half-spaces: what moves on a plane moves as over a large slab, and rounded edges roll on it."""

from dataclasses import replace
from functools import cache
from math import cos, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from turned_floor import end_of

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.rounded_solid import rounded_mass_properties
from touchstone.scenarios.scenario import (
    GRAVITY,
    Body,
    HalfSpace,
    PairCoefficients,
    Piece,
    RoundedBox,
    RoundedHull,
    Scenario,
    vector,
)
from touchstone.scenarios.solids import (
    ball,
    block,
    box_corners,
    capsule,
    cone,
    cylinder,
    ellipsoid,
    half_space,
    hull,
    slab,
    solid,
)

LYING = (2**-0.5, 2**-0.5, 0.0, 0.0)
TURNED = quaternion(Rotation.from_rotvec((0.4, 0.9, 0.2)))
MOTION = {"velocity": (1.0, 0.3, -0.2), "spin": (1.0, -1.0, 2.0)}
STATE = (0.5, (0.1, 0.2, 0.2), TURNED)
ROLLING = (1.0, (0.1, 0.2, 0.05), LYING)
CORNERS = [(x, y, z) for x in (-0.1, 0.06) for y in (-0.05, 0.07) for z in (-0.04, 0.05)] + [(0.0, 0.0, 0.12)]
MOVING = {
    "ball": ball("body", "wood", 0.1, 1.0, (0.1, 0.2, 0.1), (1.0, 0.2, 0.0), (-2.0, 10.0, 3.0)),
    "box": block("body", "wood", (0.1, 0.07, 0.05), *STATE, **MOTION),
    "capsule": capsule("body", "wood", 0.05, 0.1, *STATE, **MOTION),
    "cylinder": cylinder("body", "wood", 0.05, 0.1, *STATE, **MOTION),
    "cone": cone("body", "wood", 0.07, 0.1, *STATE, **MOTION),
    "ellipsoid": ellipsoid("body", "wood", (0.1, 0.07, 0.05), *STATE, **MOTION),
    "rounded box": solid("body", "wood", RoundedBox((0.08, 0.05, 0.03), 0.02), *STATE, **MOTION),
    "rounded hull": solid("body", "wood", RoundedHull(tuple(CORNERS), 0.02), *STATE, **MOTION),
    "hull": hull("body", "wood", CORNERS, *STATE, **MOTION),
    "standing box": block("body", "wood", (0.1, 0.07, 0.05), 1.0, (0.1, 0.2, 0.05), velocity=(1.0, 0.0, 0.0)),
    "standing cone": cone("body", "wood", 0.07, 0.1, 1.0, (0.1, 0.2, 0.05), velocity=(1.0, 0.0, 0.0)),
    "rolling cylinder": cylinder(
        "body", "wood", 0.05, 0.1, *ROLLING, velocity=(1.0, 0, 0), spin=(0, 20.0, 0)
    ),
}
"""Bodies on or above the plane z = 0."""


@cache
def on_a_slab(name: str) -> np.ndarray:
    """Positions over a level slab."""
    return end_of(slab("floor", "wood"), MOVING[name], Rotation.identity(), 0.6)


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("name", MOVING)
def test_a_half_space_is_a_large_slab(name: str, turn: float) -> None:
    """Positions are those over a slab to a nanometre, on a level plane and where all is turned."""
    turned = Rotation.from_rotvec(turn * np.array((1.0, -0.5, 0.3)))
    found = end_of(half_space("floor", "wood"), MOVING[name], turned, 0.6)
    assert np.abs(found - on_a_slab(name)).max() < 1e-9


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart"])
@pytest.mark.parametrize("offset", [0.0, 0.5])
def test_engines_play_their_own_planes(engine: str, offset: float) -> None:
    """A box rests on a plane that is posed by its body, its piece, or both, to a millimetre."""
    tilt = Rotation.from_rotvec((0.0, 0.2, 0.0))
    up = tilt.apply((0.0, 0.0, 1.0))
    plane = Piece("plane", HalfSpace(), (0.3, 0.2, -offset), quaternion(Rotation.from_rotvec((0, 0, 0.4))))
    floor = Body(
        "floor", "fixed", "wood", (plane,), position=vector(offset * up), orientation=quaternion(tilt)
    )
    box = block("box", "wood", (0.1, 0.07, 0.05), 1.0, vector(0.05 * up), quaternion(tilt))
    scene = Scenario("t", "", (), (floor, box), 1.0, (PairCoefficients("wood", "wood", 0.0, 0.6),))
    recording = record(load(engine), scene, Settings("recommended", 1 / 240))
    assert np.abs(recording.position[:, 1] - recording.position[0, 1]).max() < 1e-3


def rolled(box: RoundedBox, tilt: float, times: np.ndarray) -> np.ndarray:
    """Positions (n, 3) of a rounded box of 1 kg that rolls on one edge from rest, where the middle of the
    edge's rounding starts at x = 0; the box is turned by `tilt` [rad]."""
    (x, _, z), r = box.half_extents, box.radius
    start = np.array((-x * cos(tilt) + z * sin(tilt), x * sin(tilt) + z * cos(tilt)))
    about = rounded_mass_properties(box_corners(box.half_extents), r, mass=1.0)[2][1][1]

    def arm(angle: float) -> np.ndarray:
        return np.array(((cos(angle), sin(angle)), (-sin(angle), cos(angle)))) @ start

    def change(_: float, y: np.ndarray) -> tuple[float, float]:
        a, c = arm(y[0])
        inertia = (r + c) ** 2 + a * a + about
        return y[1], (GRAVITY * a + r * a * y[1] ** 2) / inertia

    run = solve_ivp(change, (0.0, times[-1]), (0.0, 0.0), "DOP853", times, rtol=1e-12, atol=1e-13)
    places = np.array([arm(angle) for angle in run.y[0]])
    return np.column_stack((r * run.y[0] + places[:, 0], np.zeros(len(times)), r + places[:, 1]))


@pytest.mark.parametrize(
    ("engine", "profile", "rate", "error"),
    [("reference", "balanced", 960, 1e-6), ("bullet", "recommended", 3840, 2e-4)],
)
def test_a_rounded_edge_rolls(engine: str, profile: str, rate: int, error: float) -> None:
    """Follow the integrated motion of a box that rolls back on its rounded edge."""
    box, tilt = RoundedBox((0.1, 0.1, 0.05), 0.05), 0.5
    times = np.arange(25) / 120
    true = rolled(box, tilt, times)
    turn = quaternion(Rotation.from_rotvec((0.0, tilt, 0.0)))
    body = solid("box", "wood", box, 1.0, vector(true[0]), turn)
    bodies, pairs = (half_space("floor", "wood"), body), (PairCoefficients("wood", "wood", 0.0, 1.0),)
    scene = Scenario("rolls", "", (), bodies, 0.2, pairs)
    recording = record(load(engine), replace(scene, frame_rate=120), Settings(profile, 1 / rate))
    np.testing.assert_allclose(recording.position[:, 1], true, atol=error)


@pytest.mark.parametrize(
    ("engine", "reason"),
    [
        ("mujoco", "no shape RoundedBox"),
        ("dart", "no shape RoundedBox"),
        ("bullet", "the only hull of a free"),
    ],
)
def test_engines_refuse_what_they_cannot_round(engine: str, reason: str) -> None:
    """MuJoCo and DART have no rounded shapes, Bullet one per body."""
    one = solid("box", "wood", RoundedBox((0.1, 0.1, 0.05), 0.05), 1.0, (0.0, 0.0, 0.1))
    both = (*one.pieces, replace(one.pieces[0], name="other", position=(0.3, 0.0, 0.0)))
    bodies = half_space("floor", "wood"), replace(one, pieces=both)
    scene = Scenario("t", "", (), bodies, 1.0, (PairCoefficients("wood", "wood", 0.0, 0.5),))
    with pytest.raises(Unsupported, match=reason):
        load(engine).build(scene, Settings("recommended", 1 / 240))
