"""The study `reality tosses`: every engine plays measured tosses from their fitted start.

Half of the tosses identify e and mu of each engine, the other half judges it. Beside the engines stand the
noise of tracking, what an engine makes of the error of the fitted start, and the floor: what the reference
leaves if each toss may choose its own e and mu.

A folder of tosses has `tosses.npz`, in the layout of the cube of contact-nets (Pfrommer, Halm & Posa 2020),
or one CSV file per toss with the columns `COLUMNS`; `body.toml` states the box if it is not that cube.
"""

from __future__ import annotations

import base64
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import ceil, exp, inf, log, nan
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import monotonic
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation, Slerp

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, installed
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.machine import machine, origin
from touchstone.reports.output_folder import output_folder
from touchstone.reports.page.html import Content
from touchstone.reports.page.page import page
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import EVERY_ENGINE
from touchstone.reports.runner.tasks import PROCESSES, played
from touchstone.reports.studies.study import (
    Column,
    RefusedError,
    failures,
    kept,
    missing_rows,
    page_text,
    with_interval,
)
from touchstone.reports.views.matrix import GOOD, WARN
from touchstone.reports.views.pictures import (
    DASHES,
    DOTS,
    INK,
    NOTHING,
    PALE,
    axis,
    by,
    color_of,
    grid,
    log_axis,
    rule,
    save,
)
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number
from touchstone.scenarios.files.safe_paths import DAMAGED, regular
from touchstone.scenarios.scenario import GRAVITY, PairCoefficients, Scenario, Vector, vector
from touchstone.scenarios.solids import block

ARCHIVE, BODY = "tosses.npz", "body.toml"
COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
"""Columns of a CSV file: time [s], position of the box' centre [m], unit quaternion from box to world; z is
up, the table is z = 0."""
RATE = 148.0
"""Samples a second of `tosses.npz` [1/s]."""
UNIT = 1e-3
"""Largest deviation of a quaternion's length from 1 [1]: five written digits."""
GAP = 1.5
"""Steps of time between two samples from which on one is missing [1]."""
RESTING = 0.05
"""Time at the end during which a toss rests [s]."""
STILL = 2e-3
"""Distance within which a tracked body rests [m]: several times the noise of tracking."""
LEVEL = 0.1
"""Largest height of a resting box' lower corners over the table [1], over the half edge that stands upright:
calibration of trackers leaves 0.02."""
BEFORE_CONTACT = 5
"""Last samples of a flight whose acceleration is measured [1]."""
FALL = 0.5
"""Largest deviation of that acceleration from gravity [1]: noise of 0.1 mm at 148 samples a second gives
0.07."""


@dataclass(frozen=True, slots=True)
class Box:
    """The box that is tossed: half edges [m], mass [kg], moments of inertia [kg m^2] along them."""

    half_extents: Vector
    mass: float
    inertia: Vector

    @property
    def width(self) -> float:
        """Mean edge [m]."""
        return 2 * float(np.mean(self.half_extents))

    def corners(self, position: Array, orientation: Rotation) -> Array:
        """Corners in the world (n, 8, 3) at n poses [m]."""
        own = np.array(list(product((-1.0, 1.0), repeat=3))) * self.half_extents
        return np.asarray(position[:, None] + own @ orientation.as_matrix().swapaxes(1, 2))


CUBE = Box((0.0524, 0.0524, 0.0524), 0.37, (8.1e-4, 8.1e-4, 8.1e-4))


@dataclass(frozen=True, slots=True)
class Toss:
    """A tracked motion of n samples: time [s], position [m], orientation; `low`: height of the lowest corner
    [m]; it rests from sample `rest` on."""

    name: str
    time: Array
    position: Array
    orientation: Rotation
    low: Array
    rest: int


def read(folder: Path) -> tuple[Box, list[Toss]]:
    """The box and all tosses of a folder.

    Raises:
        RefusedError: a file is absent, damaged, or not what it says; names file, toss and sample.
    """
    box = _box(folder / BODY) if (folder / BODY).exists() else CUBE
    if (folder / ARCHIVE).exists():
        found = list(_archive(folder / ARCHIVE))
    else:
        found = [_table(path) for path in sorted(folder.glob("*.csv"))]
    if not folder.is_dir():
        raise RefusedError(f"{folder}: no such folder")
    if not found:
        raise RefusedError(f"{folder}: expected {ARCHIVE}, or files .csv, each with a toss")
    return box, [_checked(box, *one) for one in found]


