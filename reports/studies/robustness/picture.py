"""The picture of the study `robustness`: rise of energy over residual, one marker per run."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from touchstone.reference_impl.solver.tolerances import RESIDUAL_OPEN
from touchstone.reports.verdict.random_outcomes import EXACT
from touchstone.reports.views.pictures import INK, PALE
from touchstone.scenarios.random_scenes import ALL_KINDS

ACROSS = 2
"""Number of panels side by side."""
FLOOR = 1e-16
"""Smaller figures, and 0, are drawn at this value: rounding."""
CEILING = 1e3
"""Larger and non-finite figures are drawn at this value: beyond it, the size of an explosion does not
matter."""
HUES = (
    "#0072B2", "#56B4E9", "#009E73", "#88CC00", "#F0E442", "#E69F00",
    "#D55E00", "#CC79A7", "#AA4499", "#882255", "#777777", "#000000",
)  # fmt: skip
"""Markers of the kinds of scene."""
FAILED = ("hang", "non-finite", "exploded")
"""Outcomes that are drawn even if the rise is unknown."""
TICKS = (1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3)


def rise_over_residual(runs: pd.DataFrame, path: Path) -> None:
    """Draw one panel per engine and profile. Engines that report no residual are drawn at its left edge."""
    known = runs[runs.rise.notna() | runs.outcome.isin(FAILED)] if len(runs) else runs
    panels = list(known.groupby(["engine", "profile"], sort=False)) if len(known) else []
    across = max(1, min(ACROSS, len(panels)))
    down = max(1, -(-len(panels) // across))
    with rc_context({"font.family": "DejaVu Sans", "font.size": 9.5, "axes.edgecolor": PALE}):
        figure = Figure(figsize=(5.2 * across + 0.6, 4.2 * down + 1.3), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(down, across, squeeze=False, sharex=True, sharey=True)
        for axes, ((engine, profile), part) in zip(grid.flat, panels):
            _panel(axes, part)
            axes.set_title(f"{engine}, {profile}: {len(part)} runs", loc="left", color=INK, fontsize=10)
        for axes in list(grid.flat)[len(panels) :]:
            axes.set_visible(False)
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower left", ncols=6, frameon=False, markerscale=1.6)
        figure.suptitle(
            "Random scenes: rise of energy and residual\n",
            x=0.01, ha="left", color=INK, fontsize=13, fontweight="bold",
        )  # fmt: skip
        figure.supylabel(
            "largest rise of energy in a frame, over that at the start [1]", color=INK, fontsize=9.5
        )
        figure.savefig(path, format="png", facecolor="white")


def _panel(axes: Axes, runs: pd.DataFrame) -> None:
    for kind, hue in zip(ALL_KINDS, cycle(HUES)):
        part = runs[runs.kind == kind]
        if len(part):
            axes.plot(
                _drawn(part.residual, FLOOR), _drawn(part.rise, CEILING), "o", color=hue, label=kind,
                markersize=3.5, markeredgewidth=0, alpha=0.75,
            )  # fmt: skip
    axes.axvline(RESIDUAL_OPEN, color=PALE, linewidth=0.8, linestyle=":")
    axes.axhline(EXACT.rise, color=PALE, linewidth=0.8, linestyle=":")
    axes.set_xlabel("largest residual of a frame [m/s]", color=INK, fontsize=9)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(FLOOR / 3, CEILING * 3)
    axes.set_ylim(FLOOR / 3, CEILING * 3)
    axes.set_xticks(TICKS)
    axes.set_yticks(TICKS)
    axes.minorticks_off()
    axes.grid(color="#eeeeee", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.tick_params(colors=INK, length=3, labelsize=8.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _drawn(values: pd.Series, unknown: float) -> np.ndarray:
    """Values clipped to the picture's range; unknown and non-finite ones are `unknown`."""
    found = values.to_numpy(dtype=float)
    return np.clip(np.where(np.isfinite(found), found, unknown), FLOOR, CEILING)
