"""Points of the study: per cell and quantity the error, its parts and the time per simulated second."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import nan

import numpy as np
import pandas as pd

from touchstone.reports.run.request import step_text
from touchstone.reports.studies.work_precision.definitions import (
    FINE,
    FINER,
    PERTURBED,
    PERTURBED_SEEDS,
    QUANTITIES,
    REFERENCE,
    STUDY,
    TRUTH_ENGINE,
    TRUTH_PROFILE,
)
from touchstone.reports.studies.work_precision.errors import Run, Truth, distance, errors_of, run_of, truth_of
from touchstone.reports.studies.work_precision.front import band, pareto
from touchstone.reports.sweep.cells import TIMING, Cell, scene_of
from touchstone.reports.sweep.content_hash import hash_of
from touchstone.reports.sweep.measures import FRAMES

COLUMNS = (
    *("study", "scenario", "engine", "profile", "settings", "dt", "quantity", "unit"),
    *("error", "discretisation", "model", "time", "time_low", "time_high", "front"),
    *("truth", "truth_change", "horizon", "outcome", "verdict", "reason", "reproduce"),
)
"""Columns of the table. Times are in s per simulated second: the median of the rounds, and their range;
`discretisation` is the change from the engine's own finest step, `model` the error there."""


class Results:
    """Rows of a sweep by cell, with the runs and truths made of them."""

    def __init__(self, frame: pd.DataFrame) -> None:
        self._rows = dict(iter(frame.groupby("cell", sort=False)))

    def rows(self, cell: Cell) -> pd.DataFrame:
        """Rows of a cell."""
        found: pd.DataFrame = self._rows.get(hash_of(cell), pd.DataFrame({"outcome": []}))
        return found

    def run(self, cell: Cell) -> Run | None:
        """The run of a cell; None if it did not end."""
        return run_of(self.rows(cell), scene_of(cell.source, cell.scenario, 0))

    def truth(self, scene: str) -> Truth | None:
        """The true motion of a scene."""
        fine, finer, plain = (
            self.run(Cell(scene, TRUTH_ENGINE, TRUTH_PROFILE, dt)) for dt in (FINE, FINER, 1 / 240)
        )
        perturbed = [
            self.run(Cell(scene, TRUTH_ENGINE, TRUTH_PROFILE, 1 / 240, seed=seed, source=PERTURBED))
            for seed in PERTURBED_SEEDS
        ]
        runs = {"plain": [plain] if plain else [], "perturbed": [run for run in perturbed if run]}
        return truth_of(scene_of(Cell(scene, REFERENCE, "", 1).source, scene, 0), fine, finer, runs)

    def times(self, cell: Cell, run: Run, rounds: int) -> list[float]:
        """Seconds per simulated second of each round: the frames timed, extrapolated to the whole scene by
        the seconds of all frames in the accuracy run."""
        scenario = scene_of(cell.source, cell.scenario, 0)
        found = []
        for repeat in range(rounds):
            timed = self.rows(timing_cell(cell, repeat))
            series = [s for m, s in zip(timed.get("metric", ()), timed.get("series", ())) if m == FRAMES]
            if series and len(series[0]):
                frames = np.asarray(series[0], dtype=float)
                share = run.frames[: len(frames)].sum() / run.frames.sum()
                found.append(float(frames.sum() / share / scenario.duration))
        return found


def timing_cell(cell: Cell, repeat: int) -> Cell:
    """The timing cell of an accuracy cell."""
    return Cell(
        cell.scenario, cell.engine, cell.profile, cell.dt, cell.changes, measure=TIMING, repeat=repeat
    )


def points(frame: pd.DataFrame, cells: Sequence[Cell], rounds: int) -> pd.DataFrame:
    """The table of the study from the rows of its sweep (with series)."""
    results = Results(frame)
    found: list[dict[str, object]] = []
    for scene in dict.fromkeys(cell.scenario for cell in cells):
        mine = [cell for cell in cells if cell.scenario == scene]
        truth = results.truth(scene)
        runs = {cell: results.run(cell) for cell in mine}
        finest = {
            key: min((c for c in mine if _family(c) == key), key=lambda c: c.dt) for key in map(_family, mine)
        }
        limits = {key: runs[cell] for key, cell in finest.items()}
        for cell in mine:
            base = _base(cell, results.rows(cell))
            run = runs[cell]
            if run is None or truth is None:
                found.append({**base, "quantity": "", "error": nan})
                continue
            limit = limits[_family(cell)] if finest[_family(cell)] != cell else None
            times = dict(zip(("time", "time_low", "time_high"), band(results.times(cell, run, rounds))))
            horizon = truth.horizon / scene_of(cell.source, scene, 0).frame_rate
            for parts in _parts(run, limit, truth):
                found.append({**base, **times, **parts, "horizon": horizon})
    table = pd.DataFrame(found, columns=list(COLUMNS))
    table["front"] = False
    for (_, quantity), part in table[table.quantity != ""].groupby(["scenario", "quantity"]):
        table.loc[part.index, "front"] = pareto(
            part.time.to_numpy(), part.error.to_numpy(), QUANTITIES[str(quantity)].floor
        )
    return table


def _family(cell: Cell) -> tuple[str, str, tuple[str, ...]]:
    """Cells that differ in their step only."""
    return cell.engine, cell.profile, cell.changes


def _parts(run: Run, limit: Run | None, truth: Truth) -> Iterator[dict[str, object]]:
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
            "truth_change": truth.change.get(name, nan),
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
