"""Points of the study: per cell and quantity the error, its parts and the time per simulated second."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import nan

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.reports.runner.cells import TIMING, Cell, grid, scene_of
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.measures import FRAMES, closed_path
from touchstone.reports.runner.request import step_text
from touchstone.reports.studies.work_precision.definitions import (
    BASE,
    FINE,
    FINER,
    QUANTITIES,
    REFERENCE,
    STUDY,
    changes,
    truth_cells,
)
from touchstone.reports.studies.work_precision.errors import (
    CellRun,
    TrueMotion,
    distance,
    errors_of,
    run_of,
    truth_of,
)
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario


def pareto(time: Array, error: Array, floor: float = 0.0) -> Array:
    """Whether each point is on the front: no other is better in one and no worse in the other (n,).

    Args:
        time: [s] (n,).
        error: (n,); errors below `floor` count as equal.
    """
    time, error = np.asarray(time, dtype=float), np.maximum(np.asarray(error, dtype=float), floor)
    order = np.lexsort((error, time))
    found = np.zeros(len(time), dtype=bool)
    least = np.inf
    for k, i in enumerate(order):
        if not np.isfinite(time[i]) or not np.isfinite(error[i]):
            continue
        # points of equal time and error are all on the front
        twin = (
            k > 0 and found[order[k - 1]] and (time[i], error[i]) == (time[order[k - 1]], error[order[k - 1]])
        )
        if error[i] < least or twin:
            found[i], least = True, error[i]
    return found


def band(samples: Sequence[float]) -> tuple[float, float, float]:
    """Median, least and largest of the repeats; NaN without any."""
    values = np.asarray(samples, dtype=float)
    if not len(values):
        return np.nan, np.nan, np.nan
    return float(np.median(values)), float(values.min()), float(values.max())


def deficit(ours: Array, theirs: Array, floor: float) -> Array:
    """By which factor each of their points is better than the nearest of ours (m,); at most 1: dominated.

    Our point answers theirs up to the larger of both ratios, of time and of error: at most so many times
    slower and so many times less accurate. Of our points the best one counts.

    Args:
        ours: time and error (n, 2).
        theirs: time and error (m, 2).
        floor: errors below it count as equal.
    """
    a, b = (np.array(points, dtype=float).reshape(-1, 2) for points in (ours, theirs))
    a[:, 1], b[:, 1] = np.maximum(a[:, 1], floor), np.maximum(b[:, 1], floor)
    if not len(a):
        return np.full(len(b), np.inf)
    with np.errstate(invalid="ignore"):
        factors = np.maximum(a[None, :, 0] / b[:, None, 0], a[None, :, 1] / b[:, None, 1])
    return np.asarray(np.where(np.isnan(factors), np.inf, factors).min(axis=1))


COLUMNS = (
    *("study", "scenario", "engine", "profile", "settings", "dt", "quantity", "unit"),
    *("error", "discretisation", "model", "time", "time_low", "time_high", "front", "own_front"),
    *("truth", "truth_width", "horizon", "outcome", "verdict", "reason", "reproduce"),
)
"""Columns of the table. Times are in s per simulated second: the median of the rounds, and their range;
`discretisation` is the change from the engine's own finest step, `model` the error there; `front` is that of
all engines, `own_front` that of the engine alone."""


class SweptRuns:
    """Rows of a sweep (with series) by cell, with the runs and truths made of them."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._rows = dict(iter(frame.groupby("cell", sort=False)))

    def rows(self, cell: Cell) -> pd.DataFrame:
        """Rows of a cell."""
        found: pd.DataFrame = self._rows.get(hash_of(cell), _EMPTY)
        return found

    def run(self, cell: Cell) -> CellRun | None:
        """The run of a cell; None if it did not end."""
        return run_of(self.rows(cell), scene_of(cell.source, cell.scenario, 0))

    def truth(self, scenario: Scenario, cells: Sequence[Cell]) -> TrueMotion | None:
        """The true motion of a scene from its `truth_cells`, or without them."""
        found: dict[str, dict[float, CellRun]] = {}
        last: list[CellRun | None] = []
        for cell in cells:
            run = self.run(cell)
            if cell.dt > FINE:
                last.append(run)
            elif run is not None:
                found.setdefault(cell.engine, {})[cell.dt] = run
        codes = {name: (both[FINE], both[FINER]) for name, both in found.items() if len(both) == 2}
        plain, *moved = last or [None]
        return truth_of(scenario, codes, plain, [run for run in moved if run])

    def frames(self, cell: Cell, repeat: int) -> Array:
        """Seconds of the displayed frames of a cell that were timed in a round; empty if it was not."""
        timed = self.rows(timing_cell(cell, repeat))
        found = [series for metric, series in zip(timed.metric, timed.series) if metric == FRAMES]
        return np.asarray(found[0] if found else [], dtype=float)

    def times(self, cell: Cell, run: CellRun, rounds: int) -> list[float]:
        """Seconds per simulated second of each round: the frames timed, extrapolated to the whole scene by
        the seconds of all frames in the accuracy run."""
        duration = scene_of(cell.source, cell.scenario, 0).duration
        several = (self.frames(cell, repeat) for repeat in range(rounds))
        return [
            float(frames.sum() * run.frames.sum() / run.frames[: len(frames)].sum() / duration)
            for frames in several
            if len(frames)
        ]


