"""Differences between engines in a run by topics (overlap, energy, friction, timing), and their pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from math import exp, inf, isfinite, log
from pathlib import Path
from typing import TYPE_CHECKING, Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.reports.metrics import in_tables
from touchstone.reports.metrics.motion.time_series import FORCE, Course, heaviest_pairs
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import REFERENCE, Request, Results, reproduce, step_text
from touchstone.reports.views.pictures import (
    DASHES,
    DOTS,
    INK,
    POWERS,
    Looks,
    axis,
    color_of,
    encoded,
    ends,
    grid,
    log_axis,
    marker_of,
    rule,
    save,
    strips,
)
from touchstone.reports.views.tables import number, scaled_number, unit_of

if TYPE_CHECKING:
    from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic and its metrics, each with the largest difference that counts as none [its unit]."""

    name: str
    same: Mapping[str, float]


LARGEST_SCENE_COUNT = 6
"""Largest number of scenes that are all drawn over time; of more, only the gallery's."""
PAIRS_DRAWN = 3
FORCE_PICTURE = "forces.png"
SAME_SHARE = 0.02
"""Relative difference within which two values are equal [1]: about the repeatability of medians in one
run."""
TOPICS = (
    # Overlap removal ends at 1e-6 m; the rest is rounding over some hundred frames.
    Topic("overlap", {"overlap.max": 1e-6, "overlap.tunnelled": 0.5, "contact.gap": 1e-6}),
    Topic("energy", {"energy.injected": 1e-9, "energy.gain": 1e-9, "energy.loss": 1e-9}),
    Topic("friction", {"friction.cone": 1e-6, "friction.deficit": 1e-6, "friction.stop": 1e-6}),
    Topic("timing", {"time.frame.median": 0.0, "time.frame.p99": 0.0}),
)


@dataclass(frozen=True, slots=True)
class Line:
    """Values of a scene's metric on every engine that has one; `same` as in its topic."""

    metric: str
    subject: str
    same: float
    rows: dict[str, Row]

    @property
    def scenario(self) -> str:
        """The scene."""
        return next(iter(self.rows.values())).scenario

    @property
    def values(self) -> dict[str, float]:
        """Value per engine [SI]."""
        return {engine: row.value for engine, row in self.rows.items()}

    @property
    def differs(self) -> bool:
        """Whether any two values differ."""
        return len(self.nearest) < len(self.rows)

    @property
    def nearest(self) -> list[str]:
        """The engines nearest to the truth, 0: several where their values are equal."""
        least = min(map(abs, self.values.values()))
        reach = max(least + self.same, least * (1 + SAME_SHARE))
        return [engine for engine, value in self.values.items() if abs(value) <= reach]

    @property
    def outlier(self) -> str:
        """The engine farthest from the median of the others (times by ratio); of two, from the truth."""
        values = self.values
        if len(values) == 2:
            return max(values, key=lambda engine: abs(values[engine]))
        return max(values, key=lambda engine: abs(self._off(engine)))

    @property
    def outlier_text(self) -> str:
        """The outlier, by how much, and whether it is the one nearest to the truth."""
        name = self.outlier
        if self._timed:
            return f"{name} {number(exp(self._off(name)))} times"
        off = self._off(name)
        best = ", nearest to the truth" * (name in self.nearest)
        return f"{name} {'+' * (off > 0)}{self.text(off)} {self.unit}".rstrip() + best

    def _off(self, engine: str) -> float:
        others = float(np.median([value for name, value in self.values.items() if name != engine]))
        mine = self.values[engine]
        return log(mine / others) if self._timed else mine - others

    @property
    def _timed(self) -> bool:
        return self.metric.startswith("time.") and min(self.values.values()) > 0

    @property
    def worst(self) -> str:
        """The engine that exceeds its limit by most, or else the one farthest from the truth."""
        return max(self.values, key=lambda engine: (max(1.0, self._share(engine)), abs(self.values[engine])))

    @property
    def share(self) -> float:
        """Ratio of the worst value to its limit; 0 without a limit."""
        return self._share(self.worst)

    def _share(self, engine: str) -> float:
        value, limit = self.values[engine], self.rows[engine].limit
        if not limit >= 0:
            return 0.0
        return abs(value) / limit if limit else (inf if value else 0.0)

    @property
    def name(self) -> str:
        """Metric and subject."""
        return f"{self.metric} {self.subject}".strip()

    def text(self, value: float) -> str:
        """A value in the unit of tables."""
        return scaled_number(self.metric, value)

    @property
    def unit(self) -> str:
        """The unit of tables; blank for 1."""
        return unit_of(self.metric).replace("1", "")


