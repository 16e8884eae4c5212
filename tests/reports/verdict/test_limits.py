"""Limits: the most specific wins, and every limit and known failing names something that exists."""

from dataclasses import replace
from importlib import import_module
from math import inf, nan

import numpy as np
import pytest

from touchstone.adapters.detectors import DETECTORS
from touchstone.adapters.oracles.articulated import Articulated
from touchstone.adapters.registry import ENGINES, OPTIONAL_ENGINES
from touchstone.reports.bench.geometry import FAMILIES, MOTION
from touchstone.reports.bench.scaling import BALLS, BROAD_PHASE, VERTICES
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import VERDICTS, Row
from touchstone.reports.studies import effects, robustness
from touchstone.reports.studies.calibration import ALL, LARGEST, SHAPES, SLOW
from touchstone.reports.studies.inverse_kinematics import CCD, MEASURED, SOLVERS, STARTS
from touchstone.reports.studies.predictability import ERROR
from touchstone.reports.verdict import limits as module
from touchstone.reports.verdict.failings import NOISY, known
from touchstone.reports.verdict.judge import judged, judged_in
from touchstone.reports.verdict.limits import FILE, LIMITS, Limit, file_model
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tags
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.files.read import data_of_file

BENCH_METRICS = ("ratio.time", "certificate.open", "certificate.false", "scaling.exponent")
ROW = Row("run", "ball_snip", "mujoco", "recommended", 1 / 540, "overlap.max", 2.0, "m", "a-b")

OF_THE_PROJECT = ENGINES | {
    name: import_module(f"touchstone.adapters.engines.{name}").ENTRY for name in OPTIONAL_ENGINES
}
"""Engines that play by default, and those that play when they are named."""


KNOWN = tuple(known().values())


@pytest.fixture
def limits(monkeypatch):
    """Put limits in the place of the real ones."""
    return lambda *limits: monkeypatch.setattr(module, "LIMITS", limits)


def each_of(entries):
    """Check all entries of an engine in one test: as single tests, thousands of entries take ten seconds.

    Faults name their entries.
    """
    groups: dict[str, list] = {}
    for entry in entries:
        groups.setdefault(entry.engine or "all engines", []).append(entry)

    def decorate(check):
        def test(engine):
            faults = []
            for entry in groups[engine]:
                try:
                    check(entry)
                except (AssertionError, LookupError) as error:
                    faults.append(f"{entry}: {type(error).__name__}: {error}")
            assert faults == []

        test.__doc__ = check.__doc__
        return pytest.mark.parametrize("engine", groups)(test)

    return decorate


@each_of([*LIMITS, *KNOWN])
def test_every_entry_names_what_exists(entry):
    """Metric, engine, scene or tag, and profile of every limit and known failing exist; reasons are lines."""
    assert len(entry.reason) > 8
    assert "\n" not in entry.reason
    spread = tuple(f"{name}.spread" for name in METRICS if name.startswith("events."))
    if entry.scenario in STARTS or entry.metric == "ik.missed":
        assert entry.metric in MEASURED
        assert entry.scenario in ("", *STARTS)
        assert entry.profile in ("", *(profile for _, profile in SOLVERS))
        return
    if entry.metric in BENCH_METRICS:
        assert entry.engine in ("", *DETECTORS)
        assert entry.subject in ("", *DETECTORS)
        assert entry.scenario in (*FAMILIES, MOTION, BALLS, BROAD_PHASE, VERTICES)
        return
    if entry.metric in robustness.METRICS:
        assert (entry.engine, entry.scenario) == ("reference", robustness.ALL)
        assert entry.profile in ENGINES["reference"].profiles
        return
    if entry.metric in effects.JUDGED:
        assert entry.engine in ENGINES if entry.metric == "time.left" else entry.engine == effects.REFERENCE
        assert entry.scenario in ("", *effects.GROUPS)
        assert entry.subject in ("", effects.ALL, *(f"+{effect}" for effect in PLANNED))
        return
    calibrated = (*LARGEST.values(), SLOW)
    assert entry.metric in (*METRICS, *spread, *calibrated, ERROR, "run")
    assert entry.engine in ("", *OF_THE_PROJECT)
    places = (ALL, *SHAPES) if entry.metric in calibrated else (*catalogue(), *tags())
    assert entry.scenario in ("", *places)
    profiles = (
        OF_THE_PROJECT[entry.engine].profiles
        if entry.engine
        else {p for e in ENGINES.values() for p in e.profiles}
    )
    assert entry.profile.replace(NOISY, "") in ("", *profiles)
    bodies = {body.name for scenario in catalogue().values() for body in scenario.bodies}
    numbered = entry.subject.startswith("#") and entry.subject[1:].isdigit()
    groups = {"energy.injected": ["all", "simulated", "driven"]}
    if entry.metric == "published.error" and entry.scenario:
        groups[entry.metric] = [one.name for one in catalogue()[entry.scenario].published]
    named = entry.subject in (*groups.get(entry.metric, ()), "*")
    assert numbered or named or set(filter(None, entry.subject.split("-"))) <= bodies


def sizes(metric, reason):
    """Scene -> the limit of a metric, among those with such a reason."""
    return {one.scenario: one.largest for one in LIMITS if one.metric == metric and reason in one.reason}


HINGE_SPEED = sizes("joint.speed", "tracker")
PERSON_ENERGY = {scene: 100 * joule for scene, joule in sizes("energy.injected", "of its motion").items()}


