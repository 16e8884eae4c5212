"""The METRICS table: every metric is named, dimensioned, explained, and runs over a real recording."""

import re
import sys
from dataclasses import replace
from math import isfinite, isnan

import pytest

from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics import IMPULSE_METRICS, METRICS, OTHER_LABELS, SOLVER_METRICS, posture
from touchstone.reports.metrics.context import Context, JudgeMissing, NotMeasured, Value
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.scenario import Scenario

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

USUAL = ("ball_snip", "wall_push")
"""A hand's scene and a person's: most metrics are measured in them; others of the gallery are slow tests."""


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_is_defined(name):
    """A metric has its own name, an SI unit, a direction and a one-line formula with that unit."""
    metric = METRICS[name]
    assert metric.name == name
    assert re.fullmatch(r"[a-z]+(\.[a-z0-9_]+)*", name)
    assert metric.unit in UNITS
    assert metric.better in ("lower", "none")
    if "truth 0" in metric.formula or "error" in metric.label:
        assert metric.better == "lower"
    assert metric.formula[0].isupper() or metric.formula[0].isdigit() or metric.formula[0] == "-"
    assert len(metric.formula) <= 110
    if metric.shown:
        assert metric.shown[1] in (1e3, 1e6)
        assert metric.shown[0].endswith(metric.unit)


def test_names_and_formulas_are_told_apart():
    """No two metrics have the same words for readers; those that the audit rejects are in the table."""
    labels = [*(one.label for one in METRICS.values()), *OTHER_LABELS.values()]
    assert all(labels)
    assert len(set(labels)) == len(labels)
    assert len({metric.formula for metric in METRICS.values()}) == len(METRICS)
    assert set(IMPULSE_METRICS) <= set(METRICS)


def played(registry, engine: str, name: str) -> tuple[Recording, Scenario]:
    """A recording and its scene; of `wall_push` on other engines than ours the first half, which meets the
    wall."""
    scene = catalogue()[name]
    if engine == "reference" or name != "wall_push":
        return registry.played(name, engine), scene
    scene = replace(scene, duration=scene.duration / 2, expectations=())
    recording = record(registry.engine(engine), scene, registry.settings(engine))
    assert len(recording.contacts)
    return recording, scene


@pytest.mark.parametrize(
    "scene",
    [
        scenario.name if scenario.name in USUAL else pytest.param(scenario.name, marks=pytest.mark.slow)
        for scenario in tagged("gallery")
    ],
)
@pytest.mark.parametrize("engine", ENGINES)
def test_every_metric_runs_over_a_real_recording(registry, monkeypatch, engine, scene):
    """Each metric gives finite values, or says in one line why not."""
    monkeypatch.setattr(posture, "FRAMES", 2)
    missed = {}
    context = Context(*played(registry, engine, scene))
    for name, metric in METRICS.items():
        try:
            values = metric.measure(context)
        except NotMeasured as reason:
            missed[name] = str(reason)
            continue
        assert values, name
        for subject, value in values.items():
            assert isinstance(subject, str)
            if isinstance(value, Value):
                assert isfinite(value.value) or (isnan(value.value) and value.reason), (name, subject)
            else:
                assert isfinite(value), (name, subject)
    assert all(re.fullmatch(r"[^\n]{5,}", reason) for reason in missed.values())
    if scene == "ball_snip":
        # with a hand, a ball and a floor, what needs a closed form or a person is all that is missing
        sliding = {f"friction.{name}" for name in ("stop", "lift", "tilt", "creep", "heading")}
        others = {name for name in missed if not name.startswith(OF_PROBES)} - sliding
        only_ours = {"time.share", "work", "energy.ledger", *SOLVER_METRICS}
        only_theirs = {"contact.impulse_balance.driven"}
        assert others <= {*ELSEWHERE, *only_ours, *only_theirs, "contact.gap"}
        assert not others & (only_ours if engine == "reference" else only_theirs)


def test_a_missing_oracle_is_told(registry, monkeypatch):
    """Without coal what needs distances is not judged, with the line that installs it; the rest is."""
    scene = catalogue()["ball_snip"]
    context = Context(registry.played("ball_snip", "reference"), scene)
    monkeypatch.delitem(sys.modules, "touchstone.adapters.oracles.overlap", raising=False)
    monkeypatch.setitem(sys.modules, "coal", None)
    for name in ("overlap.max", "overlap.tunnelled", "contact.gap"):
        with pytest.raises(JudgeMissing, match="pip install --force-reinstall coal pin numba"):
            METRICS[name].measure(context)
    assert METRICS["friction.cone.point"].measure(context)[""] < 1e-12  # Coulomb's inequality, to rounding
