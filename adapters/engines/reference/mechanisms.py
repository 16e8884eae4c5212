"""Translation of joints between bodies to the reference's arrays: mechanisms as further rows of drivers, and
their joints as further rows of joints."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.joined_bodies import require_uncoupled
from touchstone.reference_impl.core import conventions
from touchstone.reference_impl.core.driver_dtypes import DRIVER, JOINT
from touchstone.scenarios.body_joints import is_limited, mechanisms, spanning_trees
from touchstone.scenarios.scenario import BodyJoint, Scenario

TYPES = {
    "hinge": conventions.JOINT_HINGE,
    "slider": conventions.JOINT_SLIDER,
    "ball": conventions.JOINT_BALL,
    "fixed": conventions.JOINT_FIXED,
}
WIDTHS = (1, 1, 3, 0, 6)
"""Rates of a joint of each type, JOINT_*."""
PLACES = (1, 1, 4, 0, 7)
"""Positions of a joint of each type."""


def with_mechanisms(
    scenario: Scenario, bodies: np.ndarray, joints: np.ndarray, drivers: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joints and drivers with those of the scene's mechanisms behind them; sets what bodies know of them.

    Raises:
        Unsupported: a joint with a prescribed body, or a mechanism that is too large.
    """
    index = {body.name: k for k, body in enumerate(scenario.bodies)}
    tree, loops = spanning_trees(scenario)
    groups = mechanisms(scenario)
    for joint in loops:
        if is_limited(joint):
            raise Unsupported(f"reference: no limit of a joint that closes a loop ({joint.name!r})")
        require_uncoupled("reference", scenario, joint)
    for joint in scenario.body_joints:
        if joint.parent and scenario.bodies[index[joint.parent]].kind == "prescribed":
            raise Unsupported(f"reference: no joint with a prescribed body ({joint.name!r})")
    all_joints, all_drivers, first = [joints], [drivers], len(joints)
    for number, group in enumerate(groups, len(drivers)):
        names = {joint.name for joint in group}
        own = [joint for joint in tree if joint.name in names]
        closing = [joint for joint in loops if joint.name in names]
        children = {joint.child for joint in own}
        roots = [j.parent for j in own if _is_moved(scenario, index, j.parent) and j.parent not in children]
        free = list(dict.fromkeys(roots))
        rows = np.zeros(len(free) + len(own) + len(closing), JOINT)
        rows["mimics"] = -1
        for row, name in zip(rows, free):
            row["type"], row["parent"], row["child"] = conventions.JOINT_FREE, -1, index[name]
        place = {joint.name: k for k, joint in enumerate(own, first + len(free))}
        for row, joint in zip(rows[len(free) :], own + closing):
            _set_joint(scenario, index, bodies, row, joint)
            row["mimics"] = place.get(joint.mimics, -1)
        driver = np.zeros(1, DRIVER)
        _set_coordinates(rows[: len(free) + len(own)], driver, bodies, first, number)
        driver["loop_count"], driver["mimic_count"] = len(closing), (rows["mimics"] >= 0).sum()
        driver["constrained"] = driver["loop_count"] + driver["mimic_count"] > 0
        for joint in own + closing:
            if joint.parent:
                _set_beside(bodies, index[joint.child], index[joint.parent], joint.child)
        all_joints.append(rows)
        all_drivers.append(driver)
        first += len(rows)
    return np.concatenate(all_joints), np.concatenate(all_drivers)


def _is_moved(scenario: Scenario, index: dict[str, int], name: str) -> bool:
    return bool(name) and scenario.bodies[index[name]].kind == "simulated"


