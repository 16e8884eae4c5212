"""Results of a stored run: its long table, and its recordings."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
import pyarrow

from touchstone.adapters.recording import Recording, RecordingError, load
from touchstone.reports.results import COLUMNS, NUMBERS

NEEDED = (
    "study",
    "scenario",
    "engine",
    "profile",
    "metric",
    "subject",
    "verdict",
    "reason",
    "unit",
    *NUMBERS,
)
"""Columns that every version has written."""
TABLES = ("results.parquet", "results.csv")


class RunError(ValueError):
    """A folder holds no results; the message says what is missing."""


def table_of(folder: Path) -> pd.DataFrame:
    """Long table of a run, with the columns of `results.COLUMNS`; raises RunError."""
    if not folder.is_dir():
        raise RunError(f"{folder}: no such folder")
    path = next((folder / name for name in TABLES if (folder / name).is_file()), None)
    if path is None:
        raise RunError(f"{folder}: holds neither {' nor '.join(TABLES)}")
    try:
        frame = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path)
    except (OSError, ValueError, pyarrow.ArrowException) as error:
        raise RunError(f"{path}: cannot be read: {f'{error}'.partition(chr(10))[0][:100]}") from error
    if missing := [name for name in NEEDED if name not in frame]:
        raise RunError(f"{path}: no columns {', '.join(missing)}")
    for name in NUMBERS:
        try:
            frame[name] = pd.to_numeric(frame[name])
        except (ValueError, TypeError) as error:
            raise RunError(f"{path}: {name}: expected numbers") from error
    texts = [name for name in COLUMNS if name not in NUMBERS]
    frame = frame.reindex(columns=list(COLUMNS))  # an older table lacks newer columns
    frame[texts] = frame[texts].astype(object).fillna("").astype(str)
    return frame


def recordings_of(folder: Path) -> Iterator[tuple[Path, Recording]]:
    """Recordings of a run with their paths; raises RunError if there are none or one cannot be read."""
    if not folder.is_dir():
        raise RunError(f"{folder}: no such folder")
    paths = sorted((folder / "recordings").glob("*.npz"))
    if not paths:
        raise RunError(f"{folder}: no recordings; expected recordings/*.npz")
    for path in paths:
        try:
            yield path, load(path)
        except RecordingError as error:
            raise RunError(str(error)) from error


def label_of(path: Path, recording: Recording) -> tuple[str, str, str]:
    """Scene, engine and label (profile and what was changed in it) of a recording, from its file's name."""
    scene = str(json.loads(recording.scenario)["name"])
    facts = recording.facts
    engine, profile = str(facts["engine"]), str(facts["profile"])
    rest = path.stem.removeprefix(f"{scene}-{engine}-")
    changed = rest.removeprefix(profile) if rest.startswith(profile) else ""
    return scene, engine, profile + changed.replace("+", ", ", 1)
