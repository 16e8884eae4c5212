"""Distance of the motion from what is known of it: closed forms, published values, symmetry, the law of
impact, free flight."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts.forces import force_between
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, measured, worst
from touchstone.reports.metrics.motion.events import bounces
from touchstone.scenarios.closed_form import flips
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.impact_laws import outcomes
from touchstone.scenarios.truths.published import FRONT, MOMENT, members


def truth_position(context: Context) -> Values:
    """Largest distance of the centre of mass from its closed form over the longest path of any body [1]."""
    way = _largest(context, lambda truth: truth.position - truth.position[0], "moves")
    found = {}
    for body, truth in context.truths.items():
        error = context.mass_centers[:, body] - truth.position
        found[_name(context, body)] = float(np.linalg.norm(error, axis=1).max() / way)
    return worst(found)


def truth_velocity(context: Context) -> Values:
    """Error of the velocity in the last frame over the largest speed of any body [1]."""
    return _last_error(context, lambda truth: truth.velocity, context.recording.linear_velocity, "moves")


def truth_orientation(context: Context) -> Values:
    """Largest angle between a body and its closed form [rad]."""
    if not context.truths:
        raise NotMeasured("the scene has no closed form")
    found = {}
    for body, truth in context.truths.items():
        is_at = Rotation.from_quat(context.recording.orientation[:, body], scalar_first=True)
        must_be = Rotation.from_quat(truth.orientation, scalar_first=True)
        found[_name(context, body)] = float((is_at * must_be.inv()).magnitude().max())
    return worst(found)


def truth_spin(context: Context) -> Values:
    """Error of the angular velocity in the last frame over the largest one of any body [1]."""
    rates = context.recording.angular_velocity
    return _last_error(context, lambda truth: truth.angular_velocity, rates, "turns")


def _last_error(context: Context, rate: Callable[[Motion], Array], measured: Array, does: str) -> Values:
    """Error of a rate (f, n, 3) in the last frame over the largest true one of any body [1]."""
    largest = _largest(context, rate, does)
    error = {k: np.linalg.norm(measured[-1, k] - rate(truth)[-1]) for k, truth in context.truths.items()}
    return worst({_name(context, body): float(size / largest) for body, size in error.items()})


def _largest(context: Context, quantity: Callable[[Motion], Array], does: str) -> float:
    """Largest norm of a vector over all frames and bodies."""
    if not context.truths:
        raise NotMeasured("the scene has no closed form")
    sizes = [np.linalg.norm(quantity(truth), axis=1).max() for truth in context.truths.values()]
    if max(sizes) == 0:
        raise NotMeasured(f"by the scene's truth nothing {does}")
    return float(max(sizes))


def _name(context: Context, body: int) -> str:
    return context.scenario.bodies[body].name


def published_error(context: Context) -> Values:
    """Difference of a measured from a published value, over the published tolerance [1]."""
    scenario, recording = context.scenario, context.recording
    if not scenario.published:
        raise NotMeasured("the scene states no published value")
    if recording.time[-1] < max(one.end for one in scenario.published) - context.frame / 2:
        raise NotMeasured("the end was not played")

    names = [body.name for body in scenario.bodies]

    def motion(name: str) -> Motion:
        k = scenario.body_index(name)
        velocity, rate = recording.linear_velocity[:, k], recording.angular_velocity[:, k]
        return Motion(context.mass_centers[:, k], velocity, recording.orientation[:, k], rate)

    found = {}
    for one in scenario.published:
        if one.quantity == "force":
            value = force_between(context, one)
        elif one.quantity == "reach":
            frames = np.searchsorted(recording.time, (one.start - MOMENT, one.end - MOMENT))
            places = context.mass_centers[frames][:, members(one.body, names)] @ np.array(one.along)
            value = float(np.diff(np.quantile(places, FRONT, axis=1))[0])
        else:
            inertia = scenario.bodies[scenario.body_index(one.body)].inertia
            other = motion(one.other) if one.other else None
            value = one.measured(recording.time, motion(one.body), other, inertia)
        text = " ".join((f"{value:.6g} of {one.value:.6g} {one.unit}", one.outcome(value))).strip()
        found[one.name] = Value((value - one.value) / one.tolerance, text)
    return found


SAME_PLACE = 1e-9
"""Distance within which a body starts at the mirror image of another's place [m]: rounding."""
MIRROR = np.array([-1.0, 1.0, 1.0])


def symmetry_mirror(context: Context) -> Values:
    """Largest difference of a body's velocity from the mirror image of its partner's [m/s]; truth 0.

    In scenes tagged `symmetric`, whose mirror plane is x = 0. A body's partner starts at the mirror image of
    its place; on the mirror plane it is the body itself.
    """
    return _farthest(context, context.recording.linear_velocity)


