"""What adapters of engines share about joints between bodies: parents, start rates, and joints of loops."""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import Array, Unsupported
from touchstone.scenarios.body_joints import is_limited, mass_center
from touchstone.scenarios.scenario import Body, BodyJoint, Scenario


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


def closing_points(engine: str, joint: BodyJoint, child: Body) -> list[Array]:
    """Points at which constraints hold both bodies of a joint that closes a loop: its anchor, or of a hinge
    two on its axis, as far apart as the child's centre of mass is from the anchor.

    Raises:
        Unsupported: a slider, or a joint with a spring, a damper, a motor or a limit.
    """
    if joint.type == "slider" or joint.stiffness or joint.damping or is_limited(joint):
        raise Unsupported(f"{engine}: no {joint.type} with forces or limits closes a loop ({joint.name!r})")
    anchor = np.array(joint.anchor)
    if joint.type != "hinge":
        return [anchor]
    arm = float(np.linalg.norm(mass_center(child) - joint.anchor)) or 1.0
    return [anchor + side * arm * np.array(joint.axis) for side in (-0.5, 0.5)]
