"""`bench frame`: time of a displayed frame of the reference over that of every engine.

Every engine is started RESTARTS times, in drawn order, on one processor; each start plays all its columns
of all scenes. Columns: the reference at its own step (`balanced`, `paper`) and at the common step of 1/240 s;
the engines at their recommended step and at the common one, each also with kinematic links (`drive=posed`)
where a scene has driven bodies. Intervals are over restarts and blocks of frames (`reports/bootstrap.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, nan
from pathlib import Path

import numpy as np
import pandas as pd
from rich.text import Text

from touchstone.adapters.contract import MISSING, Array, Settings
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.registry import ENGINES, installed, missing_reason
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.process import last_core
from touchstone.reports.bootstrap import RATIO, STATISTICS, mean, restart_interval, restart_ratio
from touchstone.reports.metrics.context import Context
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.ratios import FACTORS, Timed, factor_rows, pair_frames, ratio_rows, timed
from touchstone.reports.runner.request import EQUAL_PROFILE, MACHINE_PROFILE, REFERENCE, step_text
from touchstone.reports.studies.study import (
    MICRO,
    kept,
    limit_text,
    remarks,
    spread_text,
    value_text,
    with_interval,
)
from touchstone.reports.verdict.rows import measured_of
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario

BUDGET = 5.0
"""Seconds of native steps after which a column stops in a scene: DART takes 20 minutes for 216 balls."""
SLOW = 20.0
"""A column that takes this many times as long as the fastest one of its scene is started once [1]."""
OURS, THEIRS = ("balanced", "paper", EQUAL_PROFILE), (MACHINE_PROFILE, EQUAL_PROFILE)


@dataclass(frozen=True, slots=True)
class Contestant:
    """An engine under a name of its own: one process per restart plays all its settings."""

    name: str
    engine: str

    def settings(self, scenario: Scenario) -> list[Settings]:
        """Settings of all columns: where a scene has driven bodies, engines also with kinematic links."""
        profiles = ENGINES[self.engine].profiles
        if self.engine == REFERENCE:
            return [Settings(name, profiles[name]) for name in OURS]
        drives = ("native", "posed") if scenario.trackers else ("native",)
        names = [name for name in THEIRS if name in profiles]
        return [Settings(name, profiles[name], drive=drive) for name in names for drive in drives]


CONTESTANTS = tuple(Contestant(name, name) for name in ENGINES)
Key = tuple[str, str, str]
"""Scene, contestant's name and label of its settings."""


@dataclass(slots=True)
class Take:
    """What a column did in a scene: settings, the first restart's recording, times [s] of all restarts, and
    status and reason if it failed."""

    engine: str
    settings: Settings
    first: Recording | None = None
    times: list[Array] = field(default_factory=list)
    ended: tuple[str, str] | None = None

    @property
    def frame(self) -> float:
        """Mean time of a frame in the first restart [s]; infinite if there is none."""
        return float(self.times[0].mean()) if self.times else inf


def played(
    contestants: Sequence[Contestant],
    scenarios: Sequence[Scenario],
    restarts: int,
    seed: int,
    folder: Path,
    progress: Progress,
) -> Mapping[Key, Take]:
    """Play all scenes `restarts` times; contestants, scenes and settings in an order that the seed draws.

    The first restart plays each column once more before, for its recording, which stays in
    `folder`/recordings: times are those of plays that read no state.
    """
    rng = np.random.default_rng(seed)
    takes: dict[Key, Take] = {}
    for name in ("recordings", "output"):
        (folder / name).mkdir()
    for restart in range(restarts):
        for k in rng.permutation(len(contestants)):
            one = contestants[k]
            with Children(per_engine=True, core=last_core()) as children:
                for i in rng.permutation(len(scenarios)):
                    settings = one.settings(scenarios[i])
                    for j in rng.permutation(len(settings)):
                        key = (scenarios[i].name, one.name, settings[j].label)
                        take = takes.setdefault(key, Take(one.engine, settings[j]))
                        if take.ended is None and not (restart and _slow(key, takes)):
                            _play(key, take, scenarios[i], children, folder, progress)
                        progress(f"{one.name} {settings[j].label}", scenarios[i].frame_count)
    return {
        key: takes[key]
        for scenario in scenarios
        for one in contestants
        for settings in one.settings(scenario)
        if (key := (scenario.name, one.name, settings.label)) in takes
    }


