"""`report.md`: the run as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from reports.frame_budget import BUDGET_PICTURE, HEADS, NOTE, budget_rows, budgets
from reports.results import rows_of
from reports.tables import LEGEND, grid, number
from reports.terminal import RATIO_HEADS, ratio_rows, remark_lines

if TYPE_CHECKING:
    from reports.run import Request, Results
    from scenarios.scenario import Scenario

BUDGET_STAGES = ("collision", "removal", "impulses", "integration", "drive")


def report(request: Request, results: Results) -> str:
    """The whole page."""
    parts = ["# touchstone run", "", f"`{request.command}`" if request.command else ""]
    for scenario in request.scenarios:
        scene = results.frame[results.frame.scenario == scenario.name]
        parts += ["", f"## {scenario.name}", "", f"{scenario.summary}.", ""]
        parts += _grid(results.frame, scenario.name)
        parts += ["", f"`{LEGEND}`", ""]
        parts += ["### Asked and achieved", "", *_asked(scene, scenario), ""]
        parts += ["### Time: the reference's median frame over an engine's", ""]
        parts += [*_markdown(list(RATIO_HEADS), ratio_rows(scene), 1), ""]
        parts += ["### Frame budget", "", *_budget(scene), ""]
        parts += ["### Spread of the events", "", *_spreads(scene), ""]
        parts += ["### Remarks", "", *_bullets(remark_lines(scene))]
        parts += ["", f"Reproduce: `touchstone run {scenario.name}`"]
    found = budgets(results.recordings)
    if found:
        parts += ["", "## Frame budget of the scenes", "", *_markdown(list(HEADS), budget_rows(found), 1)]
        parts += ["", NOTE, "", f"![frame budget]({BUDGET_PICTURE})"]
    return "\n".join(parts).rstrip() + "\n"


def _bullets(lines: list[str]) -> list[str]:
    return [f"- {line}" for line in lines] or ["none"]


def _markdown(heads: list[str], rows: list[list[str]], left: int) -> list[str]:
    rule = ["---"] * left + ["---:"] * (len(heads) - left)
    return ["| " + " | ".join(line) + " |" for line in (heads, rule, *rows)]


def _grid(frame: pd.DataFrame, scenario: str) -> list[str]:
    cells = grid(frame, scenario)
    heads = ["metric", "unit", *(f"{engine} {profile} {step} s" for engine, profile, step in cells.heads)]
    rows = [
        [f"`{metric}` {subject}".strip(), "" if unit == "1" else unit, *(cell.marked for cell in row)]
        for metric, subject, unit, row in cells.rows
    ]
    return _markdown(heads, rows, 2)


def _asked(scene: pd.DataFrame, scenario: Scenario) -> list[str]:
    """Restitution of every bounce and friction of every sliding pair, beside what the scene asks for."""
    columns = list(dict.fromkeys(zip(scene.engine, scene.profile)))
    achieved = scene[scene.metric.isin(["restitution.achieved", "friction.deficit"]) & scene.value.notna()]
    lines: dict[tuple[str, str], dict[tuple[str, str], str]] = {}
    wanted: dict[tuple[str, str], float] = {}
    for row in rows_of(achieved):
        kind = row.metric.partition(".")[0]
        names = row.subject.partition(" ")[0].split("-")
        asked = scenario.pair_coefficients(*map(scenario.body_index, names))[kind == "friction"]
        value = row.value if kind == "restitution" else asked * (1 - row.value)
        wanted[kind, row.subject] = asked
        lines.setdefault((kind, row.subject), {})[row.engine, row.profile] = number(value)
    told = [column for column in columns if any(column in line for line in lines.values())]
    heads = ["", "asked", *(f"{engine} {profile}" for engine, profile in told)]
    rows = [
        [f"{kind} {subject}", number(wanted[kind, subject]), *(line.get(column, "-") for column in told)]
        for (kind, subject), line in lines.items()
    ]
    return _markdown(heads, rows, 1) if rows else ["nothing bounces or slides"]


def _budget(scene: pd.DataFrame) -> list[str]:
    """Per column the median frame and the share of each stage, with the pairs that were looked at."""
    heads = ["engine", "frame us", *BUDGET_STAGES, "pairs", "contacts"]
    rows = []
    for (engine, profile), part in scene.groupby(["engine", "profile"], sort=False):
        total = part[part.metric == "time.frame.median"].value
        if total.empty:
            continue
        shares = part[part.metric == "time.share"].set_index("subject").value
        counts = part[part.metric == "work"].set_index("subject").value
        stages = [f"{100 * shares[name]:.0f} %" if name in shares else "" for name in BUDGET_STAGES]
        pairs = [number(counts[name]) if name in counts else "" for name in ("pairs", "contacts")]
        rows.append([f"{engine} {profile}", number(1e6 * total.iloc[0]), *stages, *pairs])
    note = "Shares of the stages an engine tells apart; a blank is a stage it does not tell. Means per frame."
    return [*_markdown(heads, rows, 1), "", note]


def _spreads(scene: pd.DataFrame) -> list[str]:
    rows = [
        [f"`{row.metric}` {row.subject}", f"{number(row.value)} {row.unit}", row.verdict, row.reason]
        for row in rows_of(scene[scene.engine == "all"])
        if np.isfinite(row.value)
    ]
    return _markdown(["event", "spread", "verdict", "remark"], rows, 4) if rows else ["none"]
