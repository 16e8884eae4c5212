"""Pictures of the study: error over wall time per simulated second, a panel per scene and quantity.

Engines differ in colour (safe for colour-blind readers), marker and line style; the Pareto front is a grey
line below all. SVG and PNG.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator

from touchstone.reports.results import write_beside
from touchstone.reports.studies.work_precision.definitions import QUANTITIES, REFERENCE
from touchstone.reports.views.pictures import INK, PALE, color_of, marker_of

STYLES: dict[str, Any] = {"paper": ":", "balanced": "-", "accurate": "--"}
"""Line styles of the reference's profiles; others are solid."""
FRONT = "#bbbbbb"
MOST_ROWS = 6
"""Scenes of one picture; more go into further files."""
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.edgecolor": PALE,
    "svg.fonttype": "none",
    "svg.hashsalt": "touchstone",
}


def draw(table: pd.DataFrame, folder: Path) -> list[Path]:
    """Write `work_precision.svg` and `.png`, with a number for every further set of scenes."""
    usable = table[(table.quantity != "") & table.time.notna() & np.isfinite(table.error)]
    scenes = list(dict.fromkeys(usable.scenario))
    groups = [scenes[k : k + MOST_ROWS] for k in range(0, len(scenes), MOST_ROWS)]
    written = []
    for number, group in enumerate(groups, start=1):
        figure = picture(usable, group)
        for suffix in ("svg", "png"):
            path = folder / f"work_precision{'' if number == 1 else f'_{number}'}.{suffix}"
            with rc_context(STYLE):  # type: ignore[arg-type]
                write_beside(path, partial(_save, figure, suffix))
            written.append(path)
    return written


def _save(figure: Figure, suffix: str, path: Path) -> None:
    """Write a figure; an SVG bears no date, so that equal figures are equal files."""
    metadata = {"Date": None} if suffix == "svg" else None
    figure.savefig(path, format=suffix, facecolor="white", metadata=metadata)


def picture(table: pd.DataFrame, scenes: list[str]) -> Figure:
    """A figure with a row per scene and a column per quantity that any of them has."""
    quantities = [name for name in QUANTITIES if name in set(table[table.scenario.isin(scenes)].quantity)]
    with rc_context(STYLE):  # type: ignore[arg-type]
        size = (2.7 * len(quantities) + 0.5, 2.1 * len(scenes) + 0.9)
        figure = Figure(figsize=size, dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(len(scenes), len(quantities), squeeze=False)
        for row, scene in zip(grid, scenes):
            for axes, quantity in zip(row, quantities):
                part = table[(table.scenario == scene) & (table.quantity == quantity)]
                _panel(axes, part, quantity)
            row[0].set_ylabel(scene, fontsize=10, color=INK, fontweight="bold")
        for axes, quantity in zip(grid[0], quantities):
            unit = QUANTITIES[quantity].unit
            axes.set_title(f"{quantity}{'' if unit == '1' else f' [{unit}]'}", fontsize=10, color=INK)
        for axes in grid[-1]:
            axes.set_xlabel("wall time per simulated second [s]", color=INK)
        figure.legend(handles=_legend(table), loc="outside lower center", ncols=4, frameon=False)
        figure.suptitle("Error over time: lower left is better", color=INK)
    return figure


def _panel(axes: Axes, part: pd.DataFrame, quantity: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.tick_params(colors=INK, labelsize=7)
    axes.grid(True, color="#ececec", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    if part.empty:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "does not apply", transform=axes.transAxes, ha="center", color=PALE)
        return
    floor = QUANTITIES[quantity].floor
    part = part.assign(drawn=part.error.clip(lower=floor))
    front = part[part.front].sort_values("time")
    axes.step(front.time, front.drawn, where="post", color=FRONT, linewidth=4, zorder=1)
    for (engine, profile), line in part[part.settings == ""].groupby(["engine", "profile"], sort=False):
        _line(axes, line.sort_values("dt"), str(engine), str(profile))
    for engine, changed in part[part.settings != ""].groupby("engine", sort=False):
        axes.plot(
            changed.time,
            changed.drawn,
            linestyle="none",
            marker=marker_of(str(engine)),
            markersize=4.5,
            markerfacecolor="white",
            markeredgecolor=color_of(str(engine)),
            zorder=3,
        )
    low, high = part.drawn.min(), part.drawn.max()
    axes.set_ylim(max(low, floor) / 3, max(high * 3, low * 30))
    axes.axhline(QUANTITIES[quantity].tolerance, color=PALE, linewidth=0.8, linestyle=(0, (1, 2)), zorder=0)
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
    truth = part.truth.iloc[0]
    if truth == "not converged":
        axes.text(
            0.02, 0.98, "truth not converged", transform=axes.transAxes, va="top", fontsize=6.5, color=PALE
        )


def _line(axes: Axes, line: pd.DataFrame, engine: str, profile: str) -> None:
    color = color_of(engine)
    axes.plot(
        line.time,
        line.drawn,
        color=color,
        marker=marker_of(engine),
        markersize=3.5,
        linewidth=1.2,
        linestyle=STYLES.get(profile, "-") if engine == REFERENCE else "-",
        zorder=4,
    )
    # the band: from the least to the largest of the rounds
    axes.hlines(line.drawn, line.time_low, line.time_high, color=color, linewidth=2.5, alpha=0.3, zorder=2)


def _legend(table: pd.DataFrame) -> list[Line2D]:
    handles = []
    lines = table[table.settings == ""]
    for engine, profile in dict.fromkeys(zip(lines.engine, lines.profile)):
        handles.append(
            Line2D(
                [],
                [],
                color=color_of(engine),
                marker=marker_of(engine),
                markersize=4,
                linestyle=STYLES.get(profile, "-") if engine == REFERENCE else "-",
                label=f"{engine}, {profile}",
            )
        )
    hollow: dict[str, Any] = {
        "marker": "o",
        "markerfacecolor": "white",
        "markeredgecolor": INK,
        "linestyle": "none",
    }
    handles.append(Line2D([], [], label="another value of the main knob", markersize=4.5, **hollow))
    handles.append(Line2D([], [], color=FRONT, linewidth=4, label="Pareto front"))
    handles.append(Line2D([], [], color=PALE, linestyle=(0, (1, 2)), label="tolerance"))
    return handles
