"""Metrics of joints: limits, reach cones, speeds."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values
from touchstone.scenarios.avatar.chains import hinge_axes, shortest_rotations
from touchstone.scenarios.scenario import Joint, ReachCone


def joint_limit(context: Context) -> Values:
    """Largest excess of a hinge over its limits [rad]."""
    names = _hinges(context)
    if not names:
        raise NotMeasured("the scene has no joints")
    return _worst_joint(limit_excess(context), [joint.name for joint in names])


def joint_cone(context: Context) -> Values:
    """Largest angle by which a bone leaves its reach cone, or a ball joint its range of twist [rad]."""
    cones = [cone for chain in context.scenario.chains for cone in chain.cones]
    if not cones:
        raise NotMeasured("the scene has no reach cones")
    excess = np.column_stack([cone_excess(context, cone) for cone in cones])
    return _worst_joint(excess, [cone.joints[0].removesuffix("_1") for cone in cones])


def joint_speed(context: Context) -> Values:
    """Largest speed of a hinge, by its change of angle between frames [rad/s]."""
    names = _hinges(context)
    if not names:
        raise NotMeasured("the scene has no joints")
    speed = np.abs(np.diff(context.recording.joint_angle, axis=0)) / context.frame
    return _worst_joint(speed, [joint.name for joint in names])


def limit_excess(context: Context) -> Array:
    """Excess of every hinge over its limits (f, j) [rad]; 0 within."""
    hinges, angle = _hinges(context), context.recording.joint_angle
    low = np.array([joint.lower for joint in hinges])
    high = np.array([joint.upper for joint in hinges])
    return np.maximum(0.0, np.maximum(low - angle, angle - high))


def cone_excess(context: Context, cone: ReachCone) -> Array:
    """Excess of a ball joint over its cone or its range of twist (f,) [rad], the larger of the two."""
    names = [joint.name for joint in _hinges(context)]
    columns = [names.index(name) for name in cone.joints]
    by_name = {joint.name: joint for joint in context.scenario.joints}
    axes = hinge_axes(tuple(by_name[name] for name in cone.joints))
    turned = Rotation.from_euler("XYZ", context.recording.joint_angle[:, columns])
    rest, center = np.array((0.0, 0.0, 1.0)), np.array(cone.center) @ axes
    bone = turned.apply(rest)
    swung = shortest_rotations(center, bone) * shortest_rotations(rest, center[None])[0]
    twist = (swung.inv() * turned).as_rotvec()[:, 2]
    low, high = cone.twist
    over = np.maximum(0.0, np.maximum(low - twist, twist - high))
    return np.maximum(over, _outside(bone, center, np.array(cone.swing) @ axes))


def _outside(bone: Array, center: Array, corners: Array) -> Array:
    """Angles (f,) of directions from a spherical polygon that is star-shaped from its centre [rad]."""
    after = np.roll(corners, -1, axis=0)
    normals = np.cross(corners, after)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    # The polygon's sector about the centre that contains each direction.
    start, end = np.cross(center, corners), np.cross(center, after)
    in_sector = (bone @ start.T >= 0) & (bone @ end.T <= 0)
    height = bone @ normals.T
    inside = (in_sector & (height >= 0)).any(axis=1)
    # Distance from each edge: from its great circle where the foot is on the edge, else from its ends.
    feet = bone[:, None] - height[:, :, None] * normals
    ahead = np.cross(normals[None], feet)
    on_edge = (np.einsum("fei,ei->fe", ahead, corners) <= 0) & (np.einsum("fei,ei->fe", ahead, after) >= 0)
    to_circle = np.abs(np.arcsin(np.clip(height, -1, 1)))
    to_corner = np.arctan2(np.linalg.norm(np.cross(bone[:, None], corners[None]), axis=2), bone @ corners.T)
    distance = np.where(on_edge, to_circle, to_corner).min(axis=1)
    return np.where(inside, 0.0, distance)


def _hinges(context: Context) -> list[Joint]:
    """The hinges in the order of the recording's columns."""
    by_name = {joint.name: joint for joint in context.scenario.joints}
    return [by_name[name] for tracker in context.scenario.trackers for name in tracker.joints]


def _worst_joint(values: Array, names: list[str]) -> Values:
    column = int(values.max(axis=0).argmax())
    return {"": Value(float(values[:, column].max()), f"of {names[column]}")}
