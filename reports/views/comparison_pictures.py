"""Pictures of the differences between engines in a run: overlap, energy, friction, timing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from math import ceil, log10
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from touchstone.adapters.contract import Array
from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics import in_tables
from touchstone.reports.metrics.motion.time_series import FORCE
from touchstone.reports.results import Row, rows_of, write_beside
from touchstone.reports.runner.request import REFERENCE, Request, Results
from touchstone.reports.views.comparison import (
    FORCE_PICTURE,
    LARGEST_SCENE_COUNT,
    Columns,
    ForcePanel,
    Line,
    Section,
    columns,
    force_panels,
    head,
    sections,
)
from touchstone.reports.views.pictures import (
    INK,
    PALE,
    color_of,
    engines_legend,
    figure,
    headline,
    marker_of,
    open_axes,
    panels,
    rows_for,
)
from touchstone.reports.views.tables import number, unit_of

ACROSS = 3
"""Largest number of panels side by side."""
WIDTH, PANEL, DOT, MILLI = 11.0, 2.3, 0.28, 1e3
"""Width of a picture, heights of a panel and of a row of dots [inches]; milliseconds in a second."""
BELOW, LEAST_EXCESS = 0.1, 1e-4
"""Smaller values are drawn at these and labelled 0: a share of a line's `same`, an excess of friction [1]."""
CONE = "largest excess of friction over mu times\npressure, over the latter; Coulomb: 0"
DEFICIT = "friction over mu times pressure\nwhile sliding; Coulomb: 1"
FRICTION: tuple[tuple[str, str, float, Callable[[Row], float]], ...] = (
    ("friction.cone", CONE, 0.0, lambda row: max(row.value, LEAST_EXCESS)),
    ("friction.deficit", DEFICIT, 1.0, lambda row: 1.0 - row.value),
    ("friction.stop", "distance of stopping, too long by;\nCoulomb: 0", 0.0, lambda row: row.value),
)
"""Metric, the quantity drawn, its truth."""
TITLES = {
    "overlap": "Overlap: the depth of the deepest pair of bodies",
    "energy": "Energy from nowhere: how far S = K + U - W rises above its least so far",
    "friction": "Friction, beside Coulomb's law",
    "timing": "The time a displayed frame takes",
    "forces": "Contact force: the normal impulses of a pair in a displayed frame, over its duration",
}
NOTES = {
    "overlap": "measured by one oracle for all engines",
    "energy": "passive contact only lowers S; W: work of the drive, or of driven bodies on simulated ones",
    "friction": "contact by contact: impulses are the engine's word, audited against the motion",
    "timing": "native step calls, one thread, all engines interleaved in one run; each its own step",
    "forces": "pairs with the largest impulses, which are the engine's word; dashed: closed form",
}
DASHES = ";   dashed: limit of the engines, dotted: of the reference"


def draw(request: Request, results: Results, folder: Path) -> None:
    """Write `<topic>.png` of every topic in which engines differ."""
    for section in sections(request, results):
        if section.lines:
            path = folder / f"{section.topic.name}.png"
            write_beside(path, partial(_write, request, results, section))


def _write(request: Request, results: Results, section: Section, path: Path) -> None:
    name = section.topic.name
    with _figure(path, name, DASHES * (name in ("overlap", "energy")), columns(results)) as drawn:
        PICTURES[name](drawn, request, results, section)


@contextmanager
def _figure(path: Path, name: str, more: str, own: Columns) -> Iterator[Figure]:
    """A figure with the title and the note of a topic, and the engines; its size is set while it is drawn."""
    with figure(path, WIDTH, PANEL, 9.5) as drawn:
        yield drawn
        headline(drawn, TITLES[name], NOTES[name] + more)
        engines_legend(drawn, own, map(head, own.values()))


def draw_forces(request: Request, results: Results, folder: Path) -> None:
    """Write FORCE_PICTURE, with the panels of `force_panels`, if there is one."""
    panels = force_panels(request, results)
    if panels:
        write_beside(folder / FORCE_PICTURE, partial(_write_forces, panels, columns(results)))


def _write_forces(panels_of: Sequence[ForcePanel], own: Columns, path: Path) -> None:
    across = min(ACROSS, len(panels_of))
    with _figure(path, "forces", "", own) as drawn:
        drawn.set_size_inches(WIDTH, 1.1 + PANEL * rows_for(len(panels_of), across))
        for axes, panel in zip(panels(drawn, len(panels_of), across), panels_of):
            _force_panel(axes, panel)


