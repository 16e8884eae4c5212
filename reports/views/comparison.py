"""Differences between engines by four topics: overlap, energy, friction, timing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import exp, inf, isfinite, log
from typing import TYPE_CHECKING

import numpy as np

from touchstone.reports.metrics.motion.time_series import Course, heaviest_pairs
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import reproduce, step_text
from touchstone.reports.views.tables import number, scaled_number, unit_of

if TYPE_CHECKING:
    from touchstone.reports.runner.request import Request, Results
    from touchstone.scenarios.scenario import Scenario


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic and its metrics, each with the largest difference that counts as none [its unit]."""

    name: str
    same: Mapping[str, float]


LARGEST_SCENE_COUNT = 6
"""Largest number of scenes that are all drawn over time; of more, only the gallery's."""
PAIRS_DRAWN = 3
"""Largest number of pairs of a scene whose forces are drawn."""
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
        """The outlier and by how much."""
        name = self.outlier
        if self._timed:
            return f"{name} {number(exp(self._off(name)))} times"
        off = self._off(name)
        return f"{name} {'+' * (off > 0)}{self.text(off)} {self.unit}".rstrip()

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
            for line in apart:
                _add_gaps(section.gaps, line, rows)
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


def _add_gaps(gaps: dict[str, list[str]], line: Line, rows: list[Row]) -> None:
    for row in rows:
        here = row.metric == line.metric and row.subject in ("", line.subject)
        if here and row.engine not in line.rows and row.reason:
            gaps.setdefault(f"{row.engine}, `{row.metric}`: {row.reason}", []).append(line.scenario)


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