_EMPTY = pd.DataFrame({"outcome": [], "metric": [], "series": []})


def timing_cell(cell: Cell, repeat: int) -> Cell:
    """The timing cell of an accuracy cell."""
    return replace(cell, measure=TIMING, repeat=repeat)


def points(frame: pd.DataFrame, cells: Sequence[Cell], rounds: int) -> pd.DataFrame:
    """The table of the study from the rows of its sweep (with series); `attrs["bands"]` has the lines on the
    bands by scene."""
    swept = SweptRuns(frame)
    found: list[dict[str, object]] = []
    bands: dict[str, str] = {}
    for scene in dict.fromkeys(cell.scenario for cell in cells):
        mine = [cell for cell in cells if cell.scenario == scene]
        truth = swept.truth(catalogue()[scene], truth_cells(scene))
        if truth is not None and truth.band is not None and closed_path(catalogue()[scene]) is None:
            bands[scene] = truth.band.words
        runs = {cell: swept.run(cell) for cell in mine}
        finest = {
            key: min((c for c in mine if _family(c) == key), key=lambda c: c.dt) for key in map(_family, mine)
        }
        limits = {key: runs[cell] for key, cell in finest.items()}
        for cell in mine:
            base = _base(cell, swept.rows(cell))
            run = runs[cell]
            if run is None or truth is None:
                found.append({**base, "quantity": "", "error": nan})
                continue
            limit = limits[_family(cell)] if finest[_family(cell)] != cell else None
            times = dict(zip(("time", "time_low", "time_high"), band(swept.times(cell, run, rounds))))
            horizon = truth.horizon / scene_of(cell.source, scene, 0).frame_rate
            for parts in _parts(run, limit, truth):
                found.append({**base, **times, **parts, "horizon": horizon})
    table = pd.DataFrame(found, columns=list(COLUMNS))
    table.attrs["bands"] = bands
    measured = table[table.quantity != ""]
    for name, keys in (
        ("front", ["scenario", "quantity"]),
        ("own_front", ["scenario", "quantity", "engine"]),
    ):
        table[name] = False
        for (_, quantity, *_), part in measured.groupby(keys):
            floor = QUANTITIES[str(quantity)].floor
            table.loc[part.index, name] = pareto(part.time.to_numpy(), part.error.to_numpy(), floor)
    return table


def _family(cell: Cell) -> tuple[str, str, tuple[str, ...]]:
    """Cells that differ in their step only."""
    return cell.engine, cell.profile, cell.changes


def _parts(run: CellRun, limit: CellRun | None, truth: TrueMotion) -> Iterator[dict[str, object]]:
    """Per quantity: the error, what the step adds to it, and what is left at the engine's finest step."""
    errors = errors_of(run, truth)
    finest = errors_of(limit, truth) if limit else errors
    for name, error in errors.items():
        left = finest.get(name, nan)
        apart = abs(error - left)
        if name == "position" and limit:
            apart = distance(run.path, limit.path, truth.horizon)
        yield {
            "quantity": name,
            "unit": QUANTITIES[name].unit,
            "error": error,
            "discretisation": apart if limit else nan,
            "model": left,
            "truth": truth.source.get(name, ""),
            "truth_width": truth.width.get(name, nan),
        }


def _base(cell: Cell, rows: pd.DataFrame) -> dict[str, object]:
    first = rows[rows.metric == "run"].iloc[0] if len(rows) else None
    outcome = first.outcome if first is not None else "not measured"
    return {
        "study": STUDY,
        "scenario": cell.scenario,
        "engine": cell.engine,
        "profile": cell.profile,
        "settings": " ".join(cell.changes),
        "dt": cell.dt,
        # A run that diverges at a coarse step is a measurement, not a fault.
        "verdict": "" if first is None or outcome == "diverged" else first.verdict,
        "outcome": outcome,
        "reason": first.reason if first is not None else "",
        "reproduce": reproduce(cell, bool(first is not None and "all effects" in first.reason)),
    }