def _play(
    key: Key, take: Take, scenario: Scenario, children: Children, folder: Path, progress: Progress
) -> None:
    if not installed(take.engine):
        take.ended = (MISSING, missing_reason(take.engine))
        return
    name = "-".join(key).replace(", ", "+")
    for reading in (True, False) if take.first is None else (False,):
        path = folder / "recordings" / f"{name if reading else 'times'}.npz"
        output = folder / "output" / f"{name}.txt"
        job = Job(take.engine, scenario, take.settings, path, output, BUDGET, reading)
        (outcome,) = children.play([job], lambda label, count: progress(label, 0))
        if outcome.status != "done":
            take.ended = (outcome.status, outcome.reason)
            return
        recording = load(path)
        if reading:
            take.first = recording
        else:
            path.unlink()
            take.times.append(recording.time_frame)


def _slow(key: Key, takes: Mapping[Key, Take]) -> bool:
    fastest = min(take.frame for other, take in takes.items() if other[0] == key[0])
    return takes[key].frame > SLOW * fastest


STUDY = "bench frame"
RESTARTS = 5
ALSO = ("slide", "stack", "balls_box", "dominoes")
OVERLAP = "overlap.max"


def scenes() -> list[Scenario]:
    """The gallery and ALSO."""
    return [*tagged("gallery"), *(catalogue()[name] for name in ALSO)]


def steps(scenarios: Sequence[Scenario] | None = None, restarts: int = RESTARTS) -> int:
    """Displayed frames of all columns and restarts."""
    return restarts * sum(
        scenario.frame_count * sum(len(one.settings(scenario)) for one in CONTESTANTS)
        for scenario in scenarios or scenes()
    )


def run(
    out: Path,
    progress: Progress,
    scenarios: Sequence[Scenario] | None = None,
    restarts: int = RESTARTS,
    seed: int = 0,
    contestants: Sequence[Contestant] = CONTESTANTS,
) -> pd.DataFrame:
    """Play all scenes `restarts` times; store rows, manifest and the first restart's recordings."""
    chosen = tuple(scenarios or scenes())
    with output_folder(out) as folder:
        takes = played(contestants, chosen, restarts, seed, folder, progress)
        rows = [row for scenario in chosen for row in rows_of_scene(scenario, takes)]
        facts = {"study": STUDY, "restarts": restarts, "seed": seed, "core": last_core()}
        return kept(rows, folder, {**facts, "scenarios": [scenario.name for scenario in chosen]})


def rows_of_scene(scenario: Scenario, takes: Mapping[tuple[str, str, str], Take]) -> Iterator[Row]:
    """Overlap, times, ratios and their factors in one scene; a failed column has a row with its reason."""
    columns: dict[tuple[str, str], Timed] = {}
    for (name, engine, label), take in takes.items():
        if name != scenario.name:
            continue
        base = Row(STUDY, scenario.name, engine, label, take.settings.dt, "run")
        if take.ended is not None:
            yield replace(base, verdict=take.ended[0], reason=take.ended[1])
        if take.first is None or take.ended is not None:
            continue
        rows = measured_of(base, Context(take.first, scenario), (OVERLAP,))
        yield (overlap := next(row for row in rows if row.metric == OVERLAP))
        column = columns[engine, label] = timed(engine, label, take.first, take.times, overlap)
        yield from _times(base, column, scenario.frame_count)
    yield from ratio_rows(STUDY, scenario, list(columns.values()), one_run=False)
    yield from factor_rows(STUDY, scenario.name, columns)


def _times(base: Row, column: Timed, frame_count: int) -> Iterator[Row]:
    """All statistics of a column's frame: over those with a contact, then over all."""
    restarts, count = column.times.shape
    every = np.arange(count)
    chosen = np.flatnonzero(column.contact) if column.contact.any() else every
    remark = f"its first {count} of {frame_count} frames; " if count < frame_count else ""
    for suffix, statistic in STATISTICS.items():
        found = restart_interval(column.times, statistic, every if suffix else chosen)
        reason = f"{remark}{plural(restarts, 'restart')}, contact in {plural(len(chosen), 'frame')}"
        yield with_interval(base, found, metric=f"time.frame{suffix}", unit="s", reason=reason)


