"""What driven plates press, hold, lift and drag, against closed forms: forces, stick and slip."""

from collections.abc import Callable
from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import load
from touchstone.scenarios.scenario import (
    GRAVITY,
    IDENTITY,
    Body,
    Box,
    Joint,
    PairCoefficients,
    Piece,
    Scenario,
    Tracker,
)
from touchstone.scenarios.solids import block, box_inertia, slab

Path = Callable[[float], tuple[float, float, float]]
PROFILES = ("balanced", "accurate")
BOX = (0.1, 0.1, 0.05)
PLATE = (0.03, 0.03, 0.02)
TOP = 2 * BOX[2] + PLATE[2]
"""Height of a plate that lies on the box [m]."""


def plate(name: str, half: tuple[float, float, float], mass: float) -> Body:
    """A driven box of `pad`."""
    inertia = box_inertia(mass, half)
    return Body(name, "driven", "pad", (Piece(name, Box(half)),), mass=mass, inertia=inertia)


def plate_on_a_box(mass: float) -> tuple[Body, ...]:
    """The ground, a plate, and a box of 1 kg on which it lies."""
    box = block("box", "wood", BOX, 1.0, (0, 0, BOX[2]))
    return slab("ground", "wood"), plate("plate", PLATE, mass), box


def tracker(
    root: str, path: Path, duration: float, stiffness: float, mass: float, ratio: float = 1.0
) -> Tracker:
    """A path sampled a hundred times per second; `ratio` is that of the damping to the critical one."""
    times = np.linspace(0.0, duration, round(100 * duration) + 1).tolist()
    places = tuple(path(time) for time in times)
    damping = 2 * ratio * sqrt(stiffness * mass)
    rows = (tuple(times), places, (IDENTITY,) * len(times), ((),) * len(times))
    return Tracker(root, (), *rows, stiffness=stiffness, damping=damping)


def play(
    bodies: tuple[Body, ...],
    trackers: tuple[Tracker, ...],
    rate: int = 60,
    profile: str = "balanced",
    pad: float = 0.5,
    wood: float = 0.3,
    gravity: tuple[float, float, float] = (0.0, 0.0, -GRAVITY),
    joints: tuple[Joint, ...] = (),
) -> Recording:
    """Play plates of `pad` among bodies of `wood`."""
    given = {("wood", "wood"): wood, ("wood", "pad"): pad, ("pad", "pad"): pad}
    pairs = tuple(PairCoefficients(*names, 0.0, mu) for names, mu in given.items())
    fields = {"trackers": trackers, "joints": joints, "gravity": gravity, "frame_rate": rate}
    scenario = Scenario("driven", "", (), bodies, trackers[0].times[-1], pairs, **fields)
    return record(load("reference"), scenario, Settings(profile, 1 / rate))


def ramp(time: float, begin: float, end: float) -> float:
    """0 before `begin`, 1 after `end`, linear between."""
    return min(max((time - begin) / (end - begin), 0.0), 1.0)


def mean_force(recording: Recording, a: int, b: int, axis: int, since: float) -> float:
    """Mean contact force between two bodies along an axis since a time [N]."""
    rows = recording.contacts
    mine = (rows["body_a"] == a) & (rows["body_b"] == b) & (rows["time"] > since - 1e-9)
    return abs(float(rows["impulse"][mine][:, axis].sum())) / (float(recording.time[-1]) - since)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("rate", [30, 60, 240])
@pytest.mark.parametrize(("stiffness", "mass"), [(1e3, 0.4), (1e4, 0.4), (1e5, 0.01), (10, 100), (1e5, 100)])
def test_a_plate_presses_with_its_spring(profile: str, rate: int, stiffness: float, mass: float) -> None:
    """A tracker 10 mm inside a box on the ground presses with K d, whatever the step; nothing moves."""
    path = tracker("plate", lambda t: (0, 0, TOP - 0.01 * ramp(t, 0, 0.3)), 1.5, stiffness, mass)
    found = play(plate_on_a_box(mass), (path,), rate, profile)
    assert mean_force(found, 1, 2, 2, 1.4) == pytest.approx(0.01 * stiffness, rel=1e-6)
    assert mean_force(found, 0, 2, 2, 1.4) == pytest.approx(0.01 * stiffness + GRAVITY, rel=1e-6)
    assert np.abs(found.position[:, 2] - (0, 0, BOX[2])).max() < 1e-6


