"""Contact of curved surfaces on the reference: of second order, and without loss of energy."""

from dataclasses import replace
from math import log2, sqrt

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import Recording, record
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import mechanical_energy
from touchstone.scenarios.catalogue import find
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import Body, Box, PairCoefficients, Piece, Scenario, vector
from touchstone.scenarios.solids import ball, block, capsule, cylinder, ellipsoid, half_space, slab

G = 9.81


def play(scene: Scenario, rate: int, profile: str = "balanced", *changes: str) -> Recording:
    """A scene on the reference in steps of 1 / rate."""
    chosen = replace(Settings(profile, ENGINES["reference"].profiles[profile]), dt=1 / rate, changes=changes)
    return record(load("reference"), replace(scene, frame_rate=rate), chosen)


def error(scene: Scenario, rate: int, profile: str = "balanced", *changes: str) -> float:
    """Distance from the truth, as `truth.position` judges it."""
    recording = play(scene, rate, profile, *changes)
    found = METRICS["truth.position"].measure(Context(recording, scene)).values()
    return max(getattr(value, "value", value) for value in found)


@pytest.mark.parametrize(
    ("name", "most", "rates", "order"),
    [
        ("cone_rolls", 5e-4, (120, 480), 3.5),
        ("disc_rolls", 1e-5, (60, 240), 2.5),
        ("ellipsoid_rolls", 1e-3, (60, 120), 2.5),
        ("rattleback", 4e-2, (120, 480), 2.5),
        ("rim_rolls", 1e-5, (60, 240), 2.5),
    ],
)
def test_rotation_in_space_converges(name: str, most: float, rates: tuple[int, int], order: float) -> None:
    """Half the step, an eighth of the error, a sixteenth where a line touches."""
    scene = find(name)
    assert error(scene, 60) < most
    # without substeps of its own for the turn
    coarse, fine = (error(scene, rate, "balanced", "contact_turn=0.5") for rate in rates)
    assert log2(coarse / fine) / log2(rates[1] / rates[0]) > order


@pytest.mark.parametrize(
    ("name", "rate", "most"),
    [
        ("ball_off_sphere", 60, 1e-7),
        # it leaves in the first third of a substep, where neither law finds a force
        ("ball_off_sphere", 240, 1e-8),
        ("ball_off_sphere", 480, 1e-8),
        *(("ball_off_sphere_rough", 60, 5e-5), ("ball_off_sphere_rough", 480, 5e-6)),
        # the next ball is an obstacle, not a place to which the contact moves
        *(("bowl_of_balls", 60, 1e-4), ("bowl_of_balls", 480, 1e-5)),
        *(("ellipsoid_rocks", 60, 1e-4), ("ellipsoid_rocks", 480, 3e-8)),
        *(("prism_rolls", 60, 5e-6), ("prism_rolls", 480, 2e-6)),
        *(("rocking_block", 60, 2e-4), ("rocking_block", 480, 2e-5)),
        # a slip that reverses stops first
        *(
            (f"sliders{of}", rate, 1e-6)
            for of in ("", *(f"_seed{k}" for k in range(3)))
            for rate in (60, 240, 1920)
        ),
    ],
)
def test_rotation_about_one_axis_is_near(name: str, rate: int, most: float) -> None:
    """Force, normal and lever that change together have their effect on impulse and way, also where a body
    leaves or begins to slide within a substep."""
    assert error(find(name), rate) < most


def test_a_ball_without_friction_gets_no_spin() -> None:
    """Its lever and its normal, of which each has a mean, stay parallel."""
    recording = play(find("ball_off_sphere"), 60)
    assert np.abs(recording.angular_velocity).max() < 1e-6


def test_a_smaller_turn_is_nearer() -> None:
    """Substeps for the turn of curved contacts are what `accurate` pays for."""
    assert error(find("ellipsoid_rolls"), 60, "accurate") < error(find("ellipsoid_rolls"), 60) / 10


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_a_top_keeps_its_tip_in_place(profile: str) -> None:
    """The marks of an attempt whose contact was curved do not move bodies in the next attempt."""
    assert error(find("top_precesses"), 480, profile) < 1e-3


def rocking(size: float) -> Scenario:
    """An ellipsoid, tilted at rest, which rolls to and fro without slip; the largest half axis is `size`."""
    axes = (size, 0.6 * size, 0.5 * size)
    turn = Rotation.from_rotvec((0.0, 0.5, 0.0))
    height = float(np.linalg.norm(np.array(axes) * turn.inv().apply((0.0, 0.0, 1.0))))
    w, x, y, z = turn.as_quat(scalar_first=True).tolist()
    body = ellipsoid("ellipsoid", "wood", axes, 1.0, (0.0, 0.0, height), (w, x, y, z))
    return Scenario(
        name="rocking",
        summary="an ellipsoid rocks",
        tags=(),
        bodies=(slab("floor", "wood"), body),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 5.0),),
        duration=3.0 * sqrt(size / 0.15) // (1 / 60) / 60,
    )


@pytest.mark.parametrize("size", [1.5, 0.15, 0.015, 0.0015])
def test_rolling_keeps_the_energy_at_any_size(size: float) -> None:
    """An ellipsoid that rocks keeps its energy to 1e-4 of the swing."""
    scene = rocking(size)
    energy = mechanical_energy(Context(play(scene, 60), scene), [1])
    swing = energy[0] - G * 0.5 * size
    assert np.abs(energy - energy[0]).max() < 1e-4 * swing


