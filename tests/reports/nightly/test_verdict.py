"""Verdicts of nights: physics against the accepted night, times with their cause."""

import json
from math import comb
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from touchstone.reports.nightly import verdict
from touchstone.reports.nightly.verdict import (
    CHANGE,
    FEWEST,
    GONE,
    REGRESSION,
    WARNING,
    Finding,
    chance,
    histories,
    ordered,
    physics,
    step,
    timing,
    warns,
)

NIGHTS, SERIES = 60, 400
JUDGED = FEWEST + 3
"""Nights of a history before which nothing is judged."""


def lognormal(generator, count):
    """Times over their truth: lognormal by 5 %, with spikes of 10 to 100 % in 8 % of the nights."""
    spikes = np.where(generator.random(count) < 0.08, 1 + generator.uniform(0.1, 1.0, count), 1.0)
    return np.exp(generator.normal(0, 0.05, count)) * spikes


@pytest.fixture(params=["gamma", "lognormal"])
def noise(request, nights):
    """Noise of nights: right-tailed, with spikes."""
    return {"gamma": nights.noise, "lognormal": lognormal}[request.param]


def test_false_alarms_are_rare_and_steps_are_found(noise):
    """Without a step at most 1 % of the judged series and nights are confirmed; a step of 15 % is confirmed
    within three nights in at least three of four histories."""
    generator = np.random.default_rng(11)
    alarms = seen = found = 0
    for _ in range(SERIES):
        history = noise(generator, NIGHTS)
        for end in range(JUDGED, NIGHTS + 1):
            alarms += step(history[:end]) is not None
            seen += 1
        history = noise(generator, NIGHTS)
        history[40:] *= 1.15
        found += any(step(history[:end]) for end in (41, 42, 43))
    assert alarms <= 0.01 * seen
    assert found >= 0.75 * SERIES


def test_the_test_is_exact():
    """The smallest p-value is one over the number of choices of nights; equal nights have 1."""
    generator = np.random.default_rng(5)
    before = generator.normal(1.0, 0.01, 20)
    assert chance(before, np.full(3, 1.3)) == pytest.approx(1 / comb(23, 3))
    assert chance(before, before[:3]) > 0.05
    assert chance(np.ones(20), np.ones(3)) == 1


def test_steps_are_dated(nights):
    """The first night of a confirmed step is its night."""
    generator = np.random.default_rng(2)
    firsts = []
    for _ in range(100):
        history = nights.noise(generator, NIGHTS)
        history[40:] *= 1.15
        later = step(history[:46])
        if later:
            firsts.append(later.first)
    assert abs(np.median(firsts) - 40) <= 1


@pytest.mark.parametrize(
    ("quiet", "tail", "warned", "found"),
    [
        (20, [1.2] * 3, True, (21, pytest.approx(1.2))),  # past a night without a value
        (20, [1.2, 0.99, 1.2], True, None),
        (20, [1.0, 1.5, 1.0], False, None),
        (20, [1.04] * 3, False, None),
        (20, [0.5] * 3, False, None),
        (5, [2.0] * 3, False, None),
    ],
)
def test_steps_of_quiet_series(quiet, tail, warned, found):
    """A step is found to the night and the ratio; two slow nights of three warn only; a spike, less than 5 %,
    a step downwards, and a short history are quiet."""
    values = np.insert(np.r_[np.full(quiet, 1.0), tail], 5, np.nan)
    later = step(values)
    assert (later and (later.first, later.ratio)) == found
    assert warns(values) == warned


EVIL = "<script>alert(1)</script>"


@pytest.mark.parametrize(
    ("before", "after", "kind", "text"),
    [
        ({}, {}, None, ""),
        ({}, {"overlap": 1e-3 * (1 + 1e-6)}, None, ""),
        ({}, {"overlap": 1.05e-3}, CHANGE, "1.00 -> 1.05 mm"),
        ({}, {"overlap": 0.95e-3}, CHANGE, "1.00 -> 0.950 mm"),
        ({}, {"overlap": 3e-3, "verdict": "fail"}, REGRESSION, "1.00 -> 3.00 mm: pass -> fail"),
        ({"verdict": "known"}, {"overlap": 1.05e-3, "verdict": "known"}, REGRESSION, "a known failing grew"),
        ({"verdict": "known"}, {"overlap": 0.9e-3, "verdict": "known"}, CHANGE, "1.00 -> 0.900 mm"),
        ({"verdict": "known"}, {"verdict": "pass"}, GONE, "a known failing is gone"),
        ({"verdict": "fail"}, {"verdict": "pass"}, GONE, "fail -> pass"),
        ({}, {"overlap": float("nan"), "verdict": "unjudged"}, REGRESSION, "pass -> unjudged"),
    ],
)
def test_a_change_of_physics_is_always_told(nights, before, after, kind, text):
    """A figure that moved by 5 % is a finding, each time; times are none, nor is rounding."""
    found = physics(nights.frame(time=5.0, **after), nights.frame(**before))
    assert [one.kind for one in found] == ([kind] if kind else [])
    assert all(text in one.line for one in found)


def test_what_is_no_longer_measured_is_a_regression(nights):
    """An engine that is missing tonight is never green."""
    tonight = nights.frame()
    tonight["engine"] = "bullet"
    found = physics(tonight, nights.frame())
    assert [(one.kind, one.text) for one in found] == [(REGRESSION, "no longer measured")]


