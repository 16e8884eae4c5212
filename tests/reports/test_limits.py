"""Limits: the most specific wins, known failings are strict, and every row names something that exists."""

from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest

from touchstone.adapters.detectors import DETECTORS
from touchstone.adapters.engines.drake import ENTRY
from touchstone.adapters.registry import ENGINES
from touchstone.reports import limits as module
from touchstone.reports import own_limits
from touchstone.reports.bench.curves import BALLS, BROAD_PHASE, VERTICES
from touchstone.reports.bench.geometry import MOTION
from touchstone.reports.bench.poses import FAMILIES
from touchstone.reports.known_failures import bounds as known_bounds
from touchstone.reports.known_failures.bounds import UNMEASURED
from touchstone.reports.known_failures.cause import NOISY
from touchstone.reports.known_failures.table import CAUSES
from touchstone.reports.limits import CCD, HINGE_SPEED, KNOWN, LIMITS, PERSON_ENERGY, Known, Limit, judged
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import VERDICTS, Row
from touchstone.reports.run.request import DEFAULT_PROFILES
from touchstone.reports.studies import effects
from touchstone.reports.studies.calibration.probes import SHAPES
from touchstone.reports.studies.calibration.rows import ALL, LARGEST
from touchstone.reports.studies.inverse_kinematics import MEASURED, SOLVERS, STARTS
from touchstone.reports.studies.predictability import ERROR
from touchstone.reports.studies.robustness import study as robustness
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tags
from touchstone.scenarios.effects import PLANNED

BENCH_METRICS = ("ratio.time", "certificate.open", "certificate.false", "scaling.exponent")
ROW = Row("run", "ball_snip", "mujoco", "recommended", 1 / 540, "overlap.max", 2.0, "m", "a-b")

OF_THE_PROJECT = {**ENGINES, "drake": ENTRY}
"""Engines that play by default, and Drake, which plays when it is named."""


@pytest.fixture
def limits(monkeypatch):
    """Put limits and known failings in the place of the real ones."""

    def put(limits=(), known=(), bound=inf):
        monkeypatch.setattr(module, "LIMITS", tuple(limits))
        monkeypatch.setattr(module, "KNOWN", tuple(known))
        for place in (module, known_bounds):
            monkeypatch.setattr(place, "bound_of", lambda row, known=None: bound)
            monkeypatch.setattr(place, "is_measured", lambda row: True)

    return put


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
        assert entry.engine == effects.REFERENCE
        assert entry.scenario in ("", *effects.GROUPS)
        assert entry.subject in ("", effects.ALL, *(f"+{effect}" for effect in PLANNED))
        return
    assert entry.metric in (*METRICS, *spread, *LARGEST.values(), ERROR, "run")
    assert entry.engine in ("", *OF_THE_PROJECT)
    places = (ALL, *SHAPES) if entry.metric in LARGEST.values() else (*catalogue(), *tags())
    assert entry.scenario in ("", *places)
    profiles = (
        OF_THE_PROJECT[entry.engine].profiles
        if entry.engine
        else {p for e in ENGINES.values() for p in e.profiles}
    )
    assert entry.profile.replace(NOISY, "") in ("", *profiles)
    bodies = {body.name for scenario in catalogue().values() for body in scenario.bodies}
    numbered = entry.subject.startswith("#") and entry.subject[1:].isdigit()
    groups = ("all", "simulated", "driven") if entry.metric == "energy.injected" else ()
    assert numbered or entry.subject in groups or set(filter(None, entry.subject.split("-"))) <= bodies


@pytest.mark.parametrize("scene", HINGE_SPEED)
def test_hinge_speeds_are_those_of_the_trackers(scene):
    """The limit of a scene's hinges is the speed of its tracker's fastest one, rounded up to 0.1 rad/s."""
    scenario = catalogue()[scene]
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    turned = [np.diff(sample(tracker, times).angle, axis=0) for tracker in scenario.trackers]
    fastest = max(float(np.abs(rows).max()) for rows in turned) * scenario.frame_rate
    assert fastest <= HINGE_SPEED[scene] < fastest + 0.1


