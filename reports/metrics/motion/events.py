"""Times and places of expected events: touch, roll, leave, land, meet, part."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from touchstone.reports.metrics.context import ROUNDING, Context, NotMeasured, Values
from touchstone.reports.metrics.motion.ballistic_arcs import (
    OPEN_GAP,
    TOUCH_GAP,
    Gap,
    first_closing,
    gap_of,
    last_opening,
)
from touchstone.scenarios.scenario import Expectation, Scenario

ROLL_SLIP = 0.01
"""Slip below which a contact rolls [m/s]."""
PART_GAP = 3e-3
"""Gap from which bodies have separated [m]: more than Bullet's margins of 1 mm round two hulls."""
PARTED = 0.1
"""Least duration of a separation [s]: an engine's contact may open for a moment."""


def event_time(event: str) -> Callable[[Context], Values]:
    """The metric of an event's time."""

    def measure(context: Context) -> Values:
        return {subject: _time(context, e) for subject, e in _expected(context, event).items()}

    measure.__doc__ = {
        "touch": "Time at which the pair's gap first closes to 1e-4 m [s].",
        "roll": "Time after the first touch at which the slip of the closed pair falls below 0.01 m/s [s].",
        "leave": "Time at which the pair's gap opens past 1e-3 m for good [s].",
        "land": "Time at which the pair's gap first closes after the last leave [s].",
        "meet": "Time at which the pair's gap closes to 1e-4 m within the time expected, open before [s].",
        "part": "Time at which the gap opens past 3e-3 m for 0.1 s in the time expected, not before [s].",
    }[event]
    return measure


def event_place(event: str) -> Callable[[Context], Values]:
    """The metric of a body's distance from its start at an event."""

    def measure(context: Context) -> Values:
        found = {}
        for subject, e in _expected(context, event).items():
            path = context.recording.position[:, context.scenario.body_index(e.body)]
            time = _time(context, e)
            now = [np.interp(time, context.recording.time, path[:, axis]) for axis in range(2)]
            found[subject] = float(np.hypot(now[0] - path[0, 0], now[1] - path[0, 1]))
        return found

    measure.__doc__ = f"Horizontal distance of the body from its start at `events.{event}` [m]."
    return measure


def subjects(scenario: Scenario) -> dict[tuple[str, str], Expectation]:
    """(event, subject) -> expectation; a pair that is expected several times is numbered."""
    found: dict[tuple[str, str], Expectation] = {}
    counts: dict[tuple[str, str], int] = {}
    keys = [(e.event, f"{e.body}-{e.other}") for e in scenario.expectations]
    for key, expectation in zip(keys, scenario.expectations):
        counts[key] = counts.get(key, 0) + 1
        event, pair = key
        found[event, f"{pair} #{counts[key]}" if keys.count(key) > 1 else pair] = expectation
    return found


def _expected(context: Context, event: str) -> dict[str, Expectation]:
    wanted = {subject: e for (name, subject), e in subjects(context.scenario).items() if name == event}
    if not wanted:
        raise NotMeasured(f"the scene expects no {event}")
    return wanted


def _time(context: Context, expectation: Expectation) -> float:
    gap = gap_of(context, context.expected_pairs[(expectation.body, expectation.other)])
    match expectation.event:
        case "touch":
            return first_closing(context, gap, 0.0)
        case "leave":
            return last_opening(context, gap)
        case "roll":
            return _roll(context, expectation)
        case "land":
            leaves = [_time(context, e) for e in context.scenario.expectations if e.event == "leave"]
            return first_closing(context, gap, max(leaves, default=0.0))
        case "meet":
            open_before = _at(context, gap, expectation.earliest) > TOUCH_GAP
            return first_closing(context, gap, expectation.earliest) if open_before else float("nan")
        case "part":
            return _parting(context, gap, expectation.earliest)


def _at(context: Context, gap: Gap, time: float) -> float:
    """The gap in the last frame up to `time` [m]."""
    return float(gap.gap[np.searchsorted(context.recording.time, time + ROUNDING, side="right") - 1])


def _parting(context: Context, gap: Gap, start: float) -> float:
    """First time after `start` at which the gap opens past PART_GAP and stays open for PARTED [s]. NaN if
    there is none, or if the gap is open for PARTED from `start`."""
    time, frames = context.recording.time, round(PARTED / context.frame)
    is_open = gap.gap > PART_GAP
    first = int(np.searchsorted(time, start + ROUNDING, side="right")) - 1
    if is_open[first : first + 1 + frames].all():
        return float("nan")
    for k in np.flatnonzero(~is_open[:-1] & is_open[1:] & (time[1:] > start)).tolist():
        if is_open[k + 1 : k + 1 + frames].all():
            return float(time[k] + context.frame * (PART_GAP - gap.gap[k]) / (gap.gap[k + 1] - gap.gap[k]))
    return float("nan")


def _roll(context: Context, expectation: Expectation) -> float:
    pair = context.expected_pairs[(expectation.body, expectation.other)][0]
    d, r = context.distances, context.recording
    point, normal = d.point[pair], d.normal[pair]
    velocity = [context.material_velocity(k, point, normal) for k in pair]
    slip = velocity[1] - velocity[0]
    slip -= np.einsum("fi,fi->f", slip, normal)[:, None] * normal
    speed = np.linalg.norm(slip, axis=1)
    touches = [_time(context, e) for e in context.scenario.expectations if e.event == "touch"]
    slid = False
    for k in range(len(r.time) - 1):
        if r.time[k] < max(touches, default=0.0) or d.distance[pair][k + 1] > OPEN_GAP:
            continue
        slid = slid or bool(speed[k] > ROLL_SLIP)
        if slid and speed[k + 1] <= ROLL_SLIP < speed[k]:
            return float(r.time[k] + context.frame * (speed[k] - ROLL_SLIP) / (speed[k] - speed[k + 1]))
    return float("nan")
