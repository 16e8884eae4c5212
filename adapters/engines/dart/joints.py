"""Joints between bodies in DART: one skeleton a mechanism, constraints that close loops, forces of motors."""

from typing import Any, NamedTuple

import dartpy
import numpy as np

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.engines.dart.model import add_free, isometry
from touchstone.adapters.joined_bodies import closing_points, laws, moved_parent, servo, start_motion
from touchstone.scenarios.body_joints import is_limited, mechanisms, spanning_trees
from touchstone.scenarios.scenario import IDENTITY, ORIGIN, UNBOUNDED, BodyJoint, Scenario

ROUNDING = 1e-9
"""Excess of a gain over 1 that is rounding [1]."""


class Joined(NamedTuple):
    """Nodes of the bodies of all mechanisms by scenario index, and the joints whose forces each step sets."""

    nodes: dict[int, Any]
    motors: list[tuple[Any, BodyJoint]]


def add_mechanisms(world: Any, scenario: Scenario) -> Joined:
    """Add each mechanism as a skeleton, posed at the start with the velocities of its bodies.

    Raises:
        Unsupported: a joint with a prescribed body, or one that no constraint of DART closes a loop with.
    """
    tree, loops = spanning_trees(scenario)
    nodes: dict[int, Any] = {}
    motors: list[tuple[Any, BodyJoint]] = []
    for group in mechanisms(scenario):
        own = {joint.name for joint in group}
        skeleton = dartpy.dynamics.Skeleton(group[0].name)
        for joint in tree:
            if joint.name in own:
                _add(skeleton, scenario, joint, nodes, motors)
        skeleton.enableSelfCollisionCheck()
        world.addSkeleton(skeleton)
    for joint in loops:
        _close(world, scenario, joint, nodes)
    return Joined(nodes, motors)


def _add(
    skeleton: Any,
    scenario: Scenario,
    joint: BodyJoint,
    nodes: dict[int, Any],
    motors: list[tuple[Any, BodyJoint]],
) -> None:
    """Add the child of a joint to its parent's node, which it adds with a free joint if it is new."""
    parent, index = moved_parent("dart", scenario, joint), scenario.body_index(joint.child)
    child, outer = scenario.bodies[index], None
    frame = isometry(ORIGIN, IDENTITY)
    if parent is not None:
        key = scenario.body_index(parent.name)
        if key not in nodes:
            nodes[key] = add_free(skeleton, parent)
        outer, frame = nodes[key], isometry(parent.position, parent.orientation)
    kinds = {"hinge": "Revolute", "slider": "Prismatic", "ball": "Ball", "fixed": "Weld"}
    create = getattr(skeleton, f"create{kinds[joint.type]}JointAndBodyNodePair")
    made, nodes[index] = create() if outer is None else create(outer)
    made.setName(joint.name)
    # the joint's axes are the parent's, at the anchor; there the child is as at the start
    inner = frame.inverse()
    anchor = inner.multiply(isometry(joint.anchor, IDENTITY)).translation()
    place = isometry(anchor, IDENTITY)
    pose = inner.multiply(isometry(child.position, child.orientation))
    made.setTransformFromParentBodyNode(place)
    made.setTransformFromChildBodyNode(pose.inverse().multiply(place))
    turn, speed = start_motion(child, parent)
    if joint.type == "ball":
        made.setVelocities(inner.rotation() @ turn)
        for k in range(3):
            made.setDampingCoefficient(k, joint.damping)
    elif joint.type != "fixed":
        made.setAxis(inner.rotation() @ np.array(joint.axis))
        made.setVelocity(0, float(np.dot(joint.axis, turn if joint.type == "hinge" else speed)))
        _set_forces(made, joint, motors)


