"""Assertions on two runs of one scene: the same bits again, and the same motion in another order of
bodies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.reports.assertions.invariants import context_of, source_of
from touchstone.reports.assertions.outcome import Finding, InvariantError, Place, settled
from touchstone.scenarios.scenario import Scenario

ORDER_TOLERANCE = 1e-6
"""Distance by which bodies may end apart where only their order differs [m]: that at which contacts are
found."""
FIELDS = ("position", "orientation", "linear_velocity", "angular_velocity", "joint_angle", "joint_rate")


def assert_deterministic(first: Recording, second: Recording, scenario: Scenario | None = None) -> float:
    """Two runs of one scene are equal to the bit, contacts included; returns 0."""
    context = context_of(first, scenario)
    source = source_of(context)
    _require_ended(first, second, "determinism", source)
    if first.position.shape != second.position.shape:
        raise InvariantError(f"{source}: the runs have {len(first.time)} and {len(second.time)} frames")
    place, worst = Place(), 0.0
    for name in FIELDS:
        one, two = getattr(first, name), getattr(second, name)
        same = (one == two) | (np.isnan(one) & np.isnan(two))
        if not same.all():
            frame, k = np.argwhere(~same)[0][:2]
            if place.frame is None or frame < place.frame:
                body = () if name.startswith("joint") else (context.scenario.bodies[int(k)].name,)
                place = Place(int(frame), body, f"the first difference, in {name}")
            worst = max(worst, float(np.nanmax(np.abs(one - two))))
    if place.frame is None and not _same_contacts(first, second):
        place, worst = Place(None, (), "the contacts differ"), max(worst, 1.0)
    time = None if place.frame is None else float(first.time[place.frame])
    reason = "equal to the bit"
    return settled((Finding("determinism", worst, "1", 0.0, reason, source, place, time),))


def _same_contacts(first: Recording, second: Recording) -> bool:
    names = first.contacts.dtype.names or ()
    return len(first.contacts) == len(second.contacts) and all(
        np.array_equal(
            first.contacts[name], second.contacts[name], equal_nan=name not in ("body_a", "body_b")
        )
        for name in names
    )


def assert_order_independent(
    first: Recording,
    second: Recording,
    scenario: Scenario | None = None,
    reordered: Scenario | None = None,
    limit: float = ORDER_TOLERANCE,
) -> float:
    """Bodies of the same name move equally, to within the limit [m], in two runs whose scenes differ in the
    order of their bodies only."""
    context, other = context_of(first, scenario), context_of(second, reordered)
    source = source_of(context)
    _require_ended(first, second, "order independence", source)
    names = [body.name for body in context.scenario.bodies]
    theirs = [body.name for body in other.scenario.bodies]
    if sorted(names) != sorted(theirs):
        raise InvariantError(f"{source}: the scenes do not have the same bodies")
    if names == theirs:
        raise InvariantError(f"{source}: order independence could not be judged: the order is the same")
    frames = min(len(first.time), len(second.time))
    at = [theirs.index(name) for name in names]
    apart = np.linalg.norm(first.position[:frames] - second.position[:frames, at], axis=2)
    frame, body = (int(k) for k in np.unravel_index(apart.argmax(), apart.shape))
    over = np.flatnonzero((apart > limit).any(axis=1))
    remark = f"first beyond the limit in frame {over[0]}" if len(over) else ""
    place = Place(frame, (names[body],), remark)
    reason = "contacts are found to within it" if limit == ORDER_TOLERANCE else "as given"
    finding = Finding(
        "order", float(apart.max()), "m", limit, reason, source, place, float(first.time[frame])
    )
    return settled((finding,))


def _require_ended(first: Recording, second: Recording, what: str, source: str) -> None:
    ended = first.ended or second.ended
    if ended:
        raise InvariantError(f"{source}: {what} could not be judged: the run ended before its scene: {ended}")


def reordered(scenario: Scenario) -> Scenario:
    """The scenario with its bodies in reverse order; raises ValueError for driven bodies, whose links have an
    order of their own."""
    if scenario.trackers:
        raise ValueError(f"{scenario.name!r} has a driven body: its links cannot be reordered")
    return replace(scenario, bodies=scenario.bodies[::-1])
