"""Friction: what slides with spin; static, rolling and torsional friction by closed forms, and in engines."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import energy_ledger
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import (
    FRICTION_LAWS,
    IDENTITY,
    Body,
    BodyJoint,
    PairCoefficients,
    Piece,
    Scenario,
    Sphere,
    Tracker,
)
from touchstone.scenarios.solids import ball, block, slab

FRAME, G, INERTIA = 1 / 60, 9.81, 2 / 5
"""Length of a frame [s], gravity [m/s2], inertia of a ball over m r^2 [1]."""
SCENES = [scenario.name for scenario in tagged("friction_laws")]
FARTHEST = {"slope_of_blocks": 1e-6, "stick_slip": 1e-4}
"""Largest distance from the closed form over the longest way of a body, 1e-10 in other scenes [1]: a block
that turns back does so at a stop found to 1e-6 of a substep; joints with springs are of second order."""


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
@pytest.mark.parametrize("scene", SCENES)
def test_bodies_follow_the_closed_form(scene: str, profile: str) -> None:
    """Bodies roll, spin and slide as long as the closed form says, and then stay."""
    scenario = catalogue()[scene]
    run = record(load("reference"), scenario, Settings(profile, FRAME))
    away, ways = [], []
    for truth in scenario.truths:
        body, true = scenario.body_index(truth.body), motion(scenario, truth, run.time)
        away.append(np.abs(run.position[:, body] - true.position).max())
        ways.append(np.linalg.norm(np.diff(true.position, axis=0), axis=1).sum())
        if not true.velocity[-1].any() and not true.angular_velocity[-1].any():
            assert np.abs(run.linear_velocity[-1, body]).max() < 1e-12
            assert np.abs(run.angular_velocity[-1, body]).max() < 1e-12
        if scene == "spins_to_rest":
            spin = run.angular_velocity[:, body] - true.angular_velocity
            assert np.abs(spin).max() < 1e-11 * np.abs(true.angular_velocity).max()
    assert max(away) < FARTHEST.get(scene, 1e-10) * max(*ways, 0.01)


HALF, MU, SLID = np.array((0.1, 0.06, 0.03)), 0.3, 0.4
"""Half extents of a block of 1 kg, its friction, and a time at which it still slides [m; 1; s]."""


def sliding_block(_: float, state: np.ndarray) -> np.ndarray:
    """Rates of (x, y, angle, their rates) of the block: Coulomb friction at four corners, whose loads are
    linear over the face and balance weight and moments."""
    angle, velocity, spin = state[2], state[3:5], state[5]
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    corners = np.array(((1, 1), (1, -1), (-1, -1), (-1, 1))) * HALF[:2] @ turn.T
    slip = velocity + spin * np.stack((-corners[:, 1], corners[:, 0]), axis=1)
    way = slip / np.linalg.norm(slip, axis=1)[:, None]
    shape = np.column_stack((np.ones(4), corners))
    moments = np.vstack((np.ones(4), (corners - HALF[2] * MU * way).T))
    load = shape @ np.linalg.solve(moments @ shape, (9.81, 0.0, 0.0))
    force = -MU * load[:, None] * way
    torque = (corners[:, 0] * force[:, 1] - corners[:, 1] * force[:, 0]).sum()
    return np.array((*state[3:], *force.sum(axis=0), 3 * torque / (HALF[0] ** 2 + HALF[1] ** 2)))


def test_what_slides_with_spin_follows_coulomb() -> None:
    """The direction of the slip turns within a substep: friction against that at its end was of first order,
    1 mm off at 1/60 s."""
    start = (0.0, 0.0, 0.0, 1.2, 0.5, 12.0)
    truth = solve_ivp(sliding_block, (0.0, SLID), start, rtol=1e-11, atol=1e-13).y[:, -1]
    moving = block(
        "block",
        "wood",
        tuple(HALF),
        1.0,
        (0.0, 0.0, HALF[2]),
        velocity=(1.2, 0.5, 0.0),
        spin=(0.0, 0.0, 12.0),
    )
    scene = Scenario(
        "test", "", (), (slab("floor", "wood"), moving), SLID, (PairCoefficients("wood", "wood", 0.0, MU),)
    )
    away = []
    for rate in (60, 240):
        run = record(load("reference"), scene, Settings("balanced", 1 / rate))
        away.append(np.linalg.norm(run.position[-1, 1, :2] - truth[:2]))
    assert away[0] < 1e-4
    assert away[1] < away[0] / 10


def test_a_box_that_a_ball_pushes_off_its_centre_turns_to_second_order() -> None:
    """Friction under a box opposes the mean of its slip, also where a curved contact moves it."""
    pushes = Body("ball", "prescribed", "ice", (Piece("ball", Sphere(0.03)),))
    box, duration, yaws = block("box", "wood", (0.1, 0.1, 0.05), 1.0, (0.1, 0.0, 0.05)), 0.3, []
    places = ((-0.03, 0.03, 0.05), (-0.03 + duration, 0.03, 0.05))
    path = Tracker("ball", (), (0.0, duration), places, (IDENTITY,) * 2, ((),) * 2, interpolation="linear")
    pairs = (PairCoefficients("wood", "wood", 0.0, MU), PairCoefficients("ice", "wood", 0.0, 0.0))
    for rate in (60, 240, 960):
        scene = Scenario(
            "test",
            "",
            (),
            (slab("floor", "wood"), pushes, box),
            duration,
            pairs,
            frame_rate=rate,
            trackers=(path,),
        )
        turned = record(load("reference"), scene, Settings("balanced", 1 / rate)).orientation[-1, 2]
        yaws.append(2 * np.arctan2(turned[3], turned[0]))
    coarse, fine = abs(yaws[0] - yaws[2]), abs(yaws[1] - yaws[2])
    assert coarse < 1e-3
    assert fine < coarse / 8


@pytest.mark.parametrize("scene", ["rolls_to_rest", "spins_to_rest"])
def test_moments_take_the_energy(scene: str) -> None:
    """The recorded work is the energy of the motion that they end."""
    scenario = catalogue()[scene]
    run = record(load("reference"), scenario, Settings("balanced", FRAME))
    work = run.work[:, run.work_names == "moment_work"].sum()
    energy = sum(
        body.mass * np.dot(body.linear_velocity, body.linear_velocity) / 2
        + body.inertia[0][0] * np.dot(body.angular_velocity, body.angular_velocity) / 2
        for body in scenario.bodies
    )
    assert work == pytest.approx(-energy, rel=1e-9)
    ledger = energy_ledger(Context(run, scenario))
    assert ledger["friction"] == pytest.approx(-energy, rel=1e-9)
    assert abs(ledger["correction"]) < 1e-9 * energy


def test_a_drop_takes_spin_by_its_impulse(lab: SimpleNamespace) -> None:
    """An impact under torsional friction takes the length times its impulse from the spin, as a push does."""
    length, height = 1e-3, 0.1
    ball = lab.ball(position=(0.0, 0.0, 0.05 + height), angular_velocity=(0.0, 0.0, 100.0))
    scene = lab.scene(lab.ground(), ball, laws={"torsional_friction": length}, duration=0.5)
    run = record(load("reference"), scene, Settings("balanced", FRAME))
    # from the landing on, the impulse is that of the weight
    impulse = ball.mass * -scene.gravity[2] * scene.duration
    left = 100.0 - length * impulse / ball.inertia[2][2]
    assert run.angular_velocity[-1, scene.body_index("ball"), 2] == pytest.approx(left, rel=1e-9)


@pytest.mark.parametrize("rate", [60, 240])
def test_a_ball_with_backspin_turns_round(rate: int) -> None:
    """Rolling friction opposes the backspin until sliding has taken it, and the roll from then on."""
    radius, length, mu, speed, spin, duration = 0.05, 4e-3, 0.3, 2.0, -25.0, 0.3
    slides, rolls = mu * G / (INERTIA * radius), length * G / (INERTIA * radius**2)
    turned = -spin / (slides + rolls)
    thrown = ball("ball", "wood", radius, 1.0, (0.0, 0.0, radius), (speed, 0.0, 0.0), (0.0, spin, 0.0))
    laws = (PairCoefficients("wood", "wood", 0.0, mu, rolling_friction=length),)
    scene = Scenario("test", "", (), (slab("table", "wood"), thrown), duration, laws, frame_rate=rate)
    run = record(load("reference"), scene, Settings("balanced", 1 / rate))
    way, rate_of_turn = speed * duration - mu * G * duration**2 / 2, (slides - rolls) * (duration - turned)
    assert run.position[-1, 1, 0] == pytest.approx(way, abs=1e-9)
    assert run.angular_velocity[-1, 1, 1] == pytest.approx(rate_of_turn, abs=1e-6)


def test_wheels_on_axles_roll_to_rest(lab: SimpleNamespace) -> None:
    """Rolling friction acts on what joints hold: a cart slows down by the moments of its wheels."""
    length, radius, places = 2e-3, 0.05, {"front": 0.3, "rear": -0.3}
    spin = {"linear_velocity": (1.0, 0.0, 0.0), "angular_velocity": (0.0, 1.0 / radius, 0.0)}
    wheels = [lab.ball(name, (x, 0.0, radius), **spin) for name, x in places.items()]
    frame = lab.block("frame", (0.3, 0.1, 0.01), (0.0, 0.0, radius), linear_velocity=(1.0, 0.0, 0.0))
    joints = tuple(
        BodyJoint(name, "hinge", "frame", name, (x, 0.0, radius), (0.0, 1.0, 0.0))
        for name, x in places.items()
    )
    scene = lab.scene(
        lab.ground(),
        replace(frame, pieces=()),
        *wheels,
        mu=0.5,
        laws={"rolling_friction": length},
        body_joints=joints,
        duration=0.5,
    )
    run = record(load("reference"), scene, Settings("balanced", FRAME))
    mass = frame.mass + sum(wheel.mass for wheel in wheels)
    turned = sum(wheel.inertia[1][1] for wheel in wheels) / radius**2
    pull = length / radius * mass * -scene.gravity[2] / (mass + turned)
    speed = run.linear_velocity[:, scene.body_index("frame"), 0]
    np.testing.assert_allclose(speed, 1.0 - pull * run.time, atol=1e-8)


def test_the_method_of_the_paper_has_none(lab: SimpleNamespace) -> None:
    """Refuse each law in profile `paper`."""
    for law in FRICTION_LAWS:
        scene = lab.scene(lab.ground(), lab.ball(), mu=0.1, laws={law: 0.2})
        with pytest.raises(Unsupported, match="the method of profile paper has no friction beyond its mu"):
            record(load("reference"), scene, Settings("paper", FRAME))


@pytest.mark.parametrize("engine", ["bullet", "mujoco", "dart"])
def test_engines_have_the_laws_that_they_name(registry: SimpleNamespace, engine: str) -> None:
    """An engine refuses a law that it lacks, and brakes by one that it has: to 10 %, as springs give."""
    one = registry.engine(engine)
    laws = getattr(one, "friction_laws", ())
    for law, scene in zip(FRICTION_LAWS, ("slope_of_blocks", "rolls_to_rest", "spins_to_rest")):
        scenario = catalogue()[scene]
        if law not in laws:
            with pytest.raises(Unsupported, match=f"^{engine}: the adapter has no {law.replace('_', ' ')}$"):
                registry.played(scene, engine)
            continue
        run = registry.played(scene, engine)
        start, end = 6, 60
        for truth in scenario.truths:
            body, true = scenario.body_index(truth.body), motion(scenario, truth, run.time)
            spin = np.linalg.norm(run.angular_velocity[:, body], axis=1)
            asked = np.linalg.norm(true.angular_velocity, axis=1)
            assert spin[start] - spin[end] == pytest.approx(asked[start] - asked[end], rel=0.1)
