"""The METRICS table: every metric is named, dimensioned, explained, and runs over a real recording."""

import re
from math import isfinite

import pytest

from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics import IMPULSE_METRICS, METRICS, OTHER_LABELS, SOLVER_METRICS
from touchstone.reports.metrics.context import Context, JudgeMissing
from touchstone.scenarios.catalogue import catalogue, tagged

UNITS = {"s", "m", "m s", "m/s", "1", "J", "N", "N s", "rad", "rad/s"}
OF_PROBES = (
    *("truth.", "bounce.", "rotation.", "rolling.", "rest.", "symmetry.", "momentum."),
    *("energy.gain", "energy.loss", "force.error"),
)
"""Metrics that need a closed form or a tag that scenes of the gallery do not have."""
ELSEWHERE = (
    *("events.meet", "events.part", "friction.coast"),
    *("joint.cone", "joint.stop", "joint.drift", "joint.turn", "joint.force"),
    *("posture.deviation", "posture.over_best"),
    *("impact.law", "published.error"),
)
"""Metrics of other scenes than `ball_snip`."""

PLAYED = [
    (engine, one.name)
    if one.name == "ball_snip" or (engine, one.name) == ("reference", "wall_push")
    else pytest.param(engine, one.name, marks=pytest.mark.slow)
    for engine in ENGINES
    for one in tagged("gallery")
]
"""A hand's scene and a person's: most metrics are measured in them."""


def test_metrics_are_told_apart():
    """A metric has its own name, words and one-line formula, an SI unit and a direction; those that the audit
    rejects are in the table."""
    labels = [*(one.label for one in METRICS.values()), *OTHER_LABELS.values()]
    assert all(labels)
    assert len(set(labels)) == len(labels)
    assert len({metric.formula for metric in METRICS.values()}) == len(METRICS)
    assert set(IMPULSE_METRICS) <= set(METRICS)
    for name, metric in METRICS.items():
        assert metric.name == name
        assert metric.unit in UNITS
        assert metric.better in ("lower", "none")
        if "truth 0" in metric.formula or "error" in metric.label:
            assert metric.better == "lower"
        if metric.shown:
            assert metric.shown[1] in (1e3, 1e6)
            assert metric.shown[0].endswith(metric.unit)


@pytest.mark.parametrize(("engine", "scene"), PLAYED)
def test_every_metric_runs_over_a_real_recording(registry, engine, scene):
    """Each metric gives finite values, or says in one line why not; none ends in an error."""
    rows = registry.judged_rows(scene, engine)
    assert {row.metric for row in rows} == set(METRICS)
    assert [row.reason for row in rows if row.verdict == "error"] == []
    for row in rows:
        assert isfinite(row.value) or re.fullmatch(r"[^\n]{5,}", row.reason), row
    if scene == "ball_snip":
        # with a hand, a ball and a floor, what needs a closed form or a person is all that is missing
        missed = {row.metric for row in rows} - {row.metric for row in rows if isfinite(row.value)}
        sliding = {f"friction.{name}" for name in ("stop", "lift", "tilt", "creep", "heading")}
        others = {name for name in missed if not name.startswith(OF_PROBES)} - sliding
        only_ours = {"time.share", "work", "energy.ledger", *SOLVER_METRICS}
        only_theirs = {"contact.impulse_balance.driven"}
        assert others <= {*ELSEWHERE, *only_ours, *only_theirs, "contact.gap"}
        assert not others & (only_ours if engine == "reference" else only_theirs)


def test_a_missing_oracle_is_told(registry, without_coal):
    """Without coal what needs distances is not judged, with the line that installs it; the rest is."""
    scene = catalogue()["ball_snip"]
    context = Context(registry.played("ball_snip", "reference"), scene)
    for name in ("overlap.max", "overlap.tunnelled", "contact.gap"):
        with pytest.raises(JudgeMissing, match="pip install --force-reinstall coal pin numba"):
            METRICS[name].measure(context)
    assert METRICS["friction.cone.point"].measure(context)[""] < 1e-12  # Coulomb's inequality, to rounding
