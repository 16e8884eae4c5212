"""The warning of a run whose solver left something unresolved."""

from __future__ import annotations

from collections.abc import Iterable

from reports.metrics.evidence import Evidence
from reports.metrics.solver import CAPS, RESIDUAL, worst_place
from reports.results import Row

KINDS = {
    "solver.residual": ((RESIDUAL,), "contact solve left {} m/s in {}"),
    "solver.dropped_time": (("dropped_time",), "{} s were not simulated, most of it in {}"),
    "solver.parted_energy": (("parted_energy",), "parting overlap added {} J, most of it in {}"),
    "solver.caps": (CAPS, "caps reached: {}, most in {}"),
}
"""Metric -> its counters, and what a warning says of its size and its worst place."""


def warning(rows: Iterable[Row], evidence: Evidence) -> str | None:
    """One line that names engine, profile, scene, frame and pair of everything that a run left unresolved
    beyond its limit; None where that is nothing.

    Args:
        rows: judged rows of one run.
        evidence: of the same run.
    """
    broken = [row for row in rows if row.metric in KINDS and row.verdict in ("fail", "known")]
    if not broken:
        return None
    told = []
    for row in broken:
        counters, words = KINDS[row.metric]
        told.append(words.format(f"{row.value:.3g}", worst_place(evidence, *counters)))
    first = broken[0]
    return f"warning: {first.engine} {first.profile} {first.scenario}: {'; '.join(told)}"
