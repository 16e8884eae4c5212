"""Charts of a page: drawn by Vega as the page is written, inlined as SVG that takes the page's colours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics.motion.time_series import FORCE, Course, heaviest_pairs
from touchstone.reports.views.pictures import ends, log_axis, looks
from touchstone.reports.views.renderer import RendererError, svg
from touchstone.reports.views.tables import Column
from touchstone.scenarios.scenario import Scenario

INK, FAINT = "#010203", "#040506"
"""Stand-ins for the colours of text and of grid lines, which the page replaces."""
WIDTH, ROW = 620, 18
"""Width of a chart and height of one of its rows [px]."""

PADDING = 14
"""Margin of a chart [px]: browsers draw labels wider than they are measured here."""
NOT_DRAWN = "this chart is not drawn"
"""What stands in its place."""
LEAST_SCENES = 3
"""Scenes of a chart [1]: fewer are read faster as numbers."""
LEAST_NIGHTS = 5
"""Nights of a chart [1]: fewer show no course."""


def svg_of(chart: Any) -> str:
    """A chart as SVG whose colours of text and lines are those of the page, or a paragraph: why there is
    none."""
    axis = dict.fromkeys(("gridColor", "domainColor", "tickColor"), FAINT)
    axis |= {"labelColor": INK, "titleColor": INK}
    plain = (
        chart.configure(background="transparent", font="system-ui, sans-serif", padding=PADDING)
        .configure_axis(**axis, titleFontWeight="normal", labelFontSize=11)
        .configure_view(stroke=None)
        .configure_legend(labelColor=INK, titleColor=INK, orient="top", title=None)
        .configure_title(color=INK, anchor="start", fontSize=13)
    )
    try:
        text = svg(plain.to_dict())
    except RendererError as error:
        return f"<p>{NOT_DRAWN}: {escape(str(error))}</p>"
    text = text.replace(f'"{INK}"', '"var(--ink)"').replace(f'"{FAINT}"', '"var(--line)"')
    for engine, color in colors().items():
        text = text.replace(f'"{color}"', f'"var({variable(engine)})"')
    return text.replace("<svg ", '<svg role="img" ', 1)


def variable(engine: str) -> str:
    """Name of the CSS variable that holds an engine's colour."""
    return "--engine-" + re.sub(r"[^\w-]", "_", engine)


def colors() -> dict[str, str]:
    """Colour of every engine in pictures."""
    return {name: entry.color for name, entry in ENGINES.items()}


def values_of(frame: pd.DataFrame, columns: Sequence[Column], metric: str, factor: float) -> pd.DataFrame:
    """Largest absolute value of a metric per scene and engine, in the unit of the chart."""
    mine = pd.MultiIndex.from_frame(frame[["engine", "profile"]]).isin(list(columns))
    rows = frame[mine & (frame.metric == metric) & frame.value.notna()]
    rows = rows.assign(value=rows.value.abs() * factor)
    return rows.groupby(["scenario", "engine"], sort=False).value.max().reset_index()


def dots(
    frame: pd.DataFrame, columns: Sequence[Column], metric: str, factor: float, title: str, floor: float
) -> str:
    """One row per scene, one mark per engine, on a logarithmic axis; "" with fewer than two engines or
    LEAST_SCENES.

    Values below `floor` [unit of the chart] are drawn at it.
    """
    found = values_of(frame, columns, metric, factor)
    if found.engine.nunique() < 2 or found.scenario.nunique() < LEAST_SCENES:
        return ""
    found["shown"] = found.value.clip(lower=floor)
    scenes = list(dict.fromkeys(found.scenario))
    base = alt.Chart(found)
    y = alt.Y("scenario:N", sort=scenes, title=None, axis=alt.Axis(grid=False))
    lines = base.mark_rule(color=FAINT).encode(y=y, x="min(shown):Q", x2="max(shown):Q")
    marks = base.mark_point(filled=True, size=70, opacity=0.9).encode(
        x=log_axis(alt.X, "shown", title, ends(found.shown)),
        y=y,
        tooltip=["scenario", "engine", alt.Tooltip("value:Q", format=".3g")],
        **looks(engine for engine, _ in columns),
    )
    return svg_of((lines + marks).properties(width=WIDTH, height=ROW * len(scenes)))


