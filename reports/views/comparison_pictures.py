"""Pictures of the differences between engines in a run: overlap, energy, friction, timing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.reports.metrics import in_tables
from touchstone.reports.metrics.motion.time_series import FORCE
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import REFERENCE, Request, Results
from touchstone.reports.views.comparison import (
    FORCE_PICTURE,
    LARGEST_SCENE_COUNT,
    Columns,
    ForcePanel,
    Line,
    Section,
    columns,
    force_panels,
    head,
    sections,
)
from touchstone.reports.views.pictures import (
    DASHES,
    DOTS,
    INK,
    POWERS,
    Looks,
    axis,
    color_of,
    encoded,
    ends,
    grid,
    log_axis,
    marker_of,
    rule,
    save,
    strips,
)
from touchstone.reports.views.tables import number, unit_of

ACROSS = 3
"""Largest number of panels side by side."""
PANEL, ROW, TIMES, MILLI = (210, 120), 20, 34, 1e3
"""Width and height of a panel, heights of rows of dots and of times [point]; milliseconds in a second."""
BELOW, LEAST_EXCESS = 0.1, 1e-4
"""Smaller values are drawn at these and labelled 0: a share of a line's `same`, an excess of friction [1]."""
CONE = "largest excess of friction over mu times\npressure, over the latter; Coulomb: 0"
DEFICIT = "friction over mu times pressure\nwhile sliding; Coulomb: 1"
FRICTION: tuple[tuple[str, str, float, Callable[[Row], float]], ...] = (
    ("friction.cone", CONE, 0.0, lambda row: max(row.value, LEAST_EXCESS)),
    ("friction.deficit", DEFICIT, 1.0, lambda row: 1.0 - row.value),
    ("friction.stop", "distance of stopping, too long by;\nCoulomb: 0", 0.0, lambda row: row.value),
)
"""Metric, the quantity drawn, its truth."""
TITLES = {
    "overlap": "Overlap: the depth of the deepest pair of bodies",
    "energy": "Energy from nowhere: how far S = K + U - W rises above its least so far",
    "friction": "Friction, beside Coulomb's law",
    "timing": "The time a displayed frame takes",
    "forces": "Contact force: the normal impulses of a pair in a displayed frame, over its duration",
}
NOTES = {
    "overlap": "measured by one oracle for all engines",
    "energy": "passive contact only lowers S; W: work of the drive, or of driven bodies on simulated ones",
    "friction": "contact by contact: impulses are the engine's word, audited against the motion",
    "timing": "native step calls, one thread, all engines interleaved in one run; each its own step",
    "forces": "pairs with the largest impulses, which are the engine's word; dashed: closed form",
}
DASHES_NOTE = "; dashed: limit of the engines, dotted: of the reference"


def draw(request: Request, results: Results, folder: Path) -> None:
    """Write `<topic>.png` of every topic in which engines differ, and of forces; what fails is a fault."""
    for section in sections(request, results):
        if section.lines:
            path = folder / f"{section.topic.name}.png"
            results.write(path.name, partial(_write, request, results, section, path))
    results.write(FORCE_PICTURE, lambda: draw_forces(request, results, folder))


def _write(request: Request, results: Results, section: Section, path: Path) -> None:
    name = section.topic.name
    note = NOTES[name] + DASHES_NOTE * (name in ("overlap", "energy"))
    save(PICTURES[name](request, results, section), path, TITLES[name], note)


def draw_forces(request: Request, results: Results, folder: Path) -> None:
    """Write FORCE_PICTURE, with the panels of `force_panels`, if there is one."""
    if found := force_panels(request, results):
        own = columns(results)
        drawn = grid([_force_panel(panel, own) for panel in found], ACROSS)
        save(drawn, folder / FORCE_PICTURE, TITLES["forces"], NOTES["forces"])


def _marks(own: Columns) -> Looks:
    """Looks of engines by the headings of their columns."""
    return encoded(map(color_of, own), map(marker_of, own), list(map(head, own.values())))


