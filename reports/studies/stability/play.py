"""Plays the cells of the study `stability`, hard scenes on an engine at a step, and judges their outcomes."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from math import inf
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import AdapterError, Engine, Settings, Unsupported
from touchstone.adapters.recorder import Player, ready
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import installed
from touchstone.reports.metrics.solver import state_hash
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.measures import Measured, base_row
from touchstone.reports.runner.request import line_of
from touchstone.reports.runner.sweep import sweep
from touchstone.reports.runner.tasks import own_step
from touchstone.reports.studies.study import Column
from touchstone.reports.verdict import figures, outcomes
from touchstone.reports.verdict.outcomes import Outcome, judge
from touchstone.scenarios.difficulty.checks import Checks
from touchstone.scenarios.difficulty.family import Family, families, hard_names, hard_scene
from touchstone.scenarios.scenario import Scenario

LEFT_BOUNDS = "the plan does not hold"
"""Part of the reason of a run that left the bounds of its plan; it is played again with all effects."""
OUTCOME, FIGURE, UNDER, COMMAND, HASH = (
    f"stability.{name}" for name in ("outcome", "figure", "under", "command", "hash")
)
FAILED, KEPT = "TOUCHSTONE_FAILED_RUNS", "TOUCHSTONE_KEPT_RUNS"
"""Environment variables with the folder of the recordings of failed runs, or of all: it must not belong to
the hash of a cell, so that a store can be moved."""


@dataclass(frozen=True, slots=True)
class Played:
    """Outcome of a cell, the command that plays it, its time [s] and the hash of its states."""

    outcome: Outcome
    line: str
    seconds: float = 0.0
    state_hash: str = ""


def hard_cell(scene: str, engine: str, profile: str, dt: float, budget: float = inf) -> Cell:
    """Cell of a hard scene, which ends once the engine's steps have taken `budget` seconds; its hash depends
    on what decides an outcome beside the run: the judge's sources and the scene's checks."""
    judge = hashlib.sha256(_sources() + repr(hard_scene(scene)[1]).encode()).hexdigest()[:12]
    options = (f"budget={budget!r}", f"judge={judge}")
    measure, source = f"{__name__}:outcome", f"{__name__}:scene"
    return Cell(scene, engine, profile, dt, measure=measure, source=source, options=options)


def file_of(cell: Cell) -> str:
    """Name of a cell's recording."""
    return f"{cell.scenario}-{cell.engine}-{cell.profile}-{cell.dt:.3g}.npz"


def scene(name: str, seed: int) -> Scenario:
    """Source of scenes: a hard scene by name."""
    return hard_scene(name)[0]


def outcome(cell: Cell, scenario: Scenario, engine: Engine) -> Measured:
    """Measure of a cell: its outcome, the figures that decided it, its command and the hash of its states.

    A failed run, or every one, leaves its recording in the folder that FAILED or KEPT names.
    """
    checks, budget = hard_scene(cell.scenario)[1], float(cell.option("budget", "inf"))
    found, recording = _play(engine, scenario, checks, cell.settings, budget)
    if LEFT_BOUNDS in found.reason:
        cell = replace(cell, effects=True)
        found, recording = _play(engine, scenario, checks, cell.settings, budget)
    kept, failed = os.environ.get(KEPT), os.environ.get(FAILED)
    if recording is not None and (kept or (failed and found.name != "ok")):
        path = Path(kept or failed or "") / file_of(cell)
        path.parent.mkdir(parents=True, exist_ok=True)
        recording.save(path)
    digits = "" if recording is None else state_hash(recording)
    return Measured(tuple(_rows(base_row(cell), found, line_of(cell), digits)))


def play_scenario(
    engine: Engine, scenario: Scenario, checks: Checks, settings: Settings, budget: float = inf
) -> Outcome:
    """Outcome of any scene with its checks, played in this process."""
    return _play(engine, scenario, checks, settings, budget)[0]


def _play(
    engine: Engine, scenario: Scenario, checks: Checks, settings: Settings, budget: float
) -> tuple[Outcome, Recording | None]:
    player: Player | None = None
    ended = ""
    try:
        player = ready(engine, scenario, settings)
        while player.frames_played < scenario.frame_count and player.seconds_played <= budget:
            player.play(1)
    except Unsupported as error:
        return Outcome("skipped", str(error)), None
    except AdapterError as error:
        ended = str(error)
        if player is None:
            return Outcome("gave up", ended), None
    except Exception as error:
        return Outcome("error", f"{type(error).__name__}: {error}".splitlines()[0]), None
    assert player is not None
    try:
        recording = player.recording(ended)
        player.world.close()
    except Exception as error:
        return Outcome("error", f"{type(error).__name__}: {error}".splitlines()[0]), None
    return judge(recording, scenario, checks, ended), recording


