"""Metrics of joints: limits, reach cones, speeds."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, judging, measured, worst
from touchstone.reports.metrics.motion.joints import bounded, excess
from touchstone.scenarios.avatar.chains import hinge_axes, shortest_rotations
from touchstone.scenarios.avatar.kinematics import tracked_poses
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Joint, ReachCone, Scenario, Tracker

Mask = NDArray[np.bool_]

PRESSED = 1e-3
"""Depth of a tracked link in a body from which the link is pressed against it [m]: a visible depth."""
KEPT_SCENES = 4
"""Number of scenes whose tracked depths are cached: the columns of a scene are judged in sequence."""


def pressed(context: Context, tracker: Tracker) -> dict[int, Mask]:
    """Mask (f,) of pressed frames, per body that a tracker presses links of its driven body into [bool].

    The body is fixed, or driven too (a link of the same driven body where these may touch). Raises
    JudgeMissing where the overlap oracle cannot be imported.
    """
    scenario, frames = context.scenario, len(context.recording.time)
    links = set(scenario.links(tracker))
    found: dict[int, Mask] = {}
    for (a, b), depth in tracked_depths(scenario).items():
        for link, other in ((a, b), (b, a)):
            if link in links:
                deep = depth[:frames] > PRESSED
                found[other] = found[other] | deep if other in found else deep
    return {other: deep for other, deep in found.items() if deep.any()}


@lru_cache(KEPT_SCENES)
def tracked_depths(scenario: Scenario) -> dict[tuple[int, int], Array]:
    """Depth (f,) [m] of every pair of a tracked link and a body that is not simulated."""
    with judging():
        from touchstone.adapters.oracles.overlap import measure
    frames = scenario.frame_count + 1
    times = np.arange(frames) / scenario.frame_rate
    position = np.tile([body.position for body in scenario.bodies], (frames, 1, 1))
    orientation = np.tile([body.orientation for body in scenario.bodies], (frames, 1, 1))
    for tracker in scenario.trackers:
        links = list(scenario.links(tracker))
        position[:, links], orientation[:, links] = tracked_poses(scenario, tracker, times)
    shown = SimpleNamespace(time=times, position=position, orientation=orientation)
    distances = measure(cast(Recording, shown), scenario).distance
    kinds = [body.kind for body in scenario.bodies]
    return {
        (a, b): np.maximum(0.0, -distance)
        for (a, b), distance in distances.items()
        if "driven" in (kinds[a], kinds[b]) and "simulated" not in (kinds[a], kinds[b])
    }


def joint_limit(context: Context) -> Values:
    """Largest excess of a hinge over its limits [rad]."""
    over = limit_excess(context).max(axis=0, initial=0.0)
    found = {joint.name: float(value) for joint, value in zip(_hinges(context), over)}
    found |= {one.name: float(excess(context, one).max()) for one in bounded(context.scenario, "hinge")}
    return worst(measured(found, "no hinge has limits"))


def joint_cone(context: Context) -> Values:
    """Largest angle by which a bone leaves its reach cone, or a ball joint its range of twist [rad]."""
    cones = [cone for chain in context.scenario.chains for cone in chain.cones]
    cones = measured(cones, "the scene has no reach cones")
    excess = np.column_stack([cone_excess(context, cone) for cone in cones])
    return _worst_joint(excess, [cone.joints[0].removesuffix("_1") for cone in cones])


def joint_speed(context: Context) -> Values:
    """Largest speed of a hinge, by its change of angle between frames [rad/s]."""
    names = [joint.name for joint in measured(_hinges(context), "the scene has no joints")]
    speed = np.abs(np.diff(context.recording.joint_angle, axis=0)) / context.frame
    return _worst_joint(speed, names)


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
    by_name = {joint.name: joint for joint in context.scenario.joints}
    return [by_name[name] for tracker in context.scenario.trackers for name in tracker.joints]


def _worst_joint(values: Array, names: list[str]) -> Values:
    column = int(values.max(axis=0).argmax())
    return {"": Value(float(values[:, column].max()), f"of {names[column]}")}


FRAMES = 6
"""Number of evenly spread pressed frames to optimise, 0.2 s each. Twelve change the result by 0.2 %."""


def posture_deviation(context: Context) -> Values:
    """Angle between shown and tracked hinges, rms over joints and pressed frames [rad]."""
    tracker, frames = _person(context)
    away = _shown(context, tracker) - sample(tracker, context.recording.time).angle
    return {"": float(np.sqrt(np.mean(away[frames] ** 2)))}


def posture_over_best(context: Context) -> Values:
    """Sum of |q - q_tracker|^2 shown over that of the best known free posture, 6 pressed frames [1].

    In pressed frames the tracker's posture overlaps something; they are the same for every engine. The best
    posture is that of 20 starts, with the root in its shown pose (`nearest_posture.py`).
    """
    tracker, frames = _person(context)
    with judging():
        from touchstone.adapters.oracles.nearest_posture import NearestPosture
    scenario, recording = context.scenario, context.recording
    search, root = NearestPosture(scenario, tracker), scenario.body_index(tracker.root)
    chosen = frames[np.linspace(0, len(frames) - 1, min(FRAMES, len(frames))).round().astype(int)]
    shown, tracked = _shown(context, tracker), sample(tracker, recording.time).angle
    rng, best = np.random.default_rng(scenario.seed), 0.0
    last: list[Array] = []
    for f in chosen.tolist():
        turned = Rotation.from_quat(recording.orientation[f], scalar_first=True).as_matrix()
        poses = list(zip(turned, recording.position[f]))
        posture = search.best(poses[root], poses, tracked[f], [tracked[f], shown[f], *last], rng)
        if posture is None:
            raise NotMeasured(f"no free posture found at {recording.time[f]:.3f} s")
        best += float(np.sum((posture - tracked[f]) ** 2))
        last = [posture]
    if best == 0:
        shown_in = plural(len(chosen), "frame")
        raise NotMeasured(f"tracked postures are free where the root is shown ({shown_in})")
    return {"": float(np.sum((shown[chosen] - tracked[chosen]) ** 2)) / best}


def _person(context: Context) -> tuple[Tracker, NDArray[np.int64]]:
    """The first driven body with chains, and the frames in which its tracker presses it into something."""
    scenario = context.scenario
    turned = {name for chain in scenario.chains for name in chain.joints}
    tracker = next((t for t in scenario.trackers if turned & set(t.joints)), None)
    if tracker is None:
        raise NotMeasured("no driven body with chains")
    deep = list(pressed(context, tracker).values())
    deep = measured(deep, "the tracker presses the driven body into nothing")
    return tracker, np.flatnonzero(np.any(deep, axis=0))


def _shown(context: Context, tracker: Tracker) -> Array:
    """Angles of the tracker's hinges (f, j) [rad]."""
    trackers = context.scenario.trackers
    first = sum(len(other.joints) for other in trackers[: trackers.index(tracker)])
    return context.recording.joint_angle[:, first : first + len(tracker.joints)]