def test_a_step_names_its_night_and_its_cause(store, nights):
    """An update that slows an engine: the first bad night, the ratio, and the version that changed."""
    for number in range(24):
        slow = number >= 20
        store.add(
            nights.frame(1.2e-4 if slow else 1e-4),
            nights.facts(number, versions={"mujoco": "4.1.0" if slow else "4.0.0"}),
        )
    found = store.nights()
    by_number = {night.sequence: night for night in found}
    history = histories(store, found, "one")
    (finding,) = timing(history, by_number)
    assert finding.kind == REGRESSION
    assert finding.text == "1.20 times as long since 2026-01-21: mujoco 4.0.0 -> 4.1.0"
    assert finding.moved == "100 -> 120 µs"
    assert timing(history, by_number, accepted=24) == []
    # another machine has no history
    assert len(histories(store, found, "two")) == 0


def test_findings_are_readable_and_the_worst_is_first(nights):
    """Names and units for readers; the value farthest beyond its limit first, what is not measured last."""
    scenes = {"fall": 2.5e-3, "slip": 9e-3, "stack": 4e-3}
    before = pd.concat([nights.frame(scene=scene) for scene in (*scenes, "slide")], ignore_index=True)
    tonight = pd.concat(
        [nights.frame(scene=scene, overlap=value, verdict="fail") for scene, value in scenes.items()],
        ignore_index=True,
    )
    found = ordered(physics(tonight, before))
    assert [one.scene for one in found] == ["slip", "stack", "fall", "slide"]
    assert found[0].line == (
        "regression: slip mujoco recommended: deepest overlap (overlap.max): 1.00 -> 9.00 mm: pass -> fail"
    )
    shown = verdict.shown_changes(found)
    assert (shown[0].metric, shown[0].moved, shown[-1].text) == (
        "overlap.max",
        "1.00 → 9.00 mm",
        "no longer measured",
    )


@pytest.mark.parametrize("count", [1, 2, 4, 5])
def test_few_nights_are_numbers(store, nights, count):
    """Times of fewer than five nights are a table, of more a chart; of one there is nothing to compare."""
    for number in range(count):
        store.add(nights.frame(1e-4 * (1 + number)), nights.facts(number))
    found = store.nights()
    by_number = {night.sequence: night for night in found}
    history = histories(store, found, "one")
    drawn = verdict.history_charts(history, by_number)
    table = verdict.history_table(history, by_number)
    assert list(drawn) == (["fall, engines"] if count == 5 else [])
    assert len(table.rows) == (1 if 2 <= count <= 4 else 0)
    if count == 2:
        assert table.heads == [
            "scene",
            "engine",
            "2026-01-01 02:00 [µs]",
            "2026-01-02 02:00 [µs]",
            "last over first",
        ]
        assert table.rows[0] == ["fall", "mujoco", "100", "200", "2.00"]


def test_outputs_say_the_same(nights, tmp_path, monkeypatch):
    """Sentence, Markdown, JUnit XML and badge; HTML in names is text; a job's summary is appended to."""
    frame = pd.concat([nights.frame(), nights.frame(verdict="fail", scene="slip")], ignore_index=True)
    findings = [
        Finding(REGRESSION, "slip", "mujoco", "recommended", "overlap.max", EVIL, EVIL),
        Finding(WARNING, "a", "mujoco", "b", "time.frame.median", "", "slow"),
    ]
    level, sentence = verdict.sentence(frame, findings, frame)
    assert (level, sentence.startswith("1 confirmed regression (mujoco). 1 limit broken")) == ("bad", True)
    summary = tmp_path / "summary.md"
    summary.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    text = verdict.markdown(sentence, findings, ["set aside x"])
    verdict.write_markdown(tmp_path, text)
    assert "<script" not in text
    assert "- set aside x" in text
    assert summary.read_text() == f"before\n{text}"
    verdict.write_junit(tmp_path, frame, findings)
    root = ElementTree.parse(tmp_path / "junit.xml").getroot()
    suites = {suite.get("name"): suite for suite in root}
    failures = {name: suite.get("failures") for name, suite in suites.items()}
    assert failures == {"fall": "0", "slip": "1", "nights": "1"}
    failure = suites["slip"].find("testcase/failure")
    assert failure.text.startswith("touchstone run slip --engine mujoco --profile recommended")
    assert suites["nights"].find("testcase/failure").get("message").endswith(EVIL)
    verdict.write_badge(tmp_path, level)
    assert json.loads((tmp_path / "badge.json").read_text())["message"] == "regression"


@pytest.mark.parametrize("compared", [True, False])
def test_a_good_night_is_said_so(nights, compared):
    """Without a finding the level is that of the limits; a first night says that it compares with nothing, a
    later one how many figures had no verdict before."""
    frame = nights.frame()
    level, sentence = verdict.sentence(frame, [], frame if compared else None)
    assert level == "good"
    assert sentence.startswith("No regression." if compared else "First night of these settings")
    assert "for the first time" not in sentence
    more = pd.concat([frame, nights.frame(scene="slip")], ignore_index=True)
    judged = int((more.verdict != "").sum() - (frame.verdict != "").sum())
    assert f"{judged} figure" in verdict.sentence(more, [], frame)[1]
    assert "changed" not in verdict.markdown(sentence, [], [])


def test_long_lists_are_counted():
    """Of many findings of a kind the first are listed, the rest is counted."""
    lines = verdict.listed(
        [Finding(CHANGE, f"p{k}", "mujoco", "p", "overlap.max", "", "x") for k in range(50)]
    )
    assert len(lines) == verdict.MOST_LINES + 1
    assert lines[-1] == f"change: {50 - verdict.MOST_LINES} more"
    assert np.all([line.startswith("change: p") for line in lines[:-1]])
