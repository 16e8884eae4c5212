"""Figures of a run that decide its outcome, each from poses and velocities and no engine's word."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from math import dist, inf, nan

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts import passages
from touchstone.reports.metrics.contacts.passages import Motions, extent
from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.energy import mechanical_energy, momentum_angular, momentum_linear
from touchstone.reports.metrics.motion.joints import driving
from touchstone.reports.metrics.solver import STATES
from touchstone.scenarios.avatar.kinematics import tracked_poses
from touchstone.scenarios.body_joints import ALONG_AXIS, WORLD, spanning_trees
from touchstone.scenarios.difficulty.checks import Checks, Wall
from touchstone.scenarios.scenario import UNBOUNDED, UNMOVED, Scenario, Vector

UNIT = 1e-3
"""Tolerance of the length of an orientation [1]: single precision and a missing normalisation stay below."""
LEAST_HEIGHT = 1e-3
"""Least height of a centre over the ground in the available energy [m]: contact tolerances of engines lift a
thin plate by as much."""
LEAST_WAY = 1e-6
"""Displacement below which a body has not moved, for resets [m]."""
RETURNED = 10.0
"""Factor over the first frame's displacement at which a body was away before a reset [1]."""
JUMP = 3.0
"""Factor over the displacement that velocities and gravity explain, from which a body jumped [1]."""


def finite(context: Context) -> bool:
    """Whether all values of all frames are finite."""
    return all(bool(np.isfinite(getattr(context.recording, name)).all()) for name in STATES)


def rotations(context: Context) -> bool:
    """Whether all orientations of all frames are unit quaternions, to UNIT."""
    sizes = np.linalg.norm(context.recording.orientation, axis=-1)
    return bool((np.abs(sizes - 1) <= UNIT).all())


def reset_frame(context: Context) -> int | None:
    """First frame at which all simulated bodies jump back to where, and as fast as, they started."""
    r, bodies = context.recording, context.simulated
    if len(r.time) < 3 or not bodies:
        return None
    x, v = r.position[:, bodies], r.linear_velocity[:, bodies]
    away = np.linalg.norm(x - x[0], axis=2)
    slower = np.linalg.norm(v - v[0], axis=2)
    first, first_change = away[1] + LEAST_WAY, slower[1] + LEAST_WAY
    back = ((away <= first) & (slower <= first_change)).all(axis=1)
    was_away = (away > RETURNED * first).any(axis=1)
    speed = np.linalg.norm(v, axis=2)
    step = np.linalg.norm(np.diff(x, axis=0), axis=2)
    fall = float(np.linalg.norm(context.gravity)) * context.frame
    explained = (np.minimum(speed[1:], speed[:-1]) + fall) * context.frame + LEAST_WAY
    jumped = (step > JUMP * explained).any(axis=1)
    found = np.flatnonzero(back[1:] & was_away[:-1] & jumped)
    return int(found[0]) + 1 if len(found) else None


def available_energy(scenario: Scenario, below: Mapping[int, float]) -> float:
    """Kinetic energy of simulated bodies and energy of joints' springs at the start, plus sum(m g h), with h
    the height of a centre of mass over the lowest of their points [J]; of a body that joints hold at least
    the length of its `joint_paths`, by which it may fall.

    Args:
        below: distance of a body's lowest point below its centre, by body index; 0 without pieces [m].
    """
    g = np.array(scenario.acting_gravity)
    size = float(np.linalg.norm(g))
    springs = (one for one in scenario.body_joints if one.type in ALONG_AXIS)
    energy, heights = sum(one.stiffness * one.target**2 / 2 for one in springs), {}
    for k, body in enumerate(scenario.bodies):
        if body.kind != "simulated":
            continue
        turned = Rotation.from_quat(body.orientation, scalar_first=True)
        local = turned.inv().apply(body.angular_velocity)
        energy += body.mass * float(np.dot(body.linear_velocity, body.linear_velocity)) / 2
        energy += float(local @ np.array(body.inertia) @ local) / 2
        center = np.array(body.position) + turned.apply(body.center_of_mass)
        heights[k] = -float(center @ g) / size if size else 0.0
    if size == 0 or not heights:
        return energy
    bottom = min(height - below.get(k, 0.0) for k, height in heights.items())
    held = joint_paths(scenario)
    falls = {k: max(height - bottom, held.get(k, 0.0)) for k, height in heights.items()}
    return energy + sum(scenario.bodies[k].mass * size * fall for k, fall in falls.items())


def joint_paths(scenario: Scenario) -> dict[int, float]:
    """Length of the way along the joints of its tree from an unmoved body or the world to the centre of mass
    of each simulated body that they hold, by body index [m]: it stays as near to the joint that holds it."""
    held = {WORLD: 0.0} | {body.name: 0.0 for body in scenario.bodies if body.kind in UNMOVED}
    anchors: dict[str, Vector] = {}
    found = {}
    for joint in spanning_trees(scenario)[0]:
        travel = joint.upper - joint.lower if joint.type == "slider" else 0.0
        if joint.parent not in held or travel >= UNBOUNDED:
            continue
        way = dist(anchors.get(joint.parent, joint.anchor), joint.anchor)
        held[joint.child], anchors[joint.child] = held[joint.parent] + way + travel, joint.anchor
        k = scenario.body_index(joint.child)
        body = scenario.bodies[k]
        turned = Rotation.from_quat(body.orientation, scalar_first=True)
        center = np.array(body.position) + turned.apply(body.center_of_mass)
        found[k] = held[joint.child] + dist(center, joint.anchor)
    return found


