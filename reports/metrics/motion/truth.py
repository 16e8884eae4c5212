"""Errors against the closed form, in scenes that have one; each is that of the worst body."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Values, worst
from touchstone.scenarios.truths.body_motion import Motion


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
    fastest = _largest(context, lambda truth: truth.velocity, "moves")
    v = context.recording.linear_velocity
    return worst(
        {
            _name(context, body): float(np.linalg.norm(v[-1, body] - truth.velocity[-1]) / fastest)
            for body, truth in context.truths.items()
        }
    )


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
    fastest = _largest(context, lambda truth: truth.angular_velocity, "turns")
    w = context.recording.angular_velocity
    return worst(
        {
            _name(context, body): float(np.linalg.norm(w[-1, body] - truth.angular_velocity[-1]) / fastest)
            for body, truth in context.truths.items()
        }
    )


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