def symmetry_offset(context: Context) -> Values:
    """Largest distance of a body's mass centre from the mirror image of its partner's [m]; truth 0.

    In the scenes of `symmetry_mirror`. A body off the mirror plane is twice as far from its own image.
    """
    return _farthest(context, context.mass_centers)


def _farthest(context: Context, vectors: Array) -> Values:
    """Largest difference of a body's vector (f, n, 3) from the mirror image of its partner's."""
    if "symmetric" not in context.scenario.tags:
        raise NotMeasured("not tagged symmetric: the scene is not its own mirror image")
    bodies, names = context.simulated, [body.name for body in context.scenario.bodies]
    start = context.mass_centers[0, bodies]
    apart = np.linalg.norm(start[:, None] * MIRROR - start, axis=2)
    partner, nearest = apart.argmin(axis=1), apart.min(axis=1)
    if nearest.max() > SAME_PLACE:
        raise NotMeasured(f"{names[bodies[int(nearest.argmax())]]} has no mirror image at the start")
    own = vectors[:, bodies]
    error = np.linalg.norm(own[:, partner] - own * MIRROR, axis=2).max(axis=0)
    return worst({names[body]: float(error[k]) for k, body in enumerate(bodies)})


SETTLED = 0.05
"""Time after an impact at which soft contacts have ended, 40 ms at most [s]."""


def impact_law(context: Context) -> Values:
    """Largest difference of a body's velocity after an impact from that by a law, over the speed before [1].

    The subjects are the laws of `scenarios/truths/impact_laws.py`; an engine follows the nearest.
    """
    try:
        time, laws = outcomes(context.scenario)
    except ValueError as error:
        raise NotMeasured(str(error)) from error
    r = context.recording
    frame = int(np.flatnonzero(r.time >= time + SETTLED - 1e-9)[0])
    found = r.linear_velocity[frame, context.simulated]
    speed = np.linalg.norm(r.linear_velocity[0, context.simulated], axis=1).max()
    if len(context.simulated) == 1:
        (body,) = context.simulated
        half = max(context.scenario.bodies[body].pieces[0].shape.half_extents)  # type: ignore[union-attr]
        found = np.array([found[0], r.angular_velocity[frame, body] * half])
    apart = {law: np.linalg.norm(found - velocity, axis=1).max() for law, velocity in laws.items()}
    return {law: float(size / speed) for law, size in apart.items()}


SHORTEST_ARC_FRAMES = 2.0
"""Least length of an arc that surely has a displayed frame near its middle [frames]."""


def bounce_height(context: Context) -> Values:
    """Height of each bounce of two frames or more against the closed form [relative]; -1 if there is none."""
    found = {}
    for truth in context.scenario.truths:
        body, g = context.scenario.body_index(truth.body), float(np.linalg.norm(context.gravity))
        ups = [a.velocity[2] for a in truth.arcs[1:] if a.velocity[2] > 0 > a.acceleration[2]]
        asked = [up**2 / (2 * g) for up in ups if 2 * up / g >= SHORTEST_ARC_FRAMES * context.frame]
        if not asked:
            continue
        fixed = next(k for k, kind in enumerate(context.kind) if kind == "fixed")
        seen = bounces(context, (min(body, fixed), max(body, fixed)))
        for k, height in enumerate(asked):
            reached = seen[k].departure ** 2 / (2 * g) if k < len(seen) else 0.0
            found[f"#{k + 1}"] = reached / height - 1
    return measured(found, "by the scene's truth nothing bounces")


def rotation_flip(context: Context) -> Values:
    """Largest error of the times at which a free top flips [s]; a missed flip counts until the end."""
    found = {}
    for truth in context.scenario.truths:
        if truth.law == "torque_free":
            asked = flips(context.scenario, truth)
            seen = _flips_seen(context, context.scenario.body_index(truth.body))
            seen = np.append(seen, np.full(max(0, len(asked) - len(seen)), context.scenario.duration))
            found[truth.body] = float(np.max(np.abs(seen[: len(asked)] - asked)))
    return measured(found, "the scene has no free top")


def _flips_seen(context: Context, body: int) -> np.ndarray:
    """Times at which the rate about the middle axis is zero, between frames by Euler's equations."""
    inertia = np.array(context.scenario.bodies[body].inertia)
    moments, axes = np.linalg.eigh(inertia)
    turned = Rotation.from_quat(context.recording.orientation[:, body], scalar_first=True)
    w = turned.inv().apply(context.recording.angular_velocity[:, body]) @ axes
    slope = (moments[2] - moments[0]) / moments[1] * w[:, 2] * w[:, 0] * np.linalg.det(axes)
    return np.asarray(CubicHermiteSpline(context.recording.time, w[:, 1], slope).roots(extrapolate=False))
