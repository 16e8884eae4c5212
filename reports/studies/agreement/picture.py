"""The picture of the study `agreement`: error over step, one panel per scene, one line per engine."""

from __future__ import annotations

from math import ceil
from pathlib import Path

import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from touchstone.reports.results import rows_of
from touchstone.reports.run.request import step_text
from touchstone.reports.views.pictures import INK, PALE, color_of, marker_of

COLUMNS = 4
FLOOR = 1e-12
"""Smaller errors are drawn at this value [1, rad]: rounding."""
CEILING = 10.0
"""Larger errors are drawn at this value [1, rad]: the motion is lost."""


def convergence(frame: pd.DataFrame, path: Path) -> None:
    """Draw errors against the closed form over the step; the larger marker is the engine's own step."""
    errors = frame[frame.metric == "agreement.error"]
    panels = list(dict.fromkeys(zip(errors.scenario, errors.subject)))
    panels = [panel for panel in panels if _tells(errors, panel)] or panels[:1]
    if not panels:
        return _empty(path)
    rows = ceil(len(panels) / COLUMNS)
    style = {"font.family": "DejaVu Sans", "font.size": 9, "axes.edgecolor": PALE}
    with rc_context(style):  # type: ignore[arg-type]
        figure = Figure(figsize=(3.0 * COLUMNS, 2.5 * rows + 0.5), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False)
        for axes, panel in zip(grid.flat, panels):
            _panel(axes, errors, *panel)
        for axes in list(grid.flat)[len(panels) :]:
            axes.set_visible(False)
        engines = list(dict.fromkeys(errors.engine))
        handles = [_line(engine) for engine in engines]
        handles.append(Line2D([], [], color=PALE, linestyle=":", label="order 1"))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
        figure.suptitle("Error against the closed form over the step [s]; large marker: own step")
        figure.savefig(path, format="png", facecolor="white")


def _tells(errors: pd.DataFrame, panel: tuple[str, str]) -> bool:
    """Whether any engine's error exceeds rounding."""
    part = errors[(errors.scenario == panel[0]) & (errors.subject == panel[1])]
    return bool((part.value > 10 * FLOOR).any())


def _panel(axes: Axes, errors: pd.DataFrame, scenario: str, quantity: str) -> None:
    part = errors[(errors.scenario == scenario) & (errors.subject == quantity)]
    for engine in dict.fromkeys(part.engine):
        mine = rows_of(part[part.engine == engine])
        own = mine[0]
        mine = sorted(mine, key=lambda row: row.dt)
        line = _line(engine)
        axes.plot(
            [row.dt for row in mine],
            [_drawn(row.value) for row in mine],
            color=line.get_color(),
            marker=line.get_marker(),
            markersize=3.5,
            linewidth=1.3,
        )
        axes.plot(own.dt, _drawn(own.value), color=line.get_color(), marker=line.get_marker(), markersize=8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(FLOOR / 3, 3 * CEILING)
    low, high = part.dt.min(), part.dt.max()
    top = 1e-1
    axes.plot([low, high], [top * low / high, top], color=PALE, linestyle=":", linewidth=1)
    axes.xaxis.set_major_locator(FixedLocator([1 / 1920, 1 / 480, 1 / 120, 1 / 60]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: step_text(value)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_locator(FixedLocator([1e-12, 1e-9, 1e-6, 1e-3, 1.0]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(True, color="#e6e6e6", linewidth=0.6)
    axes.set_title(f"{scenario}, {quantity}", fontsize=9, color=INK)


def _drawn(error: float) -> float:
    return min(max(error, FLOOR), CEILING)


def _line(engine: str) -> Line2D:
    colour = color_of(engine)
    return Line2D([], [], color=colour, marker=marker_of(engine), markersize=4, label=engine)


def _empty(path: Path) -> None:
    figure = Figure(figsize=(6, 1), dpi=150)
    FigureCanvasAgg(figure)
    figure.text(0.5, 0.5, "no scene was played", ha="center", va="center", color=INK)
    figure.savefig(path, format="png", facecolor="white")
