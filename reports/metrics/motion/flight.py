"""Heights of bounces and times of flips, compared with the closed form."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from touchstone.reports.metrics.context import Context, NotMeasured, Values
from touchstone.reports.metrics.motion.ballistic_arcs import bounces
from touchstone.scenarios.closed_form import flips
from touchstone.scenarios.scenario import Arc

SHORTEST_ARC_FRAMES = 2.0
"""Least length of an arc that surely has a displayed frame near its middle [frames]."""


def bounce_height(context: Context) -> Values:
    """Height of each bounce of two frames or more against the closed form [relative]; -1 if there is none."""
    found = {}
    for truth in context.scenario.truths:
        body, g = context.scenario.body_index(truth.body), float(np.linalg.norm(context.gravity))
        asked = _heights(truth.arcs, g, context.frame)
        if not asked:
            continue
        fixed = next(k for k, kind in enumerate(context.kind) if kind == "fixed")
        seen = bounces(context, (min(body, fixed), max(body, fixed)))
        for k, height in enumerate(asked):
            reached = seen[k].departure ** 2 / (2 * g) if k < len(seen) else 0.0
            found[f"#{k + 1}"] = reached / height - 1
    if not found:
        raise NotMeasured("by the scene's truth nothing bounces")
    return found


def _heights(arcs: tuple[Arc, ...], g: float, frame: float) -> list[float]:
    """Heights of the arcs that start upwards, against gravity, and last long enough [m]."""
    speeds = [arc.velocity[2] for arc in arcs[1:] if arc.velocity[2] > 0 > arc.acceleration[2]]
    return [speed**2 / (2 * g) for speed in speeds if 2 * speed / g >= SHORTEST_ARC_FRAMES * frame]


def rotation_flip(context: Context) -> Values:
    """Largest error of the times at which a free top flips [s]; a missed flip counts until the end."""
    found = {}
    for truth in context.scenario.truths:
        if truth.law == "torque_free":
            asked = flips(context.scenario, truth)
            seen = _flips_seen(context, context.scenario.body_index(truth.body))
            seen = np.append(seen, np.full(max(0, len(asked) - len(seen)), context.scenario.duration))
            found[truth.body] = float(np.max(np.abs(seen[: len(asked)] - asked)))
    if not found:
        raise NotMeasured("the scene has no free top")
    return found


def _flips_seen(context: Context, body: int) -> np.ndarray:
    """Times at which the rate about the middle axis is zero, between frames by Euler's equations."""
    inertia = np.array(context.scenario.bodies[body].inertia)
    moments, axes = np.linalg.eigh(inertia)
    turned = Rotation.from_quat(context.recording.orientation[:, body], scalar_first=True)
    w = turned.inv().apply(context.recording.angular_velocity[:, body]) @ axes
    slope = (moments[2] - moments[0]) / moments[1] * w[:, 2] * w[:, 0] * np.linalg.det(axes)
    return np.asarray(CubicHermiteSpline(context.recording.time, w[:, 1], slope).roots(extrapolate=False))
