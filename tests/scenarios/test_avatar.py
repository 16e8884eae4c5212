"""The avatar: the table it is made of, mirrored sides, ball joints within limits, no overlap at rest."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reference_impl.kinematics.reach_cone import recover_angles
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.scenarios.avatar.avatar import (
    MARGIN,
    MASS,
    SEGMENTS,
    STATURE,
    Parts,
    arm_with_hand_parts,
    avatar_parts,
)
from touchstone.scenarios.avatar.chains import hinge_axes

ROUNDING = 1e-12
"""Some hundred operations on numbers of about 1."""
SIDED = ("upper_arm", "forearm", "hand", "thigh", "shank", "foot")


@pytest.fixture(scope="module")
def person(lab: SimpleNamespace):
    """The avatar standing alone."""
    return lab.person()


def test_the_whole_is_as_tall_and_heavy_as_the_table_says(person, lab: SimpleNamespace) -> None:
    """Weigh 73 kg and stand 1.741 m tall, on 27 hinges in five chains."""
    assert sum(body.mass for body in person.bodies) == pytest.approx(MASS, rel=ROUNDING)
    world = lab.build(person)
    assert np.ptp([row["low"][2] for row in world.pieces] + [row["high"][2] for row in world.pieces]) == (
        pytest.approx(STATURE, abs=2e-4)  # the head's hull ends at millimetres
    )
    assert len(person.joints) == 27
    joints = {chain.name: len(chain.joints) for chain in person.chains}
    assert joints == {"neck": 3, "left_arm": 6, "right_arm": 6, "left_leg": 6, "right_leg": 6}


@pytest.mark.parametrize("name", SIDED)
def test_a_segment_keeps_its_mass_and_inertia_in_every_posture(name: str, person) -> None:
    """Give a segment and the balls at its inner joint mass, centre and inertia of the table."""
    rng = np.random.default_rng(1)
    world = translate(person)
    world.joints["angle"] = rng.uniform(world.joints["lower"], world.joints["upper"])
    pose_links(world.bodies, world.joints, world.drivers[0])
    above = {joint.child: joint.parent for joint in person.joints}
    own = [f"left_{name}"]
    while not person.bodies[person.body_index(above[own[-1]])].pieces:
        own.append(above[own[-1]])
    rows = world.bodies[[person.body_index(member) for member in own]]
    mass = rows["mass"].sum()
    center = rows["mass"] @ rows["center"] / mass
    inertia = np.zeros((3, 3))
    for row in rows:
        arm = row["center"] - center
        inertia += row["rotation"] @ row["inertia"] @ row["rotation"].T
        inertia += row["mass"] * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    length, share, along, gyration = SEGMENTS[name]
    turned = rows[0]["rotation"]
    assert len(own) == {"upper_arm": 3, "thigh": 3, "hand": 2, "foot": 2}.get(name, 1)
    assert mass == pytest.approx(share * MASS, rel=ROUNDING)
    moments = mass * (length * np.array(gyration)) ** 2
    np.testing.assert_allclose(turned.T @ inertia @ turned, np.diag(moments), atol=ROUNDING)
    if name != "foot":  # which does not begin at its joint
        arm = turned.T @ (center - rows[0]["position"])
        np.testing.assert_allclose(arm, (0, 0, -along * length), atol=ROUNDING)


def test_equal_angles_are_mirrored_postures(person) -> None:
    """Pose the right side as the mirror image of the left one."""
    world = translate(person)
    rng = np.random.default_rng(2)
    names = [joint.name for joint in person.joints]
    for k, name in enumerate(names):
        if name.startswith("left_"):
            angle = rng.uniform(world.joints[k]["lower"], world.joints[k]["upper"])
            world.joints["angle"][[k, names.index(name.replace("left_", "right_"))]] = angle
    pose_links(world.bodies, world.joints, world.drivers[0])
    mirror = np.diag((1.0, -1.0, 1.0))
    bodies = [body.name for body in person.bodies]
    for k, name in enumerate(bodies):
        if not name.startswith("left_"):
            continue
        left, right = world.bodies[k], world.bodies[bodies.index(name.replace("left_", "right_"))]
        np.testing.assert_allclose(mirror @ left["position"], right["position"], atol=ROUNDING)
        np.testing.assert_allclose(mirror @ left["center"], right["center"], atol=ROUNDING)
        np.testing.assert_allclose(mirror @ left["rotation"] @ mirror, right["rotation"], atol=ROUNDING)
        np.testing.assert_allclose(mirror @ left["inertia"] @ mirror, right["inertia"], atol=ROUNDING)


def test_nothing_overlaps_at_rest(lab: SimpleNamespace) -> None:
    """Keep 5 mm between all parts of the standing person that may touch each other."""
    person = lab.person(effects=("self_collision",))
    world = lab.build(person)

    def corners(index: int) -> list[np.ndarray]:
        at = world.bodies[index]["position"]
        pieces = person.bodies[index].pieces
        return [lab.corners(replace(p, position=tuple(at + p.position))) for p in pieces]

    nearest = min(
        signed_distance(one, two)[0]
        for a, b in person.touching_pairs()
        for one in corners(a)
        for two in corners(b)
    )
    assert nearest > 5e-3


def test_adjacent_links_are_told_across_links_without_a_shape(lab: SimpleNamespace) -> None:
    """Let the upper arm touch all but the torso and the forearm."""
    person = lab.person(effects=("self_collision",))
    names = [body.name for body in person.bodies]
    own = names.index("left_upper_arm")
    others = {names[a + b - own] for a, b in person.touching_pairs() if own in (a, b)}
    shaped = {body.name for body in person.bodies if body.pieces}
    assert shaped - others == {"left_upper_arm", "torso", "left_forearm"}


def every_cone(parts: Parts):
    """Chains' cones with the row of their first hinge in the arrays of the parts."""
    return [cone for chain in parts[2] for cone in chain.cones]


