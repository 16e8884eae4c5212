"""Free flight of a tracked toss before its first impact: its state, its noise, and when it ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.studies.tosses.measured import BEFORE_CONTACT, STILL, Box, Toss
from touchstone.scenarios.scenario import GRAVITY

OUTLIER = 4.0
"""Deviation from a flight, over the noise of tracking, from which on a sample is not part of it [1]."""
CORRECTIONS = 20
"""Most corrections of a rotation's fit [1]; it converges in about five."""
CONVERGED = 1e-9
"""Correction of a rotation's fit that ends it [rad; rad/s]."""
INTEGRATED = 1e-9
"""Relative error of the integrated rotation [1]."""


@dataclass(frozen=True, slots=True)
class State:
    """Start of a flight: position [m], velocity [m/s], orientation and angular velocity [rad/s], world."""

    position: Array
    velocity: Array
    orientation: Rotation
    spin: Array


@dataclass(frozen=True, slots=True)
class Flight:
    """Fit over samples `first` to `last` (excluded) of a toss.

    `residual` (n, 2, 3) are the deviations of position [m] and rotation [rad]; `covariance` (2, 2) that of
    the start's value and rate, over the variance of the noise [1, 1/s, 1/s^2], for each coordinate.
    """

    first: int
    last: int
    start: State
    residual: Array
    covariance: Array


def flights(box: Box, tosses: Sequence[Toss]) -> tuple[list[Flight], Array]:
    """Flight of each toss, and the noise of tracking: standard deviations of position [m], rotation [rad].

    A flight ends before the lowest corner is within STILL of the table, and begins as early as its samples
    fit the ballistic arc of the later ones to OUTLIER of the noise: before, a hand still holds the box.
    """
    last = [int(np.argmax(toss.low < STILL)) for toss in tosses]
    shortest = [_arc(toss, end - BEFORE_CONTACT, end)[1] for toss, end in zip(tosses, last)]
    sigma = float(np.sqrt(np.median([np.sum(one**2) / (3 * (len(one) - 2)) for one in shortest])))
    found = [_fit(box, toss, _beginning(toss, end, sigma), end) for toss, end in zip(tosses, last)]
    freedom = 3 * sum(len(one.residual) - 2 for one in found)
    squares = np.sum([np.sum(one.residual**2, axis=(0, 2)) for one in found], axis=0)
    return found, np.sqrt(squares / freedom)


def _beginning(toss: Toss, last: int, sigma: float) -> int:
    """Earliest sample of the flight that ends before sample `last`."""
    first = last - BEFORE_CONTACT
    while first > 0:
        fit, _ = _arc(toss, first, last)
        step = toss.time[first - 1] - toss.time[first]
        basis = np.array((1.0, step))
        times = toss.time[first:last] - toss.time[first]
        spread = sigma * np.sqrt(1 + basis @ _covariance(times) @ basis)
        off = toss.position[first - 1] - basis @ fit
        off[2] += GRAVITY * step**2 / 2
        if np.abs(off).max() > OUTLIER * spread:
            break
        first -= 1
    return first


def _basis(times: Array) -> Array:
    return np.column_stack((np.ones(len(times)), times))


def _covariance(times: Array) -> Array:
    basis = _basis(times)
    return np.asarray(np.linalg.inv(basis.T @ basis))


def _arc(toss: Toss, first: int, last: int) -> tuple[Array, Array]:
    """Position and velocity (2, 3) at sample `first` of the arc through the samples, and their deviations."""
    times = toss.time[first:last] - toss.time[first]
    straight = toss.position[first:last].copy()
    straight[:, 2] += GRAVITY * times**2 / 2
    fit = np.linalg.lstsq(_basis(times), straight, rcond=None)[0]
    return np.asarray(fit), straight - _basis(times) @ fit


def _fit(box: Box, toss: Toss, first: int, last: int) -> Flight:
    """Fit of position and rotation: corrections of the latter are fitted lines of its rotation vectors."""
    times = toss.time[first:last] - toss.time[first]
    fit, off = _arc(toss, first, last)
    measured = toss.orientation[first:last]
    begin, spin = measured[0], (measured[1] * measured[0].inv()).as_rotvec() / times[1]
    for _ in range(CORRECTIONS):
        turned = (measured * rotated(begin, spin, times, box).inv()).as_rotvec()
        change = np.linalg.lstsq(_basis(times), turned, rcond=None)[0]
        begin, spin = Rotation.from_rotvec(change[0]) * begin, spin + change[1]
        if np.abs(change).max() < CONVERGED:
            break
    residual = np.stack((off, turned - _basis(times) @ change), axis=1)
    return Flight(first, last, State(fit[0], fit[1], begin, spin), residual, _covariance(times))


def rotated(begin: Rotation, spin: Array, times: Array, box: Box) -> Rotation:
    """Orientations of the free box at times from 0 on: Euler's equations, with the angular velocity `spin` in
    the world at the start [rad/s]."""
    inertia = np.array(box.inertia)

    def rate(_: float, state: Array) -> Array:
        (a, x, y, z), (u, v, w) = state[:4], state[4:]
        # angular velocity in the box' frame: q' = q w / 2
        turning = (
            -x * u - y * v - z * w,
            a * u + y * w - z * v,
            a * v + z * u - x * w,
            a * w + x * v - y * u,
        )
        return np.array((*np.array(turning) / 2, *(-np.cross(state[4:], inertia * state[4:]) / inertia)))

    start = [*begin.as_quat(scalar_first=True), *begin.inv().apply(spin)]
    run = solve_ivp(rate, (0.0, times[-1]), start, "DOP853", times, rtol=INTEGRATED, atol=INTEGRATED)
    return Rotation.from_quat(run.y[:4].T, scalar_first=True)


def drawn(box: Box, flight: Flight, noise: Array, rng: np.random.Generator) -> State:
    """A start within the fit's error: value and rate of each coordinate from their joint distribution."""
    off = rng.multivariate_normal(np.zeros(2), flight.covariance, size=(2, 3)) * noise[:, None, None]
    start = flight.start
    return State(
        start.position + off[0, :, 0],
        start.velocity + off[0, :, 1],
        Rotation.from_rotvec(off[1, :, 0]) * start.orientation,
        start.spin + off[1, :, 1],
    )


def first_impact(time: Array, height: Array, start: State, noise: float) -> float:
    """Time of the first impact [s] of a motion from `start` at time[0], by its centre's height (n,) [m].

    The height leaves the ballistic arc along a line: the one through the first sample that is OUTLIER of the
    noise above the arc, and the next, crosses it at the impact. NaN if none leaves it.
    """
    since = time - time[0]
    off = height - (start.position[2] + start.velocity[2] * since - GRAVITY * since**2 / 2)
    k = int(np.argmax(off > OUTLIER * noise))
    if not 0 < k < len(time) - 1 or off[k + 1] <= off[k]:
        return float(time[k]) if k else float("nan")
    crossing = time[k] - off[k] * (time[k + 1] - time[k]) / (off[k + 1] - off[k])
    return float(np.clip(crossing, time[max(k - 2, 0)], time[k]))
