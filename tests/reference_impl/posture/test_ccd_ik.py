"""`ccd_ik`: one joint against brute force, singular poses, limits and cones, and how often it arrives."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.reference_impl.core.conventions import (
    ANGLE_ACOS,
    ANGLE_ATAN2,
    IK_CAP,
    IK_TOLERANCE,
    PASSES_EXTRAPOLATED,
    PASSES_PLAIN,
)
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.posture.ccd_ik import (
    Hinges,
    ccd_ik,
    fix_end_effector,
    pose_angles,
    turn_toward,
)
from touchstone.reference_impl.posture.chain_overlap_removal import next_random
from touchstone.reports.studies.inverse_kinematics.study import Arm, draw

SETTINGS = [(angle, passes) for angle in (ANGLE_ACOS, ANGLE_ATAN2) for passes in (0, 1)]


@pytest.fixture(scope="module")
def arm() -> Arm:
    """The left arm of a person whose torso's frame is the world's."""
    return Arm()


@pytest.fixture(scope="module")
def goals(arm: Arm) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two hundred reachable goals, their postures, and starts near these."""
    postures, near = draw(arm, 200, 11)
    return np.array([arm.place(posture) for posture in postures]), postures, near


def hinges_of(arm: Arm) -> Hinges:
    """All hinges of the arm."""
    return Hinges(arm.world.bodies, arm.world.joints, arm.first, arm.last)


def solve(arm: Arm, start, goal, angle=ANGLE_ATAN2, passes=PASSES_EXTRAPOLATED, cap=IK_CAP):
    """`ccd_ik` from a posture: passes, distance left, whether it arrived, and the end effector."""
    point = arm.place(start)
    wanted = np.array(goal, dtype=float)
    return *ccd_ik(hinges_of(arm), point, wanted, angle, passes, IK_TOLERANCE, cap), point


@pytest.mark.parametrize("angle", [ANGLE_ACOS, ANGLE_ATAN2])
def test_one_joint_turns_to_the_best_angle(arm: Arm, goals, angle: int) -> None:
    """Come as near as the best of many angles within the limits, for every joint of many postures."""
    points, _, near = goals
    joints = arm.world.joints
    for goal, start in zip(points[:20], near):
        for k in range(arm.first, arm.last + 1):
            point = arm.place(start)
            fix_end_effector(arm.world.bodies, joints, arm.last, point)
            pose_angles(hinges_of(arm), point)
            axis = joints[k]["world_axis"].copy()
            origin = arm.world.bodies[joints[k]["child"]]["position"].copy()
            lever = point - origin
            old, low, high = (joints[k][name] for name in ("angle", "lower", "upper"))
            # within half a turn either way: the way through the worst angle is not taken
            turns, step = np.linspace(max(low - old, -np.pi), min(high - old, np.pi), 20001, retstep=True)
            along, turns = axis * (axis @ lever), turns[:, None]
            swept = along + np.cos(turns) * (lever - along) + np.sin(turns) * np.cross(axis, lever)
            squares = ((origin + swept - goal) ** 2).sum(axis=1)
            best = float(squares.min())
            turn_toward(arm.world.bodies, joints, k, point, goal, angle)
            assert low <= joints[k]["angle"] <= high
            mine = float((point - goal) @ (point - goal))
            assert mine <= (origin + lever - goal) @ (origin + lever - goal) + 1e-15
            if abs(turns[squares.argmin()]) < np.pi / 2:
                # the best sample misses the optimum by half a step at most; levers are below 1 m
                assert best - step**2 <= mine <= best + 1e-15
            # the end effector moved as the joint's new angle says
            predicted = point.copy()
            pose_angles(hinges_of(arm), point)
            tolerance = 1e-13 if angle == ANGLE_ATAN2 else 3e-8  # acos is good to 1.5e-8 rad near 0
            np.testing.assert_allclose(point, predicted, atol=tolerance)


@pytest.mark.parametrize(("angle", "passes"), SETTINGS)
def test_reachable_goals_are_reached(arm: Arm, goals, angle: int, passes: int) -> None:
    """Arrive at 98 % of the goals from near starts, within limits and cones, with the links posed."""
    points, _, near = goals
    arrived = 0
    for goal, start in zip(points, near):
        _, left, done, point = solve(arm, start, goal, angle, passes)
        assert done == (left <= IK_TOLERANCE)
        assert np.linalg.norm(point - goal) == pytest.approx(left, abs=1e-15)
        angles = arm.joints["angle"].copy()
        hand = arm.world.bodies[arm.joints[-1]["child"]].copy()
        np.testing.assert_allclose(arm.place(angles), point, atol=1e-14)
        np.testing.assert_allclose(
            hand["rotation"], arm.world.bodies[arm.joints[-1]["child"]]["rotation"], atol=1e-14
        )
        assert arm.allows(angles)
        arrived += done
    assert arrived >= 0.98 * len(points)


def test_extrapolated_passes_are_fewer(arm: Arm, goals) -> None:
    """Take at most half the passes at the 95th percentile, where plain ones creep."""
    points, _, near = goals
    taken = {
        passes: [solve(arm, start, goal, passes=passes)[0] for goal, start in zip(points, near)]
        for passes in (PASSES_PLAIN, PASSES_EXTRAPOLATED)
    }
    plain, fewer = (np.percentile(taken[k], 95) for k in (PASSES_PLAIN, PASSES_EXTRAPOLATED))
    assert fewer <= plain / 2


