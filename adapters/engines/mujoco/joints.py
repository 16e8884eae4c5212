"""Joints between bodies in a MuJoCo spec: nested bodies, and equality constraints that close loops."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from touchstone.adapters.contract import Array, Settings
from touchstone.adapters.engines.mujoco.contacts import solref_of
from touchstone.adapters.engines.mujoco.settings import SETTINGS
from touchstone.adapters.joined_bodies import closing_points, moved_parent, start_motion
from touchstone.scenarios.body_joints import is_limited, spanning_trees
from touchstone.scenarios.scenario import UNBOUNDED, Body, BodyJoint, Quaternion, Scenario, Vector

TYPES = {
    "hinge": mujoco.mjtJoint.mjJNT_HINGE,
    "slider": mujoco.mjtJoint.mjJNT_SLIDE,
    "ball": mujoco.mjtJoint.mjJNT_BALL,
}
"""Types of joints; bodies of a fixed one are nested without a joint."""


def inverse(quaternion: Quaternion | Array) -> Array:
    return np.array(quaternion) * (1.0, -1.0, -1.0, -1.0)


def turned(vector: Vector | Array, quaternion: Quaternion | Array) -> Array:
    """`vector` rotated by `quaternion`."""
    out = np.zeros(3)
    mujoco.mju_rotVecQuat(out, np.array(vector, float), np.array(quaternion))
    return out


def in_frame(body: Body | None, point: Vector | Array) -> Array:
    """A world point in the frame of a body at the start; of the world, itself."""
    if body is None:
        return np.array(point, float)
    return turned(np.subtract(point, body.position), inverse(body.orientation))


def add_trees(spec: Any, scenario: Scenario, bodies: dict[int, Any], settings: Settings) -> None:
    """Add the bodies that the scene's joints nest in others, parents first, with their joints. Limits are as
    stiff as contacts that do not bounce."""
    for joint in spanning_trees(scenario)[0]:
        index, parent = scenario.body_index(joint.child), moved_parent("mujoco", scenario, joint)
        child = scenario.bodies[index]
        outer, turn = spec.worldbody, np.array(child.orientation)
        if parent is not None:
            outer = bodies[scenario.body_index(parent.name)]
            mujoco.mju_mulQuat(turn, inverse(parent.orientation), np.array(child.orientation))
        bodies[index] = outer.add_body(name=f"{index}", pos=in_frame(parent, child.position), quat=turn)
        if joint.type == "fixed":
            continue
        made = bodies[index].add_joint(
            name=f"joint {joint.name}",
            type=TYPES[joint.type],
            pos=in_frame(child, joint.anchor),
            axis=turned(joint.axis, inverse(child.orientation)),
        )
        if is_limited(joint):
            made.limited, made.range = mujoco.mjtLimited.mjLIMITED_TRUE, (joint.lower, joint.upper)
            made.solref_limit, made.solimp_limit = _stiffness(settings)
        if joint.largest_force == UNBOUNDED:
            # newer versions have polynomials of forces
            made.damping = (joint.damping, 0.0, 0.0) if np.ndim(made.damping) else joint.damping
            made.stiffness = (joint.stiffness, 0.0, 0.0) if np.ndim(made.stiffness) else joint.stiffness
            made.springref = joint.target


def _is_motor(joint: BodyJoint) -> bool:
    """Whether a joint's force needs an actuator: MuJoCo's springs and dampers have neither a rate nor a
    largest force."""
    return joint.damping * joint.target_rate != 0 or joint.largest_force < UNBOUNDED


def _stiffness(settings: Settings) -> tuple[tuple[float, float], Any]:
    """solref and solimp of a contact that does not bounce."""
    return solref_of(0.0, settings), SETTINGS.in_force(settings.profile, settings.changes)["solimp"]


def add_loops_and_motors(spec: Any, scenario: Scenario, settings: Settings) -> None:
    """Add joints that close loops, and couplings, as equality constraints, and an actuator for each motor.

    Raises:
        Unsupported: a slider, a spring, a motor, a limit or a coupling in a joint that closes a loop.
    """
    tree, loops = spanning_trees(scenario)
    for joint in loops:
        _add_loop(spec, scenario, joint, settings)
    for joint in tree:
        if joint.mimics:
            made = spec.add_equality(name=f"coupling {joint.name}", objtype=mujoco.mjtObj.mjOBJ_JOINT)
            made.type, (made.solref, made.solimp) = mujoco.mjtEq.mjEQ_JOINT, _stiffness(settings)
            made.name1, made.name2 = f"joint {joint.name}", f"joint {joint.mimics}"
            made.data[:5] = 0.0, joint.ratio, 0.0, 0.0, 0.0
        if _is_motor(joint) and joint.type != "fixed":
            actuator = spec.add_actuator(
                name=f"motor {joint.name}", target=f"joint {joint.name}", trntype=mujoco.mjtTrn.mjTRN_JOINT
            )
            drive = joint.damping * joint.target_rate
            actuator.gaintype, actuator.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
            actuator.gainprm[:], actuator.biasprm[:] = 0.0, 0.0
            # without a bound, the joint has the spring and the damper, which MuJoCo takes as implicit
            actuator.biasprm[0] = drive
            if joint.largest_force < UNBOUNDED:
                bias = drive + joint.stiffness * joint.target
                actuator.biasprm[:3] = bias, -joint.stiffness, -joint.damping
                actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
                actuator.forcerange = (-joint.largest_force, joint.largest_force)


def _add_loop(spec: Any, scenario: Scenario, joint: BodyJoint, settings: Settings) -> None:
    """A ball joint is one `connect`; a hinge two on its axis, as far apart as the child is from it; a fixed
    joint a `weld`."""
    index, parent = scenario.body_index(joint.child), moved_parent("mujoco", scenario, joint)
    child = scenario.bodies[index]
    for k, point in enumerate(closing_points("mujoco", scenario, joint)):
        made = spec.add_equality(name=f"loop {joint.name} {k}", objtype=mujoco.mjtObj.mjOBJ_BODY)
        made.type = mujoco.mjtEq.mjEQ_WELD if joint.type == "fixed" else mujoco.mjtEq.mjEQ_CONNECT
        made.solref, made.solimp = _stiffness(settings)
        made.name1 = f"{index}"
        made.name2 = "world" if parent is None else f"{scenario.body_index(parent.name)}"
        if joint.type != "fixed":
            made.data[:3] = in_frame(child, point)
        else:
            turn = inverse(child.orientation)
            if parent is not None:
                mujoco.mju_mulQuat(turn, inverse(child.orientation), np.array(parent.orientation))
            # the anchor in the second body and in the first, and the turn of the second in the first
            made.data[:3], made.data[3:6] = in_frame(parent, point), in_frame(child, point)
            made.data[6:10], made.data[10] = turn, 1.0


def start_rates(scenario: Scenario, model: Any, qvel: Array) -> None:
    """Set the rates of the joints at the start, from the velocities of their bodies."""
    named: Mapping[str, Body] = {body.name: body for body in scenario.bodies}
    for joint in spanning_trees(scenario)[0]:
        if joint.type == "fixed":
            continue
        child, parent = named[joint.child], moved_parent("mujoco", scenario, joint)
        turn, speed = start_motion(child, parent)
        first = int(model.joint(f"joint {joint.name}").dofadr[0])
        if joint.type == "ball":
            qvel[first : first + 3] = turned(turn, inverse(child.orientation))
        else:
            qvel[first] = np.dot(joint.axis, turn if joint.type == "hinge" else speed)