def duel(
    out: Path, progress: Progress, scenario: Scenario, engine: str, restarts: int = RESTARTS, seed: int = 0
) -> Row:
    """Ratio of an engine's time to its own, in its first profile: 1 but for noise."""

    class Once(Contestant):
        def settings(self, scenario: Scenario):  # type: ignore[no-untyped-def]
            return super().settings(scenario)[:1]

    pair = [Once(name, engine) for name in (engine, f"{engine} again")]
    with output_folder(out) as folder:
        takes = played(pair, [scenario], restarts, seed, folder, progress)
    one, two = (
        timed(engine, key[2], take.first, take.times) for key, take in takes.items() if take.first is not None
    )
    ours, theirs, chosen, _ = pair_frames(one, two)
    row = Row(STUDY, scenario.name, engine, one.label, nan, RATIO, unit="1", subject=f"{engine} again")
    return with_interval(row, restart_ratio(ours, theirs, mean, chosen))


MILLI = 1e3
TIMES = ("engine", "step [s]", "contact [µs]", "all", "median", "p99", "overlap\n[mm]")
RATIOS = ("reference", "over", "contact", "all", "median", "p99", *("steps", "dynamics", "a step"))
JUDGED = ("scene", "reference", "over the fastest", "statistic", "ratio", "95 % interval", "limit")
NOTES = (
    "contact: mean over the frames with a contact; all, median, p99: over all frames; a frame's time is the",
    "median over restarts. ±: how far the 95 % interval over restarts and blocks of frames reaches",
    "steps x dynamics x a step = the ratio with contact: of numbers of steps, of link dynamics, of the rest",
)
WORDS = {"": "contact", ".all": "all", ".median": "median", ".p99": "p99"}


def report(frame: pd.DataFrame) -> list[Part]:
    """Per scene the times of all columns and the reference's ratios, then every ratio with a limit."""
    parts = []
    for scenario in dict.fromkeys(frame.scenario):
        rows = rows_of(frame[frame.scenario == scenario])
        found = {(row.engine, row.profile, row.metric, row.subject): row for row in rows}
        parts += [_times_part(scenario, found), _ratios(scenario, found)]
    told = frame[frame.metric.str.startswith(("run", RATIO))]
    return [*parts, _judged(frame), remarks(told, NOTES)]


Rows = dict[tuple[str, str, str, str], Row]


def _times_part(scenario: str, rows: Rows) -> Part:
    lines = []
    for engine, profile, metric, _ in rows:
        if metric != "time.frame":
            continue
        row = rows[engine, profile, metric, ""]
        first, *others = (rows[engine, profile, f"{metric}{suffix}", ""] for suffix in STATISTICS)
        overlap = value_text(rows.get((engine, profile, "overlap.max", "")), MILLI)
        times = [value_text(other, MICRO) for other in others]
        name = f"{engine} {profile}".replace(", drive=", " ")
        lines.append([name, step_text(row.dt), spread_text(first, MICRO), *times, overlap])
    return Part(f"bench frame: {scenario}", TIMES, lines)


def _ratios(scenario: str, rows: Rows) -> Part:
    lines = []
    for engine, profile, metric, subject in rows:
        if (engine, metric) != (REFERENCE, RATIO):
            continue
        first, *others = (rows[engine, profile, f"{metric}{suffix}", subject] for suffix in STATISTICS)
        factors = [value_text(rows.get((engine, profile, name, subject))) for name in FACTORS]
        over = subject.replace(", drive=", " ")
        lines.append([profile, over, spread_text(first), *map(value_text, others), *factors])
    return Part(f"{scenario}: the reference over an engine", RATIOS, lines, words=2)


def _judged(frame: pd.DataFrame) -> Part:
    lines: list[list[str | Text]] = []
    for row in rows_of(frame[frame.metric.str.startswith(RATIO) & (frame.verdict != "")]):
        statistic = WORDS[row.metric.removeprefix(RATIO)]
        between = f"{exact_number(row.low)} to {exact_number(row.high)}"
        over = row.subject.replace(", drive=", " ")
        cells = (row.scenario, row.profile, over, statistic, value_text(row), between)
        deeper = row.verdict == "fail" and row.value <= row.limit
        lines.append([*cells, limit_text(row) + Text(", overlap larger" if deeper else "")])
    return Part("bench frame: the reference over the fastest engine", JUDGED, lines, words=4)