@each_of([*LIMITS, *KNOWN])
def test_reasons_are_lines(limit):
    """Every limit has its reason, on one line."""
    assert len(limit.reason) > 8
    assert "\n" not in limit.reason


@each_of(LIMITS)
def test_limits_are_of_metrics_with_a_direction(limit):
    """A limit bounds a size from above: never of a metric that is better higher, never negative."""
    assert limit.largest >= 0
    metric = METRICS.get(limit.metric)
    assert metric is None or metric.better == "lower"


@each_of(KNOWN)
def test_known_failings_say_how_to_see_them(known):
    """Every known failing names one engine and a command that shows it, and a limit it breaks exists."""
    assert known.engine in OF_THE_PROJECT
    studies = dict.fromkeys(effects.JUDGED, "effects") | dict.fromkeys(LARGEST.values(), "calibration")
    if known.metric in studies:
        assert known.reproduce == f"touchstone study {studies[known.metric]} --engine {known.engine}"
        return
    command = known.reproduce.removeprefix("touchstone run ").split()
    assert command[0] in catalogue()
    options = dict(zip(command[1::2], command[2::2]))
    assert options["--engine"] == known.engine
    if known.metric == "run":  # it fails whatever is measured
        return
    assert options["--metric"] == known.metric or options["--metric"] in METRICS
    # the limit of an event is its window, which stands in the scene
    limited = known.never or known.metric.startswith("events.")
    assert limited or any(limit.metric == known.metric for limit in LIMITS)


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(1.0, "pass"), (-1.0, "pass"), (1.1, "fail"), (-1.1, "fail"), (inf, "fail"), (nan, "fail")],
)
def test_a_limit_bounds_the_size(limits, value, verdict):
    """A value is judged by its size, the limit included; what is no number fails."""
    limits([Limit("overlap.max", 1.0, "why")])
    row = judged(replace(ROW, value=value), ())
    assert (row.verdict, row.limit, row.reason) == (verdict, 1.0, "why")


