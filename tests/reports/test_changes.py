"""What `touchstone compare` calls worse, better, changed, new and gone."""

from dataclasses import replace
from math import inf, nan

import pandas as pd
import pytest

from touchstone.reports.changes import (
    FIGURES,
    KINDS,
    MARGIN,
    RunError,
    changes,
    default,
    differences,
    label_of,
    report,
    table_of,
    tolerance_of,
    tolerances,
    toml_of,
)
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import Row, save, table
from touchstone.scenarios.files.read import SceneFileError


def row(metric: str = "overlap.max", value: float = 1.0, verdict: str = "", **fields) -> Row:
    return Row("run", "fall", "mujoco", "recommended", 1 / 540, metric, value, verdict=verdict, **fields)


def kinds(a: list[Row], b: list[Row]) -> list[str]:
    return changes(table(a), table(b), default()).kind.tolist()


@pytest.mark.parametrize(
    ("a", "b", "kind"),
    [
        (row(), row(), None),
        (row(), row(value=1.0 + 1e-8), None),
        (row(), row(value=1.1), "worse"),
        (row(), row(value=0.9), "better"),
        # within its limit nothing is worse
        (row(verdict="pass"), row(value=1.1, verdict="pass"), "changed"),
        (row(verdict="pass"), row(verdict="fail"), "worse"),
        (row(verdict="fail"), row(verdict="pass"), "better"),
        (row(verdict="known"), row(value=2.0, verdict="known"), "worse"),
        (row(verdict="pass"), row(verdict="unjudged"), "worse"),
        (row(), row(value=nan, verdict="skipped", reason="no contact"), "worse"),
        (row(value=nan, verdict="skipped"), row(value=nan, verdict="skipped"), None),
        # no better side
        (row("restitution.achieved"), row("restitution.achieved", 1.1), "changed"),
        # intervals that overlap; the windows of events are none
        (row(low=0.5, high=1.2), row(value=1.3, low=1.1, high=1.5), None),
        (row(low=0.5, high=1.05), row(value=1.3, low=1.1, high=1.5), "worse"),
        (row("events.touch", low=0.0, high=9.0), row("events.touch", 2.0, low=0.0, high=9.0), "changed"),
        # times of one program differ between runs (`times.toml`)
        (row("time.frame.median", 1e-3), row("time.frame.median", 1.9e-3), None),
        (row("time.frame.median", 1e-3), row("time.frame.median", 9e-3), "worse"),
        (row("time.frame.median", 9e-3), row("time.frame.median", 1e-3), "better"),
        (row("time.frame.max", 1e-3), row("time.frame.max", 9e-3), None),
    ],
)
def test_a_row_changes(a, b, kind):
    """One kind per row, by verdict, limit, interval, tolerance and direction."""
    assert kinds([a], [b]) == ([kind] if kind else [])


@pytest.mark.parametrize(
    ("a", "b", "kind"),
    [
        *((0.0, -0.5, "worse"), (-0.4, -0.5, "worse"), (0.4, 0.5, "worse"), (-0.4, 0.5, "worse")),
        *((-0.5, 0.0, "better"), (0.5, -0.4, "better"), (0.5, -0.5, "changed")),
    ],
)
def test_a_figure_is_worse_farther_from_its_truth(a, b, kind):
    """Every metric with a better side is worse where it moves away from 0, whatever its sign."""
    one, two = (table([row(metric, value) for metric in METRICS]) for value in (a, b))
    found = changes(one, two, (FIGURES,)).set_index("metric").kind
    sided = {name: METRICS[name].better == "lower" for name in METRICS}
    assert found.to_dict() == {name: kind if sided[name] else "changed" for name in METRICS}


def test_rows_of_one_run_only():
    """A row that is new fails only if it fails; another engine's run is one row."""
    other = [row(), row("overlap.p95")]
    assert kinds([row()], other) == ["new"]
    assert kinds(other, [row()]) == ["gone"]
    assert kinds([row()], [row(), row("work", verdict="fail")]) == ["worse"]
    dart = Row("run", "fall", "dart", "recommended", 1 / 1000, "overlap.max", 1.0)
    assert kinds([row()], [row(), dart]) == ["new"]
    assert kinds([row()], [row(), replace(dart, verdict="fail")]) == ["worse", "new"]
    # a run that failed has a row that says so, for all of its figures
    assert kinds([row(), row("overlap.p95")], [row("run", nan, "error")]) == ["worse"]
    died = row("run", nan, "error")
    assert kinds([died], [row()]) == ["better", "new"]


@pytest.mark.parametrize("verdict", ["missing", "unimportable"])
def test_an_engine_that_did_not_play_is_gone(verdict):
    """An engine that is missing later is gone, with the reason; one that was missing before is new."""
    absent = Row("run", "fall", "mujoco", "recommended", nan, "run", verdict=verdict, reason="pip install it")
    found = changes(table([row()]), table([absent]), default())
    assert found[["kind", "reason"]].values.tolist() == [["gone", f"{verdict}: pip install it"]]
    assert kinds([absent], [row()]) == ["new"]
    assert kinds([absent], [absent]) == []