def reproduce(cell: Cell, all_effects: bool) -> str:
    """The command that plays a cell again."""
    changed = "".join(f" --set {change}" for change in cell.changes)
    effects = " --effects all" if all_effects else ""
    return (
        f"touchstone run {cell.scenario} --engine {cell.engine} --profile {cell.profile} "
        f"--dt {step_text(cell.dt)}{changed}{effects}"
    )


FRONT_COLUMNS = ("scenario", "quantity", "engine", "dominates", "factor", "where", "why")
"""`factor`: by how much the engine's best point is better than the reference's nearest, in time or in error
(at most 1 where the reference dominates); `where`: that point."""
ALMOST = 1.0
"""Factor up to which the reference dominates [1]."""


def fronts(table: pd.DataFrame) -> pd.DataFrame:
    """One row per scene, quantity and engine."""
    rows = []
    usable = table[table.time.notna() & (table.quantity != "")]
    for (scene, quantity), part in usable.groupby(["scenario", "quantity"], sort=False):
        floor = QUANTITIES[str(quantity)].floor
        ours = part[part.engine == REFERENCE]
        for engine, theirs in part[part.engine != REFERENCE].groupby("engine", sort=False):
            finite = theirs[theirs.error < float("inf")]
            if finite.empty:
                continue
            factors = deficit(ours[["time", "error"]].to_numpy(), finite[["time", "error"]].to_numpy(), floor)
            worst = finite.iloc[int(factors.argmax())]
            factor = float(factors.max())
            rows.append(
                {
                    "scenario": scene,
                    "quantity": quantity,
                    "engine": engine,
                    "dominates": factor <= ALMOST,
                    "factor": factor,
                    "where": worst.reproduce.removeprefix("touchstone run "),
                    "why": "" if factor <= ALMOST else _why(str(scene), str(quantity), ours, worst),
                }
            )
    return pd.DataFrame(rows, columns=list(FRONT_COLUMNS))


def _why(scene: str, quantity: str, ours: pd.DataFrame, theirs: pd.Series) -> str:
    """Reason from the data: what the reference does not measure, where it is slower, where less accurate."""
    if ours.empty:
        driven = any(body.kind == "driven" for body in catalogue()[scene].bodies)
        return "the reference poses the avatar, so this is not defined" if driven else "not measured"
    faster = ours.time.min() > theirs.time
    better = ours.error.min() > max(theirs.error, QUANTITIES[quantity].floor)
    if faster and better:
        return "faster and more accurate than all settings of the reference"
    if faster:
        ratio = ours.time.min() / theirs.time
        return f"a setting {ratio:.3g} times as fast as the reference's fastest"
    if better:
        ratio = ours.error.min() / max(theirs.error, QUANTITIES[quantity].floor)
        return f"an error {ratio:.3g} times smaller than the reference's smallest"
    return "between two settings of the reference"


LADDER_COLUMNS = ("scenario", "change", "towards", "quantity", "unit", "before", "after", "time_ratio")
"""`before` and `after`: errors of `balanced` and of `balanced` with the change; `time_ratio`: its time over
that of `balanced`."""


def ladder(frame: pd.DataFrame, cells: Sequence[Cell]) -> pd.DataFrame:
    """Table of the ladder from the rows of the sweep: a row per scene, change and quantity; one round of
    timing."""
    if not cells:
        return pd.DataFrame(columns=list(LADDER_COLUMNS))
    names = list(dict.fromkeys(cell.scenario for cell in cells))
    plain = points(frame, grid(names, [(REFERENCE, BASE)]), 1)
    changed = points(frame, cells, 1)
    keys = ["scenario", "quantity", "unit"]
    both = changed.merge(plain, on=keys, suffixes=("", "_plain"))
    both = both[both.quantity.isin(QUANTITIES)]
    table = both[keys].copy()
    table["change"] = both.settings.where(both.settings != "", both.profile)
    table["before"], table["after"] = both.error_plain, both.error
    table["towards"] = table.change.map(changes()).fillna(both.profile)
    table["time_ratio"] = both.time / both.time_plain
    return table[list(LADDER_COLUMNS)].reset_index(drop=True)
