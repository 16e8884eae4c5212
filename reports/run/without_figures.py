"""Metrics that were asked for where no run has a figure of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from touchstone.adapters.recording import scene_of_text
from touchstone.reports.metrics.context import Context
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import STUDY, Results
from touchstone.reports.verdict.rows import measured_of

REASONS = 2
"""Reasons that a line has [1]."""


def without_figures(asked: Sequence[str], results: Results) -> str:
    """Why scenes that played have no figure of any metric asked for, and which metrics have figures; empty
    where one has, or a verdict."""
    rows = [row for row in rows_of(results.frame) if row.metric in asked]
    if not asked or not results.recordings or any(row.verdict != "skipped" for row in rows):
        return ""
    scenes = {name: None for name, *_ in results.recordings}
    where = next(iter(scenes)) if len(scenes) == 1 else f"these {len(scenes)} scenes"
    reasons = list(dict.fromkeys(row.reason for row in rows if row.reason))
    why = "; ".join(reasons) if len(reasons) <= REASONS else "nothing in it that they measure"
    why = why or "it compares columns; name another engine or profile"
    return f"no figure in {where}: {why} (valid here: {', '.join(families(_measured(results)))})"


def families(names: Iterable[str]) -> list[str]:
    """Names of metrics; several that begin with the same word as one pattern for `--metric`."""
    of_family: dict[str, list[str]] = {}
    for name in dict.fromkeys(names):
        of_family.setdefault(name.partition(".")[0], []).append(name)
    return [mine[0] if len(mine) == 1 else f"{family}.*" for family, mine in sorted(of_family.items())]


def _measured(results: Results) -> Collection[str]:
    """Names of the metrics of which a recording has figures."""
    found: dict[str, None] = {}
    for (scene, engine, label), recording in results.recordings.items():
        base = Row(STUDY, scene, engine, label, float(recording.facts["dt"]), "run")
        rows = measured_of(base, Context(recording, scene_of_text(recording.scenario)))
        found |= dict.fromkeys(row.metric for row in rows if row.verdict != "skipped")
    return found