@pytest.mark.parametrize("rate", [30, 60, 240])
@pytest.mark.parametrize(("stiffness", "mass"), [(1e5, 0.01), (1e4, 0.4), (1e4, 0.02)])
def test_a_spring_with_little_damping_presses_with_its_force(rate: int, stiffness: float, mass: float):
    """Also where the coupling swings many times in a step, at 2 % of critical damping."""
    path = tracker("plate", lambda t: (0, 0, TOP - 0.01 * ramp(t, 0, 0.3)), 3.0, stiffness, mass, 0.02)
    found = play(plate_on_a_box(mass), (path,), rate)
    assert mean_force(found, 1, 2, 2, 2.9) == pytest.approx(0.01 * stiffness, rel=1e-6)
    assert np.abs(found.position[:, 2] - (0, 0, BOX[2])).max() < 1e-6


@pytest.mark.parametrize("profile", PROFILES)
def test_a_plate_presses_on_a_leaning_stack(profile: str) -> None:
    """100 N on three boxes, each 1 cm off the one below, move none of them."""
    boxes = tuple(block(f"box_{k}", "wood", (0.1,) * 3, 1.0, (0.01 * k, 0, 0.1 + 0.2 * k)) for k in range(3))
    path = tracker("plate", lambda t: (0, 0, 0.65 - 0.1 * ramp(t, 0, 1)), 2.0, 1000.0, 1.0)
    found = play(
        (slab("ground", "wood"), plate("plate", (0.3, 0.3, 0.05), 1.0), *boxes), (path,), 60, profile
    )
    assert np.abs(found.position[:, 2:, :2] - found.position[0, 2:, :2]).max() < 1e-9
    # the impulses at the end of the press balance 100 N
    assert mean_force(found, 1, 4, 2, 1.8) == pytest.approx(100.0, rel=1e-6)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("rate", [60, 240])
def test_two_plates_hold_and_lift_a_cube(profile: str, rate: int) -> None:
    """Two plates close on a cube with 20 N and lift it by 0.2 m: it sticks, and weighs on their springs."""
    half, mass, stiffness = 0.02, 0.1, 2000.0
    trackers = tuple(
        tracker(
            name,
            lambda t, side=side: (
                side * (half + 0.0105 - 0.0105 * ramp(t, 0.1, 0.4)),
                0.0,
                half + 0.012 + 0.2 * (lambda s: s * s * (3 - 2 * s))(ramp(t, 0.8, 1.8)),
            ),
            3.0,
            stiffness,
            0.5,
        )
        for name, side in (("left", -1), ("right", 1))
    )
    plates = tuple(plate(name, (0.01, 0.03, 0.03), 0.5) for name in ("left", "right"))
    bodies = (slab("ground", "wood"), block("cube", "wood", (half,) * 3, mass, (0, 0, half)), *plates)
    found = play(bodies, trackers, rate, profile, pad=0.7)
    sag = mass * GRAVITY / (2 * stiffness)
    slip = found.position[:, 1, 2] - found.position[:, 2, 2]
    settled = round(0.75 * rate)
    assert np.ptp(slip[settled:]) < 1e-9
    np.testing.assert_allclose(found.position[-1, 2:, 2], half + 0.012 + 0.2 - sag, atol=1e-6)
    # both plates bear the same
    assert mean_force(found, 1, 2, 0, 2.9) == pytest.approx(mean_force(found, 1, 3, 0, 2.9), rel=1e-9)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_box_is_dragged_without_slip(profile: str) -> None:
    """A plate presses a box with 40 N (mu 0.8) and moves by 0.3 m over the ground (mu 0.3): it follows."""
    path = tracker(
        "plate",
        lambda t: (0.3 * (lambda s: s * s * (3 - 2 * s))(ramp(t, 0.5, 2)), 0, TOP - 0.01 * ramp(t, 0, 0.3)),
        3.0,
        4000.0,
        0.5,
    )
    found = play(plate_on_a_box(0.5), (path,), 60, profile, pad=0.8)
    assert np.ptp((found.position[:, 2] - found.position[:, 1])[30:], axis=0).max() < 1e-8
    assert found.position[-1, 2, 0] == pytest.approx(0.3 - 0.3 * (40 + GRAVITY) / 4000, abs=1e-3)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_palm_holds_a_cube_on_a_wall(profile: str) -> None:
    """20 N against a wall (mu 0.7) hold 0.1 kg: the cube falls by micrometres while the palm arrives."""
    wall = Body("wall", "fixed", "wood", (Piece("wall", Box((0.1, 1, 1))),), position=(-0.12, 0, 1))
    cube = block("cube", "wood", (0.02,) * 3, 0.1, (0, 0, 0.5))
    path = tracker("palm", lambda t: (0.0401 - 0.0101 * ramp(t, 0, 0.05), 0, 0.5), 2.0, 2000.0, 0.5)
    found = play((wall, plate("palm", (0.02, 0.03, 0.03), 0.5), cube), (path,), 60, profile, 0.7, 0.7)
    assert 0.5 - found.position[-1, 2, 2] < 1e-4
    assert np.ptp(found.position[-60:, 2], axis=0).max() < 1e-9