def test_the_most_specific_limit_wins(limits):
    """More named fields win, wherever the limit stands; among equals the last; others do not apply."""
    ladder = [
        Limit(
            "overlap.max",
            4.0,
            "four",
            engine="mujoco",
            scenario="gallery",
            profile="recommended",
            subject="a-b",
        ),
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
            limits([*ladder[first:], *strangers][::order])
            assert judged(ROW, ("gallery",)).reason == ladder[first].reason
    limits(
        [Limit("overlap.max", 1.0, "old", engine="mujoco"), Limit("overlap.max", 3.0, "new", subject="a-b")]
    )
    assert judged(ROW, ()).reason == "new"
    limits(strangers)
    assert judged(ROW, ("gallery",)) == ROW


def test_known_failings_are_strict(limits):
    """A known failing is known while it fails; once its limit is met the row fails and says what to do."""
    limits([Limit("overlap.max", 1.0, "why")], [Known("overlap.max", "mujoco", "soft", scenario="gallery")])
    assert judged(ROW, ("gallery",)).verdict == "known"
    assert judged(ROW, ("gallery",)).reason == "soft"
    assert judged(ROW, ()).verdict == "fail"
    mended = judged(replace(ROW, value=0.5), ("gallery",))
    assert mended.verdict == "fail"
    assert "a known failing is gone: take it out of known_failures (soft)" in mended.reason


@pytest.mark.parametrize(
    ("value", "bound", "verdict"),
    [(2.0, 2.5, "known"), (-2.5, 2.5, "known"), (2.6, 2.5, "fail"), (inf, 2.5, "fail"), (2.0, None, "fail")],
)
def test_a_known_failing_may_not_grow(limits, value, bound, verdict):
    """A failing that grows past its bound fails, and so does one whose size nobody measured."""
    limits([Limit("overlap.max", 1.0, "why")], [Known("overlap.max", "mujoco", "soft")], bound)
    row = judged(replace(ROW, value=value), ())
    assert row.verdict == verdict
    assert "soft" in row.reason


def test_every_known_failing_has_a_bound():
    """Each documented failing has an upper bound above its limit for every subject; no bound is left over."""
    bounds = known_bounds.read(known_bounds.FILE)
    for key, largest in bounds.items():
        engine, profile, scenario, metric, subject = key
        row = Row("run", scenario, engine, profile, 0.0, metric, subject=subject)
        tags_of = catalogue()[scenario].tags if scenario in catalogue() else ()
        known = module.known_of(row, tags_of)
        assert known is not None, key
        assert known_bounds.key_of(row, known) == key
        limit = module.limit_of(row, tags_of)
        assert limit is not None, key
        assert largest > limit.largest, key
    bounded = {key[:4] for key in bounds}
    sized = [k for k in KNOWN if not k.metric.startswith("events.") and k.metric != "run"]
    # with noisy trackers there are no bounds
    sized = [k for k in sized if NOISY not in k.profile]
    missing = [k for k in sized if (k.engine, k.profile, k.scenario, k.metric) not in bounded]
    # what is measured by now is strict again
    assert {(k.engine, k.profile, k.scenario) for k in missing} == set(UNMEASURED)


def test_bounds_are_a_quarter_over_what_was_measured(tmp_path):
    """Bounds follow from results, rounded up to two digits; what is no longer documented goes."""
    row = replace(ROW, value=-0.0431)
    key = known_bounds.key_of(row)
    assert known_bounds.bounded(row.value) == 0.054
    assert known_bounds.bounded(0.1) == 0.13
    old = {key: 9.0, ("gone", *key[1:]): 1.0, ("kept", *key[1:]): 2.0}
    now = known_bounds.updated(old, [(row, None)], [key, ("kept", *key[1:])])
    assert now == {key: 0.054, ("kept", *key[1:]): 2.0}
    known_bounds.write(now, tmp_path / "bounds.csv")
    assert known_bounds.read(tmp_path / "bounds.csv") == now


def test_a_chaotic_scene_has_one_bound_for_all_pairs(limits):
    """Ten times the largest of them; what meets its limit there is no news."""
    known = Known("overlap.max", "mujoco", "it collapses", chaotic=True)
    rows = [replace(ROW, subject=pair, value=value) for pair, value in (("a-b", 2.0), ("b-c", 0.031))]
    key = known_bounds.key_of(rows[0], known)
    assert key[-1] == known_bounds.ALL_SUBJECTS
    assert known_bounds.updated({}, [(row, known) for row in rows], [key]) == {key: 20.0}
    limits([Limit("overlap.max", 1.0, "why")], [known], bound=20.0)
    assert judged(replace(ROW, value=0.5), ()).verdict == "pass"
    assert judged(replace(ROW, value=3.0), ()).verdict == "known"
    assert judged(replace(ROW, value=21.0), ()).verdict == "fail"


def test_one_cause_is_one_entry():
    """No engine has the same reason twice."""
    reported = [(cause.engine, cause.reason) for cause in CAUSES]
    assert len(set(reported)) == len(reported)
    shown = [(k.engine, k.profile, k.scenario, k.metric, k.subject) for k in KNOWN]
    assert len(set(shown)) == len(shown)


def test_limits_by_construction_are_marked(limits):
    """A limit that the method meets whatever it simulates leaves its mark on the row."""
    limits([Limit("overlap.max", 3.0, "removed last", by_construction=True)])
    assert judged(ROW, ()).basis == "construction"
    limits([Limit("overlap.max", 3.0, "removed last")])
    assert judged(replace(ROW, basis="unaudited"), ()).basis == "unaudited"


def test_a_known_failing_has_to_be_measured(limits):
    """A value that is no number is not the known failing: it fails."""
    limits([Limit("overlap.max", 1.0, "why")], [Known("overlap.max", "mujoco", "soft")])
    assert judged(replace(ROW, value=nan), ()).verdict == "fail"


@pytest.mark.parametrize("verdict", [v for v in VERDICTS if v])
def test_what_is_judged_stays_judged(limits, verdict):
    """Rows that were skipped, that failed to run or that an expectation judged keep their verdict."""
    limits([Limit("overlap.max", 1.0, "why")])
    row = replace(ROW, verdict=verdict, reason="before")
    assert judged(row, ()) == row


def test_remarks_are_kept(limits):
    """A row's own remark comes before the limit's reason."""
    limits([Limit("overlap.max", 3.0, "why")])
    assert judged(replace(ROW, reason="outlier x"), ()).reason == "outlier x; why"


def test_a_known_event_that_never_happens(limits):
    """An expected event that never happens is known where it is listed as such, and failed elsewhere."""
    limits(known=[Known("events.roll", "reference", "it never rolls", profile="paper", never=True)])
    row = Row("run", "s", "reference", "paper", 1 / 60, "events.roll", nan, verdict="fail", reason="expected")
    assert judged(row, ()).verdict == "known"
    assert judged(replace(row, profile="balanced"), ()).verdict == "fail"
    assert judged(replace(row, value=0.5, verdict="pass"), ()).verdict == "fail"


def test_a_pair_that_did_not_fail_when_measured_may_meet_its_limit(limits):
    """An entry for a scene covers all its pairs, but says nothing of those without a bound."""
    limits([Limit("overlap.max", 1.0, "why")], [Known("overlap.max", "mujoco", "soft")], bound=None)
    assert judged(replace(ROW, value=0.5), ()).verdict == "pass"
    assert judged(ROW, ()).verdict == "fail"


def test_a_known_failing_may_be_gone_at_another_step(limits):
    """Strictness holds at the profile's own step alone."""
    limits(
        limits=[Limit("overlap.max", 1.0, "a limit")],
        known=[Known("overlap.max", "mujoco", "it sinks", profile="recommended")],
    )
    own = Row("run", "s", "mujoco", "recommended", 1 / 540, "overlap.max", 0.5)
    assert judged(own, ()).verdict == "fail"
    assert judged(replace(own, dt=1 / 6000), ()).verdict == "pass"


@pytest.mark.parametrize("scene", PERSON_ENERGY)
def test_a_persons_energy_is_that_of_its_tracker(scene):
    """Give the largest kinetic energy that a tracker asks for, by pinocchio, to two digits."""
    pytest.importorskip("pinocchio", reason="not installed (pip install pin)")
    from touchstone.adapters.oracles.articulated import Articulated

    scenario = catalogue()[scene]
    tracker = scenario.trackers[0]
    model = Articulated(scenario, tracker)
    motion = sample(tracker, np.arange(scenario.frame_count + 1) / scenario.frame_rate)
    postures = map(model.posture, motion.position, motion.orientation, motion.angle)
    rates = np.hstack((motion.linear_velocity, motion.angular_velocity, motion.rate))
    most = max(map(model.kinetic_energy, postures, rates))
    assert PERSON_ENERGY[scene] == pytest.approx(most, rel=0.02)


def test_a_run_that_diverges_may_be_known(limits):
    """Excuse a failed run whose scene, engine and profile are documented, and no other; keep what it said."""
    ended = replace(ROW, metric="run", subject="", value=nan, verdict="error", reason="diverged")
    limits([], [Known("run", "mujoco", "too fast", "ball_snip", "recommended")])
    assert (judged(ended, ()).verdict, judged(ended, ()).reason) == ("known", "diverged; too fast")
    for other in (
        replace(ended, engine="dart"),
        replace(ended, profile="default"),
        replace(ended, scenario="x"),
    ):
        assert judged(other, ()).verdict == "error"
    assert judged(replace(ended, verdict="skipped"), ()).verdict == "skipped"


def test_no_default_row_is_the_harness():
    """No known failing of a profile that plays by default is marked as the harness'."""
    marked = {known.profile for known in KNOWN if known.harness}
    assert marked == {"equal-step"}
    assert not marked & set(DEFAULT_PROFILES)


@pytest.mark.parametrize(("low", "verdict"), [(0.2, ""), (0.5, "fail"), (nan, "fail")])
def test_a_ratio_of_times_breaks_a_limit_by_its_whole_interval(low, verdict):
    """A limit, ours or of a file, says nothing of a ratio whose interval includes it."""
    row = Row("ik", "arm, near", "reference", CCD, nan, "ratio.time", 0.6, "1", low=low, high=0.9)
    assert judged(row, ()).verdict == verdict
    of_file = (Limit("ratio.time", 0.4, "as fast"),)
    assert own_limits.judged(row, catalogue()["fall"], of_file).verdict == verdict
