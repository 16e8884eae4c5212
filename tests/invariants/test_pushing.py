"""A person's hands against movable bodies: boxes of all masses, a box before a wall, and thrown balls."""

from functools import cache

import numpy as np
import pytest
from pushing import BOX_HALF, BOX_START, ball_scene, impulse_on, play, push_scene, worst

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.scenario import GRAVITY, Scenario
from touchstone.scenarios.solids import block

SPEED = 0.2
"""Speed of the person [m/s]."""
MU = 0.3
"""Friction of wood on wood."""
STEADY = 2.0
"""Time from which a box moves evenly [s]."""
PROFILES = ("balanced", "accurate")


@cache
def pushed(mass: float, profile: str) -> tuple[Scenario, Recording]:
    """A box pushed at SPEED for three seconds."""
    scene = push_scene(SPEED, mass)
    return scene, play(scene, profile)


@cache
def walled(speed: float, profile: str) -> tuple[Scenario, Recording]:
    """A box pushed against a wall 0.3 m behind it."""
    wall = block(
        "wall", "wood", (0.1, 1.0, 1.0), 0.0, (BOX_START + BOX_HALF[0] + 0.4, 0.0, 1.0), kind="fixed"
    )
    scene = push_scene(speed, 12.0, wall)
    return scene, play(scene, profile)


def balance(scene: Scenario, recording: Recording, name: str) -> tuple[Array, Array]:
    """Size of the difference between a body's impulses and its change of momentum less gravity's, and of that
    change, per frame (f - 1,) [N s]."""
    context, body = Context(recording, scene), scene.body_index(name)
    rows, felt = recording.contacts, np.zeros((len(recording.time) - 1, 3))
    for side, sign in (("a", -1.0), ("b", 1.0)):
        mine = rows[f"body_{side}"] == body
        np.add.at(felt, context.contact_frame[mine], sign * rows["impulse"][mine])
    change = np.diff(recording.linear_velocity[:, body], axis=0) - context.gravity * context.frame
    change *= context.mass[body]
    return np.linalg.norm(felt - change, axis=1), np.linalg.norm(change, axis=1)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("mass", [2.0, 12.0, 40.0])
def test_hands_balance_the_floors_friction(mass, profile):
    """Push with mu (m g - F_z) on average, as the box moves at the person's speed."""
    scene, recording = pushed(mass, profile)
    body, first = scene.body_index("box"), int(np.searchsorted(recording.time, STEADY))
    time = recording.time[-1] - recording.time[first]
    x = recording.position[[first, -1], body, 0]
    x_speed = np.diff(recording.linear_velocity[[first, -1], body, 0])[0]
    # a light box bounces between its hands by some mm
    assert np.diff(x)[0] / time == pytest.approx(SPEED, rel=0.05)
    push = impulse_on(recording, scene, "box", recording.time[first]) / time
    wanted = MU * (mass * GRAVITY - push[2]) + mass * x_speed / time
    assert push[0] == pytest.approx(wanted, rel=0.01)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_box_too_heavy_for_the_hands_stays(profile):
    """Leave 2 t where they stand: friction holds 5.9 kN, and arms give way."""
    scene, recording = pushed(2000.0, profile)
    body = scene.body_index("box")
    before = recording.time < STEADY  # then the legs reach the box
    assert np.abs(recording.position[before, body, 0] - BOX_START).max() < 1e-4
    assert impulse_on(recording, scene, "box", STEADY)[0] < MU * 2000.0 * GRAVITY
    assert np.abs(np.diff(recording.joint_angle[[0, -1]], axis=0)).max() > 0.2


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_box_before_a_wall_is_not_crushed(speed, profile):
    """Keep the box between hands and wall free of overlap and in place, though the tracker walks on; change
    its momentum by the recorded impulses, but for what the energy guard takes from its motion."""
    scene, recording = walled(speed, profile)
    body = scene.body_index("box")
    # the torso strikes it, so it rebounds at a cm/s for some um
    assert np.ptp(recording.position[recording.time > 2.5, body], axis=0).max() < 1e-4
    assert worst(scene, recording, "overlap.max") < 1e-6
    residual, change = balance(scene, recording, "box")
    assert np.median(residual) < 1e-12 * change.sum()
    # the guard removes at most the energy that a substep added: 1.3 mJ of 12 kg are 0.2 N s
    assert residual.sum() < 1e-3 * change.sum()


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("mass", [2.0, 12.0, 40.0])
def test_hands_stay_at_the_box_and_do_its_work(mass, profile):
    """Follow the box within a frame: the hands touch it in half of the frames at least, and never lag far.
    Keep it out of hands and floor, and take all of its energy from the work of the hands along their way: but
    for the second order of a substep, a thousandth of what it moves with."""
    scene, recording = pushed(mass, profile)
    context = Context(recording, scene)
    pair = (scene.body_index("left_hand"), scene.body_index("box"))
    gaps = context.distances.distance[pair][recording.time > STEADY]
    # poses that stand within a frame would leave SPEED / 60
    assert np.median(gaps) < 0.05 * SPEED / 60
    assert gaps.max() < 0.01
    assert worst(scene, recording, "overlap.max") < 1e-6
    assert worst(scene, recording, "energy.injected") < 2e-3 * mass * SPEED**2 / 2


