"""The tables of a run on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console
from rich.table import Table
from rich.text import Text

from reports.tables import Cell, Grid, grid, number

STYLES = {"fail": "bold red", "known": "yellow", "error": "bold red", "skipped": "dim", "pass": ""}
NARROW = 110
"""Columns a table needs; plain output (files, pipes) is never narrower."""


def console(**options: bool) -> Console:
    """A console as wide as the terminal, or NARROW where there is none."""
    probe = Console(**options)  # type: ignore[arg-type]
    return probe if probe.is_terminal else Console(width=NARROW, **options)  # type: ignore[arg-type]


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one table per scene, its ratios, and every verdict that is no pass."""
    for scenario in dict.fromkeys(frame.scenario):
        scene = frame[frame.scenario == scenario]
        out.print(_table(scenario, grid(frame, scenario)))
        out.print(
            Text("! limit broken   k known failing   * outlier of its row   - not measured", style="dim")
        )
        for line in ratio_lines(scene):
            out.print(line, highlight=False)
        for line in remark_lines(scene):
            out.print(line, highlight=False, style="red" if line.startswith(("fail", "error")) else "")


def _table(scenario: str, cells: Grid) -> Table:
    table = Table(title=scenario, title_justify="left", header_style="bold", pad_edge=False)
    table.add_column("metric", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for engine, profile, step in cells.heads:
        table.add_column(f"{engine}\n{profile}\n{step} s", justify="right", no_wrap=True)
    family = ""
    for metric, subject, unit, row in cells.rows:
        if family and metric.split(".")[0] != family:
            table.add_section()
        family = metric.split(".")[0]
        name = Text.assemble(metric, (f" {subject}" if subject else "", "dim"))
        table.add_row(name, "" if unit == "1" else unit, *[_text(cell) for cell in row])
    return table


def _text(cell: Cell) -> Text:
    return Text(
        cell.marked, style="bold" if cell.outlier and cell.verdict == "" else STYLES.get(cell.verdict, "")
    )


def ratio_lines(scene: pd.DataFrame) -> list[str]:
    """`ratio.time` of the reference, one line per engine."""
    lines = []
    for row in scene[scene.metric == "ratio.time"].itertuples():
        judged = f"  {row.verdict}: at most {row.limit:g}" if row.verdict else ""
        lines.append(
            f"ratio.time {row.engine} {row.profile} / {row.subject}: {number(row.value)} "
            f"[{number(row.low)}, {number(row.high)}]{judged} ({row.reason})"
        )
    return lines


def remark_lines(scene: pd.DataFrame) -> list[str]:
    """What broke a limit, is known, was skipped as a whole or failed, each with its reason."""
    lines = []
    for row in scene[scene.verdict.isin(["fail", "error", "known"])].itertuples():
        name = f"{row.metric} {row.subject}".strip()
        value = "" if row.metric == "run" else f" = {number(row.value)} {row.unit}, limit {number(row.limit)}"
        lines.append(f"{row.verdict}: {row.engine} {row.profile}: {name}{value}: {row.reason}")
    for row in scene[(scene.verdict == "skipped") & (scene.metric == "run")].itertuples():
        lines.append(f"skipped: {row.engine} {row.profile}: {row.reason}")
    return lines
