"""The picture of `bench scaling`: times over sizes on logarithmic scales, with the power laws that fit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, NullLocator

from touchstone.reports.bench.curves import BALLS, BROAD_PHASE, VERTICES
from touchstone.reports.results import Row, rows_of
from touchstone.reports.views.pictures import INK, MARKERS, PALE, detector_color

TITLES = {
    BROAD_PHASE: ("Broad phase", "moving boxes in a cloud of constant density"),
    BALLS: ("Whole frame", "balls at rest on a floor, each engine at its own step"),
    VERTICES: ("Convex depth", "vertices per hull, one hull sliding past the other"),
}
"""Curve -> title and label of sizes."""
LABEL_GAP = 0.055
"""Least distance between two labels, as a share of the picture's height [1]."""


def draw(frame: pd.DataFrame, path: Path) -> None:
    """Draw one panel per curve. A marker is the median, a bar its 95 % interval."""
    shown = [name for name in TITLES if (frame.scenario == name).any()]
    style = {"font.family": "DejaVu Sans", "font.size": 10, "axes.edgecolor": PALE}
    with rc_context(style):  # type: ignore[arg-type]
        figure = Figure(figsize=(5.0 * len(shown), 4.6), dpi=160, layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(shown), squeeze=False)[0]
        for axes, name in zip(panels, shown):
            _panel(axes, frame[frame.scenario == name], *TITLES[name])
        panels[0].set_ylabel("median time [µs], 95 % interval, fitted power law", color=INK)
        figure.savefig(path, format="png", facecolor="white")


def _panel(axes: Axes, part: pd.DataFrame, title: str, sizes_label: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    labels = []
    used: dict[str, int] = {}
    for engine in dict.fromkeys(part[part.metric == "scaling.exponent"].engine):
        mine = rows_of(part[part.engine == engine])
        colour = detector_color(engine)
        marker = MARKERS[used.setdefault(colour, 0) % len(MARKERS)]
        used[colour] += 1
        power = next(row for row in mine if row.metric == "scaling.exponent")
        end = _line(axes, [row for row in mine if row.metric == "scaling.time"], power.value, colour, marker)
        labels.append((end, rf"{engine} $\propto n^{{{power.value:.2f}}}$", colour))
    _frame(axes, part)
    _label(axes, labels)
    axes.set_title(title, loc="left", color=INK, fontsize=12, fontweight="bold")
    axes.set_xlabel(sizes_label, color=INK)


def _line(axes: Axes, rows: list[Row], power: float, colour: str, marker: str) -> float:
    """Draw one engine's times and their power law; returns the law's end [µs]."""
    sizes = np.array([size_of(row) for row in rows])
    times, low, high = (
        1e6 * np.array([getattr(row, name) for row in rows]) for name in ("value", "low", "high")
    )
    axes.errorbar(
        sizes, times, [times - low, high - times], fmt=marker, color=colour, markersize=6,
        markeredgecolor="white", elinewidth=1.2, capsize=0, zorder=3,
    )  # fmt: skip
    middle = np.exp(np.mean(np.log(times) - power * np.log(sizes)))
    ends = sizes[[0, -1]]
    axes.plot(ends, middle * ends**power, color=colour, linewidth=1.3, alpha=0.65, zorder=2)
    return float(middle * ends[1] ** power)


def size_of(row: Row) -> float:
    """The size that a time belongs to: "100 pieces" is 100."""
    return float(row.subject.split()[0])


def _frame(axes: Axes, part: pd.DataFrame) -> None:
    sizes = sorted({size_of(row) for row in rows_of(part[part.metric == "scaling.time"])})
    axes.set_xlim(sizes[0] / 1.3, sizes[-1] * 1.3)
    axes.set_xticks(sizes)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda size, _: f"{size:g}"))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda time, _: f"{time:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(colors=INK, length=3)
    axes.tick_params(which="minor", length=1.5)
    axes.grid(axis="y", color="#eeeeee", linewidth=0.8)
    axes.set_axisbelow(True)


def _label(axes: Axes, labels: list[tuple[float, str, str]]) -> None:
    """Write names and exponents right of the lines' ends, moved apart where they would overlap."""
    low, high = axes.get_ylim()
    heights = [np.log(end / low) / np.log(high / low) for end, _, _ in labels]
    placed: list[float] = []
    for k in np.argsort(heights):
        height = max(heights[k], placed[-1] + LABEL_GAP) if placed else heights[k]
        placed.append(height)
        _, text, colour = labels[k]
        weight = "bold" if text.startswith("reference") else "normal"
        axes.text(
            1.01, height, text, transform=axes.transAxes, color=colour, fontweight=weight, va="center",
            fontsize=9.5,
        )  # fmt: skip