def _box(path: Path) -> Box:
    """The box of `body.toml`: `half_extents`, `mass` and `inertia`; without inertia it is uniform."""
    try:
        given = tomllib.loads(regular(path).read_text("utf-8"))
        half, mass = vector(given["half_extents"]), float(given["mass"])
        x, y, z = np.square(half)
        inertia = vector(given.get("inertia", mass / 3 * np.array((y + z, x + z, x + y))))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RefusedError(
            f"{path}: expected half_extents = [x, y, z] in m, mass in kg, and inertia = [x, y, z] in kg m2 "
            f"unless the box is uniform ({error})"
        ) from error
    if not (min(*half, mass, *inertia) > 0 and max(*half, mass, *inertia) < np.inf):
        raise RefusedError(f"{path}: expected positive numbers")
    if 2 * max(inertia) > sum(inertia):
        raise RefusedError(f"{path}: inertia: one moment exceeds the sum of the others: no body has these")
    return Box(half, mass, inertia)


def _archive(path: Path) -> Iterator[tuple[str, str, Array, Array, Array]]:
    """Place, name, time and poses of the tosses of an archive."""
    try:
        with np.load(regular(path), allow_pickle=False) as archive:
            names = ("first", "toss", "position", "orientation")
            first, number, position, orientation = (np.asarray(archive[name]) for name in names)
            count = len(position)
            bounds = [int(k) for k in first]
            if not (
                position.shape == (count, 3)
                and orientation.shape == (count, 4)
                and number.shape == (len(first) - 1,)
            ):
                raise ValueError("shapes of the arrays do not agree")
            if bounds[0] != 0 or bounds[-1] != count or (np.diff(bounds) <= 0).any():
                raise ValueError("first: expected increasing rows, from 0 to their number")
    except DAMAGED as error:
        reason = f"{error}".strip("'\"").partition("\n")[0]
        expected = "expected the arrays first, toss, position, orientation"
        raise RefusedError(f"{path}: {expected} ({reason})") from error
    for k, (start, end) in enumerate(pairwise(bounds)):
        time, poses = np.arange(end - start) / RATE, orientation[start:end].astype(float)
        yield f"{path}: toss {number[k]}", f"{number[k]}", time, position[start:end].astype(float), poses


def _table(path: Path) -> tuple[str, str, Array, Array, Array]:
    """Place, name, time and poses of the toss of a CSV file."""
    try:
        given = pd.read_csv(regular(path), skipinitialspace=True)
    except (OSError, ValueError) as error:
        raise RefusedError(f"{path}: not a table ({error})".partition("\n")[0]) from error
    if missing := [name for name in COLUMNS if name not in given]:
        raise RefusedError(f"{path}: no column {missing[0]!r}; expected {','.join(COLUMNS)}")
    values = given[list(COLUMNS)].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    return f"{path}", path.stem, values[:, 0], values[:, 1:4], values[:, 4:]


