"""Where in a run a metric has its worst value: frame, bodies and what happened."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from touchstone.reports.assertions.outcome import Place
from touchstone.reports.metrics.contacts.contact import BOUNCE_SPEED
from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.context import Context, Value, Values
from touchstone.reports.metrics.motion.ballistic_arcs import bounces
from touchstone.reports.metrics.motion.energy import energy_rise, mechanical_energy

Locate = Callable[[Context, Values], Place]


def deepest(context: Context, values: Values) -> Place:
    """The pair and the frame of the deepest overlap."""
    distances = context.distances.distance
    pair = min(distances, key=lambda one: float(distances[one].min()))
    return Place(int(distances[pair].argmin()), _names(context, *pair))


def first_passage(context: Context, values: Values) -> Place:
    """The first passage of a body through another."""
    found = passages(context)
    if not found:
        return Place()
    first = found[0]
    return Place(int(first.time / context.frame), _names(context, first.a, first.b), "one through the other")


def largest_rise(context: Context, values: Values) -> Place:
    """The frame in which the energy exceeds its running minimum most, and the body that gained most in it."""
    rises = energy_rise(context)
    subject = max(rises, key=lambda name: float(rises[name].max()))
    rise = rises[subject]
    steepest = int(np.diff(rise, prepend=0.0).argmax())
    gains = {
        k: float(np.diff(mechanical_energy(context, [k]))[max(steepest - 1, 0)]) for k in context.simulated
    }
    body = max(gains, key=lambda k: gains[k]) if gains else None
    names = (context.scenario.bodies[body].name,) if body is not None else ()
    return Place(steepest, names, f"the steepest rise; the largest total is in frame {int(rise.argmax())}")


def largest_jump(context: Context, values: Values) -> Place:
    """The frame in which the total momentum changes most, and the body whose own changes most in it."""
    bodies = context.simulated
    momenta = context.recording.linear_velocity[:, bodies] * context.mass[bodies, None]
    steps = np.linalg.norm(np.diff(momenta.sum(axis=1), axis=0), axis=1)
    frame = int(steps.argmax())
    own = np.linalg.norm(momenta[frame + 1] - momenta[frame], axis=1)
    return Place(frame + 1, (context.scenario.bodies[bodies[int(own.argmax())]].name,), "the largest change")


def worst_contact(context: Context, values: Values) -> Place:
    """The contact whose tangential impulse exceeds the cone most, of the pair that the metric names."""
    rows = context.recording.contacts
    normal, tangential = context.impulses
    excess = np.linalg.norm(tangential, axis=1) - context.friction * np.maximum(normal, 0.0)
    value = values.get("", 0.0)
    named = value.reason.removeprefix("of ") if isinstance(value, Value) else ""
    pairs = [context.pair_name(int(a), int(b)) for a, b in zip(rows["body_a"], rows["body_b"])]
    if named:
        excess = np.where(np.array(pairs) == named, excess, -np.inf)
    k = int(excess.argmax())
    row = rows[k]
    across, bound = np.linalg.norm(tangential[k]), context.friction[k] * normal[k]
    words = f"|j_t| = {across:.3g} N s, mu j_n = {bound:.3g} N s"
    return Place(
        int(context.contact_frame[k]) + 1, _names(context, int(row["body_a"]), int(row["body_b"])), words
    )


def worst_bounce(context: Context, values: Values) -> Place:
    """The bounce whose restitution differs most from the requested one."""
    worst, place = -1.0, Place()
    for a, b in context.distances.distance:
        asked = context.scenario.pair_coefficients(a, b)[0]
        if not np.isfinite(context.distances.distance[a, b]).all():
            continue
        for bounce in bounces(context, (a, b)):
            off = abs(bounce.restitution - asked)
            if bounce.approach > BOUNCE_SPEED and off > worst:
                words = f"{bounce.restitution:.3f} at {bounce.approach:.2f} m/s, asked {asked:g}"
                worst, place = (
                    off,
                    Place(int(bounce.time / context.frame) + 1, _names(context, a, b), words),
                )
    return place


def unequal_paths(context: Context, values: Values) -> Place:
    """The bodies with the longest and the shortest path among those that differ in their heading."""
    ends = context.mass_centers[-1] - context.mass_centers[0]
    lengths = {
        t.body: float(np.linalg.norm(ends[context.scenario.body_index(t.body)]))
        for t in context.scenario.truths
    }
    far, near = max(lengths, key=lengths.__getitem__), min(lengths, key=lengths.__getitem__)
    remark = f"{lengths[far]:.4g} m and {lengths[near]:.4g} m from their start"
    return Place(len(context.recording.time) - 1, (far, near), remark)


def _names(context: Context, *bodies: int) -> tuple[str, ...]:
    return tuple(context.scenario.bodies[k].name for k in bodies)
