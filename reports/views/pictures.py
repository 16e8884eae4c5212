"""Theme, colours, markers and axes of pictures, which Vega draws without a display."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from math import ceil, floor, log10
from pathlib import Path
from typing import Any

import altair as alt
import pandas as pd
from PIL import Image

from touchstone.adapters.registry import ENGINES
from touchstone.reports.results import write_beside, write_text
from touchstone.reports.views.renderer import png, svg

INK, PALE, GRID = "#222222", "#8a8a8a", "#e8e8e8"
LIBRARY_COLORS = {"python-fcl": "#D55E00", "coal": "#0072B2"}
"""Colours of detectors that belong to no engine; with those of the engines, the palette of Okabe and Ito."""
DETECTOR_SHAPES = ("circle", "square", "diamond")
"""Markers of an engine's detectors, in the order of the table."""
DOTS, DASHES = [1, 2], [4, 3]
"""Lengths of the strokes and gaps of a line [point]."""
PALETTE = 256
"""Colours of a PNG [1]."""
NOTHING = pd.DataFrame([{}])
Looks = Mapping[str, Any]
"""Colour and shape of marks, for `encode`."""
DECADES, SHORT = 8, 100.0
"""Most ticks of a logarithmic axis, and largest ratio of its ends with ticks within decades [1]."""
POWERS = "replace(format(datum.value, datum.value < 1e-3 || datum.value > 1e5 ? '.0e' : '~g'), '+', '')"


def color_of(engine: str) -> str:
    """Colour of an engine in pictures; of one that this installation does not know, that of text."""
    return ENGINES[engine].color if engine in ENGINES else INK


def marker_of(engine: str) -> str:
    """Marker of an engine in pictures; of one that this installation does not know, a circle."""
    return ENGINES[engine].marker if engine in ENGINES else "circle"


def detector_color(name: str) -> str:
    """Colour of a detector or a variant by the engine or library that its name starts with."""
    colors = LIBRARY_COLORS | {engine: entry.color for engine, entry in ENGINES.items()}
    return next((color for owner, color in colors.items() if name.startswith(owner)), INK)


def save(chart: Any, path: Path, title: str = "", note: str = "", kind: str = "png", size: float = 9) -> None:
    """Write a chart as PNG or SVG with texts of a size [point], whole or not at all; equal data make equal
    files."""
    head = {"text": title, "subtitle": note, "fontSize": 13, "subtitleFontSize": 9.5, "offset": 12}
    text = {
        "labelColor": INK,
        "titleColor": INK,
        "labelFontSize": size,
        "titleFontSize": size,
        "labelLimit": 0,
    }
    axes = {"gridColor": GRID, "domainColor": PALE, "tickColor": PALE, "titleFontWeight": "normal"}
    legend = {"orient": "bottom", "columns": 6, "title": None, "symbolSize": 60}
    heads = {"color": INK, "subtitleColor": PALE, "fontSize": size + 1, "subtitleFontSize": size}
    look = {
        "font": "Liberation Sans, Arial, sans-serif",
        "background": "white",
        "padding": 8,
        "concat": {"spacing": 12},
        "view": {"stroke": None},
        "title": {"anchor": "start", **heads},
        "axis": text | axes,
        "legend": text | legend,
    }
    found = {**chart.to_dict(), **({"title": head} if title else {}), "config": look}
    if kind == "svg":
        write_text(path, svg(found))
    else:
        drawn = Image.open(BytesIO(png(found))).convert("RGB")
        # a fifth of the size of a file with 8 bits a channel
        small = drawn.quantize(PALETTE, Image.Quantize.FASTOCTREE)
        write_beside(path, lambda part: small.save(part, "png"))


def looks(engines: Iterable[str]) -> Looks:
    """Colour and shape of marks by their column `engine`."""
    names = list(engines)
    return encoded(map(color_of, names), map(marker_of, names), names)


def detector_looks(names: Iterable[str]) -> Looks:
    """Colour and shape of marks by their column `engine`: detectors of an engine differ in shape."""
    known = list(names)
    colors = [detector_color(name) for name in known]
    shapes = [DETECTOR_SHAPES[colors[:k].count(color) % 3] for k, color in enumerate(colors)]
    return encoded(colors, shapes, known)


def encoded(
    colors: Iterable[str], shapes: Iterable[str], names: Sequence[str], field: str = "engine"
) -> Looks:
    """Colour and shape of marks by a column, in the order of names."""
    pairs = (("color", alt.Color, colors), ("shape", alt.Shape, shapes))
    return {name: by(channel, field, dict(zip(names, look))) for name, channel, look in pairs}


def by(channel: Any, field: str, look: Mapping[str, Any], **options: Any) -> Any:
    """A look of marks by a column."""
    scale = alt.Scale(domain=list(look), range=list(look.values()))
    return channel(f"{field}:N", scale=scale, title=None, **options)


def ends(*values: pd.Series, factor: float = 1.3) -> tuple[float, float]:
    """Ends of a logarithmic axis: beyond all values by a factor."""
    return min(map(min, values)) / factor, max(map(max, values)) * factor


def axis(
    channel: Any, field: str, title: Any, span: tuple[float, float], kind: str = "linear", **options: Any
) -> Any:
    """An axis between two values; what lies beyond is drawn at the ends of a logarithmic one."""
    scale = alt.Scale(type=kind, domain=span, nice=False, zero=False, clamp=kind == "log")
    return channel(f"{field}:Q", title=title, scale=scale, axis=alt.Axis(**options))


def log_axis(channel: Any, field: str, title: Any, span: tuple[float, float], **options: Any) -> Any:
    """A logarithmic axis with ticks at decades, or at `values`."""
    low, high = span
    first, last = floor(log10(low)), ceil(log10(high))
    within = (1, 2, 5) if high < SHORT * low else (1,)
    decades = range(first, last + 1, 1 + (last - first) // DECADES)
    ticks = options.pop("values", [10.0**k * one for k in decades for one in within])
    seen = [tick for tick in ticks if low <= tick <= high]
    return axis(channel, field, title, span, "log", **{"values": seen, "labelExpr": POWERS, **options})


def grid(panels: Sequence[Any], across: int) -> Any:
    """Panels row by row, `across` side by side, with one legend."""
    drawn = alt.concat(*panels or [alt.Chart(NOTHING).mark_text(text="no data")], columns=across)
    return drawn.resolve_scale(color="shared", shape="shared")


def rule(dash: Sequence[float] = DOTS, color: str = PALE, **at: float) -> Any:
    """A line across a chart at x or y."""
    place = {axis: alt.datum(value) for axis, value in at.items()}
    return alt.Chart(NOTHING).mark_rule(color=color, strokeDash=list(dash)).encode(**place)


def strips(
    rows: Sequence[str],
    points: pd.DataFrame,
    x: Any,
    marks: Looks | None = None,
    size: tuple[float, float] = (500, 36),
) -> Any:
    """A row of markers per name and engine.

    Args:
        points: columns `row`, `engine` and that of `x`.
        size: width of the chart and height of a row [point].
    """
    engines = list(dict.fromkeys(points.engine))
    y = alt.Y("row:N", sort=list(rows), title=None, axis=alt.Axis(ticks=False, grid=False, labelPadding=6))
    drawn = alt.Chart(points).mark_point(filled=True, size=20, opacity=0.7)
    drawn = drawn.encode(x=x, y=y, yOffset=alt.YOffset("engine:N", sort=engines), **(marks or looks(engines)))
    return drawn.properties(width=size[0], height=size[1] * len(rows))
