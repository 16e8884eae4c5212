"""Recording of a run: a struct of arrays, saved as .npz with its scenario and manifest as JSON.

Conventions as in `contract.py`. f frames (the initial one included), n bodies, t trackers, j hinges, s
displayed steps = f - 1.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import CONTACT_FIELDS, LARGEST_STATE, AdapterError, Array
from touchstone.scenarios.files.safe_paths import DAMAGED, regular
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario, ScenarioError, ShortRepr

FORMAT_VERSION = 3
FORGED = (ValueError, TypeError, LookupError, AttributeError, ArithmeticError, RecursionError)
"""Exceptions of the decoder on a text that is no scenario."""
MAPPINGS = ("settings", "bodies", "drives", "effects", "limits", "pieces")
"""Fields of a manifest that are tables."""
ROUNDING = 1e-9
"""Share by which rounding may move a time [1]."""
RESIDUAL_BODY = "residual.body"
"""Start of the counters that are indices of bodies."""
LARGEST = 2**33
"""Largest size of all arrays [bytes], 100 times that of our longest runs: an archive of zeros is small."""
TEXTS = ("scenario", "manifest", "ended")


class Numbers(NamedTuple):
    """Numbers that a field may hold: which of an array they are, and what a message calls them."""

    valid: Callable[[Array], NDArray[np.bool_]]
    expected: str


STATE = Numbers(
    lambda values: np.abs(values) < LARGEST_STATE, f"numbers of a magnitude below {LARGEST_STATE:g}"
)
FINITE = Numbers(np.isfinite, "finite numbers")
SECONDS = Numbers(lambda values: (values >= 0) & (values < inf), "finite numbers from 0 on")
FORCES = Numbers(lambda values: ~np.isinf(values), "finite numbers, or NaN")
ARRAYS = {
    "time": ("f", FINITE),
    "position": ("fn3", STATE),
    "orientation": ("fn4", STATE),
    "linear_velocity": ("fn3", STATE),
    "angular_velocity": ("fn3", STATE),
    "joint_angle": ("fj", STATE),
    "joint_rate": ("fj", STATE),
    "driver_work": ("f", FORCES),
    "driver_impulse": ("ft3", FORCES),
    "contacts": ("c", None),
    "time_frame": ("s", SECONDS),
    "time_drive": ("s", SECONDS),
    "time_read": ("s", SECONDS),
    "time_crossing": ("k", SECONDS),
    "stage_names": ("m", None),
    "stage_seconds": ("sm", FINITE),
    "work_names": ("w", None),
    "work": ("sw", FINITE),
}
"""Shape of each array, in letters as in the comments of `Recording`, and its numbers."""
CONTACTS = {
    **dict.fromkeys(("position", "normal", "distance"), STATE),
    **{f"velocity_{side}_{moment}": STATE for side in "ab" for moment in ("before", "after")},
    "impulse": FORCES,
}
"""Numbers of the fields of contacts."""


class RecordingError(AdapterError):
    """The file is not a recording of this format."""


class RunEnded(AdapterError):
    """The run ended before its scene, with the reason; `recording` holds the run until then."""

    def __init__(self, reason: str, recording: Recording) -> None:
        super().__init__(reason)
        self.recording = recording

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.recording)


@dataclass(frozen=True, slots=True, repr=False)
class Recording(ShortRepr):
    """A run of one engine on one scene. `scenario` and `manifest` are JSON texts."""

    scenario: str
    manifest: str
    time: Array  # (f,) [s]
    position: Array  # (f, n, 3)
    orientation: Array  # (f, n, 4)
    linear_velocity: Array  # (f, n, 3) of the centre of mass
    angular_velocity: Array  # (f, n, 3) world
    joint_angle: Array  # (f, j)
    joint_rate: Array  # (f, j)
    driver_work: Array  # (f,) [J] done by the drives since the start; NaN if they are kinematic
    driver_impulse: Array  # (f, t, 3) [N s] on each root by its drive since the start; NaN as above
    contacts: NDArray[np.void]  # CONTACT_FIELDS, all contact points of all native steps, in time order
    time_frame: Array  # (s,) [s] native step calls of a displayed frame
    time_drive: Array  # (s,) [s] setting commands from Python
    time_read: Array  # (s,) [s] reading the state
    time_crossing: Array  # (k,) [s] an empty call into the engine
    stage_names: NDArray[np.str_]  # (m,)
    stage_seconds: Array  # (s, m)
    work_names: NDArray[np.str_]  # (w,)
    work: Array  # (s, w) summed over a displayed frame; the maximum for RESIDUAL_COUNTERS
    ended: str = ""  # why the run ended before its scene; empty if it did not fail

    @property
    def facts(self) -> dict:
        """Manifest as a dictionary."""
        return json.loads(self.manifest)

    def save(self, path: Path) -> None:
        """Write to `path` atomically (to a file beside it, then rename); raises RecordingError for numbers
        that `load` would refuse."""
        part = path.with_name(path.name + ".part")
        columns = {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}
        try:
            _check_numbers(columns)
            with open(part, "wb") as file:
                np.savez_compressed(file, format_version=np.array(FORMAT_VERSION), **columns)  # type: ignore[arg-type]
            os.replace(part, path)
        except ValueError as error:
            raise RecordingError(f"{path.name}: {error}") from error
        finally:
            part.unlink(missing_ok=True)


@lru_cache(maxsize=32)
def scene_of_text(text: str) -> Scenario:
    """The scenario of a recording's JSON text; raises ValueError with one line if there is none."""
    from touchstone.scenarios.files.read import NAME, named, scenario_of
    from touchstone.scenarios.files.schema import checked, model_of

    try:
        data, faults = checked(_decoded(text), model_of(Scenario))
        if faults:
            place, reason = faults[0]
            raise ValueError(f"{named(place)}: {reason}")
        if not NAME.fullmatch(data["name"]):
            raise ValueError(f"name: found {data['name'][:100]!r}, which names no file")
        return scenario_of(data)
    except ScenarioError as error:
        raise ValueError(": ".join(error.faults[0])) from error
    except FORGED as error:
        raise ValueError(_first_line(error)) from error


