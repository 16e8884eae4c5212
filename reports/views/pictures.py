"""Figures, colours and markers of pictures, by matplotlib without a display."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator

from touchstone.adapters.registry import ENGINES

INK, PALE = "#222222", "#8a8a8a"
LIBRARY_COLORS = {"python-fcl": "#D55E00", "coal": "#0072B2"}
"""Colours of detectors that belong to no engine; with those of the engines, the palette of Okabe and Ito."""
MARKERS = "osD"
"""Markers of an engine's detectors, in the order of the table."""


def color_of(engine: str) -> str:
    """Colour of an engine in pictures."""
    return ENGINES[engine].color


def marker_of(engine: str) -> str:
    """Marker of an engine in pictures."""
    return ENGINES[engine].marker


def detector_color(name: str) -> str:
    """Colour of a detector or a variant by the engine or library that its name starts with."""
    colors = LIBRARY_COLORS | {engine: entry.color for engine, entry in ENGINES.items()}
    return next((color for owner, color in colors.items() if name.startswith(owner)), INK)


GRID = "#e8e8e8"
STYLE: dict[Any, Any] = {"font.family": "DejaVu Sans", "axes.edgecolor": PALE, "svg.hashsalt": "touchstone"}


@contextmanager
def figure(
    path: Path,
    width: float,
    height: float,
    font: float = 9,
    kind: str = "png",
    style: Mapping[Any, Any] = {},
    **options: Any,
) -> Iterator[Figure]:
    """An empty figure [inch] that is written to `path` in the end; an SVG bears no date."""
    with rc_context({**STYLE, "font.size": font, **style}):
        found = Figure(figsize=(width, height), **{"dpi": 150, "layout": "constrained", **options})
        FigureCanvasAgg(found)
        yield found
        found.savefig(
            path, format=kind, facecolor="white", metadata={"Date": None} if kind == "svg" else None
        )


def rows_for(count: int, across: int) -> int:
    """Rows of panels, of which `across` are side by side."""
    return max(1, -(-count // across))


def panels(found: Figure, count: int, across: int, **options: Any) -> list[Axes]:
    """Axes of `count` panels, row by row; the places that are left over stay empty."""
    grid = found.subplots(rows_for(count, across), across, squeeze=False, **options)
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    return list(grid.flat)[:count]


def open_axes(axes: Axes, grid: Any = "both", labels: float = 8.5) -> None:
    """Draw a pale grid, and no more of the frame than the axes."""
    axes.grid(axis=grid, color=GRID, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, length=3, labelsize=labels)
    axes.spines[["top", "right"]].set_visible(False)


def logarithmic(axes: Axes, x: Iterable[float] = (), y: Iterable[float] = ()) -> None:
    """Make both axes logarithmic, with ticks at the given values, or where matplotlib puts them."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis, ticks in ((axes.xaxis, x), (axes.yaxis, y)):
        if places := list(ticks):
            axis.set_major_locator(FixedLocator(places))
        axis.set_minor_locator(NullLocator())


def headline(found: Figure, text: str, note: str = "") -> None:
    """Write a title at the left, and a note in the line of space below."""
    found.suptitle(f"{text}\n", x=0.01, ha="left", color=INK, fontsize=13, fontweight="bold")
    found.text(0.01, 1 - 0.36 / found.get_figheight(), note, color=PALE, fontsize=9.5, va="top")


def strips(axes: Axes, rows: Sequence[str], points: pd.DataFrame, bounds: tuple[float, float]) -> None:
    """Draw a row of markers per name and engine on a logarithmic axis.

    Args:
        points: columns `row`, `engine` and `value`.
        bounds: smaller and larger values are drawn at these.
    """
    engines = list(dict.fromkeys(points.engine))
    places = points["row"].map(list(rows).index)
    for j, engine in enumerate(engines):
        mine = points.engine == engine
        axes.plot(
            np.clip(points.value[mine].to_numpy(float), *bounds),
            places[mine] + 0.68 / len(engines) * (j - len(engines) / 2 + 0.5),
            marker_of(engine), color=color_of(engine), markersize=4, alpha=0.7,
            markeredgewidth=0, linestyle="",
        )  # fmt: skip
    axes.set_xscale("log")
    axes.set_xlim(bounds[0] / 2, bounds[1] * 2)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    open_axes(axes, "x")


def engines_legend(found: Figure, engines: Iterable[str], heads: Iterable[str] = ()) -> None:
    """Name the markers of engines below a figure, by their names or by `heads`."""
    looks = [{"color": color_of(one), "marker": marker_of(one), "linestyle": ""} for one in engines]
    handles = [Line2D([], [], label=name, **look) for name, look in zip(list(heads) or engines, looks)]  # type: ignore[arg-type]
    found.legend(handles=handles, loc="outside lower left", ncols=6, frameon=False)