@dataclass(frozen=True, slots=True)
class Section:
    """A topic: lines on which engines differ; scenes whose figures do not differ; scenes without figures of
    two engines; and per engine, metric and reason of a value missing from a line, the scenes."""

    topic: Topic
    lines: list[Line] = field(default_factory=list)
    equal: list[str] = field(default_factory=list)
    without: list[str] = field(default_factory=list)
    gaps: dict[str, list[str]] = field(default_factory=dict)


Columns = dict[str, Row]
"""Per engine a row of the column in which it is compared: its profile and step."""


def columns(results: Results) -> Columns:
    """The column of each engine that played: the first of its profiles, its default."""
    found: Columns = {}
    for row in rows_of(results.frame):
        if row.engine != "all" and row.metric != "run" and not row.metric.startswith("ratio."):
            found.setdefault(row.engine, row)
    return found


def head(row: Row) -> str:
    """The heading of a column."""
    return f"{row.engine} {row.profile} {step_text(row.dt)} s"


def not_played(results: Results) -> list[str]:
    """Skipped and failed runs in the engines' default columns, each reason once."""
    own = {engine: row.profile for engine, row in columns(results).items()}
    found: dict[str, list[str]] = {}
    for row in rows_of(results.frame[results.frame.metric == "run"]):
        if own.get(row.engine, row.profile) == row.profile:
            found.setdefault(f"{row.engine}: {row.verdict}: {row.reason}", []).append(row.scenario)
    every = results.frame.scenario.nunique()
    return [
        reason if len(set(scenes)) == every else f"{reason} ({', '.join(dict.fromkeys(scenes))})"
        for reason, scenes in found.items()
    ]


def sections(request: Request, results: Results) -> list[Section]:
    """All four topics, or none where fewer than two engines played."""
    own = columns(results)
    if len(own) < 2:
        return []
    found = [Section(topic) for topic in TOPICS]
    for scenario in request.scenarios:
        scene = rows_of(results.frame[results.frame.scenario == scenario.name])
        rows = [row for row in scene if row.engine in own and row.profile == own[row.engine].profile]
        for section in found:
            found_lines = (_line(rows, metric, same) for metric, same in section.topic.same.items())
            lines = [line for line in found_lines if line]
            apart = [line for line in lines if line.differs]
            section.lines.extend(apart)
            for line, row in product(apart, rows):
                here = row.metric == line.metric and row.subject in ("", line.subject)
                if here and row.engine not in line.rows and row.reason:
                    said = f"{row.engine}, `{row.metric}`: {row.reason}"
                    section.gaps.setdefault(said, []).append(line.scenario)
            if not apart:
                (section.equal if lines else section.without).append(scenario.name)
    return found


def _line(rows: list[Row], metric: str, same: float) -> Line | None:
    """The line of a metric, for the subject that most engines have and on which they differ most; None if
    fewer than two engines have it."""
    by_subject: dict[str, dict[str, Row]] = {}
    for row in rows:
        if row.metric == metric and isfinite(row.value):
            by_subject.setdefault(row.subject, {})[row.engine] = row
    lines = [Line(metric, subject, same, found) for subject, found in by_subject.items() if len(found) > 1]
    return max(lines, key=lambda line: (len(line.rows), np.ptp(list(line.values.values()))), default=None)


