"""Verdicts cannot pass unseen: recordings that fail in one way each must break the limit that is about it."""

import warnings
from dataclasses import replace
from math import nan

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES
from touchstone.adapters.workers.children import Job, Outcome
from touchstone.reports import metrics
from touchstone.reports.metrics.context import JudgeMissing
from touchstone.reports.results import Row, table
from touchstone.reports.run import study
from touchstone.reports.run.ratios import DEEPER, NO_DEEPER, UNCOMPARED, compared
from touchstone.reports.runner.request import Request, Results

COLUMNS = (("reference", "balanced"), ("mujoco", "recommended"))
WEIGHT = 9.81 / 60
"""Impulse that carries a ball of 1 kg for a frame [N s]."""


@pytest.fixture
def resting(lab, recordings):
    """A ball of 1 kg that rests on the ground, with the impulses that carry it: scenario and recording."""
    scenario = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 0.05)), mu=0.5, duration=0.5)
    rows = [
        {
            "time": k / 60,
            "body_a": 0,
            "body_b": 1,
            "position": (0.0, 0.0, 0.0),
            "normal": (0.0, 0.0, 1.0),
            "impulse": (0.0, 0.0, WEIGHT),
        }
        for k in range(scenario.frame_count)
    ]
    return scenario, recordings.recording(scenario, contacts=recordings.contacts(*rows))


@pytest.fixture
def judged(tmp_path):
    """Rows of a scene that columns played as given recordings: (metric, subject) -> row per column."""

    def judge(scenario, **recorded):
        outcomes = []
        scenario = scenario.reduced(
            tags=scenario.tags or ("seeded",)
        )  # our limits say nothing of foreign scenes
        for (engine, profile), recording in zip(COLUMNS, recorded.values()):
            dt = ENGINES[engine].profiles[profile]
            path = tmp_path / f"{engine}.npz"
            facts = f'{{"engine": "{engine}", "profile": "default", "dt": {dt}}}'
            replace(recording, manifest=facts).save(path)
            settings = Settings(profile, dt)
            outcomes.append(Outcome(Job(engine, scenario, settings, path, path), "done"))
        request = Request((scenario,), COLUMNS, tmp_path)
        rows = study.judge_outcomes(request, scenario, outcomes, Results(table([])), lambda *_: None)
        return {(row.engine, row.metric, row.subject): row for row in rows}

    return judge


def test_a_sound_engine_passes(resting, judged):
    """Nothing fails where a ball rests as it should."""
    scenario, sound = resting
    found = judged(scenario, ours=replace(sound, time_frame=sound.time_frame / 10), theirs=sound)
    assert [row for row in found.values() if row.verdict in ("fail", "error", "unjudged")] == []
    ratio = found["reference", "ratio.time", "mujoco recommended"]
    assert ratio.reason.endswith("; overlap no larger; one run")
    assert (ratio.verdict, ratio.reason_code, ratio.value) == ("pass", NO_DEEPER, pytest.approx(0.1))


def test_an_engine_that_hovers_fails(resting, judged):
    """A body that rests a millimetre over the ground breaks the limit of the gap; it overlaps nothing."""
    scenario, sound = resting
    found = judged(scenario, ours=sound, theirs=replace(sound, position=sound.position + [[[0], [1e-3]]]))
    assert found["mujoco", "overlap.max", ""].verdict == "pass"
    assert found["mujoco", "contact.gap", "ground-ball"].verdict == "fail"


def test_an_engine_that_tunnels_fails(lab, resting, judged):
    """A body that ends under what it stood on breaks the limit of passages, though no frame shows overlap."""
    scenario, sound = resting
    position = sound.position.copy()
    position[15:, 1, 2] = -2.0
    found = judged(scenario, ours=sound, theirs=replace(sound, position=position))
    assert found["mujoco", "overlap.max", ""].verdict == "pass"
    assert found["mujoco", "overlap.tunnelled", ""].verdict == "fail"
    assert "ground through ball" in found["mujoco", "overlap.tunnelled", ""].reason


