"""Cylinders and cones on the reference by closed forms: they roll, slide, stand, tip; rims and edges."""

from math import asin, atan, atan2, cos, pi, radians, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import mechanical_energy
from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.catalogue import find
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Cylinder,
    PairCoefficients,
    Piece,
    Scenario,
    Tracker,
    vector,
)
from touchstone.scenarios.solids import block, capsule, cone, cylinder, half_space, hull, slab

ROLLED = 2e-4
"""Distance of a cone that has rolled for 3 s from its closed form, at 1/60 s [m]."""


def play(
    *bodies: Body,
    e: float = 0.0,
    mu: float = 1.0,
    duration: float = 1.0,
    rate: int = 60,
    trackers: tuple[Tracker, ...] = (),
) -> Context:
    """What the reference makes of bodies of wood."""
    coefficients = (PairCoefficients("wood", "wood", e, mu),)
    scene = Scenario("test", "", (), bodies, duration, coefficients, trackers=trackers)
    return Context(record(load("reference"), scene, Settings("balanced", 1 / rate)), scene)


def led_table(times: np.ndarray, places: np.ndarray, turns: Rotation) -> tuple[Body, Tracker]:
    """A table on a prescribed path, its top 0.05 m above its origin, and its tracker."""
    table = Body("table", "prescribed", "wood", (Piece("table", Box((3.0, 3.0, 0.05))),))
    return table, keyframed("table", times, places, [quaternion(turn) for turn in turns])


@pytest.mark.parametrize(
    "name",
    [
        *("cylinder_rolls", "cylinder_slides", "cylinder_spins", "cylinder_stack", "cylinder_holds"),
        *("cone_rolls", "cone_swings", "cone_holds", "cone_slides"),
    ],
)
def test_they_follow_their_truth(registry, name: str) -> None:
    """Stay within a nanometre of the closed form at 1/60 s: GAP_LEFT, to which contacts close; cones that
    roll within ROLLED."""
    scene, recording = find(name), registry.played(name, "reference")
    for truth in scene.truths:
        true, body = motion(scene, truth, recording.time), scene.body_index(truth.body)
        rolls = truth.law == "rolling_cone"
        np.testing.assert_allclose(recording.position[:, body], true.position, atol=ROLLED if rolls else 1e-9)
        if name.startswith("cylinder"):
            np.testing.assert_allclose(recording.angular_velocity[:, body], true.angular_velocity, atol=1e-8)


@pytest.mark.parametrize(("kind", "turn"), [*(("cylinder", turn) for turn in (0.0, 0.4, 0.785)),
                                            *(("cone", turn) for turn in (0.0, 0.4))])  # fmt: skip
def test_a_rim_tips_where_the_weight_leaves_it(kind: str, turn: float) -> None:
    """Stand at 0.99 and tip at 1.01 of the slope at which the weight passes over the rim, however turned."""
    height, steepest = (
        (0.1, asin(0.04 / sqrt(0.04**2 + 0.1**2))) if kind == "cylinder" else (0.075, atan(2 / 3))
    )
    for share, tips in ((0.99, False), (1.01, True)):
        tilt = Rotation.from_rotvec((0.0, share * steepest, 0.0))
        up = tilt.apply((0.0, 0.0, 1.0))
        place, turned = vector(height * up), quaternion(tilt * Rotation.from_rotvec((0.0, 0.0, turn)))
        if kind == "cylinder":
            post = cylinder("post", "wood", 0.04, 0.1, 1.0, place, turned)
            slope = slab("slope", "wood", vector(up), quaternion(tilt))
        else:
            post = cone("post", "wood", 0.05, 0.15, 1.0, place, turned)
            slope = half_space("slope", "wood", orientation=quaternion(tilt))
        moved = np.abs(play(slope, post).recording.position[-1, 1] - place).max()
        assert (moved > 0.05) == tips
        assert tips or moved < 1e-9


def test_a_cylinder_bears_a_load_near_its_rim() -> None:
    """Stand still under a block on its cap that presses next to the rim, between two points of a square."""
    post = cylinder("post", "wood", 0.05, 0.04, 0.1, (0.0, 0.0, 0.04))
    arm = 0.04 * np.array((cos(radians(45.0)), sin(radians(45.0))))
    bearing = block("load", "wood", (0.004, 0.004, 0.01), 1.0, (*arm.tolist(), 0.09))
    recording = play(slab("floor", "wood"), post, bearing, mu=0.5).recording
    assert np.abs(recording.position - recording.position[0]).max() < 1e-9


