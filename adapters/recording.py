"""Recording of a run: a struct of arrays, saved as .npz with its scenario and manifest as JSON.

Conventions as in `contract.py`. f frames (the initial one included), n bodies, t trackers, j hinges, s
displayed steps = f - 1.
"""

from __future__ import annotations

import json
import os
import tokenize
import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import CONTACT_FIELDS, AdapterError, Array, State
from touchstone.adapters.vector_products import cross, turned

FORMAT_VERSION = 3
CONTACTS_AT_ONCE = 4096
"""Contacts whose velocities are computed at once: arrays of some 2 MB."""
DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    EOFError,
    NotImplementedError,  # zipfile: an unknown method of compression
    SyntaxError,  # a damaged header of an array is parsed as Python
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions of numpy and zipfile on damaged files or files of another format."""


class RecordingError(AdapterError):
    """The file is not a recording of this format."""


class RunEnded(AdapterError):
    """The run ended before its scene, with the reason; `recording` holds the run until then."""

    def __init__(self, reason: str, recording: Recording) -> None:
        super().__init__(reason)
        self.recording = recording


@dataclass(frozen=True, slots=True)
class Recording:
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
        """Write to `path` atomically (to a file beside it, then rename)."""
        part = path.with_name(path.name + ".part")
        try:
            with open(part, "wb") as file:
                columns = {f.name: np.asarray(getattr(self, f.name)) for f in fields(self)}
                np.savez_compressed(file, format_version=np.array(FORMAT_VERSION), **columns)  # type: ignore[arg-type]
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)


def load(path: Path) -> Recording:
    """Read a recording; raises RecordingError with the reason if the file is not one of this format."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            columns = {name: archive[name] for name in archive.files}
    except DAMAGED as error:
        reason = f"{error}".partition("\n")[0][:100]
        raise RecordingError(f"{path}: not a recording ({reason})") from error
    version = int(columns.pop("format_version", np.array(-1)))
    if version != FORMAT_VERSION:
        raise RecordingError(f"{path}: format version {version}, this program reads {FORMAT_VERSION}")
    wanted = {f.name for f in fields(Recording)}
    if set(columns) != wanted:
        raise RecordingError(f"{path}: fields {sorted(wanted ^ set(columns))} are missing or unknown")
    texts = {name: str(columns.pop(name)) for name in ("scenario", "manifest", "ended")}
    return Recording(**texts, **columns)  # type: ignore[arg-type]


class ContactLog:
    """Contacts of all steps; `count` is their number.

    If the engine knows no time of impact, velocities are those at the step's start and end. They are computed
    for many steps at once: arrays of a few rows cost as much time as arrays of hundreds.
    """

    def __init__(self, mass_center: Array) -> None:
        self.count = 0
        self._mass_center = mass_center
        self._done: list[np.ndarray] = []
        self._steps: list[tuple[np.ndarray, ...]] = []
        self._waiting = 0

    def add(self, time: float, before: State, after: State) -> None:
        """Keep the contacts of a step that starts at `time` [s]."""
        count = after.contact_count
        if not count:
            return
        rows = after.contacts[:count].copy()
        own = rows["time"]
        rows["time"] = np.where(np.isnan(own), time, time + own)
        bodies = np.array((rows["body_a"], rows["body_b"]))
        places = before.position[bodies], before.orientation[bodies], self._mass_center[bodies]
        moving = [one[bodies] for s in (before, after) for one in (s.linear_velocity, s.angular_velocity)]
        self._steps.append((rows, *places, *moving))
        self.count += count
        self._waiting += count
        if self._waiting >= CONTACTS_AT_ONCE:
            self._finish()

    def rows(self) -> np.ndarray:
        """All contacts so far, as CONTACT_FIELDS."""
        self._finish()
        return np.concatenate([np.zeros(0, CONTACT_FIELDS), *self._done])

    def _finish(self) -> None:
        """Fill in the velocities that the engine leaves NaN."""
        if not self._steps:
            return
        parts = list(zip(*self._steps))
        rows = np.concatenate(parts[0])
        position, orientation, center, *moving = (np.concatenate(part, axis=1) for part in parts[1:])
        arm = rows["position"] - (position + turned(orientation, center))
        for moment, linear, angular in zip(("before", "after"), moving[::2], moving[1::2]):
            for side, own in zip("ab", linear + cross(angular, arm)):
                column = rows[f"velocity_{side}_{moment}"]
                column[:] = np.where(np.isnan(column), own, column)
        self._done.append(rows)
        self._steps, self._waiting = [], 0