@pytest.mark.parametrize("profile", PROFILES)
def test_a_finger_bears_on_a_pushed_box(profile: str) -> None:
    """50 N of a finger and 9.81 N of weight at mu 0.5 hold a box against 10 N."""
    path = tracker("plate", lambda t: (0, 0, TOP - 0.01 * ramp(t, 0, 0.3)), 2.0, 5000.0, 0.5)
    pulled = {"pad": 0.5, "wood": 0.5, "gravity": (10.0, 0.0, -GRAVITY)}
    found = play(plate_on_a_box(0.5), (path,), 60, profile, **pulled)
    assert np.ptp(found.position[-60:, 2], axis=0).max() < 1e-9
    assert mean_force(found, 0, 2, 2, 1.9) == pytest.approx(50 + GRAVITY, rel=1e-6)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(("stiffness", "mass"), [(1e5, 5.0), (1e6, 100.0), (2000.0, 1.0)])
def test_a_lifted_load_rests_on_its_plate(profile: str, stiffness: float, mass: float) -> None:
    """A plate starts at 3 m/s2 and lifts a load at 1.5 m/s: no gap, and the same speed."""
    path = tracker(
        "plate", lambda t: (0, 0, 1.5 * t * t if t < 0.5 else 1.5 * t - 0.375), 1.5, stiffness, mass
    )
    load = block("load", "wood", (0.1,) * 3, 1.0, (0, 0, 0.12))
    found = play((plate("plate", (0.2, 0.2, 0.02), mass), load), (path,), 60, profile)
    gap = found.position[:, 1, 2] - found.position[:, 0, 2] - 0.12
    assert np.abs(gap[5:]).max() < 1e-6
    # before the tracker's spline comes to rest at its end
    assert np.ptp(found.linear_velocity[50:70, :, 2]) < 1e-3


def test_a_heavy_body_pushes_a_light_plate_away() -> None:
    """A box of 100 kg carries a plate of 0.1 kg on a weak spring by metres: the plan of the scene holds."""
    box = block("box", "wood", (0.1,) * 3, 100.0, (-1.0, 0, 0.1))
    fast = replace(box, linear_velocity=(5.0, 0.0, 0.0))
    path = tracker("plate", lambda t: (0, 0, 0.1), 1.0, 10.0, 0.1)
    found = play((slab("ground", "wood"), fast, plate("plate", (0.02, 0.05, 0.05), 0.1)), (path,), wood=0.0)
    assert found.position[:, 2, 0].max() > 2


@pytest.mark.parametrize("profile", PROFILES)
def test_a_loaded_hand_stands_on_its_finger(profile: str) -> None:
    """A box of 1 kg on a palm of 1000 N/m lowers it by 1 mm, until the finger stands on the ground."""
    finger = plate("finger", (0.01, 0.01, 0.02), 0.1)
    hinge = Joint("knuckle", "palm", "finger", (0.0, 0.0, -0.05), (0.0, 1.0, 0.0), IDENTITY, -1.0, 1.0)
    times, place = (0.0, 2.0), (0.0, 0.0, 0.071)
    hand = Tracker(
        "palm", ("knuckle",), times, (place,) * 2, (IDENTITY,) * 2, ((0.0,),) * 2, stiffness=1e3, damping=40.0
    )
    load = block("load", "wood", (0.02, 0.02, 0.02), 1.0, (0.0, 0.0, place[2] + 0.041))
    bodies = (slab("ground", "wood"), plate("palm", (0.03, 0.03, 0.02), 0.3), finger, load)
    found = play(bodies, (hand,), profile=profile, joints=(hinge,))
    assert found.position[-1, 1, 2] == pytest.approx(place[2] - 0.001, abs=2e-6)
    assert np.ptp(found.position[-60:], axis=0).max() < 1e-9
    events = found.work[:, found.work_names.tolist().index("events")]
    assert events[-60:].max() == 0