def test_columns_of_other_settings_match_on_request():
    """Another step or setting is another column, unless columns match by profile; two of one match none."""
    ratio = replace(
        row("ratio.time.frames"), engine="reference", profile="balanced", subject="mujoco recommended"
    )
    a = [row(), ratio]
    other = replace(row(value=1.1), dt=1 / 240, profile="recommended, cone=pyramidal")
    b = [other, replace(ratio, subject="mujoco recommended, cone=pyramidal")]
    found = changes(table(a), table(b), default())
    assert sorted(found.kind) == ["gone", "gone", "new", "new"]
    said = "the later run has recommended, cone=pyramidal at 1/240 s (--match profile compares them)"
    assert said in found.reason.tolist()
    assert changes(table(a), table(b), default(), by_profile=True).kind.tolist() == ["worse"]
    with pytest.raises(RunError, match="several columns of fall on mujoco recommended"):
        changes(table(a), table([*a, other]), default(), by_profile=True)


def test_columns_of_another_profile_are_told():
    """Where the later run has the engine in another profile, what is gone says how to compare the two."""
    other = replace(row(), profile="default")
    found = changes(table([row()]), table([other]), default())
    assert found.kind.tolist() == ["gone", "new"]
    assert found.reason[0] == "the later run has default at 1/540 s (one run of both compares them)"


def test_a_report_has_the_units_of_a_run():
    """Values and their difference are in the unit in which a run prints the metric."""
    frame = changes(
        table([row(value=0.008)]), table([row(value=0.019), row("run", verdict="fail")]), default()
    )
    parts = report(frame)
    assert parts[0].heads[3:] == ("A", "B", "unit", "remark")
    assert parts[0].rows[0][3:] == ["8", "19", "mm", "by 11.0 mm"]
    assert [line[5] for part in parts for line in part.rows if "run" in line[2]] == [""]


def test_a_file_of_tolerances(tmp_path):
    """The last pattern that fits holds; faults are named with their line."""
    path = tmp_path / "t.toml"
    path.write_text('[[tolerances]]\nmetric = "overlap.*"\nrelative = 0.2\nengine = "mujoco"\n')
    allowed = tolerances(path)
    assert changes(table([row()]), table([row(value=1.1)]), allowed).empty
    assert not changes(table([row()]), table([row(value=1.3)]), allowed).empty
    for text, line in (
        ('[[tolerances]]\nmetric = "a"\nrelative = -1\n', "t.toml:3: tolerances[0].relative: found -1"),
        ('[[tolerances]]\nmetric = "a"\nabsolut = 1\n', "t.toml:3: tolerances[0].absolut: unknown field"),
    ):
        path.write_text(text)
        with pytest.raises(SceneFileError) as error:
            tolerances(path)
        assert line in str(error.value)


def test_order_and_tables(tmp_path):
    """The worst comes first; tables read from parquet or CSV are equal; other folders are refused."""
    a = [row(f"overlap.{k}") for k in ("max", "p95", "time")]
    b = [row("overlap.max", 0.5), row("overlap.p95", 2.0), row("work")]
    found = changes(table(a), table(b), default()).kind.tolist()
    assert found == sorted(found, key=KINDS.index)
    assert found == ["worse", "gone", "better", "new"]
    save(table(a), tmp_path)
    parquet = table_of(tmp_path)
    (tmp_path / "results.parquet").unlink()
    pd.testing.assert_frame_equal(parquet, table_of(tmp_path), check_dtype=False)
    (tmp_path / "results.parquet").write_bytes(b"none")
    with pytest.raises(RunError, match=r"results.parquet: cannot be read"):
        table_of(tmp_path)
    (tmp_path / "results.parquet").unlink()
    (tmp_path / "results.csv").write_text("a,b\n1,2\n")
    with pytest.raises(RunError, match=r"results.csv: no columns study"):
        table_of(tmp_path)
    with pytest.raises(RunError, match="no such folder"):
        table_of(tmp_path / "none")


def test_a_recordings_label(registry, tmp_path):
    """Scene, engine and what was changed follow from the file's name and the manifest."""
    recording = registry.played("ball_snip", "reference")
    for label in ("balanced", "balanced, effects=contact+friction", "balanced, tracker=noisy"):
        path = tmp_path / f"ball_snip-reference-{label.replace(', ', '+')}.npz"
        assert label_of(path, recording) == ("ball_snip", "reference", label)


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


def test_the_command(touchstone, refused, tmp_path):
    """Prints a row per time and writes the file; wrong runs are one line each."""
    for name, time in (("a", 10e-6), ("b", 8e-6)):
        (tmp_path / name).mkdir()
        save(run(time), tmp_path / name)
    code, out, _ = touchstone("tolerances a b --out mine.toml")
    assert code == 0
    assert "time.frame.median  1     20 %    20 %     25 %" in out
    assert touchstone("compare a b --tolerance mine.toml")[0] == 0
    for arguments, line in (
        ("a", "a: name two runs or more"),
        ("a a", "a: name two runs or more"),
        ("a none", "none: no such folder"),
        ("a b --out mine.toml", "--out mine.toml: exists"),
        ("a b --out no/where.toml", "--out no/where.toml: No such file or directory"),
    ):
        assert line in refused(f"tolerances {arguments}")