def energy_change(context: Context) -> tuple[float, float]:
    """Largest gain and largest loss of the energy of simulated bodies since the start over the available
    energy [1]; NaN where a driver does work."""
    if context.scenario.trackers or not context.simulated or driving(context.scenario):
        return nan, nan
    energy = mechanical_energy(context, context.simulated)
    inner = {k: max(radius, LEAST_HEIGHT) for k, radius in inner_radii(context).items()}
    there = available_energy(context.scenario, inner)
    if not there > 0:
        return nan, nan
    change = (energy - energy[0]) / there
    return float(change.max()), float(-change.min())


def momentum_change(context: Context) -> float:
    """Largest change of linear or angular momentum of an isolated scene over its sum [1]; NaN for others."""
    found = []
    for measure in (momentum_linear, momentum_angular):
        with suppress(NotMeasured):
            found += [float(value) for value in measure(context).values()]  # type: ignore[arg-type]
    return max(found, default=nan)


def tracking_error(context: Context) -> tuple[float, str]:
    """Largest distance of a link's origin from its tracked place in the last frame [m], and its name."""
    scenario, r, found = context.scenario, context.recording, [(nan, "")]
    for tracker in scenario.trackers:
        places, _ = tracked_poses(scenario, tracker, r.time[-1:])
        for k, link in enumerate(scenario.links(tracker)):
            error = float(np.linalg.norm(r.position[-1, link] - places[0, k]))
            found.append((error, scenario.bodies[link].name))
    return max(found[1:], default=found[0])


def inner_radii(context: Context) -> dict[int, float]:
    """Radius of the largest inscribed ball of each body's pieces, by body index [m]; inf without pieces."""
    motions = Motions(context)
    return {
        k: max((extent(motions, k, piece).inner for piece in body.pieces), default=inf)
        for k, body in enumerate(context.scenario.bodies)
    }


def depths(context: Context) -> dict[tuple[int, int], Array]:
    """Depth of every body pair per frame (f,) [m]; infinite where the oracle knows only that one is inside
    the other."""
    found = {pair: np.maximum(0.0, -distance) for pair, distance in context.distances.distance.items()}
    return {pair: np.where(depth < passages.UNBOUNDED, depth, inf) for pair, depth in found.items()}


def truth_error(context: Context) -> tuple[float, str]:
    """Largest distance of a centre of mass from its closed form [m], and the body's name; NaN without."""
    centers, bodies = context.mass_centers, context.scenario.bodies
    found = [
        (float(np.linalg.norm(centers[:, k] - truth.position, axis=1).max()), bodies[k].name)
        for k, truth in context.truths.items()
    ]
    return max(found, default=(nan, ""))


def wall_crossing(context: Context, wall: Wall) -> tuple[int, int, int] | None:
    """First body whose centre crosses a wall: its index, the last frame in which it was its inner radius in
    front of it, and the first frame behind; None if there is none."""
    bodies = [context.scenario.body_index(name) for name in wall.bodies] or context.simulated
    inner, best = inner_radii(context), None
    for k in bodies:
        side = (context.mass_centers[:, k] - np.array(wall.point)) @ np.array(wall.normal)
        behind = np.flatnonzero(side < 0)
        if len(behind):
            before = np.flatnonzero(side[: behind[0]] >= 0.9 * inner[k])
            found = (k, int(before[-1]) if len(before) else 0, int(behind[0]))
            best = found if best is None or found[2] < best[2] else best
    return best


def rest(context: Context, checks: Checks) -> dict[str, tuple[float, float, float]]:
    """Displacements in the first and in the second half of rest [m], and root mean square surface speed
    [m/s], of each simulated body by name.

    All count the rotation at the body's farthest point.
    """
    r = context.recording
    late = np.flatnonzero(r.time >= checks.rest_from - 1e-9)
    if len(late) < 3:
        return {}
    motions, found = Motions(context), {}
    for k in context.simulated:
        pieces = context.scenario.bodies[k].pieces
        outer = max((extent(motions, k, piece).reach for piece in pieces), default=0.0)
        ends = late[[0, len(late) // 2, -1]]
        turns = Rotation.from_quat(r.orientation[ends, k], scalar_first=True)
        ways = np.linalg.norm(np.diff(context.mass_centers[ends, k], axis=0), axis=1)
        ways = ways + outer * (turns[1:] * turns[:-1].inv()).magnitude()
        speed = np.linalg.norm(r.linear_velocity[late, k], axis=1)
        speed = speed + outer * np.linalg.norm(r.angular_velocity[late, k], axis=1)
        rms = float(np.sqrt(np.mean(speed**2)))
        found[context.scenario.bodies[k].name] = (float(ways[0]), float(ways[1]), rms)
    return found
