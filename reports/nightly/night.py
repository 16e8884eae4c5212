"""A night: scene by scene, each stored as soon as it is finished, so that a killed night is continued."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow

from touchstone.adapters.workers.children import Children
from touchstone.adapters.workers.scratch import locked, scratch_folder
from touchstone.reports.cli.progress import SCENE, Progress
from touchstone.reports.nightly.due import QUICK_SECONDS, due, rows_for_nights, studies
from touchstone.reports.nightly.identity import identity, same_night
from touchstone.reports.nightly.store import Night, cache_folder
from touchstone.reports.results import COLUMNS, table, write_beside
from touchstone.reports.run.request import Request, Results
from touchstone.reports.run.study import measure_scene
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.files.safe_paths import json_of, regular
from touchstone.scenarios.scenario import Scenario

QUICK_PROBES = ("fall", "bounce_e05", "slip", "slide", "incline_holds", "collide_oblique", "cradle", "stack")
"""Probes of a quick night: one of each kind."""
QUICK_PROFILES = ("balanced", "recommended")
"""Profiles of a quick night: one of each engine."""
UNIT: Mapping[str, Any] = {"playback": {}, "settings": {}, "faults": []}
"""Facts of a finished scene, beside its rows."""
OLDEST = 20 * 3600.0
"""Age up to which an unfinished night is continued [s]."""


@dataclass
class Measured:
    """A measured night: identity, long table, packed recordings per scene, manifests of the engines."""

    identity: dict[str, Any]
    frame: pd.DataFrame
    playback: dict[str, str] = field(default_factory=dict)
    settings: dict[str, Any] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    continued: int = 0  # scenes that an earlier, killed process had finished


def scenes(quick: bool) -> tuple[Scenario, ...]:
    """Scenes of a night: the gallery and the probes, or the gallery and QUICK_PROBES."""
    gallery = tagged("gallery")
    probes = tuple(catalogue()[name] for name in QUICK_PROBES) if quick else tagged("probe")
    return (*gallery, *(one for one in probes if one not in gallery))


def measure(
    chosen: Sequence[Scenario],
    columns: tuple[tuple[str, str], ...],
    work: tuple[Path, dict[str, Any]],
    progress: Progress,
    before: Sequence[Night] = (),
) -> Measured:
    """Measure the scenes that the night has not measured yet, and the studies that are due.

    Args:
        work: folder and identity of the night (`working_folder`).
        before: nights of the store: they say which studies are due.
    """
    start = time.monotonic()
    folder, facts = work
    settings = facts["settings"]
    found = Measured(facts, table([]))
    missing = [scene for scene in chosen if _finished(folder, scene.name, UNIT) is None]
    found.continued = len(chosen) - len(missing)
    with Children() as children, scratch_folder() as scratch:
        for number, scenario in enumerate(missing, start=found.continued + 1):
            progress(f"{SCENE}{number} of {len(chosen)}: {scenario.name}", 0)
            _measure_scene(scenario, columns, scratch, folder, children, progress)
    frames = []
    for scenario in chosen:
        rows, unit = _finished(folder, scenario.name, UNIT) or (table([]), UNIT)
        frames.append(rows)
        found.playback |= unit["playback"]
        found.settings |= unit["settings"]
        found.faults += unit["faults"]
    frames += _measure_studies(found, folder, before, bool(settings.get("quick")), start, progress)
    found.frame = pd.concat(frames, ignore_index=True)
    return found


def _measure_studies(
    found: Measured, folder: Path, before: Sequence[Night], quick: bool, start: float, progress: Progress
) -> list[pd.DataFrame]:
    """Tables of the studies that are due; one that fails is a fault, and due again the next night."""
    left = QUICK_SECONDS - (time.monotonic() - start) if quick else inf
    frames, took = [], {}
    for study in due(studies(len(before), quick), before, str(found.identity["fingerprint"]), left):
        name = f"study-{study.name}"
        kept = _finished(folder, name, {"seconds": 0.0})
        if kept is None:
            progress(f"{SCENE}study {study.name}", 0)
            began = time.monotonic()
            try:
                with scratch_folder() as scratch:
                    frame = study.measure(scratch / "out", scratch, lambda label, steps: progress(label, 0))
            except Exception as error:
                reason = f"{type(error).__name__}: {error}".splitlines()[0]
                found.faults.append(f"study {study.name} failed: {reason}")
                continue
            kept = rows_for_nights(frame), {"seconds": round(time.monotonic() - began, 1)}
            _finish(folder, name, *kept)
        frames.append(kept[0])
        took[study.name] = kept[1]["seconds"]
    found.identity["studies"] = took
    return frames


def _measure_scene(
    scenario: Scenario,
    columns: tuple[tuple[str, str], ...],
    scratch: Path,
    folder: Path,
    children: Children,
    progress: Progress,
) -> None:
    place = scratch / scenario.name
    (place / "recordings").mkdir(parents=True)
    (place / "output").mkdir()
    request = Request((scenario,), columns, place)
    results = Results(table([]))
    rows = measure_scene(request, scenario, place, children, results, progress)
    unit = {
        "playback": results.playback,
        "settings": {"/".join(key): r.facts for key, r in (results.recordings | results.ended).items()},
        "faults": results.faults,
    }
    _finish(folder, scenario.name, table(rows), unit)
    shutil.rmtree(place)


def _finish(folder: Path, name: str, rows: pd.DataFrame, facts: Mapping[str, Any]) -> None:
    """Keep what a killed night need not measure again; the facts, written last, mark it as finished."""
    write_beside(folder / f"{name}.parquet", lambda part: rows.to_parquet(part, index=False))
    write_beside(folder / f"{name}.json", lambda part: part.write_text(json.dumps(facts), "utf-8"))


def _finished(
    folder: Path, name: str, kinds: Mapping[str, Any]
) -> tuple[pd.DataFrame, Mapping[str, Any]] | None:
    """What `_finish` kept; None if it is absent or damaged.

    Args:
        kinds: facts of the kinds that are expected.
    """
    try:
        facts = json_of(folder / f"{name}.json")
        rows = pd.read_parquet(regular(folder / f"{name}.parquet"))
    except (OSError, ValueError, pyarrow.ArrowException):
        return None
    good = isinstance(facts, dict) and all(type(facts.get(key)) is type(kinds[key]) for key in kinds)
    return (rows, facts) if good and list(rows.columns) == list(COLUMNS) else None


@contextmanager
def working_folder(settings: Mapping[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
    """The working folder of a night and its identity: those of a night that ended early, or new ones.

    A lock keeps a second night, which has another store, out of the folder; the night removes it once it is
    stored.
    """
    folder, facts, lock = _claimed(identity(settings))
    try:
        yield folder, facts
    finally:
        os.close(lock)


def _claimed(facts: dict[str, Any]) -> tuple[Path, dict[str, Any], int]:
    """Folder, identity, and descriptor of the folder's lock."""
    root = cache_folder() / "unfinished"
    for mark in sorted(root.glob("*/night.json")):
        lock = locked(mark.parent)
        if lock is None:
            continue  # another night that is alive works there
        try:
            old = time.time() - mark.stat().st_mtime > OLDEST
            kept = json_of(mark)
        except (OSError, ValueError):
            old, kept = False, {}
        if not old and same_night(kept, facts):
            return mark.parent, kept, lock
        if old:
            shutil.rmtree(mark.parent, ignore_errors=True)
        os.close(lock)
    folder = root / str(facts["run"])
    folder.mkdir(parents=True)
    lock = os.open(folder, os.O_RDONLY)
    fcntl.flock(lock, fcntl.LOCK_EX)
    write_beside(folder / "night.json", lambda part: part.write_text(json.dumps(facts), "utf-8"))
    return folder, facts, lock
