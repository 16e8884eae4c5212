"""`bench frame`: time of a displayed frame of the reference over that of every engine.

Every engine is started RESTARTS times, in drawn order, on one processor; each start plays all its columns
of all scenes. Columns: the reference at its own step (`balanced`, `paper`) and at the common step of 1/240 s;
the engines at their recommended step and at the common one, each also with kinematic links (`drive=posed`)
where a scene has driven bodies. Intervals are over restarts and blocks of frames (`reports/bootstrap.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.workers.process import last_core
from touchstone.reports.bench.frame_table import show
from touchstone.reports.bench.restarts import CONTESTANTS, Contestant, Take, played
from touchstone.reports.bootstrap import RATIO, STATISTICS, mean, restart_interval, restart_ratio
from touchstone.reports.cli.progress import Progress
from touchstone.reports.metrics.context import Context
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, save, save_manifest, table
from touchstone.reports.run.decomposition import factor_rows
from touchstone.reports.run.measure import measured_of
from touchstone.reports.run.ratios import Timed, pair_frames, ratio_rows, timed
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.scenario import Scenario

__all__ = ["duel", "run", "show", "steps"]

STUDY = "bench frame"
RESTARTS = 5
ALSO = ("slide", "stack", "balls_box", "dominoes")
"""Scenes beside the gallery."""
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
        frame = table(rows)
        save(frame, folder)
        facts = {"study": STUDY, "restarts": restarts, "seed": seed, "core": last_core()}
        save_manifest(folder, {**facts, "scenarios": [scenario.name for scenario in chosen]})
    return frame


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
        overlap = next(
            row
            for row in measured_of(base, Context(take.first, scenario), (OVERLAP,))
            if row.metric == OVERLAP
        )
        yield overlap
        column = timed(engine, label, take.first, take.times, overlap)
        columns[engine, label] = column
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
        row = replace(base, metric=f"time.frame{suffix}", unit="s", value=found.value)
        reason = f"{remark}{restarts} restart{'s' if restarts > 1 else ''}, contact in {len(chosen)} frames"
        yield replace(row, low=found.low, high=found.high, reason=reason)


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
    found = restart_ratio(ours, theirs, mean, chosen)
    row = Row(STUDY, scenario.name, engine, one.label, nan, RATIO, found.value, "1", f"{engine} again")
    return replace(row, low=found.low, high=found.high)
