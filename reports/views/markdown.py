"""`report.md`: the run as a page."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from touchstone.reports.metrics import HORIZON, SPREAD
from touchstone.reports.results import rows_of
from touchstone.reports.views.comparison import (
    FORCE_PICTURE,
    Columns,
    Line,
    Section,
    columns,
    command,
    force_panels,
    head,
    not_played,
    sections,
    worst_lines,
)
from touchstone.reports.views.findings import losses_part, published_part
from touchstone.reports.views.frame_budget import budget_part
from touchstone.reports.views.render import Part, markdown
from touchstone.reports.views.tables import (
    APART,
    APART_HEADS,
    LEGEND,
    TableCell,
    apart_table,
    cell_of,
    number,
)
from touchstone.reports.views.terminal import grid_part, ratio_part, remark_lines
from touchstone.scenarios.files.named import argument_of
from touchstone.scenarios.plural import plural

if TYPE_CHECKING:
    from touchstone.reports.runner.request import Request, Results
    from touchstone.scenarios.scenario import Scenario

BUDGET_STAGES = ("collision", "removal", "impulses", "integration", "drive")


def report(request: Request, results: Results) -> str:
    """The whole page."""
    frame = results.frame
    parts = ["# touchstone run", "", f"`{request.command}`" if request.command else ""]
    if apart := apart_table(rows_of(frame)):
        parts += markdown(Part(APART, APART_HEADS, apart, words=4))
    if (published := published_part(frame, request.scenarios)).rows:
        parts += markdown(published)
    parts += _differences(request, results)
    if (forces := _forces(request, results)).rows:
        parts += markdown(forces)
    parts += markdown(losses_part(frame))
    for scenario in request.scenarios:
        scene = frame[frame.scenario == scenario.name]
        grid = replace(grid_part(frame, scenario.name, code=True), title="", notes=[f"`{LEGEND}`"])
        parts += ["", f"## {scenario.name}", "", f"{scenario.summary}.", *markdown(grid)]
        remarks = Part("remarks", lines=remark_lines(scene) or ["none"])
        for part in (_asked(scene, scenario), ratio_part(scene), _budget(scene), _spreads(scene), remarks):
            parts += markdown(part, 3)
        parts += ["", f"Reproduce: `touchstone run {argument_of(scenario.name)}`"]
    budget = budget_part(results.recordings)
    parts += markdown(budget) if budget.rows else []
    return "\n".join(parts).rstrip() + "\n"


FORCE_NOTE = (
    "Normal force of the pairs with the largest impulses, from the impulses that each engine reports: mean "
    "over the frames in which the pair presses [N], largest mean of a frame [N], integral over the run. "
    "Dashed in the picture: the closed form, in scenes that state a force."
)
FORCE_FIGURES = ("force.contact.mean", "force.contact.peak", "force.contact.impulse")


def _forces(request: Request, results: Results) -> Part:
    own, frame = columns(results), results.frame
    figures = {
        (row.scenario, row.subject, row.engine, row.metric): number(row.value)
        for row in rows_of(frame[frame.metric.isin(FORCE_FIGURES)])
        if row.engine in own and row.profile == own[row.engine].profile and np.isfinite(row.value)
    }
    rows = []
    for panel in force_panels(request, results):
        places = [(panel.scenario.name, panel.pair, engine) for engine in own]
        found = [[figures.get((*place, name), "") for name in FORCE_FIGURES] for place in places]
        rows.append([*places[0][:2], *(", ".join(cells) if all(cells) else "-" for cells in found)])
    heads = ["scene", "pair", *map(head, own.values())]
    return Part("contact forces", heads, rows, [FORCE_NOTE], words=2, picture=FORCE_PICTURE)


PLACES = 8
"""Number of scenes that are named; the rest is counted."""
INTRODUCTION = (
    "Each engine in its own profile, at its own step. A line is a metric whose truth is 0, or a time, of the "
    "pair on which engines differ most; lines on which none is apart are left out. The outlier is the engine "
    "farthest from the median of the others, and by how much; of two, the one farther from the truth."
)


def _differences(request: Request, results: Results) -> list[str]:
    """The four sections, with the runs that did not take place."""
    parts = ["", "## Differences between the engines", ""]
    missing = [f"- not played: {reason}" for reason in not_played(results)]
    found, own = sections(request, results), columns(results)
    if not found:
        return [*parts, "Fewer than two engines played: no differences to show.", *missing]
    parts += [INTRODUCTION, "", f"`{LEGEND}`", "", *missing]
    for section in found:
        parts += markdown(_section(request, results, section, own), 3)
    return parts


def _section(request: Request, results: Results, section: Section, own: Columns) -> Part:
    """The table and picture of a topic, and the scenes in which each engine is best."""
    worst, name = worst_lines(section), section.topic.name
    heads = ["scene", "metric", "unit", *map(head, own.values())]
    heads += ["limit", "outlier", "the scene's worst again"]
    rows = []
    for line in section.lines:
        cells = [cell_of(line.rows[engine]) if engine in line.rows else TableCell("-") for engine in own]
        figures = [line.unit, *(cell.marked for cell in cells), _limits(line, results), line.outlier_text]
        again = f"`{command(request, line)}`" if line is worst[line.scenario] else ""
        rows.append([line.scenario, f"`{line.name}`", *figures, again])
    lines = _nearest(section, own) if rows else []
    lines += [f"{reason} ({', '.join(dict.fromkeys(scenes))})" for reason, scenes in section.gaps.items()]
    lines += [f"no engine apart: {', '.join(section.equal)}"] if section.equal else []
    lines += [f"no figure of two engines: {', '.join(section.without)}"] if section.without else []
    title = f"differences in {name}"
    if not rows:
        return Part(title, lines=lines)
    return Part(title, heads, rows, (), lines, words=3, picture=f"{name}.png")


def _limits(line: Line, results: Results) -> str:
    """The limit of all engines or of each kind of engine; for a time, that of the reference's ratio."""
    if line.metric == "time.frame.median":
        frame = results.frame
        mine = rows_of(frame[(frame.scenario == line.scenario) & (frame.metric == "ratio.time")])
        some = [row for row in mine if np.isfinite(row.limit)]
        return "; ".join(f"{r.engine} {number(r.value)} of {r.subject}, at most {r.limit:g}" for r in some)
    found: dict[str, list[str]] = {}
    for engine, row in line.rows.items():
        if np.isfinite(row.limit):
            found.setdefault(line.text(row.limit), []).append(engine)
    if len(found) == 1:
        return next(iter(found))
    return "; ".join(f"{', '.join(engines)} {limit}" for limit, engines in found.items())