def _checked(box: Box, place: str, name: str, time: Array, position: Array, orientation: Array) -> Toss:
    """The toss, if its numbers are those of a box that flies, lands and comes to rest."""

    def refuse(wrong: ArrayLike, reason: Callable[[int], str]) -> None:
        for k in np.flatnonzero(np.asarray(wrong))[:1].tolist():
            raise RefusedError(f"{place}: sample {k}: {reason(k)}")

    finite = np.isfinite(np.column_stack((time, position, orientation))).all(axis=1)
    refuse(~finite, lambda k: "expected finite numbers: a gap in the tracking?")
    if len(time) < 2 * BEFORE_CONTACT:
        raise RefusedError(f"{place}: {len(time)} samples, expected at least {2 * BEFORE_CONTACT}")
    steps = np.diff(time, prepend=time[0] - 1)
    refuse(steps <= 0, lambda k: f"time {time[k]:g} s does not follow {time[k - 1]:g} s")
    step = float(np.median(steps[1:]))
    refuse(
        [False, *(steps[1:] > GAP * step)],
        lambda k: f"a gap of {steps[k]:.4g} s; samples are {step:.4g} s apart",
    )
    length = np.linalg.norm(orientation, axis=1)
    refuse(np.abs(length - 1) > UNIT, lambda k: f"quaternion of length {length[k]:.6g}, expected 1")

    turned = Rotation.from_quat(orientation, scalar_first=True)
    corners = box.corners(position, turned)[..., 2]
    low = corners.min(axis=1)
    resting = np.linalg.norm(position - position[-1], axis=1) < STILL
    rest = int(len(time) - np.argmin(np.append(resting[::-1], False)))
    upright = np.array(box.half_extents)[np.argmax(np.abs(turned[-1].as_matrix()[2]))]
    lower = np.sort(corners[-1])[:4] / upright
    if np.abs(lower).max() > LEVEL:
        edges = ", ".join(f"{half:g}" for half in box.half_extents)
        raise RefusedError(
            f"{place}: sample {len(time) - 1}: a resting box of half edges {edges} m has its "
            f"lower corners at z = 0, found {lower[0] * upright:.4g} to {lower[3] * upright:.4g} m: "
            "another body, lengths not in m, a table not at z = 0, or quaternions not wxyz?"
        )
    if time[-1] - time[min(rest, len(time) - 1)] < RESTING:
        raise RefusedError(f"{place}: it does not rest during its last {RESTING:g} s")
    landing = int(np.argmax(low < STILL))
    if landing < BEFORE_CONTACT:
        raise RefusedError(f"{place}: {landing} samples before it lands, expected at least {BEFORE_CONTACT}")
    flown = slice(landing - BEFORE_CONTACT, landing)
    fall = -2 * float(np.polyfit(time[flown] - time[landing], position[flown, 2], 2)[0])
    if abs(fall / GRAVITY - 1) > FALL:
        raise RefusedError(
            f"{place}: sample {landing}: it falls at {fall:.4g} m/s2 before it lands, expected {GRAVITY:g}: "
            "time not in s, or no free flight?"
        )
    return Toss(name, time - time[0], position, turned, low, rest)


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
        tosses = self.judged
        fitted = self.motions(engine, best, tosses)
        again = self.motions(engine, best, tosses, drawn=True)
        selves = [replace(flown, tracked=one) for flown, one in zip(tosses, fitted)]
        own = self.errors(tosses, fitted)
        near = product((best[0], *NEAR_RESTITUTIONS), [best[1] * factor for factor in NEAR_FRICTIONS])
        several = [self.errors(tosses, self.motions(engine, cell, tosses)) for cell in near if self.floor]
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
                place = played.position[:, 1 + k] - lanes[k]
                found.append(_at(flown.tracked.time, played.time, place, turned))
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


PANELS = (
    ("tosses.position", "error of position [widths]", 1.0),
    ("tosses.rotation", "error of rotation [degrees]", 180 / np.pi),
)
"""Metric, label and factor of a panel."""
BAND = "#d9e6f2"
FLOOR_NAME, START_NAME = "best e and mu of each toss", "reference, start off by its error"
OWN = ", start within its error"
"""Ending of the profile under which an engine is compared with itself from another start."""
BARS = 0.015
"""Distance of the bars of quartiles, over the width of a panel [1]."""


