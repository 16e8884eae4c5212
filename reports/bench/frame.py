"""`bench frame`: time of a displayed frame of every scene, as ratios between all engines.

As in `touchstone run`, the recorder alternates between all columns every half second of the scene; the whole
scene is repeated. Engines are compared at their recommended steps and at equal steps; the reference takes one
step a frame in both. A ratio is meaningful only if the faster engine's overlap is no larger. An engine that
exceeds BUDGET in a scene skips the rest of it; ratios are over the frames that both played.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.adapters.registry import ENGINES
from touchstone.reports.bench.frame_table import show
from touchstone.reports.bootstrap import median_interval, time_ratio
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, rows_of, save, save_manifest, table
from touchstone.reports.run.comparisons import DEEPER
from touchstone.reports.run.request import REFERENCE, Request, Results, columns_of
from touchstone.reports.run.study import run as play
from touchstone.scenarios.catalogue import tagged, tags
from touchstone.scenarios.scenario import Scenario

__all__ = ["run", "show", "steps"]

STUDY = "bench frame"
TAGS = ("gallery", "heap", "probe")
"""Tags of the scenes that are played."""
OURS, CLASSES = "balanced", ("recommended", "equal-step")
"""The reference's profile, and the profiles of the engines that are compared with it and among themselves."""
REPEATS = 2
BUDGET = 20.0
"""Seconds of native steps after which an engine stops in a scene: DART takes 20 minutes for 216 balls."""
METRICS = ("overlap.max", "ratio.time")

Column = tuple[str, str]


def scenes() -> list[Scenario]:
    """The scenes with one of TAGS, each once."""
    found = {scenario.name: scenario for tag in TAGS if tag in tags() for scenario in tagged(tag)}
    return list(found.values())


def columns() -> tuple[Column, ...]:
    """(engine, profile) of all engines."""
    return columns_of(ENGINES, (OURS, *CLASSES))


def steps(scenarios: Sequence[Scenario] | None = None, repeats: int = REPEATS) -> int:
    """Displayed frames of all columns."""
    frames = sum(scenario.frame_count for scenario in scenarios or scenes())
    return frames * len(columns()) * repeats


def run(
    out: Path, progress: Progress, scenarios: Sequence[Scenario] | None = None, repeats: int = REPEATS
) -> pd.DataFrame:
    """Play all scenes `repeats` times; store rows, manifest and the results of every repetition."""
    played = tuple(scenarios or scenes())
    with output_folder(out) as folder:
        results = [
            play(
                Request(played, columns(), folder / f"repeat-{k + 1}", metrics=METRICS, budget=BUDGET),
                progress,
            )
            for k in range(repeats)
        ]
        frame = table(rows_of_bench(results))
        save(frame, folder)
        save_manifest(folder, {"study": STUDY, "repeats": repeats, "scenarios": [s.name for s in played]})
    return frame


def rows_of_bench(results: Sequence[Results]) -> list[Row]:
    """Overlap, time and ratios of every scene, over all repetitions; an engine that failed keeps its row."""
    first = [replace(row, study=STUDY) for row in rows_of(results[0].frame)]
    times: dict[str, dict[Column, list[Array]]] = {}
    for scenario, engine, profile in results[0].recordings:
        key = (scenario, engine, profile)
        seconds = [result.recordings[key].time_frame for result in results if key in result.recordings]
        times.setdefault(scenario, {})[engine, profile] = seconds
    rows = [row for row in first if row.metric != "ratio.time"]
    for scenario, columns_played in times.items():
        steps_of = {(r.engine, r.profile): r.dt for r in rows if r.scenario == scenario}
        for (engine, profile), sample in columns_played.items():
            value, low, high = median_interval(np.concatenate(sample))
            base = Row(STUDY, scenario, engine, profile, steps_of[engine, profile], "time.frame", unit="s")
            played, all_frames = (
                min(map(len, sample)),
                max(len(s) for t in columns_played.values() for s in t),
            )
            reason = f"its first {played} of {all_frames} frames" if played < all_frames else ""
            rows.append(replace(base, value=value, low=low, high=high, reason=reason))
        judged = {
            (r.engine, r.subject): r for r in first if r.scenario == scenario and r.metric == "ratio.time"
        }
        rows += _ratios(scenario, columns_played, steps_of, judged)
    return rows


def _ratios(
    scenario: str,
    times: Mapping[Column, Sequence[Array]],
    steps_of: Mapping[Column, float],
    judged: Mapping[tuple[str, str], Row],
) -> list[Row]:
    """Ratios of every engine to every other of its class; the ratio that `run` judges is judged again."""
    rows = []
    for mine, other in permutations(times, 2):
        if not _comparable(mine, other):
            continue
        both = [(a[: len(b)], b[: len(a)]) for a, b in zip(times[mine], times[other])]
        ratio = time_ratio(np.concatenate([a for a, _ in both]), np.concatenate([b for _, b in both]))
        row = Row(STUDY, scenario, *mine, steps_of[mine], "ratio.time", ratio.value, "1", " ".join(other))
        row = replace(row, low=ratio.low, high=ratio.high)
        asked = judged.get((mine[0], row.subject))
        if asked is not None and asked.verdict:
            deeper = asked.reason_code == DEEPER
            verdict = "pass" if ratio.value <= asked.limit and not deeper else "fail"
            row = replace(row, limit=asked.limit, verdict=verdict, reason=asked.reason)
            row = replace(row, reason_code=asked.reason_code)
        rows.append(row)
    return rows


def _comparable(one: Column, two: Column) -> bool:
    """Whether two engines are of one class; the reference belongs to each."""
    if one[0] == two[0]:
        return False
    return one[1] == two[1] or REFERENCE in (one[0], two[0])
