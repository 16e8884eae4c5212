"""Joints between bodies: each fault with its place, spanning trees, loops, and who may touch."""

from dataclasses import replace
from math import cos, inf, nan, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from touchstone.scenarios.body_joints import implied_equations, mechanisms, spanning_trees
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.families.joined_contact import LADDER, LEAN, ladder_leaves
from touchstone.scenarios.families.mechanisms import turning
from touchstone.scenarios.scenario import GRAVITY, BodyJoint, ScenarioError
from touchstone.scenarios.solids import ball, block

BASE = catalogue()["double_pendulum"]
HINGE, SECOND = BASE.body_joints
SLIDER = replace(HINGE, name="slider", type="slider")


def fault_of(*joints: BodyJoint, **fields: object) -> str:
    """The only fault of a double pendulum with other joints, or its first."""
    with pytest.raises(ScenarioError) as caught:
        replace(BASE, truths=(), body_joints=joints, **fields)
    path, message = caught.value.faults[0]
    return f"{path}: {message}"


FAULTS = {
    "type": ({"type": "screw"}, "body_joints[1].type: unknown type 'screw'; valid: hinge, slider, ball"),
    "parent": ({"parent": "link_9"}, "body_joints[1].parent: unknown body 'link_9'; valid: link_1, link_2"),
    "child": ({"child": "link_9"}, "body_joints[1].child: unknown body 'link_9'; valid: link_1, link_2"),
    "no child": ({"child": ""}, "body_joints[1].child: unknown body ''; valid: link_1, link_2"),
    "itself": ({"parent": "link_2"}, "body_joints[1].child: 'link_2' is joined to itself"),
    "axis": ({"axis": (0.0, 2.0, 0.0)}, "body_joints[1].axis: found length 2, expected 1"),
    "NaN": ({"anchor": (nan, 0.0, 0.0)}, "body_joints[1].anchor: "),
    "infinite limit": ({"upper": inf}, "body_joints[1].upper: "),
    "infinite spring": ({"stiffness": nan}, "body_joints[1].stiffness: "),
    "negative": ({"damping": -1.0}, "body_joints[1].damping: found -1, expected at least 0"),
    "start outside": (
        {"lower": 0.1, "upper": 0.5},
        "body_joints[1].lower: found 0.1 to 0.5, expected a range with the start, 0",
    ),
    "empty limits": (
        {"lower": 0.0, "upper": 0.0},
        "body_joints[1].lower: found 0 to 0, expected a range with the start, 0",
    ),
    "ball": ({"type": "ball", "stiffness": 5.0}, "body_joints[1].stiffness: found 5, which a ball joint"),
    "fixed": ({"type": "fixed", "damping": 5.0}, "body_joints[1].damping: found 5, which a fixed joint"),
    "no name": ({"name": ""}, "body_joints[1].name: found none, expected a name"),
    "unknown joint": (
        {"mimics": "joint_3"},
        "body_joints[1].mimics: unknown joint 'joint_3'; valid: joint_1",
    ),
    "mimics itself": ({"mimics": "joint_2"}, "body_joints[1].mimics: 'joint_2' mimics itself"),
    "mimics as a ball": (
        {"mimics": "joint_1", "type": "ball"},
        "body_joints[1].mimics: 'joint_2' is a ball joint, expected a hinge or slider",
    ),
    "no ratio": (
        {"mimics": "joint_1", "ratio": 0.0},
        "body_joints[1].ratio: found 0, expected another number",
    ),
    "infinite ratio": (
        {"mimics": "joint_1", "ratio": inf},
        "body_joints[1].ratio: found inf, expected finite",
    ),
    "ratio alone": ({"ratio": 2.0}, "body_joints[1].ratio: found 2, but 'joint_2' mimics no joint"),
    "name twice": ({"name": "joint_1"}, "body_joints[1].name: 'joint_1' is used twice"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_named_with_its_place(case: str) -> None:
    """Each fault gives one line with the joint's number, the field and what is valid."""
    fields, message = FAULTS[case]
    assert fault_of(HINGE, replace(SECOND, **fields)).startswith(message)


def test_couplings_name_the_joint_that_mimics_none() -> None:
    """A joint that mimics another is mimicked by none, nor is a ball; the message names what is valid."""
    first = replace(HINGE, mimics="joint_2")
    assert fault_of(first, replace(SECOND, mimics="joint_1")) == (
        "body_joints[0].mimics: 'joint_2' itself mimics 'joint_1': give the ratio to it"
    )
    assert fault_of(HINGE, replace(SECOND, mimics="joint_3")).endswith("'joint_3'; valid: joint_1")
    ball_joint = replace(HINGE, type="ball")
    assert fault_of(ball_joint, replace(SECOND, mimics="joint_1")) == (
        "body_joints[1].mimics: 'joint_1' is a ball joint, expected a hinge or slider"
    )


def test_rates_of_the_start_must_obey_couplings() -> None:
    """Rates that differ from the ratio are refused with both; those that agree are not."""
    one = turning(BASE.bodies[0], HINGE.anchor, (0.0, 1.0, 0.0))
    joints = HINGE, replace(SECOND, mimics="joint_1", ratio=-2.0)
    for spin in (-1.0, 2.0):
        pace = np.cross((0.0, 1.0, 0.0), (0.5, 0.0, 0.0))
        pace = pace + np.cross((0.0, spin, 0.0), np.subtract(BASE.bodies[1].position, SECOND.anchor))
        other = replace(
            BASE.bodies[1], linear_velocity=tuple(pace.tolist()), angular_velocity=(0.0, spin, 0.0)
        )
        if spin < 0:
            replace(BASE, truths=(), bodies=(one, other), body_joints=joints)
        else:
            assert fault_of(*joints, bodies=(one, other)) == (
                "body_joints[1]: 'joint_2' starts at 1 rad/s, expected -2, -2 times the rate of 'joint_1'"
            )


def test_couplings_join_mechanisms_and_imply_equations() -> None:
    """Coupled pendulums are one mechanism; a gear between opposite sides of a parallelogram is implied."""
    assert len(mechanisms(catalogue()["geared_pendulums"])) == 1
    assert implied_equations(catalogue()["geared_pendulums"]) == 0
    scene = catalogue()["n_bar"]
    tops = [joint.name for joint in scene.body_joints if joint.parent == ""]
    joints = [replace(j, mimics=tops[0]) if j.name == tops[1] else j for j in scene.body_joints]
    doubled = replace(scene, body_joints=tuple(joints), truths=())
    assert implied_equations(doubled) == implied_equations(scene) + 1


def test_ends_that_contact_does_not_move_are_refused() -> None:
    """A child must be simulated, a parent not driven."""
    post = block("post", "steel", (0.1, 0.1, 0.1), position=(5.0, 0.0, 0.0), kind="fixed")
    bodies = (*BASE.bodies, post)
    wrong = replace(SECOND, child="post", parent="link_1")
    assert fault_of(HINGE, wrong, bodies=bodies) == (
        "body_joints[1].child: 'post' is fixed, expected a simulated body"
    )
    gripper = catalogue()["wall_push"]
    driven = next(body.name for body in gripper.bodies if body.kind == "driven")
    free = next((body.name for body in gripper.bodies if body.kind == "simulated"), None)
    joint = BodyJoint("one", "ball", driven, free or driven, (0.0, 0.0, 0.0))
    with pytest.raises(ScenarioError, match=f"{driven!r} is driven, expected a simulated or fixed"):
        replace(gripper, body_joints=(joint,))


@pytest.mark.parametrize(
    ("joint", "fields", "message"),
    [
        (HINGE, {"linear_velocity": (1.0, 0.0, 0.0)}, "'joint_1' parts at the start by (1.0, 0.0, 0.0) m/s"),
        (SLIDER, {"linear_velocity": (0.0, 1.0, 0.0)}, ""),
        (SLIDER, {"linear_velocity": (0.0, 0.0, 1.0)}, "'slider' parts at the start by (0.0, 0.0, 1.0) m/s"),
        (HINGE, {"angular_velocity": (0, 0, 2)}, "'joint_1' parts at the start by (0.0, -0.5, 0.0) m/s"),
        (replace(HINGE, anchor=(0.25, 0.0, 0.0)), {"angular_velocity": (0.0, 2.0, 0.0)}, ""),
        (
            replace(HINGE, anchor=(0.25, 0.0, 0.0)),
            {"angular_velocity": (0.0, 2.0, 2.0)},
            "'joint_1' turns at the start by (0.0, 0.0, 2.0) rad/s across its axis",
        ),
        (replace(HINGE, type="ball", anchor=(0.25, 0.0, 0.0)), {"angular_velocity": (0.0, 0.0, 2.0)}, ""),
    ],
)
def test_velocities_at_the_start_must_meet(joint: BodyJoint, fields: dict, message: str) -> None:
    """Velocities of the start that part a joint are refused with how fast, those along it are not."""
    body = replace(BASE.bodies[0], **fields)
    if message:
        assert fault_of(joint, bodies=(body, BASE.bodies[1])).startswith(f"body_joints[0]: {message}")
    else:
        replace(BASE, truths=(), bodies=(body, BASE.bodies[1]), body_joints=(joint,))


def test_trees_and_loops_are_told_apart() -> None:
    """Each body has one joint of a tree, reached from the world; what is left closes loops."""
    for name, count in (("four_bar", 1), ("n_bar", 3), ("bricard", 1), ("governor", 2), ("hinged_pair", 0)):
        scene = catalogue()[name]
        tree, loops = spanning_trees(scene)
        assert len(loops) == count
        children = [joint.child for joint in tree]
        assert len(set(children)) == len(children) == len(scene.bodies) - (name == "hinged_pair")
        reached = {"", "one"}
        for joint in tree:
            assert joint.parent in reached
            reached.add(joint.child)
        assert {joint.name for joint in (*tree, *loops)} == {joint.name for joint in scene.body_joints}
    assert len(mechanisms(catalogue()["pendulums"])) == 3
    assert len(mechanisms(catalogue()["governor"])) == 1


def test_joined_bodies_do_not_touch() -> None:
    """Bodies of one joint are no pair that may touch; others of the mechanism are."""
    one, two = ball("one", "steel", 0.1, 1.0), ball("two", "steel", 0.1, 1.0, (0.15, 0.0, 0.0))
    scene = replace(catalogue()["hinged_pair"], bodies=(one, two), truths=())
    assert list(scene.touching_pairs()) == []
    assert list(replace(scene, body_joints=()).touching_pairs()) == [(0, 1)]
    legs = {
        catalogue()["ragdoll_stairs"].bodies[k].name
        for pair in catalogue()["ragdoll_stairs"].touching_pairs()
        for k in pair
    }
    assert {"shin_left", "shin_right", "torso"} <= legs


def test_a_ladder_leaves_its_wall_where_the_wall_would_pull() -> None:
    """Integrate the angle until the acceleration away from the wall ends."""
    scene, half = catalogue()["ladder"], LADDER[1]
    share = 1 + scene.bodies[-1].inertia[0][0] / (scene.bodies[-1].mass * half**2)

    def rate(_: float, y: np.ndarray) -> tuple[float, float]:
        return y[1], GRAVITY * sin(y[0]) / (half * share)

    def pressed(t: float, y: np.ndarray) -> float:
        return cos(y[0]) * rate(t, y)[1] - sin(y[0]) * y[1] ** 2

    pressed.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(rate, (0, 2), (LEAN, 0.0), "DOP853", events=pressed, rtol=1e-12, atol=1e-12)
    angle, turning = run.y[:, -1]
    time, speed = ladder_leaves()
    assert (run.t[-1], half * cos(angle) * turning) == pytest.approx((time, speed), rel=1e-9)
    assert cos(angle) == pytest.approx(2 / 3 * cos(LEAN), rel=1e-9)
    assert scene.duration > time


def test_excluded_bodies_do_not_touch() -> None:
    """No two bodies of a group touch; wrong groups are named; without pieces a body needs a joint."""
    balls = tuple(ball(name, "steel", 0.1, 1.0, (k * 0.15, 0.0, 0.0)) for k, name in enumerate("abc"))
    scene = replace(catalogue()["hinged_pair"], bodies=balls, body_joints=(), truths=())
    assert list(replace(scene, contact_exclusions=(("a", "c"),)).touching_pairs()) == [(0, 1), (1, 2)]
    assert list(replace(scene, contact_exclusions=(("a", "b", "c"),)).touching_pairs()) == []
    with pytest.raises(ScenarioError) as found:
        replace(scene, contact_exclusions=(("a", "a"), ("a", "d")))
    assert found.value.faults == [
        ("contact_exclusions[0]", "found ['a', 'a'], expected two different bodies or more"),
        ("contact_exclusions[1][1]", "found 'd', expected a simulated or fixed body: a, b, c"),
    ]
    with pytest.raises(ScenarioError, match=r"bodies\[0\].pieces: found none"):
        replace(scene, bodies=(replace(balls[0], pieces=()), *balls[1:]))


@pytest.mark.parametrize(
    ("name", "loops"), [("double_pendulum", 0), ("slider_crank", 1), ("governor", 2), ("squeezer", 4)]
)
def test_each_plane_loop_implies_three_equations(name: str, loops: int) -> None:
    """A loop of hinges in a plane closes by six equations, three of which hold by the plane."""
    assert implied_equations(catalogue()[name]) == 3 * loops


def test_bricards_loop_moves_by_its_one_implied_equation() -> None:
    """Six hinges in space are 30 equations of five bodies, and leave one motion."""
    assert implied_equations(catalogue()["bricard"]) == 1


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_joined_body_beyond_floating_point_warns_nobody():
    """Places and speeds that overflow where a joint compares them are refused by name, without a warning."""
    far = {"position": (1e300, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 1e300)}
    scenario = catalogue()["slider_crank"]
    k = next(k for k, body in enumerate(scenario.bodies) if body.kind == "simulated")
    bodies = [replace(body, **far) if j == k else body for j, body in enumerate(scenario.bodies)]
    with pytest.raises(ScenarioError, match=rf"bodies\[{k}\]\.position: found 1e\+300"):
        replace(scenario, bodies=tuple(bodies))
