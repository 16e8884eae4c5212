"""Mirror symmetry, in scenes that are their own mirror image."""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Values, worst

SAME_PLACE = 1e-9
"""Distance within which a body starts at the mirror image of another's place [m]: rounding."""
MIRROR = np.array([-1.0, 1.0, 1.0])
"""Reflection x -> -x."""


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
