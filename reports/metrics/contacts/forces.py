"""Contact forces per pair of bodies: the normal impulses that an engine reports, over displayed frames.

A frame's force is the sum of its normal impulses over its duration, so that engines with different steps
compare. Links count as their driven body.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values
from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.named_pairs import named_pairs


def contact_forces(context: Context) -> dict[str, Array]:
    """Normal force per pair that presses (s,) [N], in the displayed steps; in the order of the bodies."""
    met, which = context.met
    pressing = np.maximum(context.impulses[0], 0.0)
    found: dict[str, Array] = {}
    for k, pair in enumerate(met):
        mine = which == k
        if pressing[mine].any():
            steps = context.contact_frame[mine]
            impulse = np.bincount(steps, pressing[mine], minlength=len(context.recording.time) - 1)
            name = context.owner_pair(*pair)
            found[name] = found.get(name, 0.0) + impulse / context.frame
    return found


def force_series(context: Context) -> dict[str, Array]:
    """`contact_forces` at the end of each step (f,) [N]; NaN at the start, before any step."""
    return {name: np.concatenate(([np.nan], force)) for name, force in contact_forces(context).items()}


def _of_pairs(context: Context, figure: Callable[[Array], float]) -> Values:
    found = {name: figure(force) for name, force in contact_forces(context).items()}
    if not found:
        raise NotMeasured("no contact presses")
    return found


def force_mean(context: Context) -> Values:
    """Mean normal force of a pair over the frames in which it presses [N]."""
    return _of_pairs(context, lambda force: float(force[force != 0].mean()))


def force_peak(context: Context) -> Values:
    """Largest normal force of a pair, as the mean over a displayed frame [N]."""
    return _of_pairs(context, lambda force: float(force.max()))


def force_impulse(context: Context) -> Values:
    """Integral of the normal force of a pair over the run [N s]."""
    return _of_pairs(context, lambda force: float(force.sum() * context.frame))


def force_error(context: Context) -> Values:
    """Normal force or impulse of a pair over its closed form, less 1 [1]; truth 0; the worst window."""
    if not context.scenario.forces:
        raise NotMeasured("the scene states no force")
    played = len(context.recording.time) - 1
    found: dict[str, Value] = {}
    for truth in context.scenario.forces:
        first, end = truth.frames(context.scenario.frame_rate)
        if end > played:
            raise NotMeasured("the end was not played")
        value = _mean_force(context, truth, first, end)
        unit = "N"
        if truth.quantity == "impulse":
            value, unit = value * (end - first) * context.frame, "N s"
        error = value / truth.value - 1
        text = f"{value:.6g} of {truth.value:.6g} {unit} from {truth.start:g} to {truth.end:g} s"
        name = f"{truth.body}-{truth.other}"
        if name not in found or abs(error) > abs(found[name].value):
            found[name] = Value(error, text)
    return found


def _mean_force(context: Context, truth: ForceTruth, first: int, end: int) -> float:
    """Mean normal force of a pair of names over the steps from `first` to `end` - 1 [N]."""
    wanted = named_pairs(context.scenario, truth.body, truth.other)
    met, which = context.met
    rows = np.isin(which, [k for k, pair in enumerate(met) if pair in wanted])
    rows &= (context.contact_frame >= first) & (context.contact_frame < end)
    return float(np.maximum(context.impulses[0][rows], 0.0).sum() / ((end - first) * context.frame))