@pytest.mark.parametrize("shape", ["cylinder", "prism"])
def test_a_face_stands_on_its_whole_outline(shape: str) -> None:
    """Stand on a table that accelerates at 0.95 of what tips a cylinder or a prism of 12 sides, in a
    direction between the four points of a manifold; tip at 1.05."""
    size, angles = 0.05, np.arange(12) * pi / 6
    corners = tuple((size * cos(angle), size * sin(angle), z) for angle in angles for z in (-size, size))
    place, toward = (0.0, 0.0, 0.05 + size), np.array((cos(0.3), sin(0.3), 0.0))
    reach = size if shape == "cylinder" else size * cos(pi / 12) / cos(pi / 12 - 0.3)
    times = np.arange(0.0, 0.7, 1 / 120)
    for share, tips in ((0.95, False), (1.05, True)):
        way = 0.5 * share * 9.81 * reach / size * np.outer(times**2, toward)
        table, tracker = led_table(times, way, Rotation.from_rotvec(np.zeros((len(times), 3))))
        if shape == "cylinder":
            load = cylinder("load", "wood", size, size, 1.0, place)
        else:
            load = hull("load", "wood", corners, 1.0, place)
        recording = play(table, load, mu=3.0, duration=0.5, trackers=(tracker,)).recording
        moved = np.abs(recording.position[:, 1] - recording.position[:, 0] - place).max()
        assert moved > 0.005 if tips else moved < 1e-9, (share, moved)


def test_a_disc_stands_on_a_part_of_another() -> None:
    """Stand while the rim below, between the points in which both rims cross, is beyond the weight; tip when
    it is not."""
    for inside in (0.001, -0.001):
        base = Body("base", "fixed", "wood", (Piece("base", Cylinder(0.15, 0.1)),), position=(0.0, 0.0, 0.1))
        post = cylinder("post", "wood", 0.05, 0.05, 1.0, (0.15 - inside, 0.0, 0.25))
        recording = play(base, post, duration=0.5).recording
        moved = np.abs(recording.position[:, 1] - recording.position[0, 1]).max()
        assert moved < 1e-9 if inside > 0 else moved > 0.01


def test_a_cylinder_rocks_from_rim_to_rim() -> None:
    """Rock in a plane by the pendulum about each side of the rim and, where the other side lands, Housner's
    ratio 1 - 2 m r^2 / I of angular velocities."""
    radius, height, duration, yaw = 0.03, 0.1, 0.5, 0.7
    lean = Rotation.from_euler("z", yaw) * Rotation.from_rotvec((0.0, 0.05, 0.0))
    low = lean.apply((radius, 0.0, -height))[2]
    post = cylinder("post", "wood", radius, height, 1.0, (0.0, 0.0, -low), quaternion(lean))
    recording = play(slab("floor", "wood"), post, mu=2.0, duration=duration, rate=240).recording
    about = post.inertia[0][0] + radius**2 + height**2

    def level(_: float, y: np.ndarray) -> float:
        return y[0]

    level.terminal, level.direction = True, -1
    time, angle, speed, side = 0.0, 0.05, 0.0, 1
    while time < duration:
        swing = solve_ivp(
            lambda _, y: (y[1], -9.81 * (radius * cos(y[0]) - height * sin(y[0])) / about),
            (time, duration), (angle, speed), events=level, rtol=1e-12, atol=1e-14,
        )  # fmt: skip
        time, angle = swing.t[-1], max(swing.y[0, -1], 1e-300)
        if swing.status == 1:
            speed, side = -swing.y[1, -1] * (1 - 2 * radius**2 / about), -side
    turned = Rotation.from_quat(recording.orientation[-1, 1], scalar_first=True)
    x, y, z = (Rotation.from_euler("z", -yaw) * turned).apply((0.0, 0.0, 1.0))
    assert atan2(x, z) == pytest.approx(side * angle, abs=2e-4)
    assert abs(y) < 1e-6


