"""What a child process plays: tosses on an engine, and the search for the e and mu that fit them best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import ceil, exp, inf, log

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation, Slerp

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.reports.studies.tosses.measured import BEFORE_CONTACT, STILL, Box, Toss
from touchstone.scenarios.scenario import GRAVITY, PairCoefficients, Scenario, vector
from touchstone.scenarios.solids import block

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


Cell = tuple[float, float]
"""Restitution e and friction mu."""
RESTITUTIONS = (0.0, 0.25, 0.5)
FRICTIONS = (0.06, 0.12, 0.24, 0.48)
"""Lattice from whose best cell the search starts [1]."""
EVALUATIONS = 16
"""Cells that the search tries from there [1]: e and mu then change by about 3 %."""
NEAR_RESTITUTIONS = (0.0, 0.1, 0.2, 0.3, 0.4)
NEAR_FRICTIONS = (0.6, 0.75, 0.9, 1.0, 1.1, 1.3, 1.6)
"""Cells of which each toss may choose its own: e, and mu over the best one [1]."""
TOGETHER = 50
"""Boxes of one scene [1]: in the same time as one each, engines play many."""
LANE = 3.5
"""Distance between them [m]: with the least friction they slide one metre."""
ROUNDING = 1e-9
"""Of times in frames, and of e [1]."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Poses at times since the start of a flight [s]."""

    time: Array
    position: Array
    orientation: Rotation


@dataclass(frozen=True, slots=True)
class Flown:
    """A toss from the start of its flight until it rests: fitted start, another one within the fit's error,
    tracked motion, and the time of its first impact [s]."""

    start: State
    drawn: State
    tracked: Motion
    impact: float


@dataclass(frozen=True, slots=True)
class Table:
    """What all plays share: the box, the table's height [m], the noise of tracked positions [m], and the
    number of frames a second."""

    box: Box
    floor: float
    noise: float
    rate: int


@dataclass(frozen=True, slots=True)
class Errors:
    """Deviation of a played toss from the tracked one: at times since the latter's impact [s] of position [m]
    and rotation [rad], the mean distance of the corners since then [m], the delay of the impact [s], and
    whether it comes to rest on the same face."""

    time: Array
    position: Array
    rotation: Array
    corners: float
    delay: float
    same_face: bool


@dataclass(frozen=True, slots=True)
class Identified:
    """Result of `Identification`: the best cell, mean distance of the corners on the training half [m], and
    errors on the other half: with the best cell, between plays from the fitted and the drawn starts, and with
    the cell near the best that fits each toss best (none: not asked for)."""

    cell: Cell
    distance: float
    errors: list[Errors]
    drawn: list[Errors]
    floor: list[Errors]


@dataclass(frozen=True, slots=True)
class Identification:
    """Search of e and mu on the training half, and errors on the other half; `floor`: also with own e and mu
    of each toss. A task of the pool."""

    engine: str
    settings: Settings
    table: Table
    training: Sequence[Flown]
    judged: Sequence[Flown]
    floor: bool = False

    def play(self, engine: Engine) -> Identified:
        """Search in this process: the lattice on every second toss, then downhill from its best cell on all
        (Nelder & Mead)."""
        few = replace(self, training=self.training[::2])
        start = min(product(RESTITUTIONS, FRICTIONS), key=lambda cell: few.distance(engine, cell))
        e, mu = start[0], log(start[1])
        side, factor = RESTITUTIONS[1] / 2, log(FRICTIONS[1] / FRICTIONS[0]) / 2
        simplex = ((e, mu), (e + side, mu), (e, mu - factor))
        found = minimize(  # type: ignore[call-overload]
            lambda x: self.distance(engine, (float(x[0]), exp(float(x[1])))),
            np.array((e, mu)),
            method="Nelder-Mead",
            bounds=((0.0, 1.0), (None, None)),
            options={"maxfev": EVALUATIONS, "initial_simplex": np.array(simplex)},
        )
        if found.fun == inf:
            raise AdapterError("no e and mu of the lattice was played to its end")
        best = float(found.x[0]), exp(float(found.x[1]))
        fitted = self.motions(engine, best, self.judged)
        again = self.motions(engine, best, self.judged, drawn=True)
        selves = [replace(flown, tracked=one) for flown, one in zip(self.judged, fitted)]
        own = self.errors(self.judged, fitted)
        near = product((best[0], *NEAR_RESTITUTIONS), [best[1] * factor for factor in NEAR_FRICTIONS])
        several = [
            self.errors(self.judged, self.motions(engine, cell, self.judged)) for cell in near if self.floor
        ]
        floor = [min(each, key=lambda one: one.corners) for each in zip(*several)]
        return Identified(best, float(found.fun), own, self.errors(selves, again), floor)

    def errors(self, tosses: Sequence[Flown], played: Sequence[Motion]) -> list[Errors]:
        """Deviations of played tosses."""
        return [errors(self.table, *pair) for pair in zip(tosses, played)]

    def distance(self, engine: Engine, cell: Cell) -> float:
        """Mean distance of the corners over the training half [m]; infinite where a run does not end."""
        try:
            played = self.motions(engine, cell, self.training)
        except AdapterError:
            return inf
        return float(np.mean([one.corners for one in self.errors(self.training, played)]))

    def motions(
        self, engine: Engine, cell: Cell, tosses: Sequence[Flown], drawn: bool = False
    ) -> list[Motion]:
        """Motion of each toss at its tracked times."""
        table, found = self.table, []
        for first in range(0, len(tosses), TOGETHER):
            batch = tosses[first : first + TOGETHER]
            frames = ceil(max(flown.tracked.time[-1] for flown in batch) * table.rate - ROUNDING)
            starts = [flown.drawn if drawn else flown.start for flown in batch]
            played = record(engine, scene(table, starts, cell, frames), self.settings)
            lanes = _lanes(len(batch)) - (0.0, 0.0, table.floor)
            for k, flown in enumerate(batch):
                turned = Rotation.from_quat(played.orientation[:, 1 + k], scalar_first=True)
                found.append(
                    _at(flown.tracked.time, played.time, played.position[:, 1 + k] - lanes[k], turned)
                )
        return found


