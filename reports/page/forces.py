"""Charts of contact forces over time, a panel per pair and a line per engine."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pandas as pd

from touchstone.reports.metrics.motion.time_series import FORCE, Course, heaviest_pairs
from touchstone.reports.page import charts
from touchstone.reports.views.tables import Column
from touchstone.scenarios.scenario import Scenario

MOST_PAIRS = 3
"""Pairs of a chart [1]: those with the largest impulses."""
MOST_CHARACTERS = 400_000
"""Characters of all charts of forces of a page: scenes beyond have none, so that a page stays under 5 MB."""
HEIGHT = 110
"""Height of a panel [px]."""
DECIMAL = re.compile(r"(\d\.\d)\d+")


def force_charts(scenes: Mapping[str, tuple[Scenario, Mapping[Column, Course]]]) -> dict[str, str]:
    """SVG per scene, of the first scenes that fit into MOST_CHARACTERS; none without the libraries."""
    found: dict[str, str] = {}
    left = MOST_CHARACTERS
    for name, (scenario, courses) in scenes.items():
        try:
            svg = force_chart(scenario, courses)
        except charts.ChartsMissing:  # the part with the other charts says so
            return {}
        if svg and len(svg) <= left:
            found[name] = svg
            left -= len(svg)
    return found


def force_chart(scenario: Scenario, courses: Mapping[Column, Course]) -> str:
    """Normal force over time of the pairs with the largest impulses; dashed: the scene's truth. "" where
    nothing presses, and in heaps."""
    pairs = heaviest_pairs(courses.values(), MOST_PAIRS)
    if not pairs or "heap" in scenario.tags:
        return ""
    altair, _ = charts.library()
    color, _ = charts.engine_scales(altair, list(dict.fromkeys(engine for engine, _ in courses)))
    scale = altair.Scale(domain=[0, scenario.duration], nice=False)
    span = altair.X("time:Q", title="time [s]", scale=scale, axis=altair.Axis(tickCount=8))
    panels = []
    for pair in pairs:
        lines = altair.Chart(_points(courses, pair)).mark_line(strokeWidth=1.3)
        panel = lines.encode(x=span, y=altair.Y("force:Q", title="force [N]"), color=color)
        if truths := _truths(scenario, pair):
            rule = altair.Chart(pd.DataFrame(truths)).mark_rule(strokeDash=[5, 4], color=charts.INK)
            panel += rule.encode(x="start:Q", x2="end:Q", y="force:Q")
        panels.append(panel.properties(width=charts.WIDTH, height=HEIGHT, title=pair))
    return DECIMAL.sub(r"\1", charts.svg_of(altair.vconcat(*panels)))


def _points(courses: Mapping[Column, Course], pair: str) -> pd.DataFrame:
    """Force of a pair at the end of each frame; between contacts only the first and last zero."""
    parts = []
    for (engine, _), course in courses.items():
        force = course.values.get((FORCE, pair))
        if force is None:
            continue
        kept = np.isfinite(force)
        kept[1:-1] &= (force[:-2] != 0) | (force[1:-1] != 0) | (force[2:] != 0)
        parts.append(pd.DataFrame({"time": course.time[kept], "force": force[kept], "engine": engine}))
    return pd.concat(parts)


def _truths(scenario: Scenario, pair: str) -> list[dict[str, float]]:
    return [
        {"start": truth.start, "end": truth.end, "force": truth.value}
        for truth in scenario.forces
        if truth.quantity == "force"
        and pair in (f"{truth.body}-{truth.other}", f"{truth.other}-{truth.body}")
    ]
