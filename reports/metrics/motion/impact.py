"""Laws of impact: which one an engine follows where several bodies touch, or friction acts off centre."""

from __future__ import annotations

import numpy as np

from touchstone.reports.metrics.context import Context, NotMeasured, Values
from touchstone.scenarios.truths.impact_laws import outcomes

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
    return {
        law: float(np.linalg.norm(found - velocity, axis=1).max() / speed) for law, velocity in laws.items()
    }