def command(request: Request, line: Line) -> str:
    """The command that reproduces a line's worst value; for a time, also the shortest one."""
    engines = [line.nearest[0], line.worst] if line.metric.startswith("time.") else [line.worst]
    scenario = next(s for s in request.scenarios if s.name == line.scenario)
    held = " --hold-last" if any(tracker.held for tracker in scenario.trackers) else ""
    return reproduce(*(line.rows[engine] for engine in engines)) + held


def worst_lines(section: Section) -> dict[str, Line]:
    """Per scene the line that exceeds its limit by most; without a limit the first."""
    found: dict[str, Line] = {}
    for line in section.lines:
        best = found.setdefault(line.scenario, line)
        if line.share > best.share:
            found[line.scenario] = line
    return found


@dataclass(frozen=True, slots=True)
class ForcePanel:
    """A pair of a scene and the time series of each engine that played it."""

    scenario: Scenario
    pair: str
    courses: Mapping[str, Course]


def force_panels(request: Request, results: Results) -> list[ForcePanel]:
    """The pairs with the largest impulses of each scene that is no heap. Of more than LARGEST_SCENE_COUNT
    scenes, those of the gallery and those that state a force."""
    own, many = columns(results), len(request.scenarios) > LARGEST_SCENE_COUNT
    panels = []
    for scenario in request.scenarios:
        if "heap" in scenario.tags or (many and "gallery" not in scenario.tags and not scenario.forces):
            continue
        keys = {engine: (scenario.name, engine, row.profile) for engine, row in own.items()}
        courses = {engine: results.courses[key] for engine, key in keys.items() if key in results.courses}
        pairs = heaviest_pairs(courses.values(), PAIRS_DRAWN)
        panels += [ForcePanel(scenario, pair, courses) for pair in pairs]
    return panels


ACROSS = 3
PANEL, ROW, TIMES, MILLI = (210, 120), 20, 34, 1e3
"""Width and height of a panel, heights of rows of dots and of times [point]; milliseconds in a second."""
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
DASHES_NOTE = "; dashed: limit of the engines, dotted: of the reference"


def draw(request: Request, results: Results, folder: Path) -> None:
    """Write `<topic>.png` of every topic in which engines differ, and of forces; what fails is a fault."""
    for section in sections(request, results):
        if section.lines:
            path = folder / f"{section.topic.name}.png"
            results.write(path.name, partial(_write, request, results, section, path))
    results.write(FORCE_PICTURE, lambda: draw_forces(request, results, folder))


def _write(request: Request, results: Results, section: Section, path: Path) -> None:
    name = section.topic.name
    note = NOTES[name] + DASHES_NOTE * (name in ("overlap", "energy"))
    save(PICTURES[name](request, results, section), path, TITLES[name], note)


def draw_forces(request: Request, results: Results, folder: Path) -> None:
    """Write FORCE_PICTURE, with the panels of `force_panels`, if there is one."""
    if found := force_panels(request, results):
        own = columns(results)
        drawn = grid([_force_panel(panel, own) for panel in found], ACROSS)
        save(drawn, folder / FORCE_PICTURE, TITLES["forces"], NOTES["forces"])


def _marks(own: Columns) -> Looks:
    return encoded(map(color_of, own), map(marker_of, own), list(map(head, own.values())))


def _force_panel(panel: ForcePanel, own: Columns) -> Any:
    scenario, key = panel.scenario, (FORCE, panel.pair)
    courses = {e: (one.time, one.values[key]) for e, one in panel.courses.items() if key in one.values}
    span = axis(alt.X, "time", "time [s]", (0, scenario.duration))
    drawn = _lines(courses, own).encode(x=span, y=alt.Y("value:Q", title="[N]"))
    found = [t for t in scenario.forces if t.quantity == "force" and t.is_of(panel.pair)]
    truths = [(truth.start, truth.end, truth.value) for truth in found]
    if truths:
        rules = alt.Chart(pd.DataFrame(truths, columns=["time", "end", "value"])).mark_rule(strokeDash=DASHES)
        drawn += rules.encode(x="time:Q", x2="end:Q", y="value:Q")
    return drawn.properties(title=f"{scenario.name} {panel.pair}", width=PANEL[0], height=PANEL[1])


