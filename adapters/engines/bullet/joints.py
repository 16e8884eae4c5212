"""Joints between bodies in Bullet: one multibody a mechanism, constraints that close loops, and motors."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Unsupported
from touchstone.adapters.engines.bullet.tables import UNTURNED, Link, Links
from touchstone.adapters.joined_bodies import closing_points, laws, moved_parent, servo, start_motion
from touchstone.scenarios.body_joints import ALONG_AXIS, is_limited, mechanisms, spanning_trees
from touchstone.scenarios.scenario import ORIGIN, UNBOUNDED, Body, BodyJoint, Scenario, vector

TYPES = {
    "hinge": pybullet.JOINT_REVOLUTE,
    "slider": pybullet.JOINT_PRISMATIC,
    "ball": pybullet.JOINT_SPHERICAL,
    "fixed": pybullet.JOINT_FIXED,
}

GEAR_ERP = 0.2
"""Share of a gear's error that a step takes away [1]: that of Bullet's other constraints; its own is 0."""


class Tree(NamedTuple):
    """A mechanism as a multibody. The base is the first body, or nothing if each body has a joint.

    Attributes:
        origins: origins of the link frames in the body frames, one a body (b, 3) [m].
        joints, links: joint of each further body, and what places its link.
    """

    bodies: Links
    origins: Array
    joints: tuple[BodyJoint, ...]
    links: list[Link]


def trees(scenario: Scenario) -> list[Tree]:
    """The mechanisms of a scene. A link's frame has the joint's anchor as origin, and the child's axes.

    Raises:
        Unsupported: a joint with a prescribed body, or couplings of free roots with another or the world.
    """
    tree = spanning_trees(scenario)[0]
    names = [{joint.name for joint in group} for group in mechanisms(scenario)]
    return [_tree(scenario, [joint for joint in tree if joint.name in own]) for own in names]


def _tree(scenario: Scenario, joints: list[BodyJoint]) -> Tree:
    parents = [moved_parent("bullet", scenario, joint) for joint in joints]
    bodies = [scenario.body_index(joint.child) for joint in joints]
    children = {joint.child for joint in joints}
    if len({parent and parent.name for parent in parents if not parent or parent.name not in children}) > 1:
        coupled = next(joint.name for joint in joints if joint.mimics)
        raise Unsupported(f"bullet: a gear couples joints of one multibody, with one base ({coupled!r})")
    based = int(parents[0] is not None)
    if parents[0] is not None:
        bodies.insert(0, scenario.body_index(parents[0].name))
    origin = {body: np.array(scenario.bodies[body].position) for body in bodies[:based]}
    links: list[Link] = []
    for joint, parent in zip(joints, parents):
        child = scenario.bodies[scenario.body_index(joint.child)]
        outer, place, index = Rotation.identity(), np.zeros(3), 0
        if parent is not None:
            key = scenario.body_index(parent.name)
            outer, place, index = _turn(parent), origin[key], bodies.index(key) + 1 - based
        origin[scenario.body_index(joint.child)] = np.array(joint.anchor)
        links.append(
            {
                "linkPositions": vector(outer.inv().apply(np.array(joint.anchor) - place)),
                "linkOrientations": tuple((outer.inv() * _turn(child)).as_quat().tolist()),
                "linkParentIndices": index,
                "linkJointTypes": TYPES[joint.type],
                "linkJointAxis": vector(_turn(child).inv().apply(joint.axis)),
            }
        )
    own = [scenario.bodies[body] for body in bodies]
    origins = [_turn(b).inv().apply(origin[k] - np.array(b.position)) for k, b in zip(bodies, own)]
    return Tree(tuple(bodies), np.array(origins), tuple(joints), links)


def _turn(body: Body) -> Rotation:
    return Rotation.from_quat(body.orientation, scalar_first=True)


def start(tree: Tree, scenario: Scenario, number: int, on: Mapping[str, int]) -> None:
    """Set velocities, limits and the dampers of ball joints of a new multibody, and no force in motors."""
    named = {body.name: body for body in scenario.bodies}
    if len(tree.bodies) > len(tree.joints):
        root = scenario.bodies[tree.bodies[0]]
        pybullet.resetBaseVelocity(number, root.linear_velocity, root.angular_velocity, **on)
    for k, joint in enumerate(tree.joints):
        child = named[joint.child]
        turn, speed = start_motion(child, moved_parent("bullet", scenario, joint))
        if joint.type == "ball":
            rate = _turn(child).inv().apply(turn).tolist()
            pybullet.resetJointStateMultiDof(number, k, UNTURNED, rate, **on)
            pybullet.changeDynamics(number, k, jointDamping=joint.damping, **on)
            pybullet.setJointMotorControlMultiDof(
                number, k, pybullet.POSITION_CONTROL, targetPosition=UNTURNED, force=[0.0] * 3, **on
            )
        elif joint.type in ALONG_AXIS:
            rate = float(np.dot(joint.axis, turn if joint.type == "hinge" else speed))
            pybullet.resetJointState(number, k, 0.0, rate, **on)
            pybullet.setJointMotorControl2(number, k, pybullet.VELOCITY_CONTROL, force=0.0, **on)
            if is_limited(joint):
                limits = {"jointLowerLimit": joint.lower, "jointUpperLimit": joint.upper}
                pybullet.changeDynamics(number, k, **limits, **on)


class Motors:
    """Springs, dampers and motors of hinges and sliders: each a joint motor of Bullet as `servo`."""

    def __init__(self, tree: Tree, number: int, on: Mapping[str, int]) -> None:
        self._number, self._on = number, on
        self._links = [
            k
            for k, one in enumerate(tree.joints)
            if one.type in ALONG_AXIS and (one.stiffness or one.damping)
        ]
        self._law = laws([tree.joints[k] for k in self._links])

    def push(self) -> None:
        if not self._links:
            return
        states = pybullet.getJointStates(self._number, self._links, **self._on)
        rate, force = servo(self._law, *np.array([state[:2] for state in states]).T)
        pybullet.setJointMotorControlArray(
            self._number,
            self._links,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=rate.tolist(),
            forces=np.abs(force).tolist(),
            velocityGains=[1.0] * len(self._links),
            **self._on,
        )


def close_loops(
    scenario: Scenario,
    link: Mapping[int, tuple[int, int]],
    center: Array,
    turn: Array,
    on: Mapping[str, int],
) -> None:
    """Close loops: a ball joint by one point, a hinge by two on its axis, a fixed joint as a whole.

    Args:
        link: Bullet's id and link of each body.
        center, turn: inertial frames of all bodies at the start (n, 3), xyzw (n, 4).
    Raises:
        Unsupported: a joint that closes a loop is a slider, or has forces or limits.
    """
    for joint in spanning_trees(scenario)[1]:
        child, parent = scenario.body_index(joint.child), moved_parent("bullet", scenario, joint)
        kind = pybullet.JOINT_FIXED if joint.type == "fixed" else pybullet.JOINT_POINT2POINT
        other = None if parent is None else scenario.body_index(parent.name)
        for point in closing_points("bullet", scenario, joint):
            frames = []
            for body in (child, other):
                back = Rotation.identity() if body is None else Rotation.from_quat(turn[body]).inv()
                arm = point if body is None else point - center[body]
                frames.append((vector(back.apply(arm)), back.as_quat().tolist()))
            (place, axes), (other_place, other_axes) = frames
            made = pybullet.createConstraint(
                *link[child],
                *(link[other] if other is not None else (-1, -1)),
                kind,
                ORIGIN,
                place,
                other_place,
                axes,
                other_axes,
                **on,
            )
            pybullet.changeConstraint(made, maxForce=UNBOUNDED, **on)


def couple_joints(scenario: Scenario, link: Mapping[int, tuple[int, int]], on: Mapping[str, int]) -> None:
    """Couple joints that mimic others, by gears. Between links of two multibodies they exert other forces.

    Args:
        link: Bullet's id and link of each body.
    """
    tree = {joint.name: joint for joint in spanning_trees(scenario)[0]}
    for joint in tree.values():
        if joint.mimics:
            ends = [link[scenario.body_index(one.child)] for one in (joint, tree[joint.mimics])]
            made = pybullet.createConstraint(
                *ends[0], *ends[1], pybullet.JOINT_GEAR, joint.axis, ORIGIN, ORIGIN, **on
            )
            pybullet.changeConstraint(
                made,
                gearRatio=-joint.ratio,
                relativePositionTarget=0.0,
                erp=GEAR_ERP,
                maxForce=UNBOUNDED,
                **on,
            )
