"""A night: scene by scene, each stored as soon as it is finished, so that a killed night is continued.

Studies of a night: hard cases that rotate, and studies whose period is over.

A night's identity names the studies that it holds, with the time that each took (`studies`). It says when a
study ran last on this machine, and whether it fits into the time that is left. Studies that measure times by
their own rules are no part of nights.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow

from touchstone.adapters.registry import ENGINES, installed
from touchstone.adapters.workers.children import Children
from touchstone.adapters.workers.scratch import locked, scratch_folder
from touchstone.reports.nightly.store import Night, cache_folder, identity, same_night
from touchstone.reports.progress import SCENE, STUDY, Progress
from touchstone.reports.results import COLUMNS, Row, rows_of, table, write_beside, write_text
from touchstone.reports.run.study import measure_scene
from touchstone.reports.runner.request import Request, Results, columns_of, step_text
from touchstone.reports.studies import calibration as calibration
from touchstone.reports.studies import predictability, relations, robustness
from touchstone.reports.studies.stability import play
from touchstone.reports.studies.stability import study as stability
from touchstone.reports.verdict.outcomes import HARD_CLASSES, SURVIVED
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.difficulty.family import families
from touchstone.scenarios.files.safe_paths import json_of, regular
from touchstone.scenarios.scenario import Scenario

HARD = "stability"
OUTCOME = "stability.outcome"
"""Metric of a hard case: how its class ranks among HARD_CLASSES; the reason begins with the class."""
MOST = 2
"""Studies of a night beside the hard cases [1]."""
FAMILIES, QUICK_FAMILIES = 12, 2
"""Families of hard cases of a night, and of a quick one [1]: all have their turn in 4 and 23 nights."""
QUICK_SECONDS = 270.0
"""Time beyond which no study of a quick night may last [s]: the night must end within 5 minutes."""
Measure = Callable[[Path, Path, Progress], pd.DataFrame]
"""Measures into a new folder, with a folder for a store; returns the long table."""


@dataclass(frozen=True, slots=True)
class Study:
    """A study of nights: its period [nights], how long it takes on two cores [s], until a night says how long
    it took here; and what measures it."""

    name: str
    period: int
    seconds: float
    measure: Measure


def studies(turn: int, quick: bool) -> list[Study]:
    """All studies of nights.

    Args:
        turn: number of nights before this one: it chooses the families of hard cases.
    """
    every = list(families())
    count = QUICK_FAMILIES if quick else FAMILIES
    names = [every[k % len(every)] for k in range(turn * count, (turn + 1) * count)]
    hard = play.Scope(_columns(*play.QUICK), play.chosen(names), quick=True)
    own, ours = _columns(*QUICK_PROFILES), (("reference", "balanced"), ("reference", "accurate"))
    random = robustness.tasks(ours, 30, 0)
    changed, few = ([catalogue()[name] for name in one] for one in (relations.QUICK, predictability.SCENES))
    return [
        Study(HARD, 1, 9.0 * count, lambda out, store, progress: stability.run(hard, store, out, progress)),
        Study("robustness", 3, 60.0, lambda out, _, progress: robustness.run(ours, random, out, progress)),
        Study("relations", 7, 90.0, lambda out, _, progress: relations.run(own, changed, out, progress)),
        Study("calibration", 7, 90.0, lambda out, _, progress: calibration.run(own, out, progress)),
        Study(
            "predictability", 14, 240.0, lambda out, _, progress: predictability.run(few, 0, out, progress)
        ),
    ]


def due(
    every: Sequence[Study], nights: Sequence[Night], fingerprint: str, left: float = float("inf")
) -> list[Study]:
    """The studies that are due and fit into the time that is left [s]: the hard cases, then at most MOST
    others, the longest overdue first."""
    mine = [night for night in nights if night.identity.get("fingerprint") == fingerprint]
    age, cost = {}, {}
    for study in every:
        ran = [k for k, night in enumerate(mine) if study.name in _held(night)]
        age[study.name] = len(mine) - ran[-1] if ran else float("inf")
        cost[study.name] = float(_held(mine[ran[-1]])[study.name]) if ran else study.seconds
    waiting = [study for study in every if age[study.name] >= study.period]
    waiting.sort(key=lambda study: (study.name != HARD, -age[study.name] / study.period))
    found: list[Study] = []
    for study in waiting:
        fits = cost[study.name] <= left
        if fits and (study.name == HARD or sum(one.name != HARD for one in found) < MOST):
            found.append(study)
            left -= cost[study.name]
    return found


def _held(night: Night) -> Mapping[str, Any]:
    found = night.identity.get("studies")
    return found if isinstance(found, Mapping) else {}


def rows_for_nights(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of a study as nights keep them: without times; the step is part of the subject where several
    steps share a figure; the class of a hard case is a number."""
    found = []
    rows = [row for row in rows_of(frame) if not ("time" in row.metric or row.unit in ("us", "s/s"))]
    steps: dict[tuple[str, ...], set[float]] = {}
    for row in rows:
        steps.setdefault(_key(row), set()).add(row.dt)
    for row in rows:
        if row.study == HARD:
            found += [_class_row(row)] if row.metric == OUTCOME else []
        elif len(steps[_key(row)]) > 1:
            found.append(replace(row, subject=f"{row.subject} at {step_text(row.dt)} s".strip()))
        else:
            found.append(row)
    return table(found)


