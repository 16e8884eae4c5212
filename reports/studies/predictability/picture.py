"""The picture of the study `predictability`: amplification over the size of the perturbation."""

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
from touchstone.reports.studies.predictability.definitions import CLOSED_FORM, DRAWS, METRIC, SIZES
from touchstone.reports.views.pictures import INK, PALE, color_of, marker_of

ACROSS = 3
"""Largest number of panels side by side."""
FLOOR = 1e-4
"""Smaller amplifications are drawn at this value [1]: the perturbation has vanished."""
LEAST, MOST = 0.1, 100.0
"""Every panel's axis includes these amplifications [1]."""
BESIDE = 1.25
"""Factor between the abscissas of two engines, so that their ranges do not overlap."""


def amplifications(frame: pd.DataFrame, path: Path) -> None:
    """Draw the median with the range over the directions; dotted: the closed form."""
    measured = frame[frame.metric == METRIC]
    scenes, engines = list(dict.fromkeys(measured.scenario)), list(dict.fromkeys(measured.engine))
    across = max(1, min(ACROSS, len(scenes)))
    rows = max(1, ceil(len(scenes) / across))
    with rc_context({"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": PALE}):
        figure = Figure(figsize=(3.4 * across + 0.8, 2.6 * rows + 0.9), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(rows, across, squeeze=False)
        for axes, scenario in zip(grid.flat, scenes):
            _panel(axes, measured[measured.scenario == scenario])
            axes.set_title(str(scenario), loc="left", color=INK, fontsize=10)
        for axes in list(grid.flat)[len(scenes) :]:
            axes.set_visible(False)
        handles = [_line(str(engine)) for engine in engines]
        figure.legend(handles=handles, loc="outside lower left", ncols=max(1, len(handles)), frameon=False)
        figure.suptitle(
            "How far runs part that start a hair's breadth apart\n",
            x=0.01, ha="left", color=INK, fontsize=13, fontweight="bold",
        )  # fmt: skip
        note = f"marker: median of {DRAWS} directions    bar: from the least to the largest"
        figure.text(0.01, 1 - 0.36 / figure.get_figheight(), note, color=PALE, fontsize=9, va="top")
        figure.supylabel("final distance over it [1]", color=INK, fontsize=9.5)
        figure.savefig(path, format="png", facecolor="white")


def _panel(axes: Axes, scene: pd.DataFrame) -> None:
    for place, (engine, part) in enumerate(scene.groupby("engine", sort=False)):
        rows, line = rows_of(part), _line(str(engine))
        beside = 1.0 if engine == CLOSED_FORM else BESIDE ** (place - 1.5)
        x = [beside * float(row.subject.removesuffix(" m")) for row in rows]
        values = [max(row.value, FLOOR) for row in rows]
        line.set_data(x, values)
        axes.add_line(line)
        if engine != CLOSED_FORM:
            low, high = [max(row.low, FLOOR) for row in rows], [max(row.high, FLOOR) for row in rows]
            axes.vlines(x, low, high, color=line.get_color(), linewidth=3, alpha=0.25)
    axes.set_xlabel("perturbation [m]", color=INK, fontsize=9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(FixedLocator(SIZES))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_ylim(min(LEAST, max(FLOOR, float(scene.low.min()) / 2)), max(MOST, 2 * float(scene.high.max())))
    axes.axhline(1, color=PALE, linewidth=0.7, zorder=1)
    axes.grid(axis="y", color="#eeeeee", linewidth=0.8)
    axes.tick_params(colors=INK, length=3, labelsize=8.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _line(engine: str) -> Line2D:
    if engine == CLOSED_FORM:
        return Line2D([], [], color=PALE, linestyle=":", linewidth=4, zorder=1.5, label=engine)
    return Line2D(
        [], [], color=color_of(engine), marker=marker_of(engine), markersize=4.5, linewidth=1.1, label=engine
    )
