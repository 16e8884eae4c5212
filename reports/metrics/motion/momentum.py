"""Momentum that appears or vanishes, in scenes tagged `isolated`."""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Values
from touchstone.reports.metrics.motion.energy import spin

MOMENTUM_ROUNDING = 1e-12
"""Angular momentum over (sum m |v|) times the distance of the centres below which it is rounding [1]."""


def momentum_linear(context: Context) -> Values:
    """Largest change of the sum of m v over the sum of m |v| at the start [1]; truth 0."""
    momenta = _momenta(context)
    change = np.linalg.norm(momenta.sum(axis=1) - momenta[0].sum(axis=0), axis=1)
    return {"": float(change.max() / _pace(momenta))}


def momentum_angular(context: Context) -> Values:
    """Largest change of the sum of L about the common centre over the largest sum of |L| [1]; truth 0."""
    momenta = _momenta(context)
    mass = context.mass[context.simulated]
    places = context.mass_centers[:, context.simulated]
    arms = places - np.average(places, axis=1, weights=mass)[:, None]
    drift = momenta.sum(axis=1) / mass.sum()
    turning = np.cross(arms, momenta - mass[:, None] * drift[:, None])
    for k, body in enumerate(context.simulated):
        r = context.recording
        turning[:, k] += spin(context, body, r.orientation[:, body], r.angular_velocity[:, body])
    scale = np.linalg.norm(turning, axis=2).sum(axis=1).max()
    if scale <= MOMENTUM_ROUNDING * _pace(momenta) * np.linalg.norm(arms, axis=2).max():
        raise NotMeasured("nothing turns")
    change = np.linalg.norm(turning.sum(axis=1) - turning[0].sum(axis=0), axis=1)
    return {"": float(change.max() / scale)}


def momentum_withheld(context: Context) -> Values:
    """Share of the momentum missing at the end from the body that should carry all of it [1]; truth 0."""
    momenta = _momenta(context)
    speeds = {k: np.linalg.norm(truth.velocity[[0, -1]], axis=1) for k, truth in context.truths.items()}
    giver, taker = ([k for k, speed in speeds.items() if speed[end] > 0] for end in (0, 1))
    if not len(giver) == len(taker) == 1 or giver == taker:
        raise NotMeasured("by the scene's truth no body hands all its momentum to another")
    before = momenta[0].sum(axis=0)
    after = momenta[-1, context.simulated.index(taker[0])]
    return {context.scenario.bodies[taker[0]].name: float(1 - after @ before / (before @ before))}


def _momenta(context: Context) -> Array:
    """m v of the simulated bodies (f, n, 3) [kg m/s]."""
    if "isolated" not in context.scenario.tags:
        raise NotMeasured("not tagged isolated: something outside pushes")
    bodies = context.simulated
    return np.asarray(context.recording.linear_velocity[:, bodies] * context.mass[bodies, None])


def _pace(momenta: Array) -> float:
    return float(np.linalg.norm(momenta[0], axis=1).sum())