def _key(row: Row) -> tuple[str, ...]:
    return row.study, row.scenario, row.engine, row.profile, row.metric, row.subject


def _class_row(row: Row) -> Row:
    """A hard case: `pass` where it was survived; the class as a number, and in the reason."""
    verdict = row.verdict if row.verdict == "fail" else "pass" if row.subject in SURVIVED else ""
    reason = f"{row.subject}: {row.reason}".removesuffix(": ")
    value = float(HARD_CLASSES.index(row.subject))
    return replace(row, subject="", value=value, unit="1", verdict=verdict, reason=reason)


def described(value: float) -> str:
    """The class of a hard case by its number."""
    return HARD_CLASSES[int(value)] if 0 <= value < len(HARD_CLASSES) else "-"


def _columns(*profiles: str) -> tuple[tuple[str, str], ...]:
    return tuple(column for column in columns_of(ENGINES, profiles) if installed(column[0]))


QUICK_PROBES = ("fall", "bounce_e05", "slip", "slide", "incline_holds", "collide_oblique", "cradle", "stack")
"""Probes of a quick night: one of each kind."""
QUICK_PROFILES = ("balanced", "recommended")
"""Profiles of a quick night: one of each engine."""
UNIT: Mapping[str, Any] = {"playback": {}, "settings": {}, "faults": []}
"""Facts of a finished scene, beside its rows."""
OLDEST = 20 * 3600.0
"""Age up to which an unfinished night is continued [s]."""


@dataclass
class NightResults:
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
) -> NightResults:
    """Measure the scenes that the night has not measured yet, and the studies that are due.

    Args:
        work: folder and identity of the night (`working_folder`).
        before: nights of the store: they say which studies are due.
    """
    start = time.monotonic()
    folder, facts = work
    settings = facts["settings"]
    found = NightResults(facts, table([]))
    missing = [scene for scene in chosen if _finished(folder, scene.name, UNIT) is None]
    found.continued = len(chosen) - len(missing)
    # Children write into the folder until they end.
    with scratch_folder() as scratch, Children() as children:
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
    found: NightResults, folder: Path, before: Sequence[Night], quick: bool, start: float, progress: Progress
) -> list[pd.DataFrame]:
    """Tables of the studies that are due; one that fails is a fault, and due again the next night."""
    left = QUICK_SECONDS - (time.monotonic() - start) if quick else inf
    frames, took = [], {}
    for study in due(studies(len(before), quick), before, str(found.identity["fingerprint"]), left):
        name = f"study-{study.name}"
        kept = _finished(folder, name, {"seconds": 0.0})
        if kept is None:
            progress(f"{STUDY}{study.name}", 0)
            began = time.monotonic()
            try:
                with scratch_folder() as scratch:
                    frame = study.measure(
                        scratch / "out", scratch / "store", lambda label, steps: progress(label, 0)
                    )
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
    write_text(folder / f"{name}.json", json.dumps(facts))


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
    write_text(folder / "night.json", json.dumps(facts))
    return folder, facts, lock
