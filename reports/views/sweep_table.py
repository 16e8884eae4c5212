"""Table of a sweep on the terminal: a line per scene, engine and setting."""

from __future__ import annotations

import numpy as np
import pandas as pd

from touchstone.reports.metrics import in_tables
from touchstone.reports.runner.cells import TIMING
from touchstone.reports.runner.measures import FRAMES
from touchstone.reports.runner.request import step_text
from touchstone.reports.views.render import Part
from touchstone.scenarios.plural import plural

SHOWN = ("truth.position", "overlap.max", "energy.injected", "friction.stop", "friction.cone")
"""Metrics of the table, where any cell has them."""
TEXTS = ("scene", "engine", "settings")
KEYS = ("scenario", "engine", "profile", "settings", "dt", "seed")


def report(frame: pd.DataFrame) -> list[Part]:
    """The median over repeats of SHOWN; a cell that failed shows its reason."""
    metrics = [name for name in SHOWN if frame[frame.metric == name].value.notna().any()]
    timed, seeded = bool((frame.measure == TIMING).any()), frame.seed.nunique() > 1
    heads = [*TEXTS, *["seed"] * seeded, "step [s]", *(f"{name} [{in_tables(name)[0]}]" for name in metrics)]
    heads += [*["frame [us]"] * timed, "outcome"]
    rows = []
    for _, part in frame.groupby(list(KEYS), sort=False):
        first = part.iloc[0]
        values = [_value(part, name) for name in metrics]
        values += [_frame_time(part[part.measure == TIMING])] if timed else []
        label = f"{first.profile} {first.settings}".strip()
        texts = [first.scenario, first.engine, label, *([str(first.seed)] if seeded else [])]
        ended = part[part.metric == "run"]
        ends = (f"{o}: {r}" if o != "done" else r for o, r in zip(ended.outcome, ended.reason))
        rows.append([*texts, step_text(first["dt"]), *values, "; ".join(dict.fromkeys(ends))])
    return [Part(plural(frame.cell.nunique(), "cell"), heads, rows, words=len(TEXTS) + seeded, last=1)]


def _value(part: pd.DataFrame, metric: str) -> str:
    values = part[part.metric == metric].value.dropna()
    return "-" if values.empty else f"{np.median(values) * in_tables(metric)[1]:.3g}"


def _frame_time(part: pd.DataFrame) -> str:
    """Median over rounds of the mean time of the displayed frames that were timed, with the range [us]."""
    timed = part[part.metric.isin(("run", FRAMES))]
    per_cell = timed.pivot_table(index="cell", columns="metric", values="value")
    if per_cell.empty or FRAMES not in per_cell:
        return "-"
    found = 1e6 * per_cell["run"] / per_cell[FRAMES]
    spread = f" ({found.min():.3g}-{found.max():.3g})" if len(found) > 1 else ""
    return f"{found.median():.3g}{spread}"