def _set_forces(made: Any, joint: BodyJoint, motors: list[tuple[Any, BodyJoint]]) -> None:
    """Set limits, and spring and damper, which DART integrates implicitly. They have no target rate and no
    largest force: joints with these are servos, commanded in each step."""
    if is_limited(joint):
        made.setPositionLowerLimit(0, joint.lower)
        made.setPositionUpperLimit(0, joint.upper)
        made.setLimitEnforcement(True)
    # DART takes no rest position beyond the limits
    beyond = not joint.lower <= joint.target <= joint.upper
    if joint.target_rate != 0 or joint.largest_force < UNBOUNDED or beyond:
        made.setActuatorType(dartpy.dynamics.ActuatorType.SERVO)
        motors.append((made, joint))
    else:
        made.setSpringStiffness(0, joint.stiffness)
        made.setDampingCoefficient(0, joint.damping)
        made.setRestPosition(0, joint.target)


def couple_joints(scenario: Scenario, joined: Joined) -> None:
    """Couple joints that mimic others by DART's constraint that acts on both, which only the properties of
    joints lead to; the masses of all bodies are set.

    One joint follows the other a step later. A change of that one's rate comes back to it with the factor
    `gain`, or with its inverse if the other follows: that which dies away is chosen.

    Raises:
        Unsupported: a joint with a motor follows, or one follows two.
    """
    tree = spanning_trees(scenario)[0]
    made = {joint.name: joined.nodes[scenario.body_index(joint.child)].getParentJoint() for joint in tree}
    driven, following = {joint.name for _, joint in joined.motors}, set[str]()
    for joint in tree:
        if not joint.mimics:
            continue
        names, ratio = (joint.name, joint.mimics), joint.ratio
        b, a = (made[name].getIndexInSkeleton(0) for name in names)
        w = made[joint.name].getSkeleton().getInvMassMatrix()
        gain = ratio * (w[b, a] - ratio * w[a, a]) / (w[b, b] - ratio * w[b, a])
        if abs(gain) > 1 + ROUNDING:
            names, ratio = names[::-1], 1 / ratio
        follower, reference = (made[name] for name in names)
        if names[0] in driven:
            raise Unsupported(f"dart: no motor in the lighter one of two coupled joints ({names[0]!r})")
        if names[0] in following:
            raise Unsupported(f"dart: one joint is lighter than two that it is coupled with ({names[0]!r})")
        following.add(names[0])
        mimic = dartpy.dynamics.MimicDofProperties()
        mimic.mReferenceJoint, mimic.mMultiplier = reference, ratio
        mimic.mConstraintType = dartpy.dynamics.MimicConstraintType.Coupler
        properties = getattr(follower, f"get{follower.getType().removesuffix('Joint')}JointProperties")()
        properties.mMimicDofProps = [mimic]
        properties.mActuatorType = dartpy.dynamics.ActuatorType.MIMIC
        follower.setProperties(properties)


def push_motors(motors: list[tuple[Any, BodyJoint]]) -> None:
    """Command DART's servos of motors for the next step."""
    for made, joint in motors:
        rate, force = servo(laws([joint]), made.getPosition(0), made.getVelocity(0))
        made.setCommand(0, rate[0])
        made.setForceLowerLimit(0, -abs(force[0]))
        made.setForceUpperLimit(0, abs(force[0]))


def _close(world: Any, scenario: Scenario, joint: BodyJoint, nodes: dict[int, Any]) -> None:
    """Close a loop: a ball joint by one point, a hinge by two on its axis, a fixed joint as a whole."""
    index = scenario.body_index(joint.child)
    points = closing_points("dart", scenario, joint)
    child, parent = nodes[index], moved_parent("dart", scenario, joint)
    ends = [child] if parent is None else [child, nodes[scenario.body_index(parent.name)]]
    solver = world.getConstraintSolver()
    if joint.type == "fixed":
        solver.addConstraint(dartpy.constraint.WeldJointConstraint(*ends))
        return
    for point in points:
        solver.addConstraint(dartpy.constraint.BallJointConstraint(*ends, point))