def _lines(courses: Mapping[str, tuple[Array, Array]], own: Columns) -> Any:
    parts = [
        pd.DataFrame({"time": time, "value": values, "engine": head(own[engine])})
        for engine, (time, values) in courses.items()
    ]
    return alt.Chart(pd.concat(parts)).mark_line(strokeWidth=1).encode(color=_marks(own)["color"])


def _over_time(request: Request, results: Results, section: Section) -> Any:
    """Draw the first metric of a topic in which engines differ over time. Draw dots for metrics without a
    time series and, if there are many scenes, for those outside the gallery."""
    metric = next(metric for metric in section.topic.same if any(x.metric == metric for x in section.lines))
    lines = [line for line in section.lines if line.metric == metric]
    many = len(request.scenarios) > LARGEST_SCENE_COUNT
    gallery = {s.name for s in request.scenarios if "gallery" in s.tags or not many}
    shown = [line for line in lines if line.scenario in gallery and _courses(line, results)]
    dots = [line for line in lines if line not in shown]
    top = max((value for line in shown for value in line.values.values()), default=1.0)
    own = columns(results)
    parts = [grid([_panel(line, results, 2 * top) for line in shown], ACROSS)] if shown else []
    if dots:
        floor, scale = dots[0].same * BELOW, in_tables(metric)[1]
        points = _points(dots, lambda row: scale * max(abs(row.value), floor), own)
        text = f"{metric}, largest of the run [{unit_of(metric)}]"
        x = _from_zero(alt.X, text, floor * scale, points.value.max())
        parts.append(strips(list(map(_name, dots)), points, x, _marks(own), (600, ROW)))
    return grid(parts, 1)


def _courses(line: Line, results: Results) -> dict[str, tuple[Array, Array]]:
    """Per engine times and values of a line's metric; empty where it has no time series."""
    key = (line.metric, line.subject)
    found = {e: results.courses.get((line.scenario, e, row.profile)) for e, row in line.rows.items()}
    return {e: (one.time, one.values[key]) for e, one in found.items() if one and key in one.values}


def _panel(line: Line, results: Results, top: float) -> Any:
    """Draw one scene over time up to `top` [SI], with its limits as dashes."""
    floor, scale = line.same * BELOW, in_tables(line.metric)[1]
    found = _courses(line, results).items()
    courses = {engine: (time, scale * np.maximum(values, floor)) for engine, (time, values) in found}
    label = f"{line.metric.partition('.')[0]} [{unit_of(line.metric)}]"
    y = _from_zero(alt.Y, label, floor * scale, top * scale)
    drawn = _lines(courses, columns(results)).encode(x=alt.X("time:Q", title="time [s]"), y=y)
    for limit, dash in {(r.limit, tuple(DASHES if e != REFERENCE else DOTS)) for e, r in line.rows.items()}:
        drawn = rule(dash, y=scale * limit) + drawn if limit >= floor else drawn
    return drawn.properties(title=_name(line), width=PANEL[0], height=PANEL[1])


def _from_zero(channel: Any, title: Any, floor: float, top: float) -> Any:
    """A logarithmic axis whose lowest tick is labelled 0."""
    text = f"datum.value < {1.5 * floor} ? '0' : {POWERS}"
    return log_axis(channel, "value", title, (floor / 2, max(top * 2, 10 * floor)), labelExpr=text)


def _points(lines: Sequence[Line], value: Callable[[Row], float], own: Columns) -> pd.DataFrame:
    """Values by the names of their lines and columns, in the order of columns."""
    rows = [
        (_name(line), head(own[engine]), value(line.rows[engine]))
        for engine in own
        for line in lines
        if engine in line.rows
    ]
    return pd.DataFrame(rows, columns=["row", "engine", "value"])


def _name(line: Line) -> str:
    return f"{line.scenario} {line.subject}".strip()