@pytest.mark.parametrize("share", [0.9, 0.0, nan])
def test_an_engine_that_reports_too_little_impulse_fails(resting, judged, share):
    """Impulses that do not carry a ball break their audit, and nothing that rests on them is judged."""
    scenario, sound = resting
    contacts = sound.contacts.copy()
    contacts["impulse"] *= share
    found = judged(scenario, ours=sound, theirs=replace(sound, contacts=contacts))
    assert found["mujoco", "contact.impulse_balance", "ball"].verdict == "fail"
    for name in metrics.IMPULSE_METRICS:
        rows = [row for key, row in found.items() if key[:2] == ("mujoco", name)]
        assert all(row.verdict == "skipped" for row in rows)


OURS = Row("run", "s", "reference", "balanced", 1 / 60, "overlap.max", 1e-7)


@pytest.mark.parametrize(
    ("ours", "theirs", "said", "code"),
    [
        (1e-7, 1e-3, "overlap no larger", NO_DEEPER),
        (1e-3, 1e-7, "overlap larger", DEEPER),
        (5e-9, 0.0, "overlap no larger", NO_DEEPER),
        (nan, 1e-3, "no overlap: boom", UNCOMPARED),
        (1e-7, nan, "no overlap: boom", UNCOMPARED),
        (nan, nan, "no overlap: boom", UNCOMPARED),
    ],
)
def test_overlaps_are_compared_where_there_are_two(ours, theirs, said, code):
    """'No larger' is said of two numbers; without one of them nobody can tell."""
    rows = [replace(OURS, value=v, verdict="error" if v != v else "", reason="boom") for v in (ours, theirs)]
    assert compared(*rows) == (code, said)
    assert compared(None, rows[1])[0] == UNCOMPARED
    # a metric that does not apply is not one that is missing
    apart = replace(OURS, value=nan, verdict="skipped", reason="no two bodies may touch")
    assert compared(apart, apart) == (NO_DEEPER, "no overlap: no two bodies may touch")


def test_a_fast_engine_without_overlap_is_not_judged(resting, judged, monkeypatch):
    """The ratio of times has no verdict while nobody knows whether the faster one overlaps more."""
    scenario, sound = resting

    def fails(context):
        raise JudgeMissing("no coal")

    broken = replace(metrics.METRICS["overlap.max"], measure=fails)
    monkeypatch.setitem(metrics.METRICS, "overlap.max", broken)
    found = judged(scenario, ours=replace(sound, time_frame=sound.time_frame / 10), theirs=sound)
    assert found["reference", "overlap.max", ""].verdict == "unjudged"
    ratio = found["reference", "ratio.time", "mujoco recommended"]
    assert (ratio.verdict, ratio.reason_code) == ("unjudged", UNCOMPARED)
    assert ratio.reason.startswith("own steps, against the fastest; contact in ")
    assert "no overlap: no coal; one run" in ratio.reason
    slow = judged(scenario, ours=replace(sound, time_frame=sound.time_frame * 10), theirs=sound)
    assert slow["reference", "ratio.time", "mujoco recommended"].verdict == "fail"


def test_a_limit_of_a_metric_that_throws_is_an_error(resting, judged, monkeypatch):
    """A metric that fails is an error with its reason, never a pass."""
    scenario, sound = resting
    broken = replace(metrics.METRICS["overlap.max"], measure=lambda context: 1 / 0)
    monkeypatch.setitem(metrics.METRICS, "overlap.max", broken)
    found = judged(scenario, ours=sound, theirs=sound)
    assert found["mujoco", "overlap.max", ""].verdict == "error"
    assert found["reference", "ratio.time", "mujoco recommended"].verdict != "pass"