def play_all(
    asked: Sequence[Cell], store: Path, progress: Progress, jobs: int | None = None
) -> dict[Cell, Played]:
    """Play the cells that the store does not hold, in parallel; one that ends its process costs itself only.

    Raises:
        StoreError: the store cannot be used.
    """
    with recordings_in(FAILED, store / "output" / "failed"):
        frame = sweep(asked, store, jobs=jobs, progress=progress)
    found = {str(key): part for key, part in frame.groupby("cell", sort=False)}
    return {cell: _played(cell, found[hash_of(cell)]) for cell in asked}


@contextmanager
def recordings_in(variable: str, folder: Path) -> Iterator[None]:
    """Let processes that start meanwhile keep recordings in a folder: FAILED or KEPT ones."""
    before = os.environ.get(variable)
    os.environ[variable] = str(folder)
    try:
        yield
    finally:
        del os.environ[variable]
        if before is not None:
            os.environ[variable] = before


@cache
def _sources() -> bytes:
    paths = [Path(outcomes.__file__), Path(figures.__file__), Path(__file__)]
    return b"".join(path.read_bytes() for path in sorted(paths))


def _rows(base: Row, found: Outcome, line: str, digits: str) -> Iterator[Row]:
    family, level = hard_names()[base.scenario]
    row = replace(base, metric=OUTCOME, value=level, unit=family.unit)
    yield replace(row, subject=found.name, reason=found.reason)
    yield replace(base, metric=UNDER, subject=found.under)
    yield replace(base, metric=COMMAND, reason=line)
    yield replace(base, metric=HASH, reason=digits)
    for name, value in found.figures.items():
        yield replace(base, metric=FIGURE, subject=name, value=value)


def _played(cell: Cell, rows: pd.DataFrame) -> Played:
    """Outcome of a cell from its rows in the store; a cell that ended its process has one row."""
    by_metric = {row["metric"]: row for row in rows.to_dict("records")}
    if OUTCOME not in by_metric:
        reason = str(rows.reason.iloc[0])
        return Played(Outcome("slow" if reason.startswith("hung") else "error", reason), line_of(cell))
    figures, row = rows[rows.metric == FIGURE], by_metric[OUTCOME]
    named = dict(zip(figures.subject, figures.value.astype(float)))
    found = Outcome(str(row["subject"]), str(row["reason"]), str(by_metric[UNDER]["subject"]), named)
    line, digits = (str(by_metric[metric]["reason"]) for metric in (COMMAND, HASH))
    return Played(found, line, float(by_metric["seconds"]["value"]), digits)


PROFILES = ("balanced", "accurate", "paper", "default", "recommended", "maximal")
QUICK = ("balanced", "accurate", "default", "recommended", "maximal")
STEPS = (1 / 30, 1 / 240, 1 / 1920)
"""Native steps [s] of all engines beside the own step of each profile."""
BUDGET, QUICK_BUDGET = 2.0, 1.5
"""Time of the engine's steps in a cell, without reading and recording, after which it counts as slow [s]."""


@dataclass(frozen=True, slots=True)
class Scope:
    """What a study plays: columns (engine, profile), families, and whether quickly."""

    columns: tuple[Column, ...]
    families: tuple[Family, ...]
    quick: bool = False

    def cells(self) -> list[Cell]:
        """All cells, those of one scene together; engines that are not installed have none."""
        budget = QUICK_BUDGET if self.quick else BUDGET
        return [
            hard_cell(family.scene_name(level), engine, profile, dt, budget)
            for family in self.families
            for level in levels_of(family, self.quick)
            for engine, profile in self.columns
            if installed(engine)
            for dt in steps_of(engine, profile, self.quick)
        ]


def chosen(names: Iterable[str]) -> tuple[Family, ...]:
    """Families by name; none: all."""
    every = families()
    return tuple(every[name] for name in dict.fromkeys(names)) or tuple(every.values())


def levels_of(family: Family, quick: bool) -> Sequence[float]:
    """Levels to play: all, or the easiest, the middle and the most absurd one."""
    levels = family.levels
    return tuple(dict.fromkeys((levels[0], levels[len(levels) // 2], levels[-1]))) if quick else levels


def steps_of(engine: str, profile: str, quick: bool) -> tuple[float, ...]:
    """Native steps [s]: the profile's own one first."""
    own = own_step(engine, profile)
    return (own,) if quick else tuple(dict.fromkeys((own, *STEPS)))
