"""The study of inverse kinematics: complete and repeatable rows, goals that are what they say."""

from math import isnan
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from touchstone.reports.progress import quietly
from touchstone.reports.results import table
from touchstone.reports.studies.inverse_kinematics import (
    CCD,
    NEAR,
    SOLVERS,
    STARTS,
    Arm,
    draw,
    report,
    rows,
    run,
)

GOALS = 40
MEASURES = [("ik.missed", ""), ("ik.left", "max"), ("time.solve", "")]
MEASURES += [("ik.passes", part) for part in ("median", "p95", "max")]


@pytest.fixture(scope="module")
def measured():
    """Two runs on a few goals."""
    return [table(rows(GOALS, 3, quietly)) for _ in range(2)]


def test_rows_are_complete(measured) -> None:
    """Hold every measure of every solver from both starts, intervals round times, and what a call costs."""
    frame = measured[0]
    for start in STARTS:
        for engine, profile in SOLVERS:
            part = frame[(frame.scenario == start) & (frame.engine == engine) & (frame.profile == profile)]
            wanted = MEASURES + ([("ratio.time", "pinocchio")] if engine == "reference" else [])
            assert sorted(zip(part.metric, part.subject)) == sorted(wanted)
    crossings = frame[frame.metric == "time.crossing"]
    assert sorted(crossings.engine) == ["pinocchio", "reference"]
    times = frame[frame.metric.str.startswith(("time.", "ratio."))]
    assert ((times.low <= times.value) & (times.value <= times.high)).all()
    assert set(frame.seed) == {3}


def test_rows_repeat_by_seed(measured) -> None:
    """Give the same rows twice, but for the times."""
    one, two = (
        frame[~frame.metric.str.startswith(("time.", "ratio."))].drop(columns="dt") for frame in measured
    )
    assert one.to_csv() == two.to_csv()


def test_limits_are_judged(measured) -> None:
    """Judge misses of the reference from near starts, and what it costs beside the loop."""
    frame = measured[0]
    judged = frame[frame.verdict != ""]
    found = set(zip(judged.metric, judged.profile, judged.scenario))
    # a ratio whose interval has the limit within has no verdict
    assert found - {("ratio.time", CCD, start) for start in STARTS} == {("ik.missed", CCD, "arm, near")}
    missed = judged[judged.metric == "ik.missed"]
    assert (missed.verdict == "pass").all()
    assert not any(isnan(value) for value in judged.limit)


def test_goals_and_starts_are_what_they_say() -> None:
    """Draw postures within limits and cones, and near starts within a tenth of a radian, the same again."""
    arm = Arm()
    postures, near = draw(arm, GOALS, 7)
    assert all(arm.allows(angles) for angles in (*postures, *near))
    assert 0.05 < np.abs(near - postures).max() <= NEAR
    np.testing.assert_array_equal(draw(arm, GOALS, 7), (postures, near))
    assert not arm.allows(arm.joints["upper"] + 1e-6)


def test_files_and_table_are_complete(shown, tmp_path: Path) -> None:
    """Store the rows and a manifest, and show each start with each solver."""
    frame = run(5, 1, tmp_path / "ik", quietly)
    assert {path.name for path in (tmp_path / "ik").iterdir()} == {
        *("results.parquet", "results.csv", "manifest.json")
    }
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "ik" / "results.parquet"), frame)
    lines = [line.strip() for line in shown(report(frame)).splitlines()]
    for start in STARTS:
        for engine, profile in SOLVERS:
            (line,) = (line for line in lines if line.startswith(start) and f"{engine} {profile}" in line)
            mine = frame[(frame.scenario == start) & (frame.engine == engine) & (frame.profile == profile)]
            longest = mine[(mine.metric == "ik.passes") & (mine.subject == "max")].value.item()
            assert f" {longest:.0f} " in line
    assert "…" not in "".join(lines)