@pytest.fixture
def pressed(lab, recordings):
    """A driven box of 1 kg that meets the ground at 1 m/s and is stopped in a frame, pushed by its drive with
    3 N: scenario and recording."""
    box = lab.block("box", (0.05, 0.05, 0.05), (0.0, 0.0, 0.0), kind="driven")
    tracker = lab.still("box", (0.0, 0.0, 0.05))
    scenario = lab.scene(lab.ground(), box, mu=0.5, trackers=(tracker,), duration=0.5)
    frames = scenario.frame_count
    velocity = np.zeros((frames + 1, 2, 3))
    velocity[:10, 1, 2] = -1.0
    drive = np.zeros((frames + 1, 1, 3))
    drive[:, 0, 2] = -3.0 / 60 * np.arange(frames + 1)
    impulse = np.full(frames, 3.0 / 60)
    impulse[9] += 1.0
    rows = [
        {"time": k / 60, "body_b": 1, "normal": (0.0, 0.0, 1.0), "impulse": (0.0, 0.0, impulse[k])}
        for k in range(frames)
    ]
    columns = {"linear_velocity": velocity, "driver_impulse": drive}
    return scenario, recordings.recording(scenario, contacts=recordings.contacts(*rows), **columns)


def test_impulses_of_a_driven_body_are_audited(pressed, judged):
    """What the ground gives a driven body is the change of its momentum less what its drive gave."""
    scenario, sound = pressed
    found = judged(scenario, ours=sound, theirs=sound)
    audit = found["mujoco", "contact.impulse_balance.driven", "box"]
    assert (audit.verdict, audit.value) == ("pass", pytest.approx(0.0, abs=1e-12))
    assert found["mujoco", "friction.cone", ""].basis == ""
    short = sound.contacts.copy()
    short["impulse"] *= 0.8
    found = judged(scenario, ours=sound, theirs=replace(sound, contacts=short))
    audit = found["mujoco", "contact.impulse_balance.driven", "box"]
    assert (audit.verdict, audit.value) == ("fail", pytest.approx(0.2, rel=1e-9))
    assert found["mujoco", "friction.cone", ""].verdict == "skipped"


def test_rows_on_unaudited_impulses_are_marked(pressed, judged):
    """Where an engine poses its driven bodies nothing balances their impulses: rows on them say so."""
    scenario, sound = pressed
    posed = replace(sound, driver_impulse=np.full_like(sound.driver_impulse, np.nan))
    found = judged(scenario, ours=sound, theirs=posed)
    assert found["mujoco", "contact.impulse_balance.driven", ""].verdict == "skipped"
    row = found["mujoco", "friction.cone", ""]
    assert row.basis == "unaudited"
    assert "rests on impulses that nothing balances: ground-box" in row.reason
    for metric, subject in (("energy.drive", "box"), ("force.contact.mean", "ground-box")):
        assert found["mujoco", metric, subject].basis == "unaudited"
    assert found["reference", "friction.cone", ""].basis == ""


def test_figures_beyond_floating_point_warn_nobody(resting, judged):
    """Products that overflow are infinite or NaN in their rows; NumPy prints nothing."""
    scenario, sound = resting
    inertia = tuple(tuple(1e300 * value for value in row) for row in scenario.bodies[1].inertia)
    ball = replace(scenario.bodies[1], mass=1e300 * scenario.bodies[1].mass, inertia=inertia)
    heavy = replace(scenario, bodies=(scenario.bodies[0], ball))
    fast = replace(sound, linear_velocity=sound.linear_velocity + 1e20 * np.arange(31)[:, None, None])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = judged(heavy, ours=fast, theirs=sound)
    assert [row.reason for row in found.values() if row.verdict == "error"] == []


def test_a_manifest_is_read_by_no_row(resting, judged, monkeypatch):
    """A manifest of many bodies takes milliseconds to parse: no row parses it."""
    scenario, sound = resting
    parsed = []
    facts = Recording.facts
    monkeypatch.setattr(Recording, "facts", property(lambda self: parsed.append(1) or facts.fget(self)))
    rows = len(judged(scenario, ours=sound, theirs=sound))
    assert rows > 100
    assert len(parsed) < 40
