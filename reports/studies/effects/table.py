"""The tables of the study `effects` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.bench.tables import MICRO, limit_text, print_remarks, value_text
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.effects.definitions import (
    ALL,
    GROUPS,
    IDENTICAL,
    MATTERS,
    REFERENCE,
    TOGGLED,
    WITHIN,
)
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import table_of
from touchstone.scenarios.effects import EFFECT_TABLE

HEADS = (
    *("scene", "engine", "[µs]", "saved [%]", "95 %", "moved [m]", "outcome"),
    "plan [ms]",
)
MEANS = ("scenes", "engine", "left [%]", "95 % interval", "limit", "of")
NOTES = (
    "saved: of the mean frame with all effects, by the plan; the reference net of the call from Python",
    "outcome: largest difference over frames and bodies; identical: to the bit",
    "one by one: M off, and it matters   ~ off, within tolerance   = off, identical though needed",
    "            . on, identical   ! on, and it changes something   x cannot be played so",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print savings and outcomes, effects one by one, means, and every limit that is broken."""
    rows = {(r.scenario, r.engine, r.metric, r.subject): r for r in rows_of(frame)}
    table = table_of("effects: the plan against all effects", HEADS, left=2)
    for scenario, engine, metric, _ in rows:
        if metric == "time.frame":
            table.add_row(*_cells(rows, scenario, engine))
    out.print(table)
    _show_toggles(rows, out)
    means = table_of("effects: geometric means of what the plan leaves of the time", MEANS, left=2)
    for (scenario, engine, metric, _), row in rows.items():
        if metric == "time.left" and scenario in GROUPS:
            between = f"{100 * row.low:.0f} to {100 * row.high:.0f}"
            count = row.reason.partition(";")[0]
            means.add_row(scenario, engine, f"{100 * row.value:.0f}", between, limit_text(row), count)
    out.print(means)
    print_remarks(frame, out, NOTES)


def outcome(row: Row | None) -> str:
    """Verdict on the outcome in a row: its code."""
    return "" if row is None else row.reason_code


def mark(rows: dict[tuple[str, str, str, str], Row], scenario: str, effect: str) -> str:
    """Mark of the outcome of toggling an effect on the reference."""
    for sign, words in (("-", {MATTERS: "M", WITHIN: "~", IDENTICAL: "="}), ("+", {IDENTICAL: "."})):
        row = rows.get((scenario, REFERENCE, "effects.moved", sign + effect))
        if row is not None:
            return words.get(outcome(row), "!")
    return "x"


def _show_toggles(rows: dict[tuple[str, str, str, str], Row], out: Console) -> None:
    scenes = [key[0] for key in rows if key[1:3] == (REFERENCE, "time.frame")]
    if not scenes:
        return
    heads = ("scene", *(EFFECT_TABLE[effect].short for effect in TOGGLED))
    table = table_of("effects: one by one, on the reference", heads, left=1)
    for scenario in scenes:
        table.add_row(scenario, *(mark(rows, scenario, effect) for effect in TOGGLED))
    out.print(table)


def _cells(rows: dict[tuple[str, str, str, str], Row], scenario: str, engine: str) -> list[str]:
    def of(metric: str, subject: str = ALL) -> Row | None:
        return rows.get((scenario, engine, metric, subject))

    saved, moved, plan = of("time.saved"), of("effects.moved"), of("time.plan", "")
    return [
        scenario,
        engine,
        value_text(of("time.frame", ""), MICRO),
        "" if saved is None else _percent(saved.value),
        "" if saved is None else f"{_percent(saved.low)} to {_percent(saved.high)}",
        _difference(moved),
        outcome(moved),
        "" if plan is None else exact_number(1e3 * plan.value),
    ]


def _percent(share: float) -> str:
    return f"{100 * share + 0.0:.0f}"


def _difference(row: Row | None) -> str:
    if row is None:
        return ""
    return "0" if row.value == 0 else f"{row.value:.1e}"
