"""Joints between bodies: their faults, and the spanning trees of the mechanisms that they form."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import get_args, get_type_hints

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import LONGEST, Report, finite, known, unit
from touchstone.scenarios.scenario import ORIGIN, UNBOUNDED, Body, BodyJoint, Scenario, vector

WORLD = ""
"""Parent of a joint with the world."""
TYPES: tuple[str, ...] = get_args(get_type_hints(BodyJoint)["type"])
ALONG_AXIS = ("hinge", "slider")
"""Types of joints with one position."""
EQUATIONS = {"hinge": 5, "slider": 5, "ball": 3, "fixed": 6}
"""Equations that a joint of a type is [1]."""
FREE = BodyJoint("", "ball", "", "", ORIGIN)
"""Joint without limits and forces."""
PARTING = 1e-9
"""Velocity by which a joint may part at the start, over the speeds of its bodies [1]: rounding."""
IMPLIED = 1e-9
"""Singular value, over the largest, up to which equations of joints imply one another [1]: rounding."""


def spanning_trees(scenario: Scenario) -> tuple[list[BodyJoint], list[BodyJoint]]:
    """Joints as trees and loops: the first list joins each body to its tree, parents before children; the
    second closes loops.

    Trees grow from bodies that no contact moves, else from the first body of a mechanism, along sliders,
    coupled joints and those with forces first: engines close loops with others. Where a tree enters
    a joint by its child, parent and child are exchanged and the axis is reversed: q stays the same.
    """
    coupled = coupled_names(scenario)
    simulated = {body.name for body in scenario.bodies if body.kind == "simulated"}
    left, tree, loops = list(scenario.body_joints), [], []
    reached = {WORLD, *(body.name for body in scenario.bodies if body.kind != "simulated")}
    while left:
        near = [joint for joint in left if {joint.parent, joint.child} & reached]
        if not near:
            reached.add(left[0].parent)
            continue
        closing = [joint for joint in near if {joint.parent, joint.child} <= reached]
        if closing:
            left.remove(closing[0])
            loops.append(closing[0])
            continue
        preferred = (one for one in near if one.name in coupled or _belongs_in_tree(one))
        entered = next(preferred, near[0])
        left.remove(entered)
        if entered.parent not in reached:
            entered = reversed_joint(entered)
        tree.append(entered)
        reached.add(entered.child)
    assert all(joint.child in simulated for joint in tree)
    return tree, loops


def coupled_names(scenario: Scenario) -> set[str]:
    """Names of the joints that mimic others, and of these."""
    return {name for joint in scenario.body_joints if joint.mimics for name in (joint.name, joint.mimics)}


def is_limited(joint: BodyJoint) -> bool:
    """Whether a joint has a limit."""
    return joint.lower > -UNBOUNDED or joint.upper < UNBOUNDED


def _belongs_in_tree(joint: BodyJoint) -> bool:
    """Whether engines have a joint in trees alone: their constraints neither slide, nor push, nor stop."""
    return joint.type == "slider" or bool(joint.stiffness or joint.damping) or is_limited(joint)


def reversed_joint(joint: BodyJoint) -> BodyJoint:
    """The same joint with parent and child exchanged."""
    x, y, z = joint.axis
    return replace(joint, parent=joint.child, child=joint.parent, axis=(-x, -y, -z))


def mechanisms(scenario: Scenario) -> list[list[BodyJoint]]:
    """Joints of each mechanism: what simulated bodies and couplings connect."""
    groups: list[tuple[set[tuple[str, str]], list[BodyJoint]]] = []
    simulated = {body.name for body in scenario.bodies if body.kind == "simulated"}
    for joint in scenario.body_joints:
        names = {("body", name) for name in {joint.parent, joint.child} & simulated}
        names.add(("joint", joint.mimics or joint.name))
        joints, apart = [joint], []
        for group in groups:
            if group[0] & names:
                names, joints = group[0] | names, group[1] + joints
            else:
                apart.append(group)
        groups = [*apart, (names, joints)]
    return [joints for _, joints in groups]


def beyond(scenario: Scenario, joint: BodyJoint) -> set[str]:
    """Bodies that hang on what no contact moves, or on the rest of their mechanism, by one joint alone; none
    if it is in a loop."""
    simulated = {body.name for body in scenario.bodies if body.kind == "simulated"}
    links = [
        {end if end in simulated else WORLD for end in (other.parent, other.child)}
        for other in scenario.body_joints
        if other.name != joint.name
    ]

    def reached(start: str) -> set[str]:
        found = {start}
        while True:
            near = set().union(*(link for link in links if link & found))
            if near <= found:
                return found
            found |= near

    sides = reached(joint.child), reached(joint.parent if joint.parent in simulated else WORLD)
    if sides[0] & sides[1]:
        return set()
    return sides[0] if WORLD not in sides[0] else sides[1]


def equation_count(scenario: Scenario) -> int:
    """Number of equations of all joints and couplings."""
    return sum(EQUATIONS[joint.type] + bool(joint.mimics) for joint in scenario.body_joints)


def implied_equations(scenario: Scenario) -> int:
    """How many equations of the joints others imply at the start, as in plane loops of hinges."""
    bodies = {body.name: k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"}
    centers = {name: mass_center(scenario.bodies[k]) for name, k in bodies.items()}
    arms = [
        np.array(joint.anchor) - centers[name]
        for joint in scenario.body_joints
        for name in {joint.parent, joint.child} & bodies.keys()
    ]
    size = max((float(np.linalg.norm(arm)) for arm in arms), default=0.0) or 1.0
    rows: list[Array] = []
    along: dict[str, Array] = {}
    for joint in scenario.body_joints:
        axis = np.array(joint.axis)
        across = np.eye(3) - np.outer(axis, axis)
        slip = across if joint.type == "slider" else np.eye(3)
        turn = {"hinge": across, "ball": np.zeros((3, 3))}.get(joint.type, np.eye(3))
        # velocities of the anchors, and rates, of which the joint holds some equal; rates times the size
        block = np.zeros((6, 6 * len(scenario.bodies)))
        for name, sign in ((joint.child, 1.0), (joint.parent, -1.0)):
            if name in bodies:
                k, arm = 6 * bodies[name], (np.array(joint.anchor) - centers[name]) / size
                block[:3, k : k + 3] = sign * np.eye(3)
                block[:3, k + 3 : k + 6] = sign * np.cross(np.eye(3), arm)
                block[3:, k + 3 : k + 6] = sign * np.eye(3)
        along[joint.name] = axis @ block[:3] if joint.type == "slider" else axis @ block[3:] / size
        rows += [slip @ block[:3], turn @ block[3:]]
    for joint in scenario.body_joints:
        if joint.mimics:
            coupled = along[joint.name] - joint.ratio * along[joint.mimics]
            rows.append(coupled[None] / (np.linalg.norm(coupled) or 1.0))
    count = equation_count(scenario)
    values = np.linalg.svd(np.concatenate(rows), compute_uv=False) if rows else np.zeros(0)
    return count - int((values > IMPLIED * values.max(initial=0.0)).sum())


def point_velocity(body: Body | None, point: Iterable[float]) -> Array:
    """Velocity of a body at a world point at the start [m/s]; 0 for the world."""
    if body is None:
        return np.zeros(3)
    center = mass_center(body)
    return np.array(body.linear_velocity) + np.cross(body.angular_velocity, np.array(tuple(point)) - center)


def _fastest(body: Body | None, point: Iterable[float]) -> float:
    """Bound on the speed of a body at the start, up to a world point [m/s]."""
    if body is None:
        return 0.0
    arm = np.linalg.norm(np.array(tuple(point)) - mass_center(body))
    return float(np.linalg.norm(body.linear_velocity) + np.linalg.norm(body.angular_velocity) * arm)


def mass_center(body: Body) -> Array:
    """Centre of mass of a body at the start, in the world [m]."""
    w, x, y, z = body.orientation
    r, u = np.array(body.center_of_mass), np.array((x, y, z))
    turned = r + 2 * w * np.cross(u, r) + 2 * np.cross(u, np.cross(u, r))
    return np.array(body.position) + turned


def check_body_joints(scenario: Scenario, report: Report) -> None:
    """Report what is wrong with the joints between bodies."""
    bodies, sound = {body.name: body for body in scenario.bodies}, set[str]()
    for i, joint in enumerate(scenario.body_joints):
        path = f"body_joints[{i}]"
        known("type", joint.type, TYPES, f"{path}.type", report)
        joined = _check_bodies(joint, bodies, path, report)
        numbers = finite(joint.anchor, f"{path}.anchor", report, 3, LONGEST)
        numbers &= unit(joint.axis, f"{path}.axis", report, 3)
        numbers &= _check_forces(joint, path, report)
        if joined and numbers:
            _check_start(joint, bodies.get(joint.parent), bodies[joint.child], path, report)
            sound.add(joint.name)
    for i, joint in enumerate(scenario.body_joints):
        _check_coupling(scenario, joint, sound, f"body_joints[{i}]", report)


def _check_bodies(joint: BodyJoint, bodies: dict[str, Body], path: str, report: Report) -> bool:
    sound = True
    for field, valid in (("parent", ("simulated", "fixed", "prescribed")), ("child", ("simulated",))):
        name = getattr(joint, field)
        if field == "parent" and name == WORLD:
            continue
        if not known("body", name, bodies, f"{path}.{field}", report):
            sound = False
        elif bodies[name].kind not in valid:
            report(
                f"{path}.{field}", f"{name!r} is {bodies[name].kind}, expected a {' or '.join(valid)} body"
            )
            sound = False
    if joint.parent == joint.child:
        report(f"{path}.child", f"{joint.child!r} is joined to itself")
        sound = False
    return sound


def _check_forces(joint: BodyJoint, path: str, report: Report) -> bool:
    sound = True
    for field in ("lower", "upper", "stiffness", "damping", "target", "target_rate", "largest_force"):
        sound &= finite((getattr(joint, field),), f"{path}.{field}", report, 1, UNBOUNDED)
    if not sound:
        return False
    for field in ("stiffness", "damping", "largest_force"):
        if getattr(joint, field) < 0:
            report(f"{path}.{field}", f"found {getattr(joint, field):g}, expected at least 0")
            sound = False
    if not joint.lower <= 0 <= joint.upper or joint.lower == joint.upper:
        report(
            f"{path}.lower", f"found {joint.lower:g} to {joint.upper:g}, expected a range with the start, 0"
        )
    if joint.type in ALONG_AXIS:
        return sound
    fields = ("lower", "upper", "stiffness", "target", "target_rate", "largest_force")
    for field in (*fields, "damping") if joint.type == "fixed" else fields:
        if getattr(joint, field) != getattr(FREE, field):
            report(f"{path}.{field}", f"found {getattr(joint, field):g}, which a {joint.type} joint has not")
    return sound


def _check_coupling(scenario: Scenario, joint: BodyJoint, sound: set[str], path: str, report: Report) -> None:
    """Report what is wrong with a coupling; its start only if both joints are `sound`."""
    if not finite((joint.ratio,), f"{path}.ratio", report, 1, UNBOUNDED):
        return
    if not joint.mimics:
        if joint.ratio != FREE.ratio:
            report(f"{path}.ratio", f"found {joint.ratio:g}, but {joint.name!r} mimics no joint")
        return
    named = {one.name: one for one in scenario.body_joints}
    other = named.pop(joint.mimics, None)
    if other is None:
        valid = ", ".join(name for name in named if name != joint.name)
        report(f"{path}.mimics", f"unknown joint {joint.mimics!r}; valid: {valid}")
    elif other.name == joint.name:
        report(f"{path}.mimics", f"{joint.name!r} mimics itself")
    elif bent := [one for one in (joint, other) if one.type not in ALONG_AXIS]:
        expected = " or ".join(ALONG_AXIS)
        report(f"{path}.mimics", f"{bent[0].name!r} is a {bent[0].type} joint, expected a {expected}")
    elif other.mimics:
        report(f"{path}.mimics", f"{other.name!r} itself mimics {other.mimics!r}: give the ratio to it")
    elif joint.ratio == 0:
        report(f"{path}.ratio", "found 0, expected another number; what stands still is a fixed joint")
    elif {joint.name, other.name} <= sound:
        _check_coupled_start(scenario, joint, other, path, report)


def _check_coupled_start(
    scenario: Scenario, joint: BodyJoint, other: BodyJoint, path: str, report: Report
) -> None:
    """Report a rate of the start that the coupling does not allow. Prescribed parents are not checked."""
    bodies = {body.name: body for body in scenario.bodies}
    if any(one.parent and bodies[one.parent].kind == "prescribed" for one in (joint, other)):
        return
    (rate, most), (given, fastest) = (_start_rate(one, bodies) for one in (joint, other))
    if abs(rate - joint.ratio * given) > PARTING * (most + abs(joint.ratio) * fastest):
        unit = "m/s" if joint.type == "slider" else "rad/s"
        expected = f"expected {joint.ratio * given:g}, {joint.ratio:g} times the rate of {other.name!r}"
        report(path, f"{joint.name!r} starts at {rate:g} {unit}, {expected}")


def _start_rate(joint: BodyJoint, bodies: Mapping[str, Body]) -> tuple[float, float]:
    """Rate of a hinge or slider at the start, and the speeds of which it is a difference [rad/s, m/s]."""
    parent, child, axis = bodies.get(joint.parent), bodies[joint.child], np.array(joint.axis)
    if joint.type == "slider":
        pace = point_velocity(child, joint.anchor) - point_velocity(parent, joint.anchor)
        return float(pace @ axis), _fastest(child, joint.anchor) + _fastest(parent, joint.anchor)
    spin = np.array(ORIGIN if parent is None else parent.angular_velocity)
    turn = np.array(child.angular_velocity)
    return float((turn - spin) @ axis), float(np.linalg.norm(turn) + np.linalg.norm(spin))


def _check_start(joint: BodyJoint, parent: Body | None, child: Body, path: str, report: Report) -> None:
    """Report velocities of the start that part the joint. Prescribed parents are not checked."""
    if parent is not None and parent.kind == "prescribed":
        return
    a, b = point_velocity(parent, joint.anchor), point_velocity(child, joint.anchor)
    spin = np.zeros(3) if parent is None else np.array(parent.angular_velocity)
    turn, slip, axis = np.array(child.angular_velocity) - spin, b - a, np.array(joint.axis)
    if joint.type == "hinge":
        turn = turn - axis * (turn @ axis)
    elif joint.type == "ball":
        turn = 0 * turn
    elif joint.type == "slider":
        slip = slip - axis * (slip @ axis)
    speed = max(_fastest(parent, joint.anchor), _fastest(child, joint.anchor))
    if np.abs(slip).max() > PARTING * speed:
        report(path, f"{joint.name!r} parts at the start by {vector(slip)} m/s: set velocities that meet")
    rate = max(np.abs(child.angular_velocity).max(), np.abs(spin).max())
    if np.abs(turn).max() > PARTING * rate:
        report(path, f"{joint.name!r} turns at the start by {vector(turn)} rad/s across its axis")
