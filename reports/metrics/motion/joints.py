"""How far joints between bodies come apart, exceed their limits and store energy, from recorded poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context, NotMeasured, Values, measured, worst
from touchstone.scenarios.body_joints import ALONG_AXIS, WORLD, beyond
from touchstone.scenarios.scenario import UNBOUNDED, BodyJoint, Scenario


class JointMotion(NamedTuple):
    """A joint per frame (f,): the distance of its two anchors, across the axis of a slider [m]; the angle by
    which it turns otherwise than it may [rad]; its position [rad, m], 0 of ball and fixed joints. Then the
    anchor and the axis of its parent (f, 3) [m, 1], world."""

    gap: Array
    turn: Array
    position: Array
    anchor: Array
    axis: Array


def joint_motion(recording: Recording, scenario: Scenario, joint: BodyJoint) -> JointMotion:
    """Motion of a joint, whose frame and anchors are those of its bodies in the first frame."""
    place, turn = _poses(recording, scenario, joint.parent)
    other, turned = _poses(recording, scenario, joint.child)
    anchor, axis = np.array(joint.anchor), np.array(joint.axis)
    both = ((place, turn), (other, turned))
    start, end = (at + pose.apply(pose[0].inv().apply(anchor - at[0])) for at, pose in both)
    # the parent's motion undone: the child as seen from it, in the axes of the start
    back = turn[0] * turn.inv()
    apart, relative = back.apply(end - start), back * turned * turned[0].inv()
    position = np.zeros(len(apart))
    if joint.type == "slider":
        position = apart @ axis
        apart = apart - np.outer(position, axis)
    angle = np.asarray(relative.magnitude())
    if joint.type == "hinge":
        x, y, z, w = relative.as_quat().T
        position = np.unwrap(2 * np.arctan2(np.column_stack([x, y, z]) @ axis, w))
        shown = relative.apply(axis)
        angle = np.arctan2(np.linalg.norm(np.cross(axis, shown), axis=1), shown @ axis)
    elif joint.type == "ball":
        angle = np.zeros(len(apart))
    return JointMotion(np.linalg.norm(apart, axis=1), angle, position, start, back.inv().apply(axis))


def _of(context: Context, joint: BodyJoint) -> JointMotion:
    return joint_motion(context.recording, context.scenario, joint)


def _poses(r: Recording, scenario: Scenario, name: str) -> tuple[Array, Rotation]:
    """Places (f, 3) of a body's origin and its orientations; those of the world for its name."""
    if name == WORLD:
        return np.zeros((len(r.time), 3)), Rotation.identity(len(r.time))
    k = scenario.body_index(name)
    return r.position[:, k], Rotation.from_quat(r.orientation[:, k], scalar_first=True)


def _joints(context: Context) -> tuple[BodyJoint, ...]:
    if not context.scenario.body_joints:
        raise NotMeasured("the scene has no joints between bodies")
    return context.scenario.body_joints


def _slip(context: Context, joint: BodyJoint) -> float:
    """Largest distance of a joint's position from where its coupling asks it to be [rad, m]; or 0."""
    if not joint.mimics:
        return 0.0
    other = next(one for one in _joints(context) if one.name == joint.mimics)
    apart = _of(context, joint).position - joint.ratio * _of(context, other).position
    return float(np.abs(apart).max())


def joint_drift(context: Context) -> Values:
    """Largest distance of the two anchors of a joint between bodies [m]: across the axis of a slider, and of
    one that mimics another, along it from where that one asks it to be."""
    found = {one.name: float(_of(context, one).gap.max()) for one in _joints(context)}
    slips = {one.name: _slip(context, one) for one in _joints(context) if one.type == "slider"}
    return worst({name: max(gap, slips.get(name, 0.0)) for name, gap in found.items()})


def joint_turn(context: Context) -> Values:
    """Largest angle by which a joint between bodies turns otherwise than it may [rad]: across its axis, and
    of a hinge that mimics another, about it from where that one asks it to be."""
    found = {one.name: float(_of(context, one).turn.max()) for one in _joints(context) if one.type != "ball"}
    slips = {one.name: _slip(context, one) for one in _joints(context) if one.type == "hinge"}
    found = {name: max(turn, slips.get(name, 0.0)) for name, turn in found.items()}
    return worst(measured(found, "ball joints may turn in every way"))


def joint_stop(context: Context) -> Values:
    """Largest excess of a slider over its limits [m]."""
    found = {one.name: float(excess(context, one).max()) for one in bounded(context.scenario, "slider")}
    return worst(measured(found, "no slider has limits"))


def joint_force(context: Context) -> Values:
    """Largest error of the mean force on a joint in a displayed frame, over the largest true force [1].

    The force is what changes the momentum of the bodies that hang on the joint, beside gravity: of joints
    outside loops, whose bodies all have truths and touch nothing.
    """
    if not context.truths:
        raise NotMeasured("the scene has no closed form")
    r, gravity = context.recording, np.array(context.gravity)
    mass = np.array([body.mass for body in context.scenario.bodies])
    touched = {int(body) for side in ("body_a", "body_b") for body in r.contacts[side]}
    error, true = {}, 0.0
    for joint in _joints(context):
        hanging = [context.scenario.body_index(name) for name in beyond(context.scenario, joint)]
        if not hanging or touched & {*hanging} or not {*hanging} <= context.truths.keys():
            continue
        weight = mass[hanging].sum() * gravity
        forces = [
            np.diff(np.tensordot(mass[hanging], np.array(velocity), 1), axis=0) / context.frame - weight
            for velocity in (
                [r.linear_velocity[:, k] for k in hanging],
                [context.truths[k].velocity for k in hanging],
            )
        ]
        error[joint.name] = float(np.linalg.norm(forces[0] - forces[1], axis=1).max())
        true = max(true, float(np.linalg.norm(forces[1], axis=1).max()))
    if not error or true == 0:
        raise NotMeasured("no joint outside loops carries a known force")
    return worst({name: size / true for name, size in error.items()})


def bounded(scenario: Scenario, kind: str) -> list[BodyJoint]:
    """Joints between bodies of one type that have limits."""
    mine = (joint for joint in scenario.body_joints if joint.type == kind)
    return [joint for joint in mine if min(-joint.lower, joint.upper) < UNBOUNDED]


def excess(context: Context, joint: BodyJoint) -> Array:
    """Excess of a joint over its limits per frame (f,) [rad, m]; 0 within."""
    q = _of(context, joint).position
    return np.maximum(0.0, np.maximum(joint.lower - q, q - joint.upper))


def spring_energy(context: Context) -> Array:
    """Energy of the springs of joints between bodies per frame (f,), k (q - target)^2 / 2 [J]."""
    total = np.zeros(len(context.recording.time))
    for joint in context.scenario.body_joints:
        if joint.type in ALONG_AXIS and joint.stiffness:
            total += joint.stiffness * (_of(context, joint).position - joint.target) ** 2 / 2
    return total


def driving(scenario: Scenario) -> str:
    """Why joints of a scene may add energy that is not known; empty if they cannot.

    Springs store energy and dampers only lower it. The work of a motor, of a spring with a largest force, and
    of a joint with a prescribed body is not known from recorded frames.
    """
    prescribed = {body.name for body in scenario.bodies if body.kind == "prescribed"}
    for joint in scenario.body_joints:
        bound = joint.stiffness and joint.largest_force < UNBOUNDED
        if joint.damping * joint.target_rate or bound or joint.parent in prescribed:
            return f"{joint.name} drives its bodies: its work is not known"
    return ""
