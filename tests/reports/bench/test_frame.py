"""`bench frame` on frames of known length: exact ratios, verdicts as in a run, every repetition kept."""

from __future__ import annotations

from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest

from touchstone.reports.bench import frame
from touchstone.reports.results import Row, table
from touchstone.reports.run.comparisons import ratio_limits
from touchstone.reports.run.request import Results
from touchstone.scenarios.catalogue import catalogue


def silence(label: str, count: int) -> None:
    """No progress."""


def recordings(result_times: dict[tuple[str, str], float], registry) -> Results:
    """What a run gives: frames of known length per column, with the run's own ratio rows."""
    base = registry.played("ball_snip", "reference")
    kept, rows = {}, []
    for (engine, profile), seconds in result_times.items():
        kept["ball_snip", engine, profile] = replace(base, time_frame=np.full(180, seconds))
        row = Row("run", "ball_snip", engine, profile, 1 / 240, "overlap.max", unit="m")
        rows.append(replace(row, value=0.0 if engine == "reference" else 1e-3))
    ratio = Row(
        "run", "ball_snip", "reference", "balanced", 1 / 60, "ratio.time", 9.0, "1", "bullet recommended"
    )
    rows.append(replace(ratio, limit=0.5, verdict="fail", reason="against the fastest; overlap no larger"))
    missing = Row(
        "run", "ball_snip", "mujoco", "recommended", nan, "run", verdict="skipped", reason="not installed"
    )
    return Results(table([*rows, missing]), kept)


TIMES = {
    ("reference", "balanced"): 1e-5,
    ("dart", "recommended"): 4e-5,
    ("dart", "equal-step"): 2e-5,
    ("bullet", "recommended"): 1e-4,
    ("bullet", "equal-step"): 5e-5,
}


def test_frames_are_compared_in_their_class(registry) -> None:
    """Give every engine over every other at the same kind of step, the reference in both; exactly."""
    rows = frame.rows_of_bench([recordings(TIMES, registry)] * 2)
    ratios = {(r.engine, r.profile, r.subject): r for r in rows if r.metric == "ratio.time"}
    assert len(ratios) == 2 * 6
    for (engine, profile, subject), row in ratios.items():
        other = tuple(subject.split())
        assert row.value == pytest.approx(TIMES[engine, profile] / TIMES[other], rel=1e-12)
        assert "reference" in (engine, other[0]) or profile == other[1]
    frames = {(r.engine, r.profile): r for r in rows if r.metric == "time.frame"}
    assert {column: row.value for column, row in frames.items()} == TIMES


def test_frames_are_judged_as_the_run_judges(registry) -> None:
    """Judge the ratio that a run judges by the time of all repetitions: 0.1 passes where 9 failed."""
    rows = frame.rows_of_bench([recordings(TIMES, registry)] * 2)
    judged = [row for row in rows if row.metric == "ratio.time" and row.verdict]
    assert [(r.engine, r.subject, r.verdict, r.limit) for r in judged] == [
        ("reference", "bullet recommended", "pass", 0.5)
    ]
    slow = {**TIMES, ("reference", "balanced"): 9e-5}
    judged = [
        r for r in frame.rows_of_bench([recordings(slow, registry)]) if r.metric == "ratio.time" and r.verdict
    ]
    assert [row.verdict for row in judged] == ["fail"]


def test_repetitions_are_pooled(registry) -> None:
    """Take the median over all repetitions: of 1, 2 and 9 ms it is 2."""
    results = [recordings({("reference", "balanced"): t}, registry) for t in (1e-3, 2e-3, 9e-3)]
    row = next(row for row in frame.rows_of_bench(results) if row.metric == "time.frame")
    assert row.value == 2e-3
    assert 1e-3 <= row.low <= row.high <= 9e-3


