"""The picture of the study `paper`: figures 7 and 8 of the paper, and the stages' shares per scene."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from touchstone.reports.studies.paper.claim import Scenes
from touchstone.reports.studies.paper.series import COLLISION, PASSES, REMOVAL, TESTED, Series
from touchstone.reports.views.pictures import INK, PALE

LINE, WORK, SHADE = "#0072B2", "#D55E00", "#EBEBEB"
STAGES = {
    COLLISION: ("collision detection", "#0072B2", "white"),
    REMOVAL: ("overlap removal with IK", "#D55E00", "white"),
    "drive": ("tracking and attraction", "#E69F00", INK),
    "impulses": ("impulses", "#009E73", "white"),
    "integration": ("integration", "#C9C9C9", INK),
}
"""Label, colour (of Okabe and Ito, safe for colour-blind readers), and that of the number on it."""
LEAST_LABEL = 4.0
"""Least share that has room for its number [%]."""


class Panel(NamedTuple):
    """A scene, its title, the counter below it with its label, and names of the stretches of contact."""

    scene: str
    title: str
    counter: str
    label: str
    contacts: tuple[str, ...]


PANELS = (
    Panel("table_slide", "Figure 7: hand over a table", TESTED, "convex pairs\ntested",
          ("slides\nthere", "slides\nback", "ball")),
    Panel("two_arms", "Figure 8: two arms against a wall", PASSES, "CCD passes",
          ("push 1", "push 2", "push 3")),
)  # fmt: skip


def draw(scenes: Scenes, path: Path, kind: str) -> None:
    """Draw the frame time over two scenes with contact shaded and the work below, and shares per scene."""
    style = {"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": PALE, "svg.hashsalt": "paper"}
    with rc_context(style):  # type: ignore[arg-type]
        figure = Figure(figsize=(11, 7.8), dpi=160, layout="constrained")
        FigureCanvasAgg(figure)
        curves, shares = np.asarray(figure.subfigures(2, 1, height_ratios=(2.1, 1), hspace=0.03))
        grid = np.asarray(curves.subplots(2, 2, sharex="col", height_ratios=(2.1, 1)))
        for column, panel in enumerate(PANELS):
            if panel.scene in scenes:
                _draw_time(grid[0, column], scenes[panel.scene], panel)
                _draw_work(grid[1, column], scenes[panel.scene], panel)
        _draw_shares(shares.subplots(), scenes)
        about = {"Date": None} if kind == "svg" else None
        figure.savefig(path, format=kind, facecolor="white", metadata=about)


def _draw_time(axes: Axes, series: Series, panel: Panel) -> None:
    _frame(axes, series)
    axes.plot(series.time, 1e6 * series.frame, color=LINE, linewidth=1.1)
    top = 1.2e6 * float(series.frame.max())
    axes.set_ylim(0, top)
    axes.set_ylabel("frame time [µs]", color=INK)
    axes.set_title(f"{panel.title} ({panel.scene})", loc="left", color=INK, fontsize=10.5, fontweight="bold")
    if len(series.contacts) == len(panel.contacts):
        for (first, end), name in zip(series.contacts, panel.contacts):
            middle = float(series.time[first] + series.time[end - 1]) / 2
            axes.text(middle, 0.985 * top, name, ha="center", va="top", color=INK, fontsize=9)


def _draw_work(axes: Axes, series: Series, panel: Panel) -> None:
    counts = series.counts[panel.counter]
    _frame(axes, series)
    axes.fill_between(series.time, counts, step="mid", color=WORK, alpha=0.3, linewidth=0)
    axes.step(series.time, counts, where="mid", color=WORK, linewidth=1.1)
    axes.set_ylim(0, 1.15 * max(1.0, float(counts.max())))
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.set_ylabel(panel.label, color=INK)
    axes.set_xlabel("time in the scene [s]; shaded: contact", color=INK)


def _frame(axes: Axes, series: Series) -> None:
    """Shade contact, and remove what carries no information."""
    half = 0.5 / series.scenario.frame_rate
    for first, end in series.contacts:
        axes.axvspan(
            series.time[first] - half, series.time[end - 1] + half, color=SHADE, linewidth=0, zorder=0
        )
    axes.set_xlim(0, float(series.time[-1]))
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(color=PALE, labelcolor=INK)


def _draw_shares(axes: Axes, scenes: Scenes) -> None:
    names = [f"{name}  {1e6 * series.frame.mean():.0f} µs" for name, series in scenes.items()]
    left = np.zeros(len(names))
    for stage, (label, colour, ink) in STAGES.items():
        shares = np.array([100 * s.share(stage) if stage in s.stages else 0.0 for s in scenes.values()])
        axes.barh(names, shares, left=left, color=colour, label=label, height=0.74, edgecolor="white")
        for y, (start, share) in enumerate(zip(left, shares)):
            if share >= LEAST_LABEL:
                place = (start + share / 2, y)
                axes.text(*place, f"{share:.0f}", ha="center", va="center_baseline", color=ink)
        left += shares
    axes.invert_yaxis()
    axes.set_xlim(0, 100)
    title = "Stages per scene, in the order of the mean frame (beside the names)"
    axes.set_title(title, loc="left", pad=24, color=INK, fontsize=10.5, fontweight="bold")
    axes.set_xlabel("share of the time of all frames [%]", color=INK)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.tick_params(axis="x", color=PALE, labelcolor=INK)
    axes.legend(
        *axes.get_legend_handles_labels(),
        loc="lower left",
        bbox_to_anchor=(-0.01, 0.98),
        ncols=len(STAGES),
        frameon=False,
        labelcolor=INK,
        columnspacing=1.5,
        handlelength=1.2,
    )
