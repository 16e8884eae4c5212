"""Times and places of expected events: touch, roll, leave, land, meet, part.

Times between frames at which a gap closes or opens, from the free arcs on both sides.

A displayed frame is too coarse to resolve a bounce. Positions and velocities are therefore extrapolated under
gravity, forward from the last free frame and backward from the next. The engine's own contacts are not used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import ROUNDING, Context, NotMeasured, Values
from touchstone.scenarios.scenario import TRACKED, Expectation, Scenario
from touchstone.scenarios.truths.pair_names import PairName

TOUCH_GAP = 1e-4
"""Gap below which bodies touch [m]."""
OPEN_GAP = 1e-3
"""Gap above which bodies have separated [m]: wider than any engine's contact margin."""
IMPACT_SPEED_CHANGE = 0.05
"""Change of the closing speed beyond gravity's from which an impact took place [m/s]."""

CLOSING_FRAMES = 1.5
"""Frames within which an arc must close for a velocity jump at its end to count as this pair's impact [1]."""


@dataclass(frozen=True, slots=True)
class Bounce:
    """A contact between two frames: its time [s], and the approach and departure speeds [m/s] along the
    normal at which the free arcs reach gap 0."""

    time: float
    approach: float
    departure: float

    @property
    def restitution(self) -> float:
        """Ratio of departure to approach speed."""
        return self.departure / self.approach


@dataclass(frozen=True, slots=True)
class Gap:
    """Signed distance of a pair over the frames, its rate, and its acceleration without contact: gravity for
    simulated bodies, the motion of the previous frame for driven and prescribed ones."""

    gap: Array
    rate: Array
    pull: Array


def gap_of(context: Context, pairs: list[tuple[int, int]]) -> Gap:
    """The gap of the nearest of several body pairs, per frame."""
    d = context.distances
    stacked = np.array([d.distance[pair] for pair in pairs])
    nearest = stacked.argmin(axis=0)
    frames = np.arange(stacked.shape[1])
    normal = np.array([d.normal[pair] for pair in pairs])[nearest, frames]
    rates, pulls = [], []
    for a, b in pairs:
        point = d.point[(a, b)]
        velocity = [context.surface_velocity(k, point) for k in (a, b)]
        pull = [_free_acceleration(context, k, v) for k, v in zip((a, b), velocity)]
        rates.append(velocity[1] - velocity[0])
        pulls.append(pull[1] - pull[0])
    rate = np.einsum("fi,fi->f", np.array(rates)[nearest, frames], normal)
    pull = np.einsum("fi,fi->f", np.array(pulls)[nearest, frames], normal)
    return Gap(stacked.min(axis=0), rate, pull)


def _free_acceleration(context: Context, body: int, velocity: Array) -> Array:
    if context.kind[body] == "simulated":
        return np.tile(context.gravity, (len(velocity), 1))
    change = np.zeros_like(velocity)
    if context.kind[body] in TRACKED:
        change[1:] = np.diff(velocity, axis=0) / context.frame
    return change


def bounces(context: Context, pair: tuple[int, int]) -> list[Bounce]:
    """Contacts between two free frames (a soft one may last several), with speeds from the free arcs."""
    g, h = gap_of(context, [pair]), context.frame
    free = np.flatnonzero(g.gap > TOUCH_GAP).tolist()
    found = []
    for k, m in pairwise(free):
        closing, opening = _closing(g, k, h), _closing(g, m, -h)
        if closing is None or opening is None or (m == k + 1 and not _kicked(g, k, h)):
            continue
        approach = _at_contact(g.rate[k] + g.pull[k] * closing, g.pull[k])
        departure = _at_contact(g.rate[m] + g.pull[m] * opening, g.pull[m])
        found.append(Bounce(context.recording.time[k] + closing, approach, departure))
    return found


def _at_contact(rate: float, pull: float) -> float:
    """Speed at gap 0 of an arc that reaches TOUCH_GAP with `rate`; at 1 m/s they differ by 0.1 %."""
    return float(np.sqrt(max(0.0, rate * rate - 2 * pull * TOUCH_GAP)))


def first_closing(context: Context, g: Gap, start: float) -> float:
    """First time after `start` at which the gap closes to TOUCH_GAP [s]; NaN if never."""
    h, time = context.frame, context.recording.time
    for k in range(len(g.gap) - 1):
        if time[k + 1] < start or g.gap[k] <= TOUCH_GAP:
            continue
        closed, kicked, closing = g.gap[k + 1] <= TOUCH_GAP, _kicked(g, k, h), _closing(g, k, h)
        if closing is not None and (closed or kicked):
            return float(time[k] + closing)
        if closed:
            return float(time[k] + h * (g.gap[k] - TOUCH_GAP) / (g.gap[k] - g.gap[k + 1]))
        # A driven body that accelerates is hit although its arc ends just short of the other body.
        if kicked and _closing(g, k, CLOSING_FRAMES * h) is not None:
            return float(time[k + 1])
    return float("nan")


def last_opening(context: Context, g: Gap) -> float:
    """Time at which the gap last opens past OPEN_GAP [s]; NaN if it never does or is closed at the end."""
    closed = np.flatnonzero(g.gap <= OPEN_GAP)
    if not len(closed) or closed[-1] + 1 >= len(g.gap):
        return float("nan")
    k = int(closed[-1])
    share = (OPEN_GAP - g.gap[k]) / (g.gap[k + 1] - g.gap[k])
    return float(context.recording.time[k] + share * context.frame)


def _closing(g: Gap, k: int, h: float) -> float | None:
    """Time relative to frame k at which the arc through it reaches TOUCH_GAP, the nearest to k; None if not
    within h. A negative h searches backward."""
    a, b, c = g.pull[k] / 2, g.rate[k], g.gap[k] - TOUCH_GAP
    roots = np.roots([a, b, c]) if a != 0 else np.array([-c / b] if b != 0 else [])
    real = [float(root.real) for root in roots if abs(root.imag) < 1e-12 and 0 <= root.real / h <= 1]
    return min(real, key=abs) if real else None


def _kicked(g: Gap, k: int, h: float) -> bool:
    """Whether the gap opens faster at frame k + 1 than gravity explains."""
    return bool(g.rate[k + 1] - (g.rate[k] + g.pull[k] * h) > IMPACT_SPEED_CHANGE)


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


def subjects(scenario: Scenario) -> dict[tuple[str, PairName], Expectation]:
    """(event, subject) -> expectation; a pair that is expected several times is numbered."""
    found: dict[tuple[str, PairName], Expectation] = {}
    keys = [(e.event, e.body, e.other) for e in scenario.expectations]
    for k, (event, body, other) in enumerate(keys):
        number = keys[: k + 1].count(keys[k]) if keys.count(keys[k]) > 1 else 0
        found[event, PairName(body, other, number)] = scenario.expectations[k]
    return found


def _expected(context: Context, event: str) -> dict[str, Expectation]:
    wanted: dict[str, Expectation] = {
        subject: e for (name, subject), e in subjects(context.scenario).items() if name == event
    }
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
            start = expectation.earliest
            before = np.searchsorted(context.recording.time, start + ROUNDING, side="right") - 1
            return first_closing(context, gap, start) if gap.gap[before] > TOUCH_GAP else float("nan")
        case "part":
            return _parting(context, gap, expectation.earliest)


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