def _friction(request: Request, results: Results, section: Section) -> Any:
    """Draw the excess over the cone, and the share of mu j_n in sliding contacts."""
    own, parts = columns(results), []
    for metric, label, truth, value in FRICTION:
        if lines := [line for line in section.lines if line.metric == metric]:
            points = _points(lines, value, own)
            title = label.split("\n")
            x = alt.X("value:Q", title=title, scale=alt.Scale(zero=False))
            if metric == "friction.cone":
                truth, x = LEAST_EXCESS, _from_zero(alt.X, title, LEAST_EXCESS, points.value.max())
            drawn = strips(list(map(_name, lines)), points, x, _marks(own), (200, ROW))
            parts.append(drawn + rule(DASHES, INK, x=truth))
    return grid(parts, len(parts))


def _timing(request: Request, results: Results, section: Section) -> Any:
    """Draw frame times per scene and engine: median, quartiles, 5 to 95 %, maximum; with a ratio table."""
    own, marks = columns(results), _marks(columns(results))
    scenes = list(dict.fromkeys(line.scenario for line in section.lines))
    rows = []
    for scenario in scenes:
        for engine, row in own.items():
            if recording := results.recordings.get((scenario, engine, row.profile)):
                times = MILLI * recording.time_frame
                rows.append((scenario, head(row), *np.percentile(times, [5, 25, 50, 75, 95, 100])))
    table = pd.DataFrame(rows, columns=["row", "engine", "low", "first", "value", "third", "high", "most"])
    limits = [(s.name, MILLI / s.frame_rate) for s in request.scenarios if s.name in scenes]
    frames = pd.DataFrame(limits, columns=["row", "value"])
    title = "time [ms]: median, quartiles, 5 to 95 %, longest; red: a frame at 60 Hz"
    x = log_axis(alt.X, "value", title, ends(table.low, table.most, frames.value) if rows else (0.01, 100))
    drawn = strips(scenes, table, x, marks, (500, TIMES))
    y, beside = alt.Y("row:N", sort=scenes), alt.YOffset("engine:N", sort=list(map(head, own.values())))
    base = alt.Chart(table).encode(y=y, yOffset=beside, color=marks["color"])
    drawn += base.mark_rule().encode(x="low:Q", x2="high:Q")
    drawn += base.mark_rule(strokeWidth=4, strokeOpacity=0.5).encode(x="first:Q", x2="third:Q")
    drawn += base.mark_tick(height=5).encode(x="most:Q")
    drawn += alt.Chart(frames).mark_tick(color="#cc3311").encode(x="value:Q", y=y)
    return alt.hconcat(drawn, _ratio_table(results, scenes, own))


def _ratio_table(results: Results, scenes: list[str], own: Columns) -> Any:
    """Add the table of the reference's mean frame with contact over each engine's, with its interval."""
    heads = {f"{engine} {row.profile}": engine for engine, row in own.items() if engine != REFERENCE}
    cells = [
        (row.scenario, heads[row.subject], f"{number(row.value)}\n{number(row.low)} to {number(row.high)}")
        for row in rows_of(results.frame[results.frame.metric == "ratio.time"])
        if row.profile == own.get(REFERENCE, row).profile and row.subject in heads and row.scenario in scenes
    ]
    title = ["frame with contact of the reference", "over that of (one run)"]
    top = alt.Axis(orient="top", labelAngle=0, ticks=False, domain=False, grid=False)
    x = alt.X("engine:N", sort=list(heads.values()), title=title, axis=top)
    texts = alt.Chart(pd.DataFrame(cells, columns=["row", "engine", "text"]))
    texts = texts.mark_text(lineBreak="\n", fontSize=7.5)
    drawn = texts.encode(x=x, y=alt.Y("row:N", sort=scenes, axis=None), text="text:N")
    return drawn.properties(width=70 * len(heads), height=TIMES * len(scenes))


PICTURES: dict[str, Callable[[Request, Results, Section], Any]] = {
    "overlap": _over_time,
    "energy": _over_time,
    "friction": _friction,
    "timing": _timing,
}