def _nearest(section: Section, own: Columns) -> list[str]:
    """Per engine, the scenes in which it is nearest to the truth."""
    best = {engine: [line for line in section.lines if engine in line.nearest] for engine in own}
    word = "shortest" if section.topic.name == "timing" else "nearest to the truth"
    return [
        f"{engine} {word} on {len(lines)} of {plural(len(section.lines), 'line')}" + _places(lines)
        for engine, lines in best.items()
    ]


def _places(lines: list[Line]) -> str:
    """Names of the scenes, or of the metrics if there is one scene."""
    scenes = list(dict.fromkeys(line.scenario for line in lines))
    names = scenes if len(scenes) > 1 else [f"{line.scenario} {line.name}" for line in lines]
    more = f" and {len(names) - PLACES} more" if len(names) > PLACES else ""
    return f": {', '.join(names[:PLACES])}{more}" if names else ""


def _asked(scene: pd.DataFrame, scenario: Scenario) -> Part:
    """Restitution of every bounce and friction of every sliding pair, with the requested values."""
    columns = list(dict.fromkeys(zip(scene.engine, scene.profile)))
    achieved = scene[scene.metric.isin(["restitution.achieved", "friction.deficit"]) & scene.value.notna()]
    lines: dict[tuple[str, str], dict[tuple[str, str], str]] = {}
    wanted: dict[tuple[str, str], float] = {}
    index = {body.name: k for k, body in enumerate(scenario.bodies)}
    for row in rows_of(achieved):
        kind = row.metric.partition(".")[0]
        asked = scenario.pair_coefficients(index[row.body_a], index[row.body_b])[kind == "friction"]
        value = row.value if kind == "restitution" else asked * (1 - row.value)
        wanted[kind, row.subject] = asked
        lines.setdefault((kind, row.subject), {})[row.engine, row.profile] = number(value)
    shown = [column for column in columns if any(column in line for line in lines.values())]
    heads = ["", "asked", *(f"{engine} {profile}" for engine, profile in shown)]
    rows = [
        [f"{kind} {subject}", number(wanted[kind, subject]), *(line.get(column, "-") for column in shown)]
        for (kind, subject), line in lines.items()
    ]
    return Part("asked and achieved", heads, rows, empty="nothing bounces or slides")


def _budget(scene: pd.DataFrame) -> Part:
    """Median frame and share of each stage per column, with the number of tested pairs."""
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
    return Part("frame budget", heads, rows, [note])


def _spreads(scene: pd.DataFrame) -> Part:
    rows = [
        [f"`{row.metric}` {row.subject}", f"{number(row.value)} {row.unit}", row.verdict, row.reason]
        for row in rows_of(scene[(scene.engine == "all") & ~scene.metric.isin([SPREAD, HORIZON])])
        if np.isfinite(row.value)
    ]
    heads = ["event", "spread", "verdict", "remark"]
    return Part("spread of the events", heads, rows, words=4, empty="none")
