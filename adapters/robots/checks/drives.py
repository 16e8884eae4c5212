"""Limits and drives of a robot's hinges and slides that do nothing, or less than they must."""

from collections.abc import Iterator
from math import inf, pi
from typing import Any

import numpy as np

from touchstone.adapters.robots.checks.finding import NOTE, Finding
from touchstone.adapters.robots.checks.posture import Posture, axial_joints, name_of
from touchstone.adapters.robots.links import HINGE
from touchstone.adapters.robots.source import Source, number
from touchstone.adapters.robots.xml_source import Element

TURNS = 4.04 * pi
"""Range of a hinge beyond which its limit stops nothing that a robot does [rad]: two turns, as files round
them."""
OUT = 1e-6
"""Distance from a limit at which a posture lies outside it [rad, m]."""


def drive_range(model: Any, joint: int, at: float) -> tuple[float, float]:
    """Least and largest torque or force of the drives of a joint at rest at a position [N m, N]; infinite
    where nothing bounds it, and where the file has no actuators but a joint that effort does not bound."""
    drives = actuators_of(model, joint)
    low, high = (0.0, 0.0) if drives or model.nu else (-inf, inf)
    for drive in drives:
        gear = float(model.actuator_gear[drive, 0])
        ends = sorted(gear * end if gear else 0.0 for end in _force_ends(model, drive, gear * at))
        low, high = low + ends[0], high + ends[1]
    if model.jnt_actfrclimited[joint]:
        bound = model.jnt_actfrcrange[joint].tolist()
        low, high = (float(np.clip(end, *bound)) for end in (low, high))
    return low, high


def actuators_of(model: Any, joint: int) -> list[int]:
    """Actuators that act on a joint."""
    kinds = (0, 1)  # mjTRN_JOINT, mjTRN_JOINTINPARENT
    return [
        k
        for k in range(model.nu)
        if int(model.actuator_trntype[k]) in kinds and int(model.actuator_trnid[k, 0]) == joint
    ]


def _force_ends(model: Any, drive: int, length: float) -> tuple[float, float]:
    """Forces of an actuator at both ends of its control, at rest at a length."""
    gain, bias = model.actuator_gainprm[drive], model.actuator_biasprm[drive]
    constant = float(bias[0] + bias[1] * length)
    low, high = model.actuator_ctrlrange[drive] if model.actuator_ctrllimited[drive] else (-inf, inf)
    ends = [constant + (float(gain[0]) * end if gain[0] else 0.0) for end in (low, high)]
    if model.actuator_forcelimited[drive]:
        ends = np.clip(ends, *model.actuator_forcerange[drive]).tolist()
    return min(ends), max(ends)


def followers(source: Source) -> dict[str, tuple[str, float]]:
    """Joints that follow another one -> its name, and their position per position of it [1]."""
    found: dict[str, tuple[str, float]] = {}
    for element in source.root.walk():
        own = element.attributes
        if element.tag == "joint":
            for mimic in (one for one in element.children if one.tag == "mimic"):
                factor = number(mimic, "multiplier") if "multiplier" in mimic.attributes else 1.0
                found[own.get("name", "")] = (mimic.attributes.get("joint", ""), factor)
            if "joint1" in own:  # of an equality
                terms = own.get("polycoef", "0 1").split()
                found[own["joint1"]] = (own.get("joint2", ""), float(terms[1]) if len(terms) > 1 else 1.0)
    return found


def drives(source: Source, postures: list[Posture]) -> Iterator[Finding]:
    """Findings about limits, actuators, and the effort of URDF."""
    model = source.model
    named = {e.attributes.get("name"): e for e in source.root.walk() if e.tag == "joint" and e.attributes}
    coupled = followers(source)
    for joint in axial_joints(model):
        subject = name_of(model, "joint", joint)
        element = named.get(model.joint(joint).name)
        yield from _limits(model, joint, subject, element, postures)
        if source.form == "urdf" and element is not None:
            yield from _efforts(subject, element)
        if model.joint(joint).name in coupled:
            continue
        yield from _strength(model, joint, subject, postures)
        dof = model.jnt_dofadr[joint]
        still = not np.any(model.jnt_stiffness[joint]) and not np.any(model.dof_damping[dof])
        if model.nu and not actuators_of(model, joint) and still and not model.ntendon:
            yield Finding("drive", subject, "has no actuator", "it swings freely: add one, or damping", NOTE)
    for drive in range(model.nu):
        yield from _actuator(model, drive)