def test_the_file_is_one_of_limits():
    """Our file has the fields of those of users."""
    assert data_of_file(FILE, file_model())[1] == []


@pytest.mark.parametrize("scene", HINGE_SPEED)
def test_hinge_speeds_are_those_of_the_trackers(scene):
    """The limit of a scene's hinges is the speed of its tracker's fastest one, rounded up to 0.1 rad/s."""
    scenario = catalogue()[scene]
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    turned = [np.diff(sample(tracker, times).angle, axis=0) for tracker in scenario.trackers]
    fastest = max(float(np.abs(rows).max()) for rows in turned) * scenario.frame_rate
    assert fastest <= HINGE_SPEED[scene] < fastest + 0.1


@each_of(LIMITS)
def test_limits_are_of_metrics_with_a_direction(limit):
    """A limit bounds a size from above: never of a metric that is better higher, never negative."""
    assert limit.largest >= 0
    metric = METRICS.get(limit.metric)
    assert metric is None or metric.better == "lower"


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(1.0, "pass"), (-1.0, "pass"), (1.1, "fail"), (-1.1, "fail"), (inf, "fail"), (nan, "fail")],
)
def test_a_limit_bounds_the_size(limits, value, verdict):
    """A value is judged by its size, the limit included; what is no number fails."""
    limits(Limit("overlap.max", 1.0, "why"))
    row = judged(replace(ROW, value=value), ())
    assert (row.verdict, row.limit, row.reason) == (verdict, 1.0, "why")


def test_the_most_specific_limit_wins(limits):
    """More named fields win, wherever the limit stands; among equals the last; others do not apply."""
    ladder = [
        Limit("overlap.max", 4.0, "four", "mujoco", "gallery", "recommended", "a-b"),
        Limit("overlap.max", 3.0, "three", engine="mujoco", scenario="ball_snip", profile="recommended"),
        Limit("overlap.max", 2.0, "two", engine="mujoco", subject="a-b"),
        Limit("overlap.max", 1.0, "one", engine="mujoco"),
        Limit("overlap.max", 0.0, "none"),
    ]
    strangers = [
        Limit("overlap.p95", 9.0, "metric", "mujoco", "ball_snip", "recommended", "a-b"),
        Limit("overlap.max", 9.0, "engine", "dart", "ball_snip", "recommended", "a-b"),
        Limit("overlap.max", 9.0, "scene", "mujoco", "other", "recommended", "a-b"),
        Limit("overlap.max", 9.0, "profile", "mujoco", "ball_snip", "equal-step", "a-b"),
        Limit("overlap.max", 9.0, "subject", "mujoco", "ball_snip", "recommended", "a-c"),
    ]
    for first in range(len(ladder)):
        for order in (1, -1):
            limits(*[*ladder[first:], *strangers][::order])
            assert judged(ROW, ("gallery",)).reason == ladder[first].reason
    limits(Limit("overlap.max", 1.0, "old", engine="mujoco"), Limit("overlap.max", 3.0, "new", subject="a-b"))
    assert judged(ROW, ()).reason == "new"
    limits(*strangers)
    assert judged(ROW, ("gallery",)) == ROW


def test_limits_by_construction_are_marked(limits):
    """A limit that the method meets whatever it simulates leaves its mark on the row."""
    limits(Limit("overlap.max", 3.0, "removed last", by_construction=True))
    assert judged(ROW, ()).basis == "construction"
    limits(Limit("overlap.max", 3.0, "removed last"))
    assert judged(replace(ROW, basis="unaudited"), ()).basis == "unaudited"


@pytest.mark.parametrize("verdict", [v for v in VERDICTS if v])
def test_what_is_judged_stays_judged(limits, verdict):
    """Rows that were skipped, that failed to run or that an expectation judged keep their verdict."""
    limits(Limit("overlap.max", 1.0, "why"))
    row = replace(ROW, verdict=verdict, reason="before")
    assert judged(row, ()) == row


def test_remarks_are_kept(limits):
    """A row's own remark comes before the limit's reason."""
    limits(Limit("overlap.max", 3.0, "why"))
    assert judged(replace(ROW, reason="outlier x"), ()).reason == "outlier x; why"


@pytest.mark.parametrize("scene", PERSON_ENERGY)
def test_a_persons_energy_is_that_of_its_tracker(scene):
    """Give the largest kinetic energy that a tracker asks for, by pinocchio, to two digits."""

    scenario = catalogue()[scene]
    tracker = scenario.trackers[0]
    model = Articulated(scenario, tracker)
    motion = sample(tracker, np.arange(scenario.frame_count + 1) / scenario.frame_rate)
    postures = map(model.posture, motion.position, motion.orientation, motion.angle)
    rates = np.hstack((motion.linear_velocity, motion.angular_velocity, motion.rate))
    most = max(map(model.kinetic_energy, postures, rates))
    assert PERSON_ENERGY[scene] == pytest.approx(most, rel=0.02)


@pytest.mark.parametrize(("low", "verdict"), [(0.2, ""), (0.5, "fail"), (nan, "fail")])
def test_a_ratio_of_times_breaks_a_limit_by_its_whole_interval(low, verdict):
    """A limit, ours or of a file, says nothing of a ratio whose interval includes it."""
    row = Row("ik", "arm, near", "reference", CCD, nan, "ratio.time", 0.6, "1", low=low, high=0.9)
    assert judged(row, ()).verdict == verdict
    of_file = (Limit("ratio.time", 0.4, "as fast"),)
    assert judged_in(row, catalogue()["fall"], of_file).verdict == verdict