def test_hinges_reach_their_whole_cone_and_no_more(person) -> None:
    """Find every orientation of a cone within the hinges' limits, which are no wider than the margin asks."""
    world = translate(person)
    names = [joint.name for joint in person.joints]
    rng = np.random.default_rng(3)
    for cone in every_cone(avatar_parts()):
        first = names.index(cone.joints[0])
        rows = world.joints[first : first + 3]
        corners = rows[0]["cone"][: rows[0]["cone_count"]]
        reached = []
        for _ in range(4000):
            k, s = rng.integers(len(corners)), rng.uniform()
            edge = (1 - s) * corners[k] + s * corners[(k + 1) % len(corners)]
            out = _shortest(rows[0]["cone_center"], edge)
            swing = Rotation.from_rotvec(rng.uniform() ** 0.1 * out)
            zero = swing.apply(rows[0]["cone_mark"])
            bone = swing.apply(rows[0]["cone_center"])
            twist = rng.choice([rows[0]["twist_lower"], rows[0]["twist_upper"]])
            rows[0]["bone"], rows[0]["mark"] = bone, Rotation.from_rotvec(twist * bone).apply(zero)
            assert recover_angles(world.joints, first)
            reached.append(rows["angle"].copy())
        ends = np.array([np.min(reached, axis=0), np.max(reached, axis=0)])
        # 4,000 samples come within 0.1 rad of the ends
        np.testing.assert_allclose(ends, [rows["lower"] + MARGIN, rows["upper"] - MARGIN], atol=0.1)


def _shortest(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    axis = np.cross(start, end)
    return axis / np.linalg.norm(axis) * np.arctan2(np.linalg.norm(axis), start @ end)


def test_bones_keep_away_from_gimbal_lock() -> None:
    """Hold every reach cone at least ten degrees from the first hinge's axis, both ends of it."""
    for cone in every_cone(avatar_parts()):
        joints = {joint.name: joint for joint in avatar_parts()[1]}
        pole = hinge_axes(tuple(joints[name] for name in cone.joints))[:, 0]
        corners = np.array(cone.swing)
        share = np.linspace(0, 1, 101)[:, None]
        for a, b in zip(corners, np.roll(corners, -1, axis=0)):
            edge = (1 - share) * a + share * b
            edge /= np.linalg.norm(edge, axis=1)[:, None]
            assert np.abs(edge @ pole).max() < np.cos(np.radians(10))


def test_an_arm_with_a_hand_is_a_scene_of_its_own(lab: SimpleNamespace) -> None:
    """Hang the hand of fifteen parts on the right arm: fingers down, thumb forward, palm to the left."""
    parts = arm_with_hand_parts()
    arm = lab.person(parts)
    assert [len(chain.joints) for chain in arm.chains] == [6]
    assert len(arm.joints) == 6 + 15
    world = lab.build(arm)
    names = [body.name for body in arm.bodies]
    turned = world.bodies[names.index("palm")]["rotation"]
    np.testing.assert_allclose(turned, [(0, 1, 0), (0, 0, -1), (-1, 0, 0)], atol=ROUNDING)
    assert world.bodies[names.index("middle_distal")]["position"][2] < -0.6
    hand = 0.4  # of the hand alone, critically damped under Eq. 6
    wanted = MASS * (SEGMENTS["upper_arm"].mass + SEGMENTS["forearm"].mass) + hand
    # the shoulder's ball counts three times in thirds, instead of in halves
    shoulder = arm.bodies[0].mass
    assert sum(body.mass for body in arm.bodies) == pytest.approx(wanted + shoulder, rel=ROUNDING)
