"""Charts of a page: drawn by Vega as the page is written, inlined as SVG that takes the page's colours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics.motion.time_series import FORCE, Course, heaviest_pairs
from touchstone.reports.views.tables import Column
from touchstone.scenarios.scenario import Scenario

INK, FAINT = "#010203", "#040506"
"""Stand-ins for the colours of text and of grid lines, which the page replaces."""
SHAPES = {"o": "circle", "^": "triangle-up", "s": "square", "D": "diamond"}
"""Vega's names of markers of the registry."""
WIDTH, ROW = 620, 18
"""Width of a chart and height of one of its rows [px]."""

PADDING = 14
"""Margin of a chart [px]: browsers draw labels wider than they are measured here."""
LEAST_SCENES = 3
"""Scenes of a chart [1]: fewer are read faster as numbers."""
LEAST_NIGHTS = 5
"""Nights of a chart [1]: fewer show no course."""


class ChartsMissing(ImportError):
    """The libraries that draw charts are not installed; the message says how to install them."""


def library() -> tuple[Any, Any]:
    """altair and vl_convert; raises ChartsMissing."""
    try:
        import altair
        import vl_convert
    except ImportError as error:
        raise ChartsMissing(
            f"no charts: {error.name} is missing (pip install altair vl-convert-python)"
        ) from error
    return altair, vl_convert


def svg_of(chart: Any) -> str:
    """A chart as SVG whose colours of text and lines are those of the page."""
    _, convert = library()
    axis = {
        "labelColor": INK,
        "titleColor": INK,
        "gridColor": FAINT,
        "domainColor": FAINT,
        "tickColor": FAINT,
    }
    plain = (
        chart.configure(background="transparent", font="system-ui, sans-serif", padding=PADDING)
        .configure_axis(**axis, titleFontWeight="normal", labelFontSize=11)
        .configure_view(stroke=None)
        .configure_legend(labelColor=INK, titleColor=INK, orient="top", title=None)
        .configure_title(color=INK, anchor="start", fontSize=13)
    )
    text = str(convert.vegalite_to_svg(plain.to_dict()))
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


def engine_scales(altair: Any, engines: Sequence[str]) -> tuple[Any, Any]:
    """Colour and shape of marks by their engine."""
    known = {name: ENGINES[name] for name in engines if name in ENGINES}
    names = list(known)
    color = altair.Scale(domain=names, range=[entry.color for entry in known.values()])
    shape = altair.Scale(domain=names, range=[SHAPES.get(e.marker, "cross") for e in known.values()])
    return (
        altair.Color("engine:N", scale=color, title=None),
        altair.Shape("engine:N", scale=shape, title=None),
    )


def _decades(altair: Any, values: pd.Series) -> Any:
    """An axis with a line per decade."""
    low, high = int(np.floor(np.log10(values.min()))), int(np.ceil(np.log10(values.max())))
    every = 1 + (high - low) // 8
    return altair.Axis(format="~g", values=[10.0**k for k in range(low, high + 1, every)])


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
    altair, _ = library()
    found = values_of(frame, columns, metric, factor)
    if found.engine.nunique() < 2 or found.scenario.nunique() < LEAST_SCENES:
        return ""
    found["shown"] = found.value.clip(lower=floor)
    engines = [engine for engine, _ in columns]
    color, shape = engine_scales(altair, engines)
    scenes = list(dict.fromkeys(found.scenario))
    axis = _decades(altair, found.shown)
    base = altair.Chart(found)
    y = altair.Y("scenario:N", sort=scenes, title=None, axis=altair.Axis(grid=False))
    lines = base.mark_rule(color=FAINT).encode(y=y, x="min(shown):Q", x2="max(shown):Q")
    marks = base.mark_point(filled=True, size=70, opacity=0.9).encode(
        x=altair.X("shown:Q", scale=altair.Scale(type="log"), title=title, axis=axis),
        y=y,
        color=color,
        shape=shape,
        tooltip=["scenario", "engine", altair.Tooltip("value:Q", format=".3g")],
    )
    return svg_of((lines + marks).properties(width=WIDTH, height=ROW * len(scenes)))