def bounced(profile: str, e: float, speed: float) -> float:
    """Restitution of a ball that falls on a floor at a speed [m/s], from the log of its first impact."""
    drop = ball("ball", "wood", 0.1, 1.0, (0.0, 0.0, 0.1 + speed**2 / (2 * G)))
    scene = Scenario(
        name="drop",
        summary="a ball bounces",
        tags=(),
        bodies=(slab("floor", "wood"), drop),
        coefficients=(PairCoefficients("wood", "wood", e, 0.0),),
        duration=0.2,
    )
    first = play(scene, 60, profile).contacts[0]
    before, after = (
        float(first["normal"] @ (first[f"velocity_b_{when}"] - first[f"velocity_a_{when}"]))
        for when in ("before", "after")
    )
    return -after / before


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("speed", [0.02, 0.03, 0.05, 0.1, 0.3])
@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_gentle_bounces_keep_their_restitution(profile: str, speed: float, e: float) -> None:
    """From 0.02 m/s on within 2 %."""
    assert bounced(profile, e, speed) == pytest.approx(e, rel=0.02)


def spun_among(profile: str, support: float, *others: Body) -> Recording:
    """An ellipsoid that spins on a smooth support of that height, among other bodies."""
    leaning = Rotation.from_rotvec((0.6, 0.0, 0.0))
    half_axes, up = (0.1, 0.06, 0.15), leaning.inv().apply((0.0, 0.0, 1.0))
    place = (0.0, 0.0, support + float(np.linalg.norm(up * half_axes)))
    spun = ellipsoid("spun", "wood", half_axes, 1.0, place, quaternion(leaning), spin=(1.0, 2.0, 9.0))
    floor, smooth = half_space("floor", "wood"), (PairCoefficients("wood", "wood", 0.0, 0.0),)
    return play(Scenario("test", "", (), (floor, spun, *others), 0.4, smooth), 60, profile)


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_what_rests_elsewhere_changes_no_motion(profile: str) -> None:
    """Spin and keep the energy as alone where boxes rest, with more contacts than an island of curved ones
    may have."""
    boxes = tuple(block(f"box{k}", "wood", (0.1, 0.1, 0.1), 1.0, (0.5 * k, 9.0, 0.1)) for k in range(20))
    alone, among = spun_among(profile, 0.0), spun_among(profile, 0.0, *boxes)
    np.testing.assert_array_equal(among.position[:, 1], alone.position[:, 1])
    np.testing.assert_array_equal(among.angular_velocity[:, 1], alone.angular_velocity[:, 1])


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_a_curved_contact_on_many_faces_is_corrected(profile: str) -> None:
    """Spin on a plank that rests on 18 boxes as on a floor: the contacts of faces are no crowd."""
    boxes = tuple(
        block(f"box{k}", "wood", (0.1, 0.1, 0.1), 1.0, (0.5 * k - 4.25, 0.0, 0.1)) for k in range(18)
    )
    plank = block("plank", "wood", (4.5, 0.2, 0.05), 500.0, (0.0, 0.0, 0.25))
    alone, on_plank = spun_among(profile, 0.0), spun_among(profile, 0.3, plank, *boxes)
    raised = alone.position[:, 1] + (0.0, 0.0, 0.3)
    np.testing.assert_allclose(on_plank.position[:, 1], raised, rtol=0, atol=1e-9)


@pytest.mark.parametrize("rate", [60, 240])
@pytest.mark.parametrize("mu", [0.1, 0.5])
def test_a_round_body_on_a_belt_moves_as_on_a_floor(mu: float, rate: int) -> None:
    """An ellipsoid that starts with a belt, and slips and rolls on it, gains no energy from it."""
    pace, laws, found = np.array((5.0, -3.0, 0.0)), (PairCoefficients("wood", "wood", 0.0, mu),), []
    for moves in (0.0, 1.0):
        top = Piece("top", Box((20.0, 20.0, 0.5)), surface_velocity=vector(moves * pace))
        belt = Body("belt", "fixed", "wood", (top,), position=(0.0, 0.0, -0.5))
        start = vector(moves * pace + (0.3, 0.1, 0.0))
        body = ellipsoid(
            "body", "wood", (0.1, 0.07, 0.05), 1.0, (0.0, 0.0, 0.05), velocity=start, spin=(1.0, 5.0, 2.0)
        )
        found.append(play(Scenario("test", "", (), (belt, body), 0.6, laws), rate).position[-1, 1])
    np.testing.assert_allclose(found[1] - 0.6 * pace, found[0], atol=5e-5)


@pytest.mark.parametrize("shape", ["ball", "cylinder", "capsule"])
def test_a_round_body_leaves_a_table_at_its_edge(shape: str) -> None:
    """Roll over the edge too fast to turn about it, and fall on the parabola from there."""
    radius, speed, start, duration = 0.1, 1.4, -0.2, 0.4
    lies = quaternion(Rotation.from_rotvec((np.pi / 2, 0.0, 0.0)))
    state, rolls = (
        (1.0, (start, 0.0, radius)),
        {"velocity": (speed, 0.0, 0.0), "spin": (0.0, speed / radius, 0.0)},
    )
    make = {"cylinder": cylinder, "capsule": capsule}.get(shape)
    body = (
        make(shape, "wood", radius, 0.1, *state, lies, **rolls)
        if make
        else ball(shape, "wood", radius, *state, **rolls)
    )
    table = block("table", "wood", (1.0, 1.0, 0.5), 0.0, (-1.0, 0.0, -0.5), kind="fixed")
    scene = Scenario("test", "", (), (table, body), duration, (PairCoefficients("wood", "wood", 0.0, 0.4),))
    falling = duration + start / speed
    place = (start + speed * duration, 0.0, radius - G * falling**2 / 2)
    np.testing.assert_allclose(play(scene, 60).position[-1, 1], place, atol=3e-5)