def load(path: str | Path) -> Recording:
    """Read a recording; raises RecordingError with the reason if the file is not one of this format."""
    columns = _columns(Path(path))
    version = columns.pop("format_version", np.array(-1))
    if version.shape or version.dtype.kind not in "iu" or version != FORMAT_VERSION:
        found = version if version.size == 1 else "none"
        raise RecordingError(f"{path}: format version {found}, this program reads {FORMAT_VERSION}")
    wanted = {f.name for f in fields(Recording)}
    if set(columns) != wanted:
        raise RecordingError(f"{path}: fields {sorted(wanted ^ set(columns))} are missing or unknown")
    try:
        _check(columns)
    except ValueError as error:
        raise RecordingError(f"{path}: {error}") from error
    texts = {name: str(columns.pop(name)) for name in TEXTS}
    return Recording(**texts, **columns)  # type: ignore[arg-type]


def _columns(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of an archive by name; raises RecordingError."""
    place = f"{path}"
    try:
        with np.load(regular(path), allow_pickle=False) as archive:
            size = sum(info.file_size for info in archive.zip.infolist())
            if size > LARGEST:
                raise RecordingError(f"{path}: {size} bytes of arrays, expected at most {LARGEST}")
            columns = {}
            for name in archive.files:
                place = f"{path}: {name}"
                columns[name] = np.asarray(archive[name])
        return columns
    except RecordingError:
        raise
    except FileNotFoundError as error:
        raise RecordingError(f"{path}: no such file") from error
    except DAMAGED as error:
        raise RecordingError(f"{place}: not a recording ({_first_line(error)})") from error


def _check(columns: Mapping[str, NDArray[Any]]) -> None:
    """Raise ValueError, which names the field, where types, shapes or texts are not those of a recording."""
    for name in TEXTS:
        if columns[name].shape or columns[name].dtype.kind != "U":
            raise ValueError(f"{name}: found {_kind(columns[name])}, expected a text")
    _writable("ended", str(columns["ended"]))
    try:
        scenario = scene_of_text(str(columns["scenario"]))
    except ValueError as error:
        raise ValueError(f"scenario: damaged, or of another version: {error}") from error
    _check_manifest(str(columns["manifest"]), scenario)
    time, shown = columns["time"], columns["time_frame"]
    if time.ndim != 1 or time.dtype != float or not len(time):
        raise ValueError(f"time: found {_kind(time)}, expected one frame or more")
    if len(time) > scenario.frame_count + 1:
        raise ValueError(
            f"time: found {plural(len(time), 'frame')}, expected at most {scenario.frame_count + 1}"
        )
    if not (np.abs(time * scenario.frame_rate - np.arange(len(time))) < ROUNDING).all():
        raise ValueError(f"time: expected {scenario.frame_rate} frames a second, the first at 0 s")
    sizes = {
        "f": len(time),
        "s": len(time) - 1 if shown.size else 0,  # without times where no engine played
        "n": len(scenario.bodies),
        "t": len(scenario.trackers),
        "j": sum(len(tracker.joints) for tracker in scenario.trackers),
    } | {digit: int(digit) for digit in "34"}
    for name, (letters, _) in ARRAYS.items():
        found, text = columns[name], name.endswith("_names")
        kind = CONTACT_FIELDS if name == "contacts" else np.dtype(float)
        if found.dtype.kind != "U" if text else found.dtype != kind:
            raise ValueError(f"{name}: found {_kind(found)}, expected {'texts' if text else kind.name}")
        if found.ndim == len(letters):
            sizes = dict(zip(letters, found.shape)) | sizes
        expected = tuple(sizes.get(letter, letter) for letter in letters)
        if found.shape != expected:
            raise ValueError(f"{name}: found the shape {found.shape}, expected {expected}")
        if text:
            _writable(name, *found.tolist())
    _check_numbers(columns)


def _check_numbers(columns: Mapping[str, NDArray[Any]]) -> None:
    """Raise ValueError where arrays, whose shapes are those of a recording, hold numbers that no run has."""
    for name, (_, numbers) in ARRAYS.items():
        if numbers and not numbers.valid(columns[name]).all():
            raise ValueError(f"{name}: expected {numbers.expected}")
    count = columns["position"].shape[1]
    bodies = np.char.startswith(columns["work_names"], RESIDUAL_BODY)
    if not np.isin(columns["work"][:, bodies], np.arange(-1, count)).all():
        raise ValueError(f"work: {RESIDUAL_BODY}: expected indices of bodies, or -1")
    rows, end = columns["contacts"], columns["time"][-1] * (1 + ROUNDING)
    for name in ("body_a", "body_b"):
        if not ((rows[name] >= 0) & (rows[name] < count)).all():
            raise ValueError(f"contacts: {name}: expected indices of {plural(count, 'body')}")
    if not ((rows["time"] >= 0) & (rows["time"] <= end)).all():
        raise ValueError("contacts: time: expected times of the run")
    for name, numbers in CONTACTS.items():
        if not numbers.valid(rows[name]).all():
            raise ValueError(f"contacts: {name}: expected {numbers.expected}")


def _check_manifest(text: str, scenario: Scenario) -> None:
    """Raise ValueError where the manifest lacks what every run has, or is that of other bodies."""
    try:
        facts = _decoded(text)
        engine, profile, dt = facts["engine"], facts["profile"], facts["dt"]
    except FORGED as error:
        raise ValueError(
            f"manifest: expected JSON with engine, profile and dt ({_first_line(error)})"
        ) from error
    if not isinstance(engine, str) or not isinstance(profile, str):
        raise ValueError("manifest: engine, profile: expected texts")
    frame = 1 / scenario.frame_rate
    if not isinstance(dt, int | float) or not 0 < dt <= frame * (1 + ROUNDING):
        raise ValueError(f"manifest: dt: found {str(dt)[:100]}, expected seconds, at most a frame")
    for name in MAPPINGS:
        if not isinstance(facts.get(name, {}), dict):
            raise ValueError(f"manifest: {name}: expected a table")
    if not all(isinstance(state, str) for state in facts.get("effects", {}).values()):
        raise ValueError("manifest: effects: expected texts")
    names = {body.name for body in scenario.bodies}
    if unknown := sorted(facts.get("bodies", {}).keys() - names):
        raise ValueError(f"manifest: bodies: {unknown[0]!r} is not in the scene")


def _decoded(text: str) -> Any:
    """Value of a JSON text; raises ValueError or RecursionError if it is none."""
    data = json.loads(text)
    _writable("JSON", json.dumps(data, ensure_ascii=False))
    return data


def _writable(name: str, *texts: str) -> None:
    """Raise ValueError where texts hold half of a surrogate pair, which no file in UTF-8 can."""
    try:
        "".join(texts).encode()
    except UnicodeEncodeError as error:
        raise ValueError(f"{name}: expected characters of UTF-8 ({error.reason})") from error


def _kind(array: NDArray[Any]) -> str:
    return f"{array.dtype.name} of the shape {array.shape}" if array.shape else array.dtype.name


def _first_line(error: BaseException) -> str:
    return f"{error}".partition("\n")[0][:100] or type(error).__name__
