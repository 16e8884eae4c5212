"""Tolerances of times from runs of one program."""

from __future__ import annotations

from math import inf, nan

import pytest

from touchstone.reports.changes import (
    MARGIN,
    RunError,
    default,
    differences,
    tolerance_of,
    tolerances,
    toml_of,
)
from touchstone.reports.results import Row, save, table


def run(*times: float, overlap: float = 1e-3):
    """Table of a run with the times of some scenes."""
    rows = [
        Row("run", f"scene_{k}", "mujoco", "recommended", 1 / 540, "time.frame.median", value, "s")
        for k, value in enumerate(times)
    ]
    base = ("run", "scene_0", "mujoco", "recommended", 1 / 540)
    return table([*rows, Row(*base, "time.frame.max", times[0], "s"), Row(*base, "overlap.max", overlap)])


def test_the_largest_difference_of_any_pair_counts():
    """Of 10, 8 and 9 us the largest difference is 20 % of the larger; other scenes differ by less."""
    found = differences({"a": run(10e-6, 1.0), "b": run(8e-6, 1.0), "c": run(9e-6, 1.01)})
    median = found.set_index("metric").loc["time.frame.median"]
    assert median.rows == 2
    assert median.largest == pytest.approx(0.2)
    assert median["median"] == pytest.approx((0.01 / 1.01 + 0.1) / 2, rel=1e-6)
    assert median.tolerance == pytest.approx(0.25)


def test_a_time_that_varies_beyond_measure_is_not_judged():
    """Nothing is judged where MARGIN times the difference covers all; times that a run lacks do not count."""
    found = differences({"a": run(1.0, 5.0), "b": run(1 - 1 / MARGIN, nan)}).set_index("metric")
    assert found.loc["time.frame.median", "rows"] == 1
    assert found.loc["time.frame.median", "tolerance"] == inf


def test_runs_of_two_programs_are_refused():
    """A figure that no clock measures differs: its place is named."""
    with pytest.raises(RunError, match=r"a b: overlap\.max of scene_0 on mujoco recommended differs"):
        differences({"a": run(1.0), "b": run(1.0, overlap=1.1e-3)})
    with pytest.raises(RunError, match="no time in common"):
        differences({"a": run(1.0).iloc[2:], "b": run(1.0).iloc[2:]})


def test_the_file_is_read_by_compare(tmp_path):
    """What the command writes has the tolerances; times that were not measured have the largest one."""
    found = differences({"a": run(10e-6, 1.0), "b": run(8e-6, 1.0)})
    path = tmp_path / "mine.toml"
    path.write_text(toml_of(found, ["a", "b"]), "utf-8")
    allowed = tolerances(path)
    for metric in ("time.frame.median", "time.plan"):
        assert tolerance_of(allowed, metric, "dart", "slip").relative == pytest.approx(0.25)
    assert tolerance_of(allowed, "overlap.max", "dart", "slip").relative == 1e-6


def test_the_default_has_every_time_of_a_run():
    """The tolerances of this project are measured: each time of a run has its own, others the largest."""
    names = {one.metric for one in default()}
    assert {"time.*", "ratio.time*", "time.frame.median", "time.read", "ratio.time"} <= names
    assert tolerance_of(default(), "time.frame.median", "mujoco", "slip").relative < 1


def test_the_command(touchstone, tmp_path):
    """Prints a row per time and writes the file; wrong runs are one line each."""
    for name, time in (("a", 10e-6), ("b", 8e-6)):
        (tmp_path / name).mkdir()
        save(run(time), tmp_path / name)
    code, out, _ = touchstone("tolerances", "a", "b", "--out", "mine.toml")
    assert code == 0
    assert "time.frame.median  1     20 %    20 %     25 %" in out
    assert touchstone("compare", "a", "b", "--tolerance", "mine.toml")[0] == 0
    for arguments, line in (
        (("a",), "a: name two runs or more"),
        (("a", "a"), "a: name two runs or more"),
        (("a", "none"), "none: no such folder"),
        (("a", "b", "--out", "mine.toml"), "--out mine.toml: exists"),
        (("a", "b", "--out", "no/where.toml"), "--out no/where.toml: No such file or directory"),
    ):
        code, out, err = touchstone("tolerances", *arguments)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert line in err