def _force_panel(panel: ForcePanel, own: Columns) -> Any:
    scenario, key = panel.scenario, (FORCE, panel.pair)
    courses = {e: (one.time, one.values[key]) for e, one in panel.courses.items() if key in one.values}
    span = axis(alt.X, "time", "time [s]", (0, scenario.duration))
    drawn = _lines(courses, own).encode(x=span, y=alt.Y("value:Q", title="[N]"))
    found = [t for t in scenario.forces if t.quantity == "force" and t.is_of(panel.pair)]
    truths = [(truth.start, truth.end, truth.value) for truth in found]
    if truths:
        rules = alt.Chart(pd.DataFrame(truths, columns=["time", "end", "value"])).mark_rule(strokeDash=DASHES)
        drawn += rules.encode(x="time:Q", x2="end:Q", y="value:Q")
    return drawn.properties(title=f"{scenario.name} {panel.pair}", width=PANEL[0], height=PANEL[1])


def _lines(courses: Mapping[str, tuple[Array, Array]], own: Columns) -> Any:
    """A line per engine over time."""
    parts = [
        pd.DataFrame({"time": time, "value": values, "engine": head(own[engine])})
        for engine, (time, values) in courses.items()
    ]
    return alt.Chart(pd.concat(parts)).mark_line(strokeWidth=1).encode(color=_marks(own)["color"])


def _over_time(request: Request, results: Results, section: Section) -> Any:
    """Draw the first metric of a topic in which engines differ over time. Draw dots for metrics without a
    time series and, if there are many scenes, for those outside the gallery."""
    metric = next(metric for metric in section.topic.same if any(x.metric == metric for x in section.lines))
    lines = [line for line in section.lines if line.metric == metric]
    many = len(request.scenarios) > LARGEST_SCENE_COUNT
    gallery = {s.name for s in request.scenarios if "gallery" in s.tags or not many}
    shown = [line for line in lines if line.scenario in gallery and _courses(line, results)]
    dots = [line for line in lines if line not in shown]
    top = max((value for line in shown for value in line.values.values()), default=1.0)
    own = columns(results)
    parts = [grid([_panel(line, results, 2 * top) for line in shown], ACROSS)] if shown else []
    if dots:
        floor, scale = dots[0].same * BELOW, in_tables(metric)[1]
        points = _points(dots, lambda row: scale * max(abs(row.value), floor), own)
        text = f"{metric}, largest of the run [{unit_of(metric)}]"
        x = _from_zero(alt.X, text, floor * scale, points.value.max())
        parts.append(strips(list(map(_name, dots)), points, x, _marks(own), (600, ROW)))
    return grid(parts, 1)


def _courses(line: Line, results: Results) -> dict[str, tuple[Array, Array]]:
    """Per engine times and values of a line's metric; empty where it has no time series."""
    key = (line.metric, line.subject)
    found = {e: results.courses.get((line.scenario, e, row.profile)) for e, row in line.rows.items()}
    return {
        e: (course.time, course.values[key]) for e, course in found.items() if course and key in course.values
    }


def _panel(line: Line, results: Results, top: float) -> Any:
    """Draw one scene over time up to `top` [SI], with its limits as dashes."""
    floor, scale = line.same * BELOW, in_tables(line.metric)[1]
    found = _courses(line, results).items()
    courses = {engine: (time, scale * np.maximum(values, floor)) for engine, (time, values) in found}
    y = _from_zero(alt.Y, f"[{unit_of(line.metric)}]", floor * scale, top * scale)
    drawn = _lines(courses, columns(results)).encode(x=alt.X("time:Q", title="time [s]"), y=y)
    for limit, dash in {(r.limit, tuple(DASHES if e != REFERENCE else DOTS)) for e, r in line.rows.items()}:
        drawn = rule(dash, y=scale * limit) + drawn if limit >= floor else drawn
    return drawn.properties(title=_name(line), width=PANEL[0], height=PANEL[1])


def _from_zero(channel: Any, title: Any, floor: float, top: float) -> Any:
    """A logarithmic axis whose lowest tick is labelled 0."""
    text = f"datum.value < {1.5 * floor} ? '0' : {POWERS}"
    return log_axis(channel, "value", title, (floor / 2, max(top * 2, 10 * floor)), labelExpr=text)


def _points(lines: Sequence[Line], value: Callable[[Row], float], own: Columns) -> pd.DataFrame:
    """Values by the names of their lines and columns, in the order of columns."""
    rows = [
        (_name(line), head(own[engine]), value(line.rows[engine]))
        for engine in own
        for line in lines
        if engine in line.rows
    ]
    return pd.DataFrame(rows, columns=["row", "engine", "value"])