def work_precision(frame: pd.DataFrame, columns: Sequence[Column]) -> str:
    """Overlap over the time of a frame, a mark per scene and engine; "" with fewer than two engines or
    LEAST_SCENES."""
    time = values_of(frame, columns, "time.frame.median", 1e6).rename(columns={"value": "time"})
    depth = values_of(frame, columns, "overlap.max", 1e3).rename(columns={"value": "overlap"})
    found = time.merge(depth, on=["scenario", "engine"])
    if found.engine.nunique() < 2 or found.scenario.nunique() < LEAST_SCENES:
        return ""
    found["shown"] = found.overlap.clip(lower=1e-7)
    tooltips = [alt.Tooltip(f"{name}:Q", format=".3g") for name in ("time", "overlap")]
    chart = alt.Chart(found).mark_point(filled=True, size=80, opacity=0.85)
    chart = chart.encode(
        x=log_axis(alt.X, "time", "median time of a frame [µs]", ends(found.time)),
        y=log_axis(alt.Y, "shown", "deepest overlap [mm]", ends(found.shown)),
        tooltip=["scenario", "engine", *tooltips],
        **looks(engine for engine, _ in columns),
    )
    return svg_of(chart.properties(width=WIDTH, height=320))


def nights(history: pd.DataFrame, unit: str) -> str:
    """A series per engine over nights: columns `night`, `engine`, `value` [unit]."""
    marks = looks(dict.fromkeys(history.engine))
    base = alt.Chart(history).encode(
        x=alt.X("night:T", title=None),
        y=alt.Y("value:Q", title=unit, scale=alt.Scale(zero=False)),
        color=marks["color"],
    )
    layers = base.mark_line(strokeWidth=1.4) + base.mark_point(filled=True, size=16).encode(
        shape=marks["shape"], tooltip=["night:T", "engine", alt.Tooltip("value:Q", format=".4g")]
    )
    return svg_of(layers.properties(width=WIDTH, height=150))


MOST_PAIRS = 3
"""Pairs of a chart [1]: those with the largest impulses."""
MOST_CHARACTERS = 400_000
"""Characters of all charts of forces of a page: scenes beyond have none, so that a page stays under 5 MB."""
HEIGHT = 110
"""Height of a panel [px]."""
DECIMAL = re.compile(r"(\d\.\d)\d+")


def force_charts(scenes: Mapping[str, tuple[Scenario, Mapping[Column, Course]]]) -> dict[str, str]:
    """SVG per scene, of the first scenes that fit into MOST_CHARACTERS; none without the libraries."""
    found: dict[str, str] = {}
    left = MOST_CHARACTERS
    for name, (scenario, courses) in scenes.items():
        svg = force_chart(scenario, courses)
        if svg and len(svg) <= left:
            found[name] = svg
            left -= len(svg)
    return found


def force_chart(scenario: Scenario, courses: Mapping[Column, Course]) -> str:
    """Normal force over time of the pairs with the largest impulses; dashed: the scene's truth. "" where
    nothing presses, and in heaps."""
    pairs = heaviest_pairs(courses.values(), MOST_PAIRS)
    if not pairs or "heap" in scenario.tags:
        return ""
    color = looks(dict.fromkeys(engine for engine, _ in courses))["color"]
    scale = alt.Scale(domain=[0, scenario.duration], nice=False)
    span = alt.X("time:Q", title="time [s]", scale=scale, axis=alt.Axis(tickCount=8))
    panels = []
    for pair in pairs:
        lines = alt.Chart(_points(courses, pair)).mark_line(strokeWidth=1.3)
        panel = lines.encode(x=span, y=alt.Y("force:Q", title="force [N]"), color=color)
        truths = [t for t in scenario.forces if t.quantity == "force" and t.is_of(pair)]
        if truths:
            spans = [(t.start, t.end, t.value) for t in truths]
            table = pd.DataFrame(spans, columns=["start", "end", "force"])
            rule = alt.Chart(table).mark_rule(strokeDash=[5, 4], color=INK)
            panel += rule.encode(x="start:Q", x2="end:Q", y="force:Q")
        panels.append(panel.properties(width=WIDTH, height=HEIGHT, title=pair))
    return DECIMAL.sub(r"\1", svg_of(alt.vconcat(*panels)))


def _points(courses: Mapping[Column, Course], pair: str) -> pd.DataFrame:
    """Force of a pair at the end of each frame; between contacts only the first and last zero."""
    parts = []
    for (engine, _), course in courses.items():
        force = course.values.get((FORCE, pair))
        if force is None:
            continue
        kept = np.isfinite(force)
        kept[1:-1] &= (force[:-2] != 0) | (force[1:-1] != 0) | (force[2:] != 0)
        parts.append(pd.DataFrame({"time": course.time[kept], "force": force[kept], "engine": engine}))
    return pd.concat(parts)
