"""Loads on prescribed platforms: lifted, carried along, left behind, and shaken across and along gravity."""

from dataclasses import replace
from math import asin, cos, pi, sin

import numpy as np
from scipy.optimize import brentq

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.tracking import keyframed, sample
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import (
    GRAVITY,
    Body,
    Box,
    PairCoefficients,
    Piece,
    Scenario,
    Truth,
)
from touchstone.scenarios.solids import block
from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.published import Published

TAGS = ("prescribed",)
DECK = (1.0, 0.5, 0.05)
"""Half extents of the platform [m]."""
LOAD = (0.1, 0.1, 0.05)
"""Half extents of the load [m]: too flat to tip over at these accelerations."""
MASS, MU = 1.0, 0.3
"""Mass of the load [kg], friction between load and platform [1]."""
ACROSS, UP = np.array((1.0, 0.0, 0.0)), np.array((0.0, 0.0, 1.0))
RAMP = 0.1
"""Time in which an acceleration changes [s]."""
FREQUENCY, PERIODS = 2.0, 4
"""Frequency of the shakers [1/s], and how many periods they shake."""
KEYFRAMES_PER_PERIOD = 30
"""Keyframes of a shaker: its spline deviates from a sine by 1e-5 of the amplitude."""

WESTERMO = (
    "Westermo & Udwadia (1983), Earthquake Eng. Struct. Dyn. 11, 135: a block on a base a sin(w t) sticks "
    "for mu g >= a, slides throughout for mu g < 0.537 a, and slips and sticks between"
)
NEWMARK = "Newmark (1965), Géotechnique 15, 139: u = V^2 / (2 g N) (1 - N / A) after a pulse A g"

Phases = tuple[tuple[float, float, float], ...]
"""Durations [s], and accelerations at the start and at the end of each, linear between them [m/s^2]."""


@scene
def platform_lift() -> Scenario:
    """The load follows; the platform bears 12.81, 9.81 and 6.81 N per kg while it starts, moves and stops."""
    phases = _there(3.0, speeding=0.45, steady=0.4)
    scene = _platform("platform_lift", "a platform lifts a load and stops", UP, *_path(phases), duration=2.0)
    return _with_forces(scene, (0.1, 0.4), (0.65, 0.9), (1.1, 1.4), (1.7, 2.0))


@scene
def platform_stick() -> Scenario:
    """The platform accelerates at less than mu g = 2.943 m/s^2: the load moves with it."""
    phases = _there(2.9, speeding=0.35, steady=0.2)
    summary = "a load sticks to a platform that starts and stops at 2.9 m/s2, below mu g"
    scene = _platform("platform_stick", summary, ACROSS, *_path(phases), duration=1.5)
    value = Published("slip", "load", "distance", 0.0, 1e-4, WESTERMO, 0.0, 1.5, other="platform")
    return _published(_with_forces(scene, (0.1, 1.5)), value)


@scene
def platform_slip() -> Scenario:
    """The platform accelerates at more than mu g: the load slides back, catches up, slides on and stops."""
    phases = _there(4.5, speeding=0.4, steady=0.4)
    summary = "a load slides on a platform that starts and stops at 4.5 m/s2, above mu g"
    return _with_forces(_platform("platform_slip", summary, ACROSS, *_path(phases), duration=2.0), (0.1, 2.0))


@scene
def shaker_across() -> Scenario:
    """A sine of twice mu g across gravity: the load slides to and fro, and sticks between."""
    summary = "a load slides on a platform shaken sideways at 2 mu g"
    path, duration = _sine(2 * MU * GRAVITY), PERIODS / FREQUENCY
    scene = _platform("shaker_across", summary, ACROSS, *path, duration)
    # it slides throughout and turns round near 0.803 s and 1.053 s: the speed rises and falls at mu g
    period = 1 / FREQUENCY
    stroke = MU * GRAVITY * period**2 / 16
    value = Published("stroke", "load", "distance", stroke, 0.01 * stroke, WESTERMO, 0.8, 1.05)
    return _published(_with_forces(scene, (0.1, duration)), value)


@scene
def shaker_stick_slip() -> Scenario:
    """A sine of 4/3 mu g across gravity: the load slips and sticks in each half of a period."""
    share, rate, duration = 0.75, 2 * pi * FREQUENCY, PERIODS / FREQUENCY
    largest = MU * GRAVITY / share
    scene = _platform(
        "shaker_stick_slip",
        "a load slips and sticks on a platform shaken sideways at 4/3 mu g",
        ACROSS,
        *_sine(largest),
        duration,
    )
    # it slips from sin(first) = share until the speeds agree, and sticks near 0.4 s and 0.65 s
    first = asin(share)
    last = brentq(lambda x: cos(first) - cos(x) - share * (x - first), first + 0.3, 2 * pi)
    slip = (last - first) * cos(first) - (sin(last) - sin(first)) - share * (last - first) ** 2 / 2
    slip *= largest / rate**2
    value = Published(
        "slip", "load", "distance", slip, 0.01 * slip, WESTERMO, 0.4, 0.65, other="platform"
    )  # fmt: skip
    return _published(scene, value)