def work_precision(frame: pd.DataFrame, columns: Sequence[Column]) -> str:
    """Overlap over the time of a frame, a mark per scene and engine; "" with fewer than two engines or
    LEAST_SCENES."""
    altair, _ = library()
    time = values_of(frame, columns, "time.frame.median", 1e6).rename(columns={"value": "time"})
    depth = values_of(frame, columns, "overlap.max", 1e3).rename(columns={"value": "overlap"})
    found = time.merge(depth, on=["scenario", "engine"])
    if found.engine.nunique() < 2 or found.scenario.nunique() < LEAST_SCENES:
        return ""
    found["shown"] = found.overlap.clip(lower=1e-7)
    color, shape = engine_scales(altair, [engine for engine, _ in columns])
    log = altair.Scale(type="log")
    across, up = _decades(altair, found.time), _decades(altair, found.shown)
    chart = altair.Chart(found).mark_point(filled=True, size=80, opacity=0.85)
    chart = chart.encode(
        x=altair.X("time:Q", scale=log, title="median time of a frame [µs]", axis=across),
        y=altair.Y("shown:Q", scale=log, title="deepest overlap [mm]", axis=up),
        color=color,
        shape=shape,
        tooltip=[
            "scenario",
            "engine",
            altair.Tooltip("time:Q", format=".3g"),
            altair.Tooltip("overlap:Q", format=".3g"),
        ],
    )
    return svg_of(chart.properties(width=WIDTH, height=320))


def nights(
    history: pd.DataFrame, title: str, unit: str, steps: Mapping[str, pd.Timestamp] | None = None
) -> str:
    """A series per engine over nights: columns `night`, `engine`, `value` [unit].

    Args:
        steps: label -> night at which a confirmed step begins.
    """
    altair, _ = library()
    color, shape = engine_scales(altair, list(dict.fromkeys(history.engine)))
    base = altair.Chart(history).encode(
        x=altair.X("night:T", title=None),
        y=altair.Y("value:Q", title=unit, scale=altair.Scale(zero=False)),
        color=color,
    )
    layers = base.mark_line(strokeWidth=1.4) + base.mark_point(filled=True, size=16).encode(
        shape=shape, tooltip=["night:T", "engine", altair.Tooltip("value:Q", format=".4g")]
    )
    if steps:
        found = pd.DataFrame({"night": list(steps.values()), "label": list(steps)})
        marks = altair.Chart(found).encode(x="night:T")
        layers += marks.mark_rule(strokeDash=[4, 3], color="#CC3311")
        layers += marks.mark_text(align="left", dx=4, y=8, color="#CC3311").encode(text="label:N")
    return svg_of(layers.properties(width=WIDTH, height=150, title=title))


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
        try:
            svg = force_chart(scenario, courses)
        except ChartsMissing:  # the part with the other charts says so
            return {}
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
    altair, _ = library()
    color, _ = engine_scales(altair, list(dict.fromkeys(engine for engine, _ in courses)))
    scale = altair.Scale(domain=[0, scenario.duration], nice=False)
    span = altair.X("time:Q", title="time [s]", scale=scale, axis=altair.Axis(tickCount=8))
    panels = []
    for pair in pairs:
        lines = altair.Chart(_points(courses, pair)).mark_line(strokeWidth=1.3)
        panel = lines.encode(x=span, y=altair.Y("force:Q", title="force [N]"), color=color)
        if truths := _truths(scenario, pair):
            rule = altair.Chart(pd.DataFrame(truths)).mark_rule(strokeDash=[5, 4], color=INK)
            panel += rule.encode(x="start:Q", x2="end:Q", y="force:Q")
        panels.append(panel.properties(width=WIDTH, height=HEIGHT, title=pair))
    return DECIMAL.sub(r"\1", svg_of(altair.vconcat(*panels)))


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


def _truths(scenario: Scenario, pair: str) -> list[dict[str, float]]:
    return [
        {"start": truth.start, "end": truth.end, "force": truth.value}
        for truth in scenario.forces
        if truth.quantity == "force" and truth.is_of(pair)
    ]
