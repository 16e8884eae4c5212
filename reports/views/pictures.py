"""Pictures of the studies, by matplotlib without a display."""

from __future__ import annotations

from math import log
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from touchstone.adapters.registry import ACCURATE, ENGINES
from touchstone.reports.results import rows_of
from touchstone.reports.studies.calibration.rows import JUDGED_SPEED

INK, PALE = "#222222", "#8a8a8a"
LIBRARY_COLORS = {"python-fcl": "#D55E00", "coal": "#0072B2"}
"""Colours of detectors that belong to no engine; with those of the engines, the palette of Okabe and Ito."""
MARKERS = "osD"
"""Markers of an engine's detectors, in the order of the table."""
ERROR_FLOOR = 1e-16
"""Smaller errors are drawn at this value: half a rounding of double precision [1]."""
LEVELS = (
    (2.2e-16, "rounding, double precision"),
    (6.0e-8, "rounding, single precision"),
    (1.0, "no contact seen"),
)
"""Errors that get a reference line [1]."""
LETTER, LINE, GAP = 0.0078, 0.028, 0.011
"""Width and height of a label's letter and its distance from the marker, over the picture's sides [1]."""


Rectangle = tuple[float, float, float, float]
"""Left, bottom, right, top."""


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


class Point(NamedTuple):
    """A detector: time [s], and its median, 95th percentile and largest error [1]."""

    name: str
    time: float
    median: float
    p95: float
    largest: float
    colour: str
    marker: str