def _name(line: Line) -> str:
    return f"{line.scenario} {line.subject}".strip()


def _friction(request: Request, results: Results, section: Section) -> Any:
    """Draw the excess over the cone, and the share of mu j_n in sliding contacts."""
    own, parts = columns(results), []
    for metric, label, truth, value in FRICTION:
        if lines := [line for line in section.lines if line.metric == metric]:
            points = _points(lines, value, own)
            title = label.split("\n")
            x = alt.X("value:Q", title=title, scale=alt.Scale(zero=False))
            if metric == "friction.cone":
                truth, x = LEAST_EXCESS, _from_zero(alt.X, title, LEAST_EXCESS, points.value.max())
            drawn = strips(list(map(_name, lines)), points, x, _marks(own), (200, ROW))
            parts.append(drawn + rule(DASHES, INK, x=truth))
    return grid(parts, len(parts))


def _timing(request: Request, results: Results, section: Section) -> Any:
    """Draw frame times per scene and engine: median, quartiles, 5 to 95 %, maximum; with a ratio table."""
    own, marks = columns(results), _marks(columns(results))
    scenes = list(dict.fromkeys(line.scenario for line in section.lines))
    rows = []
    for scenario in scenes:
        for engine, row in own.items():
            if recording := results.recordings.get((scenario, engine, row.profile)):
                times = MILLI * recording.time_frame
                rows.append((scenario, head(row), *np.percentile(times, [5, 25, 50, 75, 95, 100])))
    table = pd.DataFrame(rows, columns=["row", "engine", "low", "first", "value", "third", "high", "most"])
    limits = [(s.name, MILLI / s.frame_rate) for s in request.scenarios if s.name in scenes]
    frames = pd.DataFrame(limits, columns=["row", "value"])
    title = "time [ms]: median, quartiles, 5 to 95 %, longest; red: a frame at 60 Hz"
    x = log_axis(alt.X, "value", title, ends(table.low, table.most, frames.value) if rows else (0.01, 100))
    drawn = strips(scenes, table, x, marks, (500, TIMES))
    y, beside = alt.Y("row:N", sort=scenes), alt.YOffset("engine:N", sort=list(map(head, own.values())))
    base = alt.Chart(table).encode(y=y, yOffset=beside, color=marks["color"])
    drawn += base.mark_rule().encode(x="low:Q", x2="high:Q")
    drawn += base.mark_rule(strokeWidth=4, strokeOpacity=0.5).encode(x="first:Q", x2="third:Q")
    drawn += base.mark_tick(height=5).encode(x="most:Q")
    drawn += alt.Chart(frames).mark_tick(color="#cc3311").encode(x="value:Q", y=y)
    return alt.hconcat(drawn, _ratio_table(results, scenes, own))


def _ratio_table(results: Results, scenes: list[str], own: Columns) -> Any:
    """Add the table of the reference's mean frame with contact over each engine's, with its interval."""
    heads = {f"{engine} {row.profile}": engine for engine, row in own.items() if engine != REFERENCE}
    cells = [
        (row.scenario, heads[row.subject], f"{number(row.value)}\n{number(row.low)} to {number(row.high)}")
        for row in rows_of(results.frame[results.frame.metric == "ratio.time"])
        if row.profile == own.get(REFERENCE, row).profile and row.subject in heads and row.scenario in scenes
    ]
    title = ["frame with contact of the reference", "over that of (one run)"]
    top = alt.Axis(orient="top", labelAngle=0, ticks=False, domain=False, grid=False)
    x = alt.X("engine:N", sort=list(heads.values()), title=title, axis=top)
    texts = alt.Chart(pd.DataFrame(cells, columns=["row", "engine", "text"]))
    texts = texts.mark_text(lineBreak="\n", fontSize=7.5)
    drawn = texts.encode(x=x, y=alt.Y("row:N", sort=scenes, axis=None), text="text:N")
    return drawn.properties(width=70 * len(heads), height=TIMES * len(scenes))


PICTURES: dict[str, Callable[[Request, Results, Section], Any]] = {
    "overlap": _over_time,
    "energy": _over_time,
    "friction": _friction,
    "timing": _timing,
}