def play(engine: Engine, task: Identification) -> Identified:
    """Play a task in this process."""
    return task.play(engine)


def errors(table: Table, flown: Flown, played: Motion) -> Errors:
    """Deviation of a played toss from its tracked motion."""
    tracked = flown.tracked
    apart = table.box.corners(played.position, played.orientation) - table.box.corners(
        tracked.position, tracked.orientation
    )
    since = tracked.time - flown.impact
    height = played.position[:, 2]
    return Errors(
        since,
        np.linalg.norm(played.position - tracked.position, axis=1),
        np.asarray((played.orientation * tracked.orientation.inv()).magnitude()),
        float(np.linalg.norm(apart[since > 0], axis=-1).mean()),
        first_impact(played.time, height, flown.start, table.noise) - flown.impact,
        _face(played.orientation) == _face(tracked.orientation),
    )


def _face(orientation: Rotation) -> int:
    """Number of the face that is on top in the end, from 1 on; negative: the opposite one."""
    up = orientation[-1].as_matrix()[2]
    k = int(np.argmax(np.abs(up)))
    return (k + 1) * int(np.sign(up[k]))


def _at(times: Array, played: Array, position: Array, orientation: Rotation) -> Motion:
    """Motion at other times, by linear interpolation."""
    places = np.column_stack([np.interp(times, played, one) for one in position.T])
    return Motion(times, places, Slerp(played, orientation)(np.minimum(times, played[-1])))


def scene(table: Table, starts: Sequence[State], cell: Cell, frames: int) -> Scenario:
    """The boxes at their starts over the table, far apart."""
    (e, mu), box = cell, table.box
    boxes, reach = [], LANE * ceil(len(starts) ** 0.5)
    for k, (start, lane) in enumerate(zip(starts, _lanes(len(starts)))):
        body = block(
            f"toss_{k}", "box", box.half_extents, box.mass,
            vector(start.position - (0.0, 0.0, table.floor) + lane),
            tuple(start.orientation.as_quat(scalar_first=True).tolist()),
            velocity=vector(start.velocity), spin=vector(start.spin),
        )  # fmt: skip
        x, y, z = box.inertia
        boxes.append(replace(body, inertia=((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))))
    return Scenario(
        name="tosses",
        summary="measured tosses of a box",
        tags=("measured",),
        bodies=(block("table", "table", (reach, reach, 0.5), 0.0, (0.0, 0.0, -0.5), kind="fixed"), *boxes),
        duration=frames / table.rate,
        coefficients=(PairCoefficients("table", "box", e, mu), PairCoefficients("box", "box", e, mu)),
        frame_rate=table.rate,
    )


def _lanes(count: int) -> Array:
    """Places (count, 3) of a square of lanes around the origin [m]."""
    side = ceil(count**0.5)
    row, column = np.divmod(np.arange(count), side)
    middle = (side - 1) / 2
    return LANE * np.column_stack((column - middle, row - middle, np.zeros(count)))