def _force_panel(axes: Axes, panel: ForcePanel) -> None:
    scenario, pair = panel.scenario, panel.pair
    for engine, course in panel.courses.items():
        if (FORCE, pair) in course.values:
            axes.plot(course.time, course.values[FORCE, pair], color=color_of(engine), linewidth=1, alpha=0.9)
    for truth in scenario.forces:
        if truth.quantity == "force" and truth.is_of(pair):
            axes.hlines(truth.value, truth.start, truth.end, color=INK, linewidth=1, linestyle=(0, (4, 3)))
    axes.set_ylim(bottom=0.0)
    _named(axes, f"{scenario.name} {pair}", "time [s]", "[N]")


def _named(axes: Axes, title: str, x: str, y: str = "") -> None:
    """Name a panel and its axes."""
    axes.set_title(title, loc="left", color=INK, fontsize=9.5)
    axes.set_xlabel(x, color=INK, fontsize=8.5)
    axes.set_ylabel(y, color=INK)
    open_axes(axes)


def _over_time(figure: Figure, request: Request, results: Results, section: Section) -> None:
    """Draw the first metric of a topic in which engines differ over time. Draw dots for metrics without a
    time series and, if there are many scenes, for those outside the gallery."""
    metric = next(metric for metric in section.topic.same if any(x.metric == metric for x in section.lines))
    lines = [line for line in section.lines if line.metric == metric]
    many = len(request.scenarios) > LARGEST_SCENE_COUNT
    gallery = {s.name for s in request.scenarios if "gallery" in s.tags or not many}
    shown = [line for line in lines if line.scenario in gallery and _courses(line, results)]
    dots = [line for line in lines if line not in shown]
    across = max(1, min(ACROSS, len(shown)))
    rows = ceil(len(shown) / across)
    heights = [PANEL] * rows + [DOT * (len(dots) + 2)] * bool(dots)
    figure.set_size_inches(WIDTH, 1.1 + sum(heights))
    grid = figure.add_gridspec(len(heights), across, height_ratios=heights)
    top = max((value for line in shown for value in line.values.values()), default=1.0)
    for k, line in enumerate(shown):
        _panel(figure.add_subplot(grid[k // across, k % across]), line, results, 2 * top)
    if dots:
        axes = figure.add_subplot(grid[rows, :])
        floor, scale = dots[0].same * BELOW, in_tables(metric)[1]
        _dots(axes, dots, lambda row: scale * max(abs(row.value), floor))
        axes.set_xscale("log")
        _decades(axes.xaxis, floor * scale, axes.get_xlim()[1])
        axes.set_xlabel(f"{metric}, largest of the run [{unit_of(metric)}]", color=INK)


def _courses(line: Line, results: Results) -> dict[str, tuple[Array, Array]]:
    """Per engine times and values of a line's metric; empty where it has no time series."""
    key = (line.metric, line.subject)
    found = {e: results.courses.get((line.scenario, e, row.profile)) for e, row in line.rows.items()}
    return {
        e: (course.time, course.values[key]) for e, course in found.items() if course and key in course.values
    }


def _panel(axes: Axes, line: Line, results: Results, top: float) -> None:
    """Draw one scene over time up to `top` [SI], with its limits as dashes."""
    floor, scale = line.same * BELOW, in_tables(line.metric)[1]
    courses = _courses(line, results)
    for engine, row in line.rows.items():
        if engine in courses:
            time, values = courses[engine]
            drawn = scale * np.maximum(values, floor)
            axes.plot(time, drawn, color=color_of(engine), linewidth=1, alpha=0.9)
        if row.limit >= floor:
            dashes = (0, (4, 3)) if engine != REFERENCE else (0, (1, 2))
            axes.axhline(scale * row.limit, color=PALE, linewidth=0.8, linestyle=dashes, zorder=1)
    axes.set_yscale("log")
    _decades(axes.yaxis, floor * scale, top * scale)
    axes.set_ylim(floor * scale / 2, top * scale)
    _named(axes, f"{line.scenario} {line.subject}".strip(), "time [s]", f"[{unit_of(line.metric)}]")


def _dots(axes: Axes, lines: Sequence[Line], value: Callable[[Row], float]) -> None:
    """Draw a row per line, a marker per engine, side by side where they coincide, and a tick at the limit."""
    for k, line in enumerate(lines):
        axes.axhspan(k - 0.5, k + 0.5, color="#f6f6f6" if k % 2 else "white", zorder=0)
        for engine, row in line.rows.items():
            shift = 0.2 * (list(ENGINES).index(engine) - (len(ENGINES) - 1) / 2)
            axes.plot(
                value(row), k + shift, marker_of(engine), color=color_of(engine), markersize=5, zorder=3
            )
    axes.set_yticks(range(len(lines)), [f"{line.scenario} {line.subject}".strip() for line in lines])
    axes.set_ylim(len(lines) - 0.5, -0.5)
    open_axes(axes)


def _decades(axis: Axis, floor: float, top: float) -> None:
    """Set ticks at decades, at most eight; the lowest is labelled 0."""
    low, high = round(log10(floor)), ceil(log10(top))
    step = max(1, ceil((high - low) / 8))
    axis.set_major_locator(FixedLocator([10.0**e for e in range(low, high + 1, step)]))
    axis.set_major_formatter(FuncFormatter(lambda v, _: "0" if v < 1.5 * floor else f"{v:g}"))
    axis.set_minor_locator(NullLocator())


def _friction(figure: Figure, request: Request, results: Results, section: Section) -> None:
    """Draw the excess over the cone, and the share of mu j_n in sliding contacts."""
    by_kind = [[line for line in section.lines if line.metric == metric] for metric, *_ in FRICTION]
    most = max(map(len, by_kind))
    figure.set_size_inches(WIDTH, 1.6 + DOT * (most + 2))
    grid = figure.add_gridspec(1, sum(map(bool, by_kind)))
    column = 0
    for (metric, label, truth, drawn), lines in zip(FRICTION, by_kind):
        if not lines:
            continue
        axes = figure.add_subplot(grid[0, column])
        column += 1
        _dots(axes, lines, drawn)
        axes.set_ylim(most - 0.5, -0.5)
        if metric == "friction.cone":
            axes.set_xscale("log")
            _decades(axes.xaxis, LEAST_EXCESS, axes.get_xlim()[1])
            truth = LEAST_EXCESS
        axes.axvline(truth, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1)
        axes.set_xlabel(label, color=INK, fontsize=8.5)


def _timing(figure: Figure, request: Request, results: Results, section: Section) -> None:
    """Draw frame times per scene and engine: median, quartiles, 5 to 95 %, maximum; with a ratio table."""
    own = columns(results)
    scenes = list(dict.fromkeys(line.scenario for line in section.lines))
    figure.set_size_inches(WIDTH, 1.8 + 0.46 * (len(scenes) + 1))
    axes, table = figure.subplots(1, 2, sharey=True, width_ratios=(3, 1 + 0.4 * len(own)))
    frames = {s.name: 1 / s.frame_rate for s in request.scenarios}
    for k, scenario in enumerate(scenes):
        for one in (axes, table):
            one.axhspan(k - 0.5, k + 0.5, color="#f6f6f6" if k % 2 else "white", zorder=0)
        for place, (engine, row) in enumerate(own.items()):
            recording = results.recordings.get((scenario, engine, row.profile))
            if recording is not None:
                y = k + 0.8 * ((place + 0.5) / len(own) - 0.5)
                _spread(axes, MILLI * recording.time_frame, y, engine)
        axes.plot([MILLI * frames[scenario]] * 2, [k - 0.5, k + 0.5], color="#cc3311", linewidth=1)
    axes.set_yticks(range(len(scenes)), scenes)
    axes.set_ylim(len(scenes) - 0.5, -0.5)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
    axes.set_xlabel("time [ms]: median, quartiles, 5 to 95 %, longest; red: a frame at 60 Hz", color=INK)
    open_axes(axes)
    _ratio_table(table, results, scenes, own)


def _spread(axes: Axes, times: Array, y: float, engine: str) -> None:
    low, first, middle, third, high = np.percentile(times, [5, 25, 50, 75, 95])
    colour = color_of(engine)
    axes.plot([low, high], [y, y], color=colour, linewidth=1)
    axes.plot([first, third], [y, y], color=colour, linewidth=4, solid_capstyle="butt", alpha=0.5)
    axes.plot(middle, y, marker_of(engine), color=colour, markersize=4.5, zorder=3)
    axes.plot(times.max(), y, "|", color=colour, markersize=5)


def _ratio_table(axes: Axes, results: Results, scenes: list[str], own: Columns) -> None:
    """Add the table of the reference's mean frame with contact over each engine's, with its interval."""
    ratios = rows_of(results.frame[results.frame.metric == "ratio.time"])
    found = {
        (row.scenario, row.subject): row for row in ratios if row.profile == own.get(REFERENCE, row).profile
    }
    heads = {f"{engine} {row.profile}": engine for engine, row in own.items() if engine != REFERENCE}
    for x, (name, engine) in enumerate(heads.items()):
        axes.text(x + 0.5, -0.5, engine, color=color_of(engine), fontweight="bold", ha="center", va="bottom")
        for k, scenario in enumerate(scenes):
            if row := found.get((scenario, name)):
                text = f"{number(row.value)}\n{number(row.low)} to {number(row.high)}"
                axes.text(x + 0.5, k, text, ha="center", va="center", fontsize=7.5, color=INK)
    axes.set_xlim(0, max(1, len(heads)))
    axes.set_title(
        "frame with contact of the reference over that of (one run)", pad=22, fontsize=9.5, color=INK
    )
    axes.axis("off")


PICTURES: dict[str, Callable[[Figure, Request, Results, Section], None]] = {
    "overlap": _over_time,
    "energy": _over_time,
    "friction": _friction,
    "timing": _timing,
}
