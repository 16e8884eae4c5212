"""The picture of the study `effects`: time saved by plans per scene, and the effects that matter."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.effects.definitions import ALL, REFERENCE, TOGGLED
from touchstone.reports.studies.effects.table import mark
from touchstone.reports.views.pictures import INK, PALE, color_of, marker_of

CELLS = {
    "M": ("#0072B2", "needed, and it matters"),
    "~": ("#8FC3E3", "needed, within tolerance"),
    "=": ("#F0C878", "needed by its bounds, yet identical"),
    ".": ("#F2F2F2", "not needed: identical"),
    "!": ("#D55E00", "not needed, yet it changes something"),
    "x": ("#FFFFFF", "cannot be played so"),
}
"""Colour and meaning of each mark."""


def savings(frame: pd.DataFrame, path: Path) -> None:
    """Draw savings per scene and engine with their intervals, beside a grid of single toggled effects."""
    rows = {(r.scenario, r.engine, r.metric, r.subject): r for r in rows_of(frame)}
    scenes = list(dict.fromkeys(key[0] for key in rows if key[2] == "time.saved" and key[3] == ALL))
    engines = list(dict.fromkeys(key[1] for key in rows if key[2] == "time.saved"))
    style = {"font.family": "DejaVu Sans", "font.size": 9, "axes.edgecolor": PALE}
    with rc_context(style):  # type: ignore[arg-type]
        figure = Figure(figsize=(11, 2.9 + 0.22 * len(scenes)), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, sharey=True, width_ratios=(1.5, 1))
        _savings(left, rows, scenes, engines)
        _grid(right, rows, scenes)
        handles: list[Line2D | Patch] = [
            Line2D([], [], color=color_of(e), marker=marker_of(e), linestyle="", label=e) for e in engines
        ]
        shown = {mark(rows, scene, effect) for scene in scenes for effect in TOGGLED}
        handles += [
            Patch(facecolor=colour, edgecolor=PALE, label=meaning)
            for sign, (colour, meaning) in CELLS.items()
            if sign in shown
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        figure.savefig(path, format="png", facecolor="white")


def _savings(
    axes: Axes, rows: dict[tuple[str, str, str, str], Row], scenes: list[str], engines: list[str]
) -> None:
    for k, engine in enumerate(engines):
        for y, scene in enumerate(scenes):
            row = rows.get((scene, engine, "time.saved", ALL))
            if row is None:
                continue
            place = y + 0.16 * (k - (len(engines) - 1) / 2)
            colour = color_of(engine)
            axes.plot([100 * row.low, 100 * row.high], [place, place], color=colour, linewidth=1)
            size = 5 if engine == REFERENCE else 3.5
            axes.plot(100 * row.value, place, color=colour, marker=marker_of(engine), markersize=size)
    axes.axvline(0, color=INK, linewidth=0.8)
    axes.set_yticks(range(len(scenes)), scenes)
    axes.set_ylim(len(scenes) - 0.5, -0.5)
    axes.grid(True, axis="x", color="#e6e6e6", linewidth=0.6)
    axes.set_title("saved by the plan, of the frame with all effects [%]", fontsize=9, color=INK)


def _grid(axes: Axes, rows: dict[tuple[str, str, str, str], Row], scenes: list[str]) -> None:
    for y, scene in enumerate(scenes):
        for x, effect in enumerate(TOGGLED):
            colour = CELLS[mark(rows, scene, effect)][0]
            axes.barh(y, 1, left=x - 0.5, height=1, color=colour, edgecolor="white", linewidth=1)
    axes.set_xlim(-0.5, len(TOGGLED) - 0.5)
    axes.set_xticks(range(len(TOGGLED)), [e.replace("_", " ") for e in TOGGLED], rotation=60, ha="left")
    axes.xaxis.tick_top()
    axes.tick_params(length=0)
    axes.set_title("each effect alone, on the reference", fontsize=9, color=INK)