def errors_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw medians over the judged tosses, quartiles at rest; the floor; what an error of the start makes of
    the reference; and the noise of tracking."""
    panels = [_panel(frame[frame.metric == metric], label, factor) for metric, label, factor in PANELS]
    note = "median over tosses that identified neither e nor mu; bars: quartiles at rest; blue: tracking"
    save(grid(panels, 2), path, "Measured tosses: how far each engine is from what happened", note, size=10)


def _panel(rows: pd.DataFrame, label: str, factor: float) -> Any:
    rows = rows.assign(**{name: factor * rows[name] for name in ("low", "value", "high")})
    noise = float(rows[rows.engine == "tracking"].value.iloc[0])
    engines = [name for name in dict.fromkeys(rows.engine) if name in ENGINES]
    heads = {(name, False): name for name in engines}
    heads |= {("floor", False): FLOOR_NAME, ("reference", True): START_NAME}
    own = rows.profile.str.endswith(OWN)
    rows = rows.assign(engine=[heads.get(one, "") for one in zip(rows.engine, own)])
    lines = rows[(rows.subject != "") & (rows.engine != "")]
    lines = lines.assign(time=lines.subject.str.removesuffix(" s").astype(float))
    last = float(lines.time.max())
    bars = lines[(lines.time == last) & lines.engine.isin(engines)]
    bars = bars.assign(time=[last * (1 + BARS * k) for k in range(1, len(bars) + 1)])
    colors = {name: color_of(name) for name in engines} | {FLOOR_NAME: INK, START_NAME: PALE}
    dashes = {name: [1, 0] for name in engines} | {FLOOR_NAME: DASHES, START_NAME: DOTS}
    color, dash = by(alt.Color, "engine", colors), by(alt.StrokeDash, "engine", dashes)
    span = (float(lines.time.min()), last * (1 + BARS * (len(bars) + 1)))
    x = axis(alt.X, "time", "time after the first impact [s]", span, grid=False, tickCount=6)
    y = log_axis(alt.Y, "value", label, (noise / 3, float(lines.high.max())))
    spread = alt.Chart(bars).mark_rule(strokeWidth=4, strokeOpacity=0.4)
    drawn = (
        alt.Chart(NOTHING).mark_rect(color=BAND).encode(y=alt.datum(noise / 3), y2=alt.datum(noise))
        + alt.Chart(lines).mark_line(strokeWidth=2.2).encode(x=x, y=y, color=color, strokeDash=dash)
        + spread.encode(x=x, y="low:Q", y2="high:Q", color=color)
    )
    return (drawn + rule([], x=0)).properties(width=340, height=250)


STUDY, TOSSES, PICTURE = "reality tosses", "tosses", "tosses.png"
POSITION, ROTATION, IMPACT = f"{TOSSES}.position", f"{TOSSES}.rotation", f"{TOSSES}.impact"
FACE, CORNERS = f"{TOSSES}.face", f"{TOSSES}.corners"
TIMES = (f"{TOSSES}.wall", f"{TOSSES}.processor")
"""Time that all engines take together, and that of their processes [s]."""
REFERENCE: Column = ("reference", "balanced")
FLOOR, TRACKING = "floor", "tracking"
"""Names, beside the engines, of the floor and of what is measured."""
BEFORE, GRID = 0.05, 0.01
"""Time before the first impact from which errors are reported, and their steps [s]."""
AFTER_REST = 0.1
"""Time for which a toss at rest is compared [s]."""
CELLS = (1 + len(NEAR_RESTITUTIONS)) * len(NEAR_FRICTIONS)
DEGREES = 180 / np.pi
SHOWN = 0.1
"""Time after the first impact whose errors the table shows [s]."""


def tasks(columns: Sequence[Column]) -> list[Column]:
    """The columns of installed engines."""
    return [column for column in columns if installed(column[0])]


def run(
    columns: Sequence[Column], box: Box, tosses: Sequence[Toss], out: Path, progress: Progress
) -> pd.DataFrame:
    """Identify and judge all engines; the folder appears complete or not at all."""
    table, flown, rows = prepared(box, tosses)
    training, judged = flown[::2], flown[1::2]
    if not judged:
        raise RefusedError(f"tosses with a flight and an impact: {len(flown)}, expected 2 or more")
    asked = [
        Identification(one[0], settings(one, table.rate), table, training, judged, floor=one == REFERENCE)
        for one in tasks(columns)
    ]
    with output_folder(out) as folder:
        began = monotonic(), getrusage(RUSAGE_CHILDREN).ru_utime
        found = played(play, asked, folder / "output", progress)
        taken = monotonic() - began[0], getrusage(RUSAGE_CHILDREN).ru_utime - began[1]
        base = Row(STUDY, TOSSES, EVERY_ENGINE, "", nan, "run")
        rows += [replace(base, metric=name, value=value, unit="s") for name, value in zip(TIMES, taken)]
        for task, one in zip(asked, found):
            rows += rows_of_task(task, one)
        facts = {
            "study": STUDY,
            "tosses": [toss.name for toss in tosses],
            "body": {"half_extents": box.half_extents, "mass": box.mass, "inertia": box.inertia},
            "table height [m]": table.floor,
        }
        return kept(
            [*missing_rows(STUDY, columns), *rows],
            folder,
            facts,
            {PICTURE: errors_picture, "report.md": text, "report.html": page_of} if asked else {},
        )


def prepared(box: Box, tosses: Sequence[Toss], seed: int = 0) -> tuple[Table, list[Flown], list[Row]]:
    """What all plays share, the tosses from their flight on, and rows of what tracking shows: its noise, as
    the length of a vector, and tosses without an impact."""
    found, noise = flights(box, tosses)
    base = Row(STUDY, TOSSES, TRACKING, "", nan, "run")
    rng, flown, rows = np.random.default_rng(seed), [], []
    for toss, flight in zip(tosses, found):
        end = int(np.searchsorted(toss.time, toss.time[toss.rest - 1] + AFTER_REST))
        part = slice(flight.first, end)
        time = toss.time[part] - toss.time[flight.first]
        tracked = Motion(time, toss.position[part], toss.orientation[part])
        impact = first_impact(time, tracked.position[:, 2], flight.start, noise[0])
        if impact == impact:
            flown.append(Flown(flight.start, drawn(box, flight, noise, rng), tracked, impact))
        else:
            reason = f"toss {toss.name}: its height shows no impact"
            rows.append(replace(base, verdict="skipped", reason=reason))
    for metric, value, unit in ((POSITION, noise[0] / box.width, "1"), (ROTATION, noise[1], "rad")):
        rows.append(replace(base, metric=metric, value=float(np.sqrt(3) * value), unit=unit))
    halves = [np.abs(toss.orientation[-1].as_matrix()[2]) @ box.half_extents for toss in tosses]
    floor = float(np.median([toss.position[-1, 2] - half for toss, half in zip(tosses, halves)]))
    rate = max(round(1 / float(np.median(np.diff(toss.time)))) for toss in tosses)
    return Table(box, floor, float(noise[0]), rate), flown, rows


def settings(column: Column, rate: int) -> Settings:
    """Settings of a column at the largest step that divides a frame and is no larger than its own."""
    engine, profile = column
    own = ENGINES[engine].profiles[profile]
    return Settings(profile, 1 / rate / ceil(1 / rate / own - ROUNDING))


def rows_of_task(task: Identification, found: Identified | Ended) -> list[Row]:
    """Rows of an engine, of its plays from the drawn starts, and of the floor."""
    base = Row(STUDY, TOSSES, task.engine, task.settings.profile, task.settings.dt, "run")
    if isinstance(found, Ended):
        return [replace(base, verdict=found.status, reason=found.reason)]
    width = task.table.box.width
    numbers = (("e", found.cell[0]), ("mu", found.cell[1]), ("training", found.distance / width))
    rows = [replace(base, metric=f"{TOSSES}.{name}", value=value, unit="1") for name, value in numbers]
    rows += error_rows(base, found.errors, width)
    rows += error_rows(replace(base, profile=base.profile + OWN), found.drawn, width)
    if found.floor:
        rows += error_rows(replace(base, engine=FLOOR, profile=""), found.floor, width)
    return rows


def error_rows(base: Row, several: Sequence[Errors], width: float) -> list[Row]:
    """Median and quartiles over tosses of each error: over time, of the rest pose, of the impact; the mean of
    the corners' distance; positions over the box' width."""
    grid = np.arange(round(-BEFORE / GRID), round(max(one.time[-1] for one in several) / GRID) + 1) * GRID
    rows = []
    for metric, unit, size, values in (
        (POSITION, "1", width, [one.position for one in several]),
        (ROTATION, "rad", 1.0, [one.rotation for one in several]),
    ):
        over = [np.interp(grid, one.time, value, left=nan) / size for one, value in zip(several, values)]
        row = replace(base, metric=metric, unit=unit)
        for t, column in zip(grid, np.transpose(over)):
            rows.append(with_interval(replace(row, subject=f"{t:.2f} s"), _quartiles(column)))
        rest = replace(row, metric=f"{metric}.rest")
        rows.append(with_interval(rest, _quartiles([value[-1] / size for value in values])))
    delays = [one.delay for one in several]
    rows.append(with_interval(replace(base, metric=IMPACT, unit="s"), _quartiles(delays)))
    face, corners = (np.mean([getattr(e, name) for e in several]) for name in ("same_face", "corners"))
    for metric, value in ((FACE, face), (CORNERS, corners / width)):
        rows.append(replace(base, metric=metric, unit="1", value=float(value)))
    return rows


def _quartiles(values: ArrayLike) -> tuple[float, float, float]:
    low, middle, high = np.nanquantile(np.asarray(values, dtype=float), (0.25, 0.5, 0.75)).tolist()
    return middle, low, high


HEADS = ("", "e", "mu", "fit", "judged", "0.1 s", "[deg]", "rest", "[deg]", "start", "face", "impact [ms]")
NOTES = (
    "e, mu: identified on one half of the tosses. fit, judged: mean distance of the corners after the first "
    "impact, there and on the other half. Medians over that half: error of position and rotation 0.1 s after "
    "the impact and at rest; start: distance at rest of a play from another start that fits the flight as "
    "well; delay of the impact. face: share of tosses that rest on the right face. Lengths are in widths.",
    f"floor: the reference, for each toss with the best of {CELLS} e and mu. tracking: noise in free flight.",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per engine, the floor and the noise."""
    rows = []
    values = {(row.engine, row.profile, row.metric, row.subject): row.value for row in rows_of(frame)}
    for column in dict.fromkeys(key[:2] for key in values if not key[1].endswith(OWN)):
        at = f"{SHOWN:.2f} s" if column[0] != TRACKING else ""
        drawn = (column[0], column[1] + OWN)
        wanted = (
            *((column, f"{TOSSES}.{name}", "", 1) for name in ("e", "mu", "training", "corners")),
            (column, POSITION, at, 1),
            (column, ROTATION, at, DEGREES),
            (column, f"{POSITION}.rest", "", 1),
            (column, f"{ROTATION}.rest", "", DEGREES),
            (drawn, f"{POSITION}.rest", "", 1),
            (column, FACE, "", 1),
            (column, IMPACT, "", 1e3),
        )
        found = [factor * values.get((*key, metric, at), nan) for key, metric, at, factor in wanted]
        if not np.isnan(found).all():
            rows.append([" ".join(column), *("" if one != one else number(one) for one in found)])
    engines = {engine for engine, *_ in values if engine in ENGINES}
    wall, own = (values.get((EVERY_ENGINE, "", name, ""), nan) for name in TIMES)
    took = (
        f"{len(engines)} engines took {wall:.0f} s, {own:.0f} s of processor time in {PROCESSES} processes."
    )
    return [Part("Against measurements", HEADS, rows, (*NOTES, took), picture=PICTURE), failures(frame)]


def text(frame: pd.DataFrame, path: Path) -> None:
    """Write `report.md`."""
    path.write_text(page_text(STUDY, report(frame)), "utf-8")


def page_of(frame: pd.DataFrame, path: Path) -> None:
    """Write `report.html`, with the picture beside `path`."""
    (measured, rest), facts = report(frame), origin()
    ends = [row for row in rows_of(frame[frame.metric == f"{POSITION}.rest"]) if row.engine in ENGINES]
    found = [f"{one.engine} {number(one.value)}" for one in ends if not one.profile.endswith(OWN)]
    content = Content(
        f"touchstone {STUDY}",
        WARN if rest.lines else GOOD,
        f"Widths from where the box came to rest, median: {', '.join(found)}.",
        frame[:0],
        command=facts.pop("command"),
        identity=[*machine().items(), *facts.items()],
        measured=measured,
        picture=base64.b64encode((path.parent / PICTURE).read_bytes()).decode(),
    )
    path.write_text(page(content), "utf-8")