@pytest.mark.parametrize("mass", [0.5, 5.0])
def test_a_ball_that_pushes_a_hand_back_gains_no_energy(mass):
    """Throw a ball at a hand, which it drives before it: the work errs by the second order of a substep, some
    thousandths of its energy."""
    scene = ball_scene(mass, 2.0)
    assert worst(scene, play(scene), "energy.injected") < 5e-3 * mass * 2.0**2 / 2


@pytest.mark.slow
@pytest.mark.parametrize("profile", PROFILES)
def test_a_tracker_that_leaves_through_a_wall_lets_nothing_diverge(profile):
    """Walk on at 3 m/s behind a wall and a box before it: the person stays in front of both."""
    scene, recording = walled(3.0, profile)
    root = scene.body_index(scene.trackers[0].root)
    assert np.abs(recording.position[:, root, 1:] - recording.position[0, root, 1:]).max() < 0.3
    assert np.linalg.norm(recording.linear_velocity[:, root], axis=1).max() < 5.0
    assert recording.position[-1, root, 0] < BOX_START


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(("mass", "speed"), [(0.15, 3.0), (3.0, 3.0), (0.15, 20.0)])
def test_a_ball_bounces_as_off_a_hand_of_finite_mass(mass, speed, profile):
    """Meet Newton's law while the hand recoils, and return the arm to its tracker."""
    scene = ball_scene(mass, speed)
    recording = play(scene, profile)
    ball, hand = scene.body_index("ball"), scene.body_index("left_hand")
    rows = recording.contacts
    first = rows[(rows["body_a"] == hand) & (rows["body_b"] == ball)][0]
    n, p = first["normal"], first["impulse"]
    approach, leave = (
        float((first[f"velocity_b_{moment}"] - first[f"velocity_a_{moment}"]) @ n)
        for moment in ("before", "after")
    )
    e, _ = scene.pair_coefficients(hand, ball)
    assert approach < -0.7 * speed
    assert leave == pytest.approx(-e * approach, abs=1e-9)  # the solver's tolerance
    recoil = float((first["velocity_a_after"] - first["velocity_a_before"]) @ n)
    # fingertips, 9 cm from the wrist, weigh a third of the hand
    effective = -float(p @ n) / recoil
    assert 0.1 < effective < 75.0
    assert recoil < 0
    away = np.abs(recording.joint_angle - recording.joint_angle[0]).max(axis=1)
    assert away.max() > 1e-4
    assert away[-1] < 1e-6
    assert worst(scene, recording, "overlap.max") < 1e-6
