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

from touchstone.adapters.contract import AdapterError, Array
from touchstone.scenarios.scenario import ShortRepr

FORMAT_VERSION = 3
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