@pytest.mark.parametrize(("angle", "passes"), SETTINGS)
def test_a_pass_comes_no_farther(goals, angle: int, passes: int) -> None:
    """Keep or shorten the distance with every further pass where hinges have limits and no reach cone."""
    arm = Arm()
    arm.world.joints["cone_count"] = 0
    for goal in goals[0][:20]:
        left = [solve(arm, np.full(6, 0.1), goal, angle, passes, cap)[1] for cap in range(12)]
        assert (np.diff(left) <= 1e-9).all()  # acos is good to 1.5e-8 rad near 0


@pytest.mark.parametrize(("angle", "passes"), SETTINGS)
@pytest.mark.parametrize(
    ("name", "start", "goal"),
    [
        # from the shoulder at (0, 0.2, 0.53): the hanging arm, 0.64 m long, straight down
        ("stretched, goal nearer on its line", np.zeros(6), (0.0, 0.2, 0.2)),
        ("stretched, goal out of reach on its line", np.zeros(6), (0.0, 0.2, -2.0)),
        ("goal out of reach aside", np.zeros(6), (3.0, 2.0, 1.0)),
        ("goal in the shoulder, on three axes", np.full(6, 0.2), (0.0, 0.2, 0.529338)),
        ("goal at the end effector", np.zeros(6), None),
        ("goal in the elbow's axis", np.full(6, 0.2), "elbow"),
        ("goal opposite", np.full(6, 0.1), (0.0, -3.0, 3.0)),
        ("goal very far", np.full(6, 0.1), (1e9, 0.0, 0.0)),
    ],
)
def test_singular_poses_do_not_fail(arm: Arm, name: str, start, goal, angle: int, passes: int) -> None:
    """End finite, within limits and cones, no farther away, and say whether the goal was reached."""
    point = arm.place(start)
    if isinstance(goal, str):
        goal = arm.world.bodies[arm.joints[3]["child"]]["position"].copy()
    goal = point if goal is None else np.array(goal)
    before = np.linalg.norm(point - goal)
    passes, left, arrived, point = solve(arm, start, goal, angle, passes)
    assert np.isfinite(arm.joints["angle"]).all()
    assert left <= before + 1e-12
    assert arrived == (np.linalg.norm(point - goal) <= IK_TOLERANCE)
    assert arm.allows(arm.joints["angle"].copy())
    if "out of reach" in name or "far" in name:
        assert not arrived
        assert passes < IK_CAP  # it stops when it does not improve
    if name == "goal at the end effector":
        assert (passes, arrived) == (0, True)


def test_the_arc_cosine_may_not_pass_one(arm: Arm) -> None:
    """Stay finite where rounding makes the cosine of the angle more than 1."""
    rng = np.random.default_rng(12)
    for _ in range(300):
        start = rng.uniform(arm.joints["lower"], arm.joints["upper"])
        arm.place(start)
        shoulder = arm.world.bodies[arm.joints[0]["child"]]["position"].copy()
        point = arm.place(start)
        goal = shoulder + rng.uniform(0.5, 2) * (point - shoulder)
        fix_end_effector(arm.world.bodies, arm.world.joints, arm.last, point)
        pose_angles(hinges_of(arm), point)
        turn_toward(arm.world.bodies, arm.world.joints, arm.first, point, goal, ANGLE_ACOS)
        assert abs(arm.joints[0]["angle"] - start[0]) < 1e-7


def test_a_part_of_a_chain_can_be_turned_alone(arm: Arm) -> None:
    """Turn elbow and shoulder alone for an end effector on the forearm; the wrist stays."""
    start = np.array((0.3, 0.1, 0.0, 0.8, 0.2, 0.1))
    arm.place(start)
    elbow = arm.first + 3
    forearm = arm.world.bodies[arm.world.joints[elbow]["child"]]
    point = forearm["position"] + forearm["rotation"] @ (0.0, 0.0, -0.2)
    goal = point + (0.03, 0.02, 0.05)
    part = hinges_of(arm)._replace(last=elbow)
    _, _, arrived = ccd_ik(part, point, goal, ANGLE_ATAN2, PASSES_EXTRAPOLATED, IK_TOLERANCE, IK_CAP)
    assert arrived
    np.testing.assert_array_equal(arm.joints["angle"][4:], start[4:])
    pose_links(arm.world.bodies, arm.world.joints, arm.world.drivers[0])
    np.testing.assert_allclose(forearm["position"] + forearm["rotation"] @ (0, 0, -0.2), point, atol=1e-14)


def test_the_generator_is_that_of_park_and_miller(arm: Arm) -> None:
    """Reach the state that their paper gives after 10,000 numbers from 1, and stay in (0, 1)."""
    state = arm.world.state[0]
    state["random"] = 1
    numbers = [next_random(state) for _ in range(10000)]
    assert state["random"] == 1043618065
    assert 0 < min(numbers) < max(numbers) < 1
    assert np.mean(numbers) == pytest.approx(0.5, abs=5 / np.sqrt(12 * 10000))
