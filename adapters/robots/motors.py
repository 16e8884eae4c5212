"""Forces in the joints of a simulated robot: the springs and dampers of its file, its actuators at the
control 0, and servos that hold the start posture.

MuJoCo's actuator exerts gear (gain u + b_0 + b_1 gear q + b_2 gear q') on a joint, u the control: a spring, a
damper and a constant force, which a target of the spring or a target rate of the damper represents exactly.
"""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from touchstone.adapters.robots.links import HINGE, SLIDE, joint_name
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import UNBOUNDED

ON_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
FIXED = int(mujoco.mjtGain.mjGAIN_FIXED)
AFFINE, NO_BIAS = int(mujoco.mjtBias.mjBIAS_AFFINE), int(mujoco.mjtBias.mjBIAS_NONE)
KEPT_STATES = tuple(
    int(getattr(mujoco.mjtDyn, f"mjDYN_{name}")) for name in ("NONE", "INTEGRATOR", "FILTER", "FILTEREXACT")
)
"""Dynamics of an actuator's control that stay at 0 where the control is 0."""


@dataclass(frozen=True, slots=True)
class Drive:
    """An actuator on a joint at its control of the start.

    Attributes:
        stiffness, damping, constant: of the force constant - stiffness q - damping q', q in the model.
        largest: bound on that force.
    """

    stiffness: float
    damping: float
    constant: float
    largest: float


def drives_of(model: Any, notes: list[str]) -> dict[int, list[Drive]]:
    """Actuators of each hinge and slider; `notes` names what cannot be kept of them."""
    found: dict[int, list[Drive]] = {}
    idle = 0
    for k in range(model.nu):
        name = model.actuator(k).name or f"{k}"
        if reason := _reason(model, k):
            notes.append(f"left out: actuator {name!r}: {reason}")
            continue
        drive = _drive(model, k)
        if min(drive.stiffness, drive.damping) < 0:
            notes.append(f"left out: actuator {name!r}: its force grows with position or speed")
            continue
        idle += not (drive.stiffness or drive.damping or drive.constant)
        low, high = model.actuator_forcerange[k]
        if model.actuator_forcelimited[k] and low != -high:
            notes.append(f"actuator {name!r}: its force is at most {drive.largest:g} both ways")
        found.setdefault(int(model.actuator_trnid[k, 0]), []).append(drive)
    if idle:
        notes.append(f"actuators: no force of {plural(idle, 'motor')}, since controls are 0")
    if idle < sum(map(len, found.values())):
        notes.append("actuators: servos are springs and dampers, with controls of 0")
    return found


def _reason(model: Any, k: int) -> str:
    """Why an actuator cannot be kept; empty where it can."""
    if int(model.actuator_trntype[k]) not in ON_JOINT:
        return "it does not act on a joint"
    if int(model.jnt_type[model.actuator_trnid[k, 0]]) not in (HINGE, SLIDE):
        return "it acts on a joint with several degrees of freedom"
    kinds = int(model.actuator_gaintype[k]) == FIXED, int(model.actuator_biastype[k]) in (AFFINE, NO_BIAS)
    if not all(kinds) or int(model.actuator_dyntype[k]) not in KEPT_STATES:
        return "its force is no spring, damper or constant"
    return ""


def _drive(model: Any, k: int) -> Drive:
    gear, gain = float(model.actuator_gear[k, 0]), float(model.actuator_gainprm[k, 0])
    has_bias = int(model.actuator_biastype[k]) == AFFINE
    zero, one, two = model.actuator_biasprm[k, :3].tolist() if has_bias else (0.0, 0.0, 0.0)
    control = float(np.clip(0.0, *model.actuator_ctrlrange[k])) if model.actuator_ctrllimited[k] else 0.0
    largest = UNBOUNDED
    if model.actuator_forcelimited[k]:
        largest = abs(gear) * float(np.abs(model.actuator_forcerange[k]).max())
    return Drive(-one * gear**2, -two * gear**2, gear * (gain * control + zero), largest)


def forces(
    model: Any, joint: int, start: float, drives: list[Drive], held: float | None, frequency: float
) -> dict[str, float]:
    """Fields of a hinge or a slider for its forces.

    Args:
        start: the joint's coordinate in the model at the scene's start [rad, m].
        held: what a servo carries that holds the start posture instead of the drives [kg m^2, kg]; None for
            the drives.
        frequency: of that servo, which is critically damped [rad/s].
    """
    place, rate = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    stiffness, damping = float(model.jnt_stiffness[joint].flat[0]), float(model.dof_damping[rate].flat[0])
    constant = stiffness * (float(model.qpos_spring[place]) - start)
    own = [(one.stiffness, one.damping, one.constant - one.stiffness * start) for one in drives]
    largest = sum(one.largest for one in drives) if drives else UNBOUNDED
    if model.jnt_actfrclimited[joint] and own:
        largest = min(largest, float(np.abs(model.jnt_actfrcrange[joint]).max()))
    if held is not None:
        own, largest = [(held * frequency**2, 2 * held * frequency, 0.0)], UNBOUNDED
    stiffness += sum(k for k, _, _ in own)
    damping += sum(d for _, d, _ in own)
    constant += sum(c for _, _, c in own)
    found = {"stiffness": stiffness, "damping": damping}
    if constant and stiffness:
        found["target"] = constant / stiffness
    elif constant and damping:
        found["target_rate"] = constant / damping
    if 0 < largest < UNBOUNDED and (stiffness or damping) and own:
        found["largest_force"] = largest
    return found


def notes_of(model: Any, joints: list[int], drives: dict[int, list[Drive]], hold: bool) -> list[str]:
    """What the forces of a robot's hinges and sliders cannot keep, a line each kind."""
    limited = [joint for joint in joints if model.jnt_actfrclimited[joint]]
    if hold:
        bounded = limited or any(joint in drives for joint in joints)
        return ["hold: servos take the place of motors, and no effort bounds them"] if bounded else []
    notes: list[str] = []
    passive, constant = [], []
    for joint in joints:
        own = drives.get(joint, [])
        spring = model.jnt_stiffness[joint].any() or model.dof_damping[model.jnt_dofadr[joint]].any()
        finite = joint in limited or any(one.largest < UNBOUNDED for one in own)
        if own and spring and finite:
            passive.append(joint)
        if not spring and not any(one.stiffness or one.damping for one in own):
            constant += [joint] if any(one.constant for one in own) else []
    if passive:
        names = _listed(model, passive)
        notes.append(f"joints {names}: the largest force of the motor bounds its spring and damper too")
    if weak := [joint for joint in limited if joint not in drives]:
        notes.append(
            f"left out: largest efforts of {plural(len(weak), 'joint')} without motors; --hold adds servos"
        )
    if constant:
        notes.append(f"left out: constant forces of the motors of joints {_listed(model, constant)}")
    return notes


def _listed(model: Any, joints: list[int]) -> str:
    names = ", ".join(repr(joint_name(model, joint)) for joint in joints[:5])
    return names + (f" and {len(joints) - 5} more" if len(joints) > 5 else "")