def _limits(
    model: Any, joint: int, subject: str, element: Element | None, postures: list[Posture]
) -> Iterator[Finding]:
    low, high = model.jnt_range[joint].tolist()
    unit = "rad" if int(model.jnt_type[joint]) == HINGE else "m"
    if not model.jnt_limited[joint]:
        kind = element.attributes.get("type", "") if element is not None else ""
        if kind in ("revolute", "prismatic"):
            text, remedy = "its limits are equal or missing", "give lower < upper, or the type fixed"
            yield Finding("limit", subject, f"{text}: nothing stops it", remedy)
        elif high > low:
            text = f"its range from {low:.4g} to {high:.4g} {unit} is not applied"
            yield Finding("limit", subject, text, 'remove limited="false", or set autolimits')
        return
    if unit == "rad" and high - low > TURNS:
        text = f"its range of {high - low:.4g} rad is more than two turns: the limit stops nothing"
        yield Finding("limit", subject, text, "state the limit in radians, or make the hinge continuous")
    for posture in postures:
        at = float(posture.qpos[model.jnt_qposadr[joint]])
        if not low - OUT <= at <= high + OUT:
            text = f"{posture.name} has it at {at:.4g} {unit}, outside its range {low:.4g} to {high:.4g}"
            yield Finding("limit", subject, text, "its limit throws it back in the first step: change either")
            return


def _efforts(subject: str, element: Element) -> Iterator[Finding]:
    """Attributes of URDF's <limit> that leave a drive without force or speed."""
    for limit in (one for one in element.children if one.tag == "limit"):
        for name, what in (("effort", "force"), ("velocity", "speed")):
            if name in limit.attributes and number(limit, name) == 0:
                text = f"{name} 0 allows its drive no {what}"
                yield Finding("drive", subject, text, f"state the {name} of the motor")


def _strength(model: Any, joint: int, subject: str, postures: list[Posture]) -> Iterator[Finding]:
    """Whether the drives of a joint overcome its dry friction and hold what hangs on it."""
    if model.nu and not actuators_of(model, joint):
        return
    unit = "N m" if int(model.jnt_type[joint]) == HINGE else "N"
    loads = []
    for posture in postures:
        low, high = drive_range(model, joint, float(posture.qpos[model.jnt_qposadr[joint]]))
        loads.append((posture.load(joint), min(-low, high), posture.name))
    load, most, name = max(loads, key=lambda one: one[0] - one[1])
    if load > max(most, 0.0) and np.isfinite(most) and most > 0:
        text = f"its drive has {most:.3g} {unit}, and gravity takes {load:.3g} {unit} at {name}"
        yield Finding("drive", subject, text, "it sinks: allow more force, or make what hangs on it lighter")
    friction = float(model.dof_frictionloss[model.jnt_dofadr[joint]])
    if friction >= most > 0:
        text = f"its dry friction of {friction:.3g} {unit} is more than the {most:.3g} {unit} of its drive"
        yield Finding("drive", subject, text, "it never moves: check the unit of either")


def _actuator(model: Any, drive: int) -> Iterator[Finding]:
    """Whether an actuator can act at all."""
    subject = name_of(model, "actuator", drive)
    empty = [
        what
        for what, is_empty in (
            ("gear 0", not model.actuator_gear[drive].any()),
            ("gain 0", not model.actuator_gainprm[drive].any()),
            ("an empty ctrlrange", _is_empty(model, drive, "ctrl")),
            ("an empty forcerange", _is_empty(model, drive, "force")),
        )
        if is_empty
    ]
    if empty:
        text = f"{' and '.join(empty)}: its force is the same whatever the control"
        yield Finding("drive", subject, text, "give it gear, gain and ranges other than 0")


def _is_empty(model: Any, drive: int, kind: str) -> bool:
    low, high = getattr(model, f"actuator_{kind}range")[drive]
    return bool(getattr(model, f"actuator_{kind}limited")[drive]) and not low < high
