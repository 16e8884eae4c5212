"""Measured tosses of a box onto a level table: read from a folder, and checked.

A folder has `tosses.npz`, in the layout of the cube of contact-nets (Pfrommer, Halm & Posa 2020), or one CSV
file per toss with the columns `COLUMNS`; `body.toml` states the box if it is not that cube.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.studies.study import RefusedError
from touchstone.scenarios.files.safe_paths import DAMAGED, regular
from touchstone.scenarios.scenario import GRAVITY, Vector, vector

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
"""The cube of contact-nets."""


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
        raise RefusedError(
            f"{path}: expected the arrays first, toss, position, orientation ({reason})"
        ) from error
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
