"""Terminal output of the study: the front of every scene and quantity, and where the reference loses."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log
from typing import Any

import pandas as pd
from rich.console import Console
from rich.table import Table

from touchstone.reports.run.request import step_text
from touchstone.reports.studies.work_precision.definitions import QUANTITIES
from touchstone.reports.studies.work_precision.errors import NOT_CONVERGED

LADDER_SHOWN = 1.25
"""Change of an error, up or down, from which a rung of the ladder is shown."""


def number(value: float, unit: str) -> str:
    """A value with its unit, in a readable multiple of it."""
    scales = {"m": ((1e-3, "mm"), (1e-6, "um"), (1e-9, "nm")), "s": ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"))}
    if unit == "1":
        return f"{100 * value:.3g} %"
    if value == 0:
        return f"0 {unit}"
    for scale, name in scales[unit]:
        if value >= scale:
            return f"{value / scale:.3g} {name}"
    return f"{value / scale:.2g} {name}"


def show(table: pd.DataFrame, console: Console) -> None:
    """Print the cheapest point of each engine that meets the usual tolerance, the fronts, and the ladder."""
    _answers(table, console)
    _unconverged(table, console)
    fronts = table.attrs.get("fronts")
    if fronts is not None and len(fronts):
        _losses(fronts, console)
    ladder = table.attrs.get("ladder")
    if ladder is not None and len(ladder):
        _ladder(ladder, console)
    failed = table[table.quantity == ""]
    for row in _rows(failed):
        console.print(f"{row.reproduce.removeprefix('touchstone run ')}: {row.outcome}: {row.reason}")
    seconds = table.attrs.get("seconds")
    if seconds:
        parts = ", ".join(f"{name} {value:.0f} s" for name, value in seconds.items())
        console.print(f"The study took {sum(seconds.values()):.0f} s: {parts}.")


def _unconverged(table: pd.DataFrame, console: Console) -> None:
    """Scenes whose truth still changes with its step: their errors cannot be smaller than that change."""
    part = table[table.truth == NOT_CONVERGED].drop_duplicates(["scenario", "quantity"])
    for row in _rows(part):
        change = number(row.truth_change, row.unit)
        console.print(
            f"{row.scenario}, {row.quantity}: the truth has not converged, half the step changes it by "
            f"{change} within {row.horizon:.3g} s"
        )


def _answers(table: pd.DataFrame, console: Console) -> None:
    engines = list(dict.fromkeys(table.engine))
    shown = Table(
        title="Cheapest measured time per simulated second within the usual tolerance",
        title_justify="left",
        box=None,
        pad_edge=False,
    )
    for head in ("scene", "quantity", "tolerance", *engines):
        shown.add_column(head, justify="left" if head in ("scene", "quantity") else "right")
    usable = table[(table.quantity != "") & table.time.notna()]
    for (scene, quantity), part in usable.groupby(["scenario", "quantity"], sort=False):
        one = QUANTITIES[str(quantity)]
        cells = []
        for engine in engines:
            mine = part[part.engine == engine]
            within = mine[mine.error <= one.tolerance]
            if not within.empty:
                best = within.loc[within.time.idxmin()]
                cells.append(f"{number(best.time, 's')} at {step_text(best['dt'])}")
            elif not mine.empty:
                cells.append(f"best {number(mine.error.min(), one.unit)}")
            else:
                cells.append("-")
        shown.add_row(str(scene), str(quantity), number(one.tolerance, one.unit), *cells)
    console.print(shown)


def _losses(fronts: pd.DataFrame, console: Console) -> None:
    won, total = int(fronts.dominates.sum()), len(fronts)
    console.print(f"\nThe reference's front dominates {won} of {total} fronts (scene, quantity, engine).")
    lost = fronts[~fronts.dominates].sort_values("factor", ascending=False)
    for _, part in lost.groupby(["scenario", "engine", "where", "why"], sort=False):
        first = part.iloc[0]
        by = "" if first.factor == inf else f" by {first.factor:.3g}"
        quantities = ", ".join(part.quantity)
        console.print(f"  {first.scenario}, {quantities}: {first.engine}{by}: {first.why} ({first['where']})")


def _ladder(ladder: pd.DataFrame, console: Console) -> None:
    """Changes of `balanced` that change an error or the time."""
    shown = Table(
        title="\nProfiles against balanced, and one setting of balanced at a time: errors and time",
        title_justify="left",
        box=None,
        pad_edge=False,
    )
    for head in ("setting", "as in", "time", "changes"):
        shown.add_column(head, justify="right" if head == "time" else "left")
    for (change, towards), part in ladder.groupby(["change", "towards"], sort=False):
        moved = []
        for row in _rows(part):
            floor = QUANTITIES[row.quantity].floor
            before, after = max(row.before, floor), max(row.after, floor)
            if not 1 / LADDER_SHOWN < after / before < LADDER_SHOWN:
                values = f"{number(row.before, row.unit)} -> {number(row.after, row.unit)}"
                moved.append((abs(_log(after / before)), f"{row.scenario} {row.quantity} {values}"))
        texts = [text for _, text in sorted(moved, reverse=True)]
        more = f"; {len(texts) - 3} more" if len(texts) > 3 else ""
        times = part.drop_duplicates("scenario").time_ratio
        shown.add_row(
            str(change), str(towards), f"{times.median():.2f} x", "; ".join(texts[:3]) + more or "none"
        )
    console.print(shown)


def _rows(frame: pd.DataFrame) -> Iterator[Any]:
    """Rows as named tuples."""
    return iter(frame.itertuples())


def _log(ratio: float) -> float:
    return log(ratio) if 0 < ratio < inf else inf
