"""The warning of a run whose solver left contacts or time unresolved. An iteration that reaches its cap is
counted (`solver.caps`), and warns by what it leaves."""

from __future__ import annotations

from dataclasses import replace

from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context, NotMeasured, Value
from touchstone.reports.metrics.solver import RESIDUAL, worst_place
from touchstone.reports.results import Row
from touchstone.reports.verdict.judge import judged

KINDS = {
    "solver.residual": ((RESIDUAL,), "contact solve left {} m/s in {}"),
    "solver.dropped_time": (("dropped_time",), "{} s were not simulated, most of it in {}"),
    "solver.parted_energy": (("parted_energy",), "parting overlap added {} J, most of it in {}"),
}
"""Metric -> its counters, and the warning's texts of its size and its worst place."""


def warning(base: Row, context: Context) -> str | None:
    """One line with engine, profile, scene, frame and pair of everything that a run left unresolved beyond
    its limit, known failings and scenes without limits included; None if there is nothing, or if the engine
    does not report it.

    Args:
        base: a row of the run, for its engine, profile, scene and step.
        context: context of the run, whole or up to its failure.
    """
    parts = []
    for metric, (counters, words) in KINDS.items():
        try:
            value = _value(context, metric)
        except NotMeasured:
            return None
        row = judged(replace(base, metric=metric, value=value), context.scenario.tags)
        if row.verdict in ("fail", "known"):
            parts.append(words.format(f"{value:.3g}", worst_place(context, *counters)))
    return f"warning: {base.engine} {base.profile} {base.scenario}: {'; '.join(parts)}" if parts else None


def _value(context: Context, metric: str) -> float:
    """Value of a metric of KINDS for the whole run."""
    found = METRICS[metric].measure(context)[""]
    return found.value if isinstance(found, Value) else found
