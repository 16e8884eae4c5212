"""What adapters of engines share about joints between bodies: parents, start rates, servos, loops."""

from collections.abc import Sequence

import numpy as np

from touchstone.adapters.contract import Array, Unsupported
from touchstone.scenarios.body_joints import coupled_names, is_limited, mass_center
from touchstone.scenarios.scenario import Body, BodyJoint, Scenario

FAR = 1e9
"""Rate to which a servo drives a joint whose force is the same at all rates [rad/s, m/s]."""


def moved_parent(engine: str, scenario: Scenario, joint: BodyJoint) -> Body | None:
    """Parent of a joint if it is simulated, or None for the world and fixed bodies.

    Raises:
        Unsupported: the parent is prescribed.
    """
    parent = next((body for body in scenario.bodies if body.name == joint.parent), None)
    if parent is not None and parent.kind == "prescribed":
        raise Unsupported(f"{engine}: no joint with a prescribed body ({joint.name!r})")
    return parent if parent is not None and parent.kind == "simulated" else None


def start_motion(child: Body, parent: Body | None) -> tuple[Array, Array]:
    """Angular velocity [rad/s] and velocity of the centre of mass [m/s] of a joint's child at the start,
    relative to its parent as a rigid body."""
    turn, speed = np.array(child.angular_velocity), np.array(child.linear_velocity)
    if parent is not None:
        arm = mass_center(child) - mass_center(parent)
        speed = speed - parent.linear_velocity - np.cross(parent.angular_velocity, arm)
        turn = turn - parent.angular_velocity
    return turn, speed


def servo(law: Array, position: Array, rate: Array) -> tuple[Array, Array]:
    """Rate at which the force of a joint's law is 0 [rad/s, m/s], and the force at present [N m, N].

    A servo that drives to that rate by at most that force exerts it, unless this would carry the joint beyond
    the rate within a step: stiff dampers do not overshoot.

    Args:
        law: joints (5, j) in the columns; rows as in `laws`.
    """
    stiffness, damping, target, target_rate, largest = law
    pull = stiffness * (target - position) + damping * target_rate
    force = np.clip(pull - damping * rate, -largest, largest)
    return np.divide(pull, damping, out=FAR * np.sign(force), where=damping > 0), force


def laws(joints: Sequence[BodyJoint]) -> Array:
    """Stiffness, damping, target, target rate and largest force of joints (5, j)."""
    fields = ("stiffness", "damping", "target", "target_rate", "largest_force")
    return np.array([[getattr(joint, field) for joint in joints] for field in fields])


def require_uncoupled(engine: str, scenario: Scenario, joint: BodyJoint) -> None:
    """Refuse a coupling of a joint that closes a loop: its position is none of the tree's."""
    if joint.name in coupled_names(scenario):
        raise Unsupported(f"{engine}: no coupled joint closes a loop ({joint.name!r})")


def closing_points(engine: str, scenario: Scenario, joint: BodyJoint) -> list[Array]:
    """Points at which constraints hold both bodies of a joint that closes a loop: its anchor, or of a hinge
    two on its axis, as far apart as the child's centre of mass is from the anchor.

    Raises:
        Unsupported: a slider, or a joint with a spring, a damper, a motor, a limit or a coupling.
    """
    require_uncoupled(engine, scenario, joint)
    if joint.type == "slider" or joint.stiffness or joint.damping or is_limited(joint):
        raise Unsupported(f"{engine}: no {joint.type} with forces or limits closes a loop ({joint.name!r})")
    anchor = np.array(joint.anchor)
    if joint.type != "hinge":
        return [anchor]
    child = scenario.bodies[scenario.body_index(joint.child)]
    arm = float(np.linalg.norm(mass_center(child) - joint.anchor)) or 1.0
    return [anchor + side * arm * np.array(joint.axis) for side in (-0.5, 0.5)]
