"""Where the reference's front dominates each engine's, per scene and quantity; why not elsewhere."""

from __future__ import annotations

import pandas as pd

from touchstone.reports.studies.work_precision.definitions import QUANTITIES, REFERENCE
from touchstone.reports.studies.work_precision.front import deficit
from touchstone.scenarios.catalogue import catalogue

COLUMNS = ("scenario", "quantity", "engine", "dominates", "factor", "where", "why")
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
    return pd.DataFrame(rows, columns=list(COLUMNS))


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
