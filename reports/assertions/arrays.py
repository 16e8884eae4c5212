"""Plain arrays of any simulator as a recording that metrics and assertions take."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchstone.adapters.contract import CONTACT_FIELDS, Array
from touchstone.adapters.recorder import scenario_json
from touchstone.adapters.recording import Recording
from touchstone.scenarios.scenario import ORIGIN, Scenario, Sphere

ARRAYS = "arrays"
"""Name of the engine in the manifest of a recording made from plain arrays."""
CONTACT_COLUMNS = ("time", "body_a", "body_b", "position", "normal", "distance", "impulse")
"""Fields of contacts that may be given; all but `distance` and `position` are needed."""
UNIT = 1e-3
"""Deviation of a quaternion's or a normal's length from 1 that is accepted [1]: single precision."""


def recording(
    scenario: Scenario,
    position: ArrayLike,
    orientation: ArrayLike | None = None,
    linear_velocity: ArrayLike | None = None,
    angular_velocity: ArrayLike | None = None,
    contacts: Mapping[str, ArrayLike] | NDArray[np.void] | None = None,
    *,
    dt: float | None = None,
) -> Recording:
    """Recording of a run of your own simulator, for the metrics and the assertions.

    Conventions of `adapters/contract.py`: SI units, z up, quaternions wxyz, velocity of the centre of mass,
    angular velocity along world axes, normals from A to B, impulses on B. f frames, n bodies of the scenario
    in its order; frame k is at k / `scenario.frame_rate`.

    Args:
        position: of the bodies' origins (f, n, 3) [m], world.
        orientation: (f, n, 4); may be left out where all moving bodies are balls.
        linear_velocity, angular_velocity: (f, n, 3) [m/s, rad/s]; without them energy, momentum, restitution
            and passages are not judged.
        contacts: of all steps, in time order: `time` [s] (c,), `body_a`, `body_b` (c,) as names or indices,
            `position` (c, 3), `normal` (c, 3), `distance` (c,), `impulse` (c, 3) [N s]; without them friction
            and restitution is not judged.
        dt: native step of the simulator [s]; None: a frame.
    Raises:
        ValueError: an array has the wrong shape or values; one line.
    """
    places = _checked("position", position, (len(np.asarray(position)), len(scenario.bodies), 3), scenario)
    frames = len(places)
    if frames < 2:
        raise ValueError(f"position: found {frames} frame(s), expected two or more")
    shape = (frames, len(scenario.bodies), 3)
    given = (("linear_velocity", linear_velocity), ("angular_velocity", angular_velocity))
    nothing = np.full(shape, np.nan)
    speed, spin = (nothing if v is None else _checked(k, v, shape, scenario) for k, v in given)
    step = 1 / scenario.frame_rate if dt is None else float(dt)
    if not np.isfinite(step) or step <= 0:
        raise ValueError(f"dt: found {dt}, expected seconds, such as 1/240")
    text = scenario_json(scenario)
    joints = sum(len(tracker.joints) for tracker in scenario.trackers)
    none = np.zeros(0)
    return Recording(
        scenario=text,
        manifest=json.dumps({"engine": ARRAYS, "profile": "", "dt": step, "contacts": contacts is not None}),
        time=np.arange(frames) / scenario.frame_rate,
        position=places,
        orientation=_orientations(orientation, (*shape[:2], 4), scenario),
        linear_velocity=speed,
        angular_velocity=spin,
        joint_angle=np.full((frames, joints), np.nan),
        joint_rate=np.full((frames, joints), np.nan),
        driver_work=np.full(frames, np.nan),
        driver_impulse=np.full((frames, len(scenario.trackers), 3), np.nan),
        contacts=_contacts(contacts, scenario),
        time_frame=none,
        time_drive=none,
        time_read=none,
        time_crossing=none,
        stage_names=np.array([], dtype=str),
        stage_seconds=np.zeros((0, 0)),
        work_names=np.array([], dtype=str),
        work=np.zeros((0, 0)),
    )


def _checked(name: str, given: ArrayLike, shape: tuple[int, ...], scenario: Scenario) -> Array:
    """The array as float64; raises ValueError if its shape differs or a value is not finite."""
    found = np.ascontiguousarray(given, dtype=float)
    if found.shape != shape:
        names = ", ".join(body.name for body in scenario.bodies)
        expected = ("frames", *shape[1:]) if name == "position" else shape
        raise ValueError(f"{name}: found the shape {found.shape}, expected {expected}; bodies are {names}")
    if not np.isfinite(found).all():
        frame, body = np.argwhere(~np.isfinite(found))[0][:2]
        raise ValueError(f"{name}: not finite in frame {frame} of body {scenario.bodies[body].name!r}")
    return found


def _orientations(given: ArrayLike | None, shape: tuple[int, ...], scenario: Scenario) -> Array:
    if given is None:
        turning = [body.name for body in scenario.bodies if body.kind != "fixed" and not _is_ball(body)]
        if turning:
            raise ValueError(f"orientation: needed, {turning[0]!r} is no ball")
        return np.tile([body.orientation for body in scenario.bodies], (shape[0], 1, 1))
    found = _checked("orientation", given, shape, scenario)
    length = np.linalg.norm(found, axis=2)
    if np.abs(length - 1).max() > UNIT:
        frame, body = np.unravel_index(np.abs(length - 1).argmax(), length.shape)
        name, most = scenario.bodies[body].name, length[frame, body]
        raise ValueError(
            f"orientation: the quaternion of {name!r} in frame {frame} has the length {most:.3g}"
        )
    return found / length[..., None]


def _is_ball(body: Any) -> bool:
    pieces = body.pieces
    return len(pieces) == 1 and isinstance(pieces[0].shape, Sphere) and pieces[0].position == ORIGIN


def _contacts(
    given: Mapping[str, ArrayLike] | NDArray[np.void] | None, scenario: Scenario
) -> NDArray[np.void]:
    """Contact rows, sorted by time, with A before B in the scenario."""
    if given is None:
        return np.zeros(0, CONTACT_FIELDS)
    if isinstance(given, np.ndarray):
        columns: dict[str, ArrayLike] = {name: given[name] for name in given.dtype.names or ()}
    else:
        columns = dict(given)
    needed = [name for name in CONTACT_COLUMNS if name not in ("position", "distance")]
    missing = [name for name in needed if name not in columns]
    unknown = [name for name in columns if name not in (CONTACT_FIELDS.names or ())]
    if missing or unknown:
        raise ValueError(
            f"contacts: {' and '.join(missing or unknown)} {'missing' if missing else 'unknown'}"
        )
    count = len(np.asarray(columns["time"]))
    rows = np.zeros(count, CONTACT_FIELDS)
    for name in (CONTACT_FIELDS.names or ())[7:]:
        rows[name] = np.nan
    for name, column in columns.items():
        values = _indices(column, scenario) if name.startswith("body") else np.asarray(column, dtype=float)
        if values.shape != rows[name].shape:
            raise ValueError(f"contacts: {name} has the shape {values.shape}, expected {rows[name].shape}")
        rows[name] = values
    _check_contacts(rows, scenario)
    flipped = rows["body_a"] > rows["body_b"]
    for name in ("normal", "impulse"):
        rows[name][flipped] *= -1
    rows["body_a"], rows["body_b"] = np.sort([rows["body_a"], rows["body_b"]], axis=0)
    return rows[np.argsort(rows["time"], kind="stable")]


def _indices(column: ArrayLike, scenario: Scenario) -> NDArray[np.int64]:
    """Indices of bodies given by name or index."""
    values = np.asarray(column)
    if values.dtype.kind in "iu" or not len(values):
        return values.astype(np.int64)
    index = {body.name: k for k, body in enumerate(scenario.bodies)}
    unknown = [name for name in values.tolist() if name not in index]
    if unknown:
        raise ValueError(f"contacts: no body {unknown[0]!r}; bodies are {', '.join(index)}")
    return np.array([index[name] for name in values.tolist()])


def _check_contacts(rows: NDArray[np.void], scenario: Scenario) -> None:
    pairs = set(scenario.touching_pairs())
    ends = np.sort([rows["body_a"], rows["body_b"]], axis=0).T
    for a, b in np.unique(ends, axis=0).tolist():
        if (a, b) not in pairs:
            k = int(np.flatnonzero((ends == (a, b)).all(axis=1))[0])
            raise ValueError(f"contacts: bodies {a} and {b} in row {k} cannot touch in {scenario.name!r}")
    for name in ("time", "normal", "impulse"):
        if not np.isfinite(rows[name]).all():
            raise ValueError(f"contacts: {name} is not finite")
    if len(rows) and np.abs(np.linalg.norm(rows["normal"], axis=1) - 1).max() > UNIT:
        raise ValueError("contacts: a normal has not the length 1")
