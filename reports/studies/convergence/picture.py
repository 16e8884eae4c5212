"""The picture of the study `convergence`: error over step, one panel per scene, one line per engine."""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from touchstone.adapters.registry import ACCURATE
from touchstone.reports.run.request import REFERENCE, step_text
from touchstone.reports.studies.convergence.definitions import STEPS, own_step
from touchstone.reports.studies.convergence.measure import ERROR
from touchstone.reports.studies.convergence.order import EXACT
from touchstone.reports.views.pictures import INK, PALE, color_of, marker_of

COLUMNS = 5
BOTTOM, TOP = 1e-11, 10.0
"""Errors beyond are drawn at these values, over the scene's size [1]: rounding; the motion is lost."""
GUIDE = 0.3
"""Error at the coarsest step from which the lines of slopes 1 and 2 start [1]."""
OWN: dict[str, Any] = {
    "color": INK,
    "linestyle": "none",
    "marker": "o",
    "markersize": 7,
    "markerfacecolor": "white",
    "markeredgewidth": 1.4,
}
STYLE: dict[str, Any] = {"font.family": "DejaVu Sans", "font.size": 8.5, "axes.edgecolor": PALE}


def draw(frame: pd.DataFrame, path: Path) -> None:
    """Draw errors over steps: hollow at the engine's own step, grey below EXACT."""
    errors = frame[frame.metric == ERROR]
    panels = list(dict.fromkeys(errors.scenario))
    rows = max(1, ceil(len(panels) / COLUMNS))
    with rc_context(STYLE):  # type: ignore[arg-type]
        figure = Figure(figsize=(2.5 * COLUMNS, 2.25 * rows + 0.9), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for axes, scenario in zip(grid.flat, panels):
            _panel(axes, errors[errors.scenario == scenario], str(scenario))
        lines = list(dict.fromkeys(zip(errors.engine, errors.profile)))
        handles = [Line2D([], [], label=" ".join(line), markersize=4, **_look(*line)) for line in lines]
        handles.append(
            Line2D([], [], color=PALE, linewidth=0.7, linestyle=(0, (4, 3)), label="slopes 1 and 2")
        )
        handles.append(Line2D([], [], label="own step", **OWN))
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
        figure.supylabel("error over the scene's size", fontsize=10, color=INK)
        for axes in grid[-1]:
            axes.set_xlabel("step [s]", color=INK)
        figure.savefig(path, format="png", facecolor="white")


def _panel(axes: Axes, part: pd.DataFrame, scenario: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = STEPS[-1], STEPS[0]
    for slope in (1, 2):
        foot = GUIDE * (low / high) ** slope
        axes.plot([low, high], [foot, GUIDE], color=PALE, linewidth=0.7, linestyle=(0, (4, 3)), zorder=1)
    for (engine, profile), mine in part.groupby(["engine", "profile"], sort=False):
        line = mine.assign(drawn=mine.value.clip(BOTTOM, TOP)).sort_values("dt")
        ladder, own = line[line.dt.isin(STEPS)], line[line.dt == own_step(str(engine), str(profile))]
        look = _look(str(engine), str(profile))
        axes.plot(ladder.dt, ladder.drawn, **look, markersize=3)
        axes.plot(own.dt, own.drawn, **look, markersize=7, markerfacecolor="white", markeredgewidth=1.4)
    axes.set_xlim(low / 1.3, high * 1.3)
    axes.set_ylim(BOTTOM / 3, TOP * 3)
    axes.xaxis.set_major_locator(FixedLocator(STEPS[::2]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: step_text(value)))
    axes.yaxis.set_major_locator(FixedLocator([1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 1.0]))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
    axes.tick_params(colors=INK, labelsize=7)
    axes.grid(True, color="#e8e8e8", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.axhspan(BOTTOM / 3, EXACT, color="#f3f3f3", zorder=0)
    axes.set_title(scenario, fontsize=9.5, color=INK, loc="left", fontweight="bold")


def _look(engine: str, profile: str) -> dict[str, Any]:
    """Colour, marker and line style of an engine; the reference's lines lie above the others."""
    return {
        "color": color_of(engine),
        "marker": marker_of(engine),
        "linewidth": 1.7 if engine == REFERENCE else 1.1,
        "linestyle": "--" if engine == REFERENCE and profile == ACCURATE else "-",
        "zorder": 4 if engine == REFERENCE else 3,
    }