PULSE, PUSHED = 0.5, 0.3
"""Acceleration of Newmark's base [g], and how long it acts [s]."""
RESISTANCES = {0.2: 0.9, 0.3: 0.6}
"""Friction of the load on that base [1] -> duration of the scene [s]: it sticks at V / (N g)."""


@scene
def newmark_blocks() -> tuple[Scenario, ...]:
    """A pulse sets a base in motion; the load on it slides back until it is as fast."""
    return tuple(_newmark(resistance, duration) for resistance, duration in RESISTANCES.items())


def _newmark(resistance: float, duration: float) -> Scenario:
    # a pulse that ends within a millisecond; the base stops after the end of the scene
    a, edge = PULSE * GRAVITY, 1e-3
    pushed = PUSHED - edge / 2
    phases = ((pushed, a, a), (edge, a, 0.0), (duration, 0.0, 0.0), (edge, 0.0, -a), (pushed, -a, -a))
    name = f"newmark_{resistance:g}".replace(".", "")
    summary = f"a load slides back on a base that a pulse of {PULSE:g} g sets in motion, mu = {resistance:g}"
    scene = _platform(name, summary, ACROSS, *_path(phases), duration, resistance)
    slip = (a * PUSHED) ** 2 / (2 * GRAVITY * resistance) * (1 - resistance / PULSE)
    value = Published(
        "slip", "load", "distance", slip, 0.01 * slip, NEWMARK, 0.0, duration, other="platform"
    )  # fmt: skip
    return _published(scene, value)


def _published(scene: Scenario, value: Published) -> Scenario:
    """Scene that states a published value, with the tag of those."""
    tags = tuple(dict.fromkeys((*scene.tags, "literature")))
    return replace(scene, tags=tags, published=(value,))


@scene
def shaker_along() -> Scenario:
    """A sine of 0.8 g along gravity: the load never leaves the platform."""
    summary = "a load stays on a platform shaken up and down at 0.8 g"
    path, duration = _sine(0.8 * GRAVITY), PERIODS / FREQUENCY
    return _with_forces(_platform("shaker_along", summary, UP, *path, duration), (0.9, 1.1), (1.15, 1.35))


def _platform(
    name: str,
    summary: str,
    direction: Array,
    times: Array,
    places: Array,
    duration: float,
    mu: float = MU,
) -> Scenario:
    """A load of 1 kg on a platform that moves by `places` (n,) [m] along a direction."""
    start = np.array((0.0, 0.0, -DECK[2]))
    end = max(duration, times[-1])
    times, places = (np.append(x, last) for x, last in ((times, end), (places, places[-1])))
    keep = np.append(np.diff(times) > 0, True)
    times, places = times[keep], places[keep]
    path = keyframed("platform", times, [start + place * direction for place in places])
    return Scenario(
        name=name,
        summary=summary,
        tags=TAGS,
        bodies=(
            Body("platform", "prescribed", "wood", (Piece("platform", Box(DECK)),)),
            block("load", "wood", LOAD, MASS, (0.0, 0.0, LOAD[2])),
        ),
        trackers=(path,),
        coefficients=(PairCoefficients("wood", "wood", 0.0, mu),),
        duration=duration,
        truths=(Truth("load", "carried"),),
    )


def _with_forces(scene: Scenario, *windows: tuple[float, float]) -> Scenario:
    """Scene that states the mean normal force on its load in time windows [s], which the load spends on the
    platform: m (g + change of the platform's upward velocity over the window)."""
    forces = []
    for start, end in windows:
        first, last = sample(scene.trackers[0], np.array((start, end))).linear_velocity[:, 2]
        mean = MASS * (GRAVITY + (last - first) / (end - start))
        forces.append(ForceTruth("platform", "load", start, end, float(mean)))
    return replace(scene, forces=tuple(forces))


def _there(acceleration: float, speeding: float, steady: float) -> Phases:
    """Phases from rest to rest: full acceleration for `speeding` [s] from the start on, constant speed for
    `steady` [s], and as much deceleration, with ramps between."""
    return (
        (speeding, acceleration, acceleration),
        (RAMP, acceleration, 0.0),
        (steady, 0.0, 0.0),
        (RAMP, 0.0, -acceleration),
        (speeding - RAMP / 2, -acceleration, -acceleration),
        (RAMP, -acceleration, 0.0),
    )


def _path(phases: Phases) -> tuple[Array, Array]:
    """Times [s] of the phases' ends and places [m] then: the spline through them is the path itself, because
    its second derivative is linear in between and continuous."""
    times, places, speed = [0.0], [0.0], 0.0
    for length, first, last in phases:
        times.append(times[-1] + length)
        places.append(places[-1] + speed * length + (2 * first + last) * length**2 / 6)
        speed += (first + last) * length / 2
    return np.array(times), np.array(places)


def _sine(largest: float) -> tuple[Array, Array]:
    """Times [s] and places [m] of a cosine of FREQUENCY that starts at rest, with its largest acceleration
    [m/s^2]."""
    times = np.linspace(0.0, PERIODS / FREQUENCY, PERIODS * KEYFRAMES_PER_PERIOD + 1)
    rate = 2 * pi * FREQUENCY
    return times, largest / rate**2 * (1 - np.cos(rate * times))