def work_precision(frame: pd.DataFrame, path: Path) -> None:
    """Depth error over time per query of every detector, from the rows of the study `narrow-phase`.

    A marker is the median, the thick bar reaches to the 95th percentile, the thin one to the largest error.
    """
    points = _points(frame)
    style = {"font.family": "DejaVu Sans", "font.size": 10.5, "axes.edgecolor": PALE}
    with rc_context(style):  # type: ignore[arg-type]
        figure = Figure(figsize=(10.5, 6.8), dpi=160, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        _frame(axes, points)
        for point in points:
            _draw(axes, point)
        _label(axes, points)
        figure.savefig(path, format="png", facecolor="white")


def _points(frame: pd.DataFrame) -> list[Point]:
    whole = frame[(frame.scenario == "all") & frame.value.notna()]
    values = {(row.engine, row.metric): row.value for row in rows_of(whole)}
    names = [name for name in dict.fromkeys(frame.engine) if (name, "time.net") in values]
    points: list[Point] = []
    for name in names:
        colour = detector_color(name)
        median, p95, largest = (
            max(ERROR_FLOOR, values[name, f"depth.error.{k}"]) for k in ("median", "p95", "max")
        )
        marker = MARKERS[sum(point.colour == colour for point in points) % len(MARKERS)]
        points.append(Point(name, values[name, "time.net"], median, p95, largest, colour, marker))
    return [point for point in points if point.time > 0]


def _draw(axes: Axes, point: Point) -> None:
    x, colour = [point.time, point.time], point.colour
    axes.plot(x, [point.median, point.p95], color=colour, linewidth=4, alpha=0.4, solid_capstyle="butt")
    axes.plot(x, [point.median, point.largest], color=colour, linewidth=0.9)
    axes.plot(point.time, point.largest, "_", color=colour, markersize=8, markeredgewidth=1.3)
    axes.plot(
        point.time, point.median, point.marker, color=colour, markersize=9, markeredgecolor="white", zorder=3
    )


def _label(axes: Axes, points: list[Point]) -> None:
    """Place every name beside its marker, at the one of eight places that covers the least."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()

    def across(time: float) -> float:
        return log(time / left) / log(right / left)

    def up(error: float) -> float:
        return log(error / low) / log(high / low)

    bars = [(across(p.time), up(p.median), across(p.time), up(p.largest)) for p in points]
    taken: list[Rectangle] = []
    for point in points:
        x, y, width = across(point.time), up(point.median), LETTER * len(point.name)
        sides = [(x + GAP, "left"), (x - GAP - width, "right")]
        places = [(start, y + k * LINE, align) for k in (0, -0.6, -1, 1) for start, align in sides]
        boxes = [(start, v - LINE / 2, start + width, v + LINE / 2) for start, v, _ in places]
        best = min(range(len(boxes)), key=lambda k: sum(_meet(boxes[k], one) for one in bars + taken))
        start, v, align = places[best]
        taken.append(boxes[best])
        axes.text(
            start if align == "left" else start + width,
            v,
            point.name,
            transform=axes.transAxes,
            ha=align,
            va="center_baseline",
            color=point.colour,
            fontweight="bold" if point.name.startswith("reference") else "normal",
            path_effects=[withStroke(linewidth=3, foreground="white")],
            zorder=4,
        )


def _meet(one: Rectangle, two: Rectangle) -> bool:
    return one[0] <= two[2] and two[0] <= one[2] and one[1] <= two[3] and two[1] <= one[3]


def _frame(axes: Axes, points: list[Point]) -> None:
    times = [point.time for point in points if point.time > 0]
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(min(times) / 2.2, max(times) * 1.5)
    axes.set_ylim(ERROR_FLOOR / 3, 3 * max(1.0, *(point.largest for point in points)))
    ticks = [m * 10.0**e for e in range(-9, 0) for m in (1, 2, 5)]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda seconds, _: f"{seconds * 1e6:g}"))
    axes.yaxis.set_major_locator(FixedLocator([10.0**e for e in range(-16, 5, 2)]))
    axes.yaxis.set_minor_locator(NullLocator())
    for level, name in LEVELS:
        axes.axhline(level, color=PALE, linewidth=0.7, linestyle=(0, (4, 3)), zorder=1)
        axes.annotate(
            name,
            (0, level),
            xycoords=("axes fraction", "data"),
            xytext=(4, 3),
            textcoords="offset points",
            ha="left",
            va="bottom",
            fontsize=8.5,
            color=PALE,
        )
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.tick_params(colors=INK, length=3)
    axes.grid(axis="y", color="#eeeeee", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.set_xlabel("median time per query [µs], one thread, crossing from Python taken off", color=INK)
    axes.set_ylabel("depth error over max(depth, size / 1000)", color=INK)
    axes.set_title(
        "Narrow phase: random and adversarial pairs of convex pieces\n",
        loc="left",
        color=INK,
        fontsize=13,
        fontweight="bold",
    )
    axes.text(
        0,
        1.015,
        "marker: median    thick bar: to the 95th percentile    thin bar: to the largest",
        transform=axes.transAxes,
        color=PALE,
        fontsize=9.5,
    )


SIDES = ((2**0.5, "√2"), (0.5**0.5, "1 / √2"))
"""Shares of friction at 45 degrees that reveal a pyramid in place of a cone [1]."""


def requested_and_achieved(frame: pd.DataFrame, path: Path) -> None:
    """Achieved over requested restitution and friction per engine, from the rows of the study `calibration`.

    Restitution from JUDGED_SPEED: medians over speeds and shapes, with the range over these and over the
    phase within a step at which bodies land. Friction per heading: medians over coefficients and shapes, with
    their range.
    """
    engines = [name for name in ENGINES if name in set(frame[frame.value.notna()].engine)]
    style = {"font.family": "DejaVu Sans", "font.size": 10.5, "axes.edgecolor": PALE}
    with rc_context(style):  # type: ignore[arg-type]
        figure = Figure(figsize=(3.1 * max(1, len(engines)) + 0.6, 7.3), dpi=160, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots(2, max(1, len(engines)), sharex="row", sharey="row", squeeze=False)
        for column, engine in enumerate(engines):
            mine = frame[(frame.engine == engine) & frame.value.notna()]
            for profile, filled in _profiles(mine):
                part = mine[mine.profile == profile]
                _draw_ranges(axes[0, column], _restitutions(part), engine, profile, filled, 0.014)
                _draw_ranges(axes[1, column], _frictions(part), engine, profile, filled, 1.1)
            axes[0, column].set_title(engine, color=color_of(engine), fontweight="bold", fontsize=12)
        _frame_calibration(axes, figure)
        figure.savefig(path, format="png", facecolor="white")


Ranges = dict[float, list[float]]
"""Values by their abscissa."""


def _profiles(frame: pd.DataFrame) -> list[tuple[str, bool]]:
    """The first profile, drawn filled, and the accurate one or the next, drawn hollow."""
    names = list(dict.fromkeys(frame.profile))
    second = ACCURATE if ACCURATE in names else next(iter(names[1:]), "")
    return [(names[0], True)] + ([(second, False)] if second not in ("", names[0]) else [])


def _asked(subject: str) -> tuple[float, float]:
    """The coefficient and the speed or heading that a row's subject names."""
    first, second = (float(word.partition("=")[2]) for word in subject.split())
    return first, second


def _restitutions(frame: pd.DataFrame) -> Ranges:
    found: Ranges = {}
    for row in rows_of(frame[frame.metric == "restitution.achieved"]):
        e, speed = _asked(row.subject)
        if speed >= JUDGED_SPEED:
            found.setdefault(e, []).extend((row.low, row.value, row.high))
    return found


def _frictions(frame: pd.DataFrame) -> Ranges:
    found: Ranges = {}
    for row in rows_of(frame[frame.metric == "friction.bias"]):
        found.setdefault(_asked(row.subject)[1], []).append(1 + row.value)
    return found


def _draw_ranges(axes: Axes, found: Ranges, engine: str, profile: str, filled: bool, shift: float) -> None:
    """Draw median and range of each list; filled markers a little to the left, hollow ones to the right."""
    colour, places = color_of(engine), sorted(found)
    x = np.array(places) + (-shift if filled else shift)
    low, high = [min(found[place]) for place in places], [max(found[place]) for place in places]
    middle = [float(np.median(found[place])) for place in places]
    wide, pale = (5.0, 0.3) if filled else (1.3, 1.0)
    axes.vlines(x, low, high, color=colour, linewidth=wide, alpha=pale, zorder=2)
    face, edge = (colour, "white") if filled else ("white", colour)
    (line,) = axes.plot(x, middle, "o", color=colour, label=profile, markersize=7, zorder=3)
    line.set_markerfacecolor(face)
    line.set_markeredgecolor(edge)


def _frame_calibration(axes: np.ndarray, figure: Figure) -> None:
    axes[0, 0].set_ylabel("restitution achieved", color=INK)
    axes[1, 0].set_ylabel("friction achieved / asked", color=INK)
    axes[1, 0].xaxis.set_major_locator(FixedLocator([0.0, 22.5, 45.0]))
    axes[1, 0].xaxis.set_major_formatter(FuncFormatter(lambda heading, _: f"{heading:g}°"))
    axes[1, 0].set_xlim(-7, 52)
    axes[1, 0].set_ylim(min(0.45, axes[1, 0].get_ylim()[0]), max(1.5, axes[1, 0].get_ylim()[1]))
    for one in axes[0]:
        one.plot((0, 1), (0, 1), color=PALE, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        if one.lines[1:]:
            one.legend(frameon=False, fontsize=9.5, loc="upper left", handletextpad=0.2, labelcolor=INK)
        one.set_xlabel("restitution asked", color=INK)
    for one in axes[1]:
        one.axhline(1, color=PALE, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        one.set_xlabel("heading of the slide", color=INK)
        for level, name in SIDES:
            one.axhline(level, color="#dddddd", linewidth=0.8, zorder=1)
            one.annotate(name, (-6, level), xytext=(0, 2), textcoords="offset points", fontsize=8, color=PALE)
    for one in axes.flat:
        one.grid(axis="y", color="#eeeeee", linewidth=0.8)
        one.set_axisbelow(True)
        one.tick_params(colors=INK, length=3)
        for side in ("top", "right"):
            one.spines[side].set_visible(False)
    figure.suptitle(
        "Bodies that land on a floor and slide over it: what engines make of restitution and friction\n",
        x=0.005,
        ha="left",
        color=INK,
        fontsize=13,
        fontweight="bold",
    )
    text = (
        "marker: median    bar: range over balls, boxes and hulls, and over speeds from "
        f"{JUDGED_SPEED:g} m/s on (restitution) or the coefficients asked (friction)"
    )
    figure.text(0.005, 0.962, text, color=PALE, fontsize=9.5, va="top")