def test_a_short_engine_is_compared_as_far_as_it_goes(registry) -> None:
    """Take the ratio over the frames that both played in each repetition, and tell how many they were."""
    result = recordings({("reference", "balanced"): 1.0, ("bullet", "recommended"): 4.0}, registry)
    ours, theirs = (
        ("ball_snip", *column) for column in (("reference", "balanced"), ("bullet", "recommended"))
    )
    late = np.where(np.arange(180) < 40, 1e-3, 1.0)
    result.recordings[ours] = replace(result.recordings[ours], time_frame=late)
    result.recordings[theirs] = replace(result.recordings[theirs], time_frame=np.full(40, 4e-3))
    rows = frame.rows_of_bench([result] * 2)
    ratios = {r.engine: r for r in rows if r.metric == "ratio.time"}
    assert ratios["reference"].value == pytest.approx(0.25, rel=1e-12)
    assert (ratios["reference"].verdict, ratios["reference"].limit) == ("pass", 0.5)
    told = {r.engine: r.reason for r in rows if r.metric == "time.frame"}
    assert told == {"reference": "", "bullet": "its first 40 of 180 frames"}


def held(recordings, lab, count: int, *tags: str) -> dict[str, float]:
    """Limits for a scene in which so many contacts hold in six frames of ten, none in the others."""
    scene = replace(lab.scene(lab.ball(), lab.ground(), duration=1 / 6), tags=tags)
    times = [(k + 0.5) / 60 for k in range(6) for _ in range(count)]
    return ratio_limits(
        scene, recordings.recording(scene, contacts=recordings.contacts(*({"time": t} for t in times)))
    )


def test_limits_follow_the_contacts_that_hold(recordings, lab) -> None:
    """Ask half the fastest engine's time where more than ten contacts hold, and no more at equal steps."""
    many = {"recommended": 0.5, "equal-step": 1.0}
    assert held(recordings, lab, 10, "probe") == {"recommended": 1.0}
    assert held(recordings, lab, 11, "probe") == held(recordings, lab, 11, "heap") == many
    assert held(recordings, lab, 10, "gallery") == {"recommended": 0.5}


def test_frames_are_shown_with_their_overlap(registry, shown) -> None:
    """Show two tables, what is missing, and which ratio comes with deeper overlap."""
    text = shown(frame, table(frame.rows_of_bench([recordings(TIMES, registry)])))
    assert "ball_snip, recommended" in text
    assert "ball_snip, equal-step" in text
    assert "overlap [mm]" in text
    assert "0.250 ±0 %" in text  # the reference over dart
    assert "4.00 ±0 % °" in text  # dart over the reference
    judged = text[text.index("the reference over the fastest engine") :]
    assert "ball_snip" in judged
    assert "bullet recommended" in judged
    assert "0.100 to 0.100" in judged
    assert "pass 0.5" in judged
    assert "skipped: mujoco: not installed" in text
    assert "…" not in text


def test_frame_writes_every_repetition(monkeypatch, tmp_path: Path, registry) -> None:
    """Play all columns of the scenes as often as asked, each into a folder of its own."""
    asked = []

    def play(request, progress):
        request.out.mkdir()
        asked.append((request.out.name, [s.name for s in request.scenarios], request.columns))
        return recordings(TIMES, registry)

    monkeypatch.setattr(frame, "play", play)
    frame.run(tmp_path / "out", silence, [catalogue()["ball_snip"]], repeats=2)
    assert [(name, scenes) for name, scenes, _ in asked] == [
        ("repeat-1", ["ball_snip"]),
        ("repeat-2", ["ball_snip"]),
    ]
    assert ("reference", "balanced") in asked[0][2]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("repeat-1", "repeat-2", "results.parquet", "results.csv", "manifest.json")
    }


def test_frame_plays_all_tagged_scenes() -> None:
    """Count frames of every scene of the gallery in every column and repetition."""
    names = [scenario.name for scenario in frame.scenes()]
    assert {"ball_snip", "balls_box", "stack"} <= set(names)
    assert len(names) == len(set(names))
    scene = catalogue()["ball_snip"]
    assert frame.steps([scene], repeats=3) == 3 * len(frame.columns()) * scene.frame_count
