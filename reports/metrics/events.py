"""What must have happened, and when: touch, roll, leave, land."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reports.metrics.arcs import OPEN_GAP, first_closing, gap_of, last_opening
from reports.metrics.evidence import Evidence, NotMeasured, Values
from scenarios.scenario import Expectation

ROLL_SLIP = 0.01
"""Slip below which a contact rolls [m/s]."""


def event_time(event: str) -> Callable[[Evidence], Values]:
    """The metric that tells when an event happened."""

    def measure(evidence: Evidence) -> Values:
        return {f"{e.body}-{e.other}": _time(evidence, e) for e in _expected(evidence, event)}

    measure.__doc__ = {
        "touch": "Time at which the pair's gap first closes to 1e-4 m [s].",
        "roll": "Time after the first touch at which the slip of the closed pair falls below 0.01 m/s [s].",
        "leave": "Time at which the pair's gap opens past 1e-3 m for good [s].",
        "land": "Time at which the pair's gap first closes after the last leave [s].",
    }[event]
    return measure


def event_place(event: str) -> Callable[[Evidence], Values]:
    """The metric that tells how far a body had come when an event happened."""

    def measure(evidence: Evidence) -> Values:
        found = {}
        for e in _expected(evidence, event):
            path = evidence.recording.position[:, evidence.scenario.body_index(e.body)]
            time = _time(evidence, e)
            now = [np.interp(time, evidence.recording.time, path[:, axis]) for axis in range(2)]
            found[f"{e.body}-{e.other}"] = float(np.hypot(now[0] - path[0, 0], now[1] - path[0, 1]))
        return found

    measure.__doc__ = f"Horizontal distance of the body from its start at `events.{event}` [m]."
    return measure


def _expected(evidence: Evidence, event: str) -> list[Expectation]:
    wanted = [e for e in evidence.scenario.expectations if e.event == event]
    if not wanted:
        raise NotMeasured(f"the scene expects no {event}")
    return wanted


def _time(evidence: Evidence, expectation: Expectation) -> float:
    gap = gap_of(evidence, evidence.expected_pairs[(expectation.body, expectation.other)])
    match expectation.event:
        case "touch":
            return first_closing(evidence, gap, 0.0)
        case "leave":
            return last_opening(evidence, gap)
        case "roll":
            return _roll(evidence, expectation)
        case "land":
            leaves = [_time(evidence, e) for e in evidence.scenario.expectations if e.event == "leave"]
            return first_closing(evidence, gap, max(leaves, default=0.0))


def _roll(evidence: Evidence, expectation: Expectation) -> float:
    pair = evidence.expected_pairs[(expectation.body, expectation.other)][0]
    d, r = evidence.distances, evidence.recording
    point, normal = d.point[pair], d.normal[pair]
    slip = evidence.surface_velocity(pair[1], point) - evidence.surface_velocity(pair[0], point)
    slip -= np.einsum("fi,fi->f", slip, normal)[:, None] * normal
    speed = np.linalg.norm(slip, axis=1)
    touches = [_time(evidence, e) for e in evidence.scenario.expectations if e.event == "touch"]
    slid = False
    for k in range(len(r.time) - 1):
        if r.time[k] < max(touches, default=0.0) or d.distance[pair][k + 1] > OPEN_GAP:
            continue
        slid = slid or bool(speed[k] > ROLL_SLIP)
        if slid and speed[k + 1] <= ROLL_SLIP < speed[k]:
            return float(r.time[k] + evidence.frame * (speed[k] - ROLL_SLIP) / (speed[k] - speed[k + 1]))
    return float("nan")