def test_a_cap_lands_on_a_swinging_plate_and_rests() -> None:
    """Rest after a start with a jerk lifted it, without rattling from rim to rim."""
    times = np.arange(0.0, 1.2, 1 / 120)
    turns = Rotation.from_rotvec(np.outer(0.25 * (1 - np.cos(5 * times)), (0.0, 1.0, 0.0)))
    table, tracker = led_table(times, np.zeros((len(times), 3)), turns)
    load = cylinder("load", "wood", 0.03, 0.02, 1.0, (0.5, 0.0, 0.07))
    recording = play(table, load, mu=3.0, trackers=(tracker,)).recording
    turned = Rotation.from_quat(recording.orientation[:, 0], scalar_first=True)
    held = turned.inv().apply(recording.position[:, 1])
    assert np.abs(held - (0.5, 0.0, 0.07)).max() < 1e-5
    assert np.abs(held[12:] - held[-1]).max() < 1e-8


@pytest.mark.parametrize("shape", ["cylinder", "capsule"])
def test_a_log_rests_between_two_edges(shape: str) -> None:
    """Lie still on the edges of two blocks: it touches each along its side, not at one end."""
    lies, edge, high = quaternion(Rotation.from_rotvec((pi / 2, 0.0, 0.0))), 0.06, 0.08
    make = {"cylinder": cylinder, "capsule": capsule}[shape]
    log = make("log", "wood", 0.1, 0.2, 1.0, (0.0, 0.0, high), lies)
    sides = [
        block(name, "wood", (0.3, 0.5, 0.2), 0.0, (x, 0.0, -0.2), kind="fixed")
        for name, x in (("west", -0.3 - edge), ("east", 0.3 + edge))
    ]
    recording = play(*sides, log, mu=0.3).recording
    assert np.abs(recording.position - recording.position[0]).max() < 1e-6
    assert np.abs(recording.angular_velocity[-1]).max() < 1e-9


@pytest.mark.parametrize("shape", ["cylinder", "capsule"])
@pytest.mark.parametrize("half_length", [0.03, 0.2])
def test_a_log_rolls_off_an_edge(shape: str, half_length: float) -> None:
    """Roll about the edge by which it touches, without loss: r a'' (1 + I / (m r^2)) = g sin(a)."""
    radius, start, duration = 0.1, 0.1, 0.3
    ridge = block(
        *("ridge", "wood", (0.1, 0.3, 0.1), 0.0, (0.0, 0.0, -0.1 * sqrt(2))),
        quaternion(Rotation.from_rotvec((0.0, pi / 4, 0.0))),
        kind="fixed",
    )
    make = {"cylinder": cylinder, "capsule": capsule}[shape]
    lies = quaternion(Rotation.from_rotvec((pi / 2, 0.0, 0.0)))
    log = make("log", "wood", radius, half_length, 1.0, (radius * sin(start), 0.0, radius * cos(start)), lies)
    context = play(ridge, log, mu=0.8, duration=duration)
    turning = radius * (1 + log.inertia[2][2] / radius**2)
    rolled = solve_ivp(
        lambda _, y: (y[1], 9.81 * sin(y[0]) / turning), (0.0, duration), (start, 0.0), rtol=1e-12, atol=1e-14
    )
    x, y, z = context.recording.position[-1, 1]
    assert atan2(x, z) == pytest.approx(rolled.y[0, -1], abs=1e-4)
    assert abs(y) < 1e-9
    assert np.ptp(mechanical_energy(context, [1])) < 1e-8


SPUN = {"coin": ((0.9, 0.2, 0.0), (1.0, 2.0, 12.0)), "cone": ((2.3, 0.4, 0.0), (3.0, 2.0, 12.0))}
"""Rotation vector and spin at the start [rad, rad/s]."""


@pytest.mark.parametrize("name", SPUN)
def test_what_falls_on_its_rim_gains_nothing(name: str) -> None:
    """Gain no energy where a coin falls on its rim, bounces, and rolls on it without loss, and where a cone
    falls on its rim, its side and its apex."""
    turned_by, spin = SPUN[name]
    turn = quaternion(Rotation.from_rotvec(turned_by))
    if name == "coin":
        body, floor = (
            cylinder(name, "wood", 0.05, 0.004, 0.1, (0.0, 0.0, 0.06), turn, spin=spin),
            slab("floor", "wood"),
        )
    else:
        body, floor = (
            cone(name, "wood", 0.05, 0.08, 0.3, (0.0, 0.0, 0.2), turn, spin=spin),
            half_space("floor", "wood"),
        )
    context = play(floor, body, e=0.3, mu=0.4, duration=3.0)
    assert np.diff(mechanical_energy(context, [1])).max() < 1e-9
