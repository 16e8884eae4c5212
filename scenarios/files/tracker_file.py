"""Keyframes of a tracker in a file of their own.

CSV: a header `time,x,y,z,qw,qx,qy,qz`, then the names of the tracker's joints, in any order, each with
`.angle` or without it. NPZ: arrays `time` (k,) [s], `position` (k, 3) [m], `orientation` (k, 4) wxyz and
`angle` (k, j) [rad], in the order of the tracker's joints; `angle` may be absent if there are none.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from touchstone.scenarios.avatar.number_checks import number_of
from touchstone.scenarios.files.safe_paths import DAMAGED, regular
from touchstone.scenarios.plural import plural

COLUMNS = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")


class TrackerFileError(ValueError):
    """The file holds no keyframes of this tracker; the message says where and why."""


def keyframes(path: Path, joints: Sequence[str]) -> dict[str, Any]:
    """Fields `times`, `positions`, `orientations` and `angles` of a tracker.

    Raises:
        TrackerFileError: the file cannot be read, or has other columns or shapes.
    """
    read = {".csv": _of_csv, ".npz": _of_npz}.get(path.suffix.lower())
    if read is None:
        raise TrackerFileError(f"{path.name}: expected a file .csv or .npz")
    try:
        table = read(regular(path), joints)
    except OSError as error:
        raise TrackerFileError(f"{path.name}: {error.strerror or error}") from error
    return {
        "times": tuple(table[:, 0].tolist()),
        "positions": tuple(map(tuple, table[:, 1:4].tolist())),
        "orientations": tuple(map(tuple, table[:, 4:8].tolist())),
        "angles": tuple(map(tuple, table[:, 8:].tolist())),
    }


def _of_csv(path: Path, joints: Sequence[str]) -> np.ndarray:
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines()))
    except (UnicodeDecodeError, csv.Error) as error:
        raise TrackerFileError(f"{path.name}: no CSV file ({error})") from error
    heads = [head.strip().removesuffix(".angle") for head in rows[0]] if rows else []
    wanted = [*COLUMNS, *joints]
    if sorted(heads) != sorted(wanted):
        missing = [name for name in wanted if name not in heads]
        more = [name for name in heads if name not in wanted]
        found = "; ".join(
            f"{kind} {', '.join(names)}" for kind, names in (("missing", missing), ("unknown", more)) if names
        )
        raise TrackerFileError(f"{path.name}:1: columns: {found or 'named twice'}")
    order = [heads.index(name) for name in wanted]
    table = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            values = [number_of(text) for text in row]
            table.append([values[k] for k in order])
        except (ValueError, IndexError) as error:
            raise TrackerFileError(
                f"{path.name}:{number}: expected {plural(len(heads), 'number')}"
            ) from error
    return np.array(table, dtype=float).reshape(-1, len(wanted))


def _of_npz(path: Path, joints: Sequence[str]) -> np.ndarray:
    try:
        with np.load(path, allow_pickle=False) as archive:
            found = {name: np.asarray(archive[name], dtype=float) for name in archive.files}
    except FileNotFoundError:
        raise
    except DAMAGED as error:
        reason = f"{error}".partition("\n")[0][:100]
        raise TrackerFileError(f"{path.name}: no NPZ file of plain numbers ({reason})") from error
    count = len(found["time"]) if "time" in found and found["time"].ndim == 1 else 0
    found.setdefault("angle", np.zeros((count, 0)))
    shapes = {
        "time": (count,),
        "position": (count, 3),
        "orientation": (count, 4),
        "angle": (count, len(joints)),
    }
    for name, shape in shapes.items():
        if name not in found:
            raise TrackerFileError(f"{path.name}: no array {name!r}; valid: {', '.join(shapes)}")
        if found[name].shape != shape:
            raise TrackerFileError(f"{path.name}: {name} has shape {found[name].shape}, expected {shape}")
    if unknown := sorted(found.keys() - shapes.keys()):
        raise TrackerFileError(f"{path.name}: unknown array {unknown[0]!r}; valid: {', '.join(shapes)}")
    return np.column_stack([found["time"], found["position"], found["orientation"], found["angle"]])