def _set_joint(
    scenario: Scenario, index: dict[str, int], bodies: np.ndarray, row: np.ndarray, joint: BodyJoint
) -> None:
    child = bodies[index[joint.child]]
    moved = _is_moved(scenario, index, joint.parent)
    turn = Rotation.from_quat(child["orientation"], scalar_first=True)
    base, origin = Rotation.identity(), np.zeros(3)
    if moved:
        parent = bodies[index[joint.parent]]
        base, origin = Rotation.from_quat(parent["orientation"], scalar_first=True), parent["center"]
    row["type"], row["child"] = TYPES[joint.type], index[joint.child]
    row["parent"] = index[joint.parent] if moved else -1
    row["axis"], row["child_axis"] = base.inv().apply(joint.axis), turn.inv().apply(joint.axis)
    row["parent_anchor"] = base.inv().apply(np.array(joint.anchor) - origin)
    row["child_anchor"] = turn.inv().apply(np.array(joint.anchor) - child["center"])
    row["rest_turn"] = (base.inv() * turn).as_quat(scalar_first=True)
    fields = ("lower", "upper", "stiffness", "damping", "target", "target_rate", "largest_force", "ratio")
    for name in fields:
        row[name] = getattr(joint, name)


def _set_coordinates(
    rows: np.ndarray, driver: np.ndarray, bodies: np.ndarray, first: int, number: int
) -> None:
    """Number the positions and rates of a tree's joints, and set the positions of the start."""
    place = coordinate = 0
    for k, row in enumerate(rows):
        kind, child = int(row["type"]), int(row["child"])
        row["coordinate"], row["place"], row["width"], row["chain"] = coordinate, place, WIDTHS[kind], -1
        inner = [j for j in range(k) if rows[j]["child"] == row["parent"]]
        row["inner"] = first + inner[0] if inner else -1
        if (
            place + PLACES[kind] > conventions.CONFIGURATION
            or coordinate + WIDTHS[kind] > conventions.HINGE_CAPACITY
        ):
            most = conventions.HINGE_CAPACITY
            raise Unsupported(f"reference: more than {most} degrees of freedom in one mechanism")
        start = np.zeros(PLACES[kind])
        if kind == conventions.JOINT_BALL:
            start[:] = row["rest_turn"]
        elif kind == conventions.JOINT_FREE:
            start[:3], start[3:] = bodies[child]["center"], bodies[child]["orientation"]
        driver["positions"][0, place : place + len(start)] = start
        place, coordinate = place + len(start), coordinate + WIDTHS[kind]
        bodies[child]["driver"], bodies[child]["hinge"] = number, first + k
    driver["root"], driver["first_joint"], driver["joint_count"] = rows[0]["child"], first, len(rows)
    driver["position_count"], driver["hinge_count"] = place, coordinate
    driver["mechanism"] = driver["loops"] = 1
    driver["mass"] = driver["inverse_mass"] = 1.0


def _set_beside(bodies: np.ndarray, a: int, b: int, name: str) -> None:
    """Note that two bodies do not collide, at the one with more places left."""
    one, other = sorted((a, b), key=lambda k: int((bodies[k]["beside"] >= 0).sum()))
    places = bodies[one]["beside"]
    empty = np.flatnonzero(places < 0)
    if not len(empty):
        raise Unsupported(f"reference: more than {len(places)} joints and exclusions of contact at {name!r}")
    places[empty[0]] = other


def set_exclusions(scenario: Scenario, bodies: np.ndarray, pieces: np.ndarray, mechanisms: int) -> None:
    """Exclude the contacts of `contact_exclusions`: bodies of a group that shares none with a larger one get
    one filter group, other pairs a note at a body. `pieces` have their filter groups of `prepare`.

    Raises:
        Unsupported: too many pairs at a body, or a pair in a scene without joints between bodies.
    """
    index = {body.name: k for k, body in enumerate(scenario.bodies)}
    joined = {frozenset((index.get(joint.parent, -1), index[joint.child])) for joint in scenario.body_joints}
    simulated = [body.kind == "simulated" for body in scenario.bodies]
    filtered: set[int] = set()
    first = int(pieces["filter_group"].max(initial=0)) + 1
    for number, names in enumerate(sorted(scenario.contact_exclusions, key=len, reverse=True)):
        own = [index[name] for name in names]
        if all(simulated[k] for k in own) and not filtered & set(own):
            pieces["filter_group"][np.isin(pieces["body"], own)] = first + number
            filtered |= set(own)
            continue
        for a, b in combinations(own, 2):
            if scenario.bodies[a].pieces and scenario.bodies[b].pieces and {a, b} not in joined:
                if not mechanisms:
                    raise Unsupported("reference: no exclusion of contact in a scene without body_joints")
                _set_beside(bodies, a, b, scenario.bodies[a].name)
