"""Known failings are strict, each has a size and a cause, and `touchstone failings measure` writes sizes."""

import re
from dataclasses import replace
from math import inf, nan

import pytest

from touchstone.adapters.registry import ENGINES, OURS
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import Row, save, table
from touchstone.reports.runner.request import DEFAULT_PROFILES
from touchstone.reports.verdict import failings, limits
from touchstone.reports.verdict.failings import Failing, FailingsError, bounded, causes, known, read, write
from touchstone.reports.verdict.judge import judged, lost, measured
from touchstone.reports.verdict.limits import LIMITS, Limit, limit_of
from touchstone.scenarios.catalogue import catalogue

ROW = Row("run", "ball_snip", "mujoco", "recommended", 1 / 540, "overlap.max", 2.0, "m", "a-b")
LINE = Failing(
    engine="mujoco", profile="recommended", scenario="ball_snip", metric="overlap.max", subject="a-b",
    largest=2.5, cause="mujoco.soft",
)  # fmt: skip
SOFT = LINE.reason


def line(**fields: object) -> Failing:
    """LINE with other fields."""
    return LINE.model_copy(update=fields)


@pytest.fixture(autouse=True)
def table_of_failings(monkeypatch):
    """Put one limit, and known failings, in the place of the real ones."""

    def put(*lines):
        monkeypatch.setattr(limits, "LIMITS", (Limit("overlap.max", 1.0, "why"),))
        monkeypatch.setattr(failings, "known", lambda: {one.key: one for one in lines})

    return put


def test_known_failings_are_strict(table_of_failings):
    """A known failing is known while it fails; once its limit is met the row fails and says what to do."""
    table_of_failings(LINE)
    assert (judged(ROW, ()).verdict, judged(ROW, ()).reason) == ("known", SOFT)
    assert judged(replace(ROW, engine="dart"), ()).verdict == "fail"
    assert judged(replace(ROW, subject="a-c"), ()).verdict == "fail"
    mended = judged(replace(ROW, value=0.5), ())
    assert mended.verdict == "fail"
    assert f"a known failing is gone: remove it from failings.csv ({SOFT})" in mended.reason


@pytest.mark.parametrize(
    ("value", "largest", "verdict"),
    [
        *((2.0, 2.5, "known"), (-2.5, 2.5, "known"), (2.6, 2.5, "fail"), (inf, 2.5, "fail")),
        *((2.0, None, "fail"), (nan, 2.5, "fail")),
    ],
)
def test_a_known_failing_may_not_grow(table_of_failings, value, largest, verdict):
    """A failing that grows past its size fails, and so does one whose size nobody measured."""
    table_of_failings(line(largest=largest))
    assert judged(replace(ROW, value=value), ()).verdict == verdict


def test_a_line_for_every_subject_leaves_those_that_meet_the_limit(table_of_failings):
    """It excuses no pair at the profile's own step, and says nothing of those that do not fail."""
    table_of_failings(LINE, line(subject="*", largest=None))
    other = replace(ROW, subject="a-c")
    assert (judged(ROW, ()).verdict, judged(other, ()).verdict) == ("known", "fail")
    assert "run `touchstone failings measure`" in judged(other, ()).reason
    assert judged(replace(other, value=0.5), ()).verdict == "pass"
    assert judged(replace(other, dt=1 / 6000), ()).verdict == "known"


def test_a_chaotic_scene_has_one_size_for_all_pairs(table_of_failings):
    """What meets its limit there is no news."""
    table_of_failings(line(subject="*", largest=20.0, chaotic=True))
    verdicts = [judged(replace(ROW, value=value, subject="b-c"), ()).verdict for value in (0.5, 3.0, 21.0)]
    assert verdicts == ["pass", "known", "fail"]


def test_a_known_failing_may_be_gone_at_another_step(table_of_failings):
    """Strictness holds at the profile's own step alone."""
    table_of_failings(LINE)
    assert judged(replace(ROW, value=0.5), ()).verdict == "fail"
    assert judged(replace(ROW, value=0.5, dt=1 / 6000), ()).verdict == "pass"


def test_a_known_event_that_never_happens(table_of_failings):
    """An expected event that never happens is known where it is listed, and failed elsewhere."""
    place = {"engine": "reference", "profile": "paper", "metric": "events.roll"}
    table_of_failings(line(**place, subject="*", largest=None))
    row = Row("run", "ball_snip", "reference", "paper", 1 / 60, "events.roll", nan, verdict="fail")
    assert judged(row, ()).verdict == "known"
    assert judged(replace(row, profile="balanced"), ()).verdict == "fail"
    assert judged(replace(row, value=0.5, verdict="pass"), ()).verdict == "fail"


def test_a_run_that_diverges_may_be_known(table_of_failings):
    """Excuse a failed run whose scene, engine and profile are documented, and no other; keep what it said."""
    ended = replace(ROW, metric="run", subject="", value=nan, verdict="error", reason="diverged")
    table_of_failings(line(metric="run", subject="*", largest=None))
    assert (judged(ended, ()).verdict, judged(ended, ()).reason) == ("known", f"diverged; {SOFT}")
    for other in ({"engine": "dart"}, {"profile": "default"}, {"scenario": "x"}):
        assert judged(replace(ended, **other), ()).verdict == "error"
    assert judged(replace(ended, verdict="skipped"), ()).verdict == "skipped"


def test_a_known_failing_that_is_no_longer_measured_fails(table_of_failings):
    """Report a row that disappears or is skipped, of its column alone, and neither where it is measured."""
    table_of_failings(LINE)
    base = replace(ROW, metric="run", subject="", value=nan)
    skipped = replace(ROW, subject="", value=nan, verdict="skipped", reason="no contact")
    other = replace(ROW, engine="dart")
    for rows, why in (
        ([], "no such row"),
        ([other], "no such row"),
        ([skipped, other], "skipped, no contact"),
    ):
        (row,) = lost(base, rows)
        assert (row.metric, row.subject, row.verdict) == ("overlap.max", "a-b", "fail")
        assert row.reason == f"a known failing is no longer measured: {why} ({SOFT})"
        assert row.reproduce == LINE.reproduce
    assert list(lost(base, [ROW])) == []
    assert list(lost(replace(base, dt=1 / 6000), [])) == []
    table_of_failings(line(chaotic=True), line(subject="*", largest=None))
    assert list(lost(base, [])) == []


def test_every_known_failing_has_a_size_above_its_limit():
    """Each line has its size, or covers subjects that have lines of their own."""
    lines = read(failings.FILE)
    assert lines == known()
    for key, one in lines.items():
        row = Row("run", one.scenario, one.engine, one.profile, 0.0, one.metric, subject=one.subject)
        limit = limit_of(row, catalogue()[one.scenario].tags if one.scenario in catalogue() else ())
        if not one.has_size:
            assert one.largest is None, key
        elif one.largest is None:
            assert one.subject == "*", key
            assert [other for other in lines if other[:4] == key[:4] and other != key], key
        else:
            assert limit is not None, key
            assert one.largest > limit.largest, key
        assert one.subject != "*" or one.largest is None or one.chaotic, key


def test_every_cause_shows_somewhere_and_once():
    """Every cause has a line, and no engine has the same reason twice."""
    assert {one.cause for one in known().values()} == set(causes())
    shown = {(one.engine, one.cause, one.reason) for one in known().values()}
    assert len({(engine, reason) for engine, _, reason in shown}) == len(shown)
    for one in known().values():
        assert one.cause.partition(".")[0] in (one.engine, "shared", "harness")
    assert all(len(reason) > 8 and "\n" not in reason for reason in causes().values())


def test_known_failings_say_how_to_see_them():
    """Every known failing names one engine and a command that shows it, and a limit it breaks exists."""
    limited = {limit.metric for limit in LIMITS}
    for one in known().values():
        assert one.engine in OURS
        if one.metric in failings.STUDIED:
            assert one.reproduce == f"touchstone study calibration --engine {one.engine}"
            continue
        command = one.reproduce.removeprefix("touchstone run ").split()
        options = dict(zip(command[1::2], command[2::2]))
        assert command[0] in catalogue()
        assert (options["--engine"], options["--profile"]) == (one.engine, one.profile.partition(",")[0])
        assert ("tracker=noisy" in one.profile) == (options.get("--tracker") == "noisy")
        if one.metric != "run":
            assert options["--metric"] == one.metric in METRICS
            assert one.metric.startswith("events.") or one.metric in limited


def test_no_default_row_is_the_harness():
    """No known failing of a profile that plays by default is marked as the harness'."""
    marked = {one.profile for one in known().values() if one.is_harness}
    assert marked == {"equal-step"}
    assert not marked & set(DEFAULT_PROFILES)


@pytest.mark.parametrize(
    "fields", [{"cause": "mujoco.none"}, {"engine": ""}, {"largest": "many"}, {"chaotic": "maybe"}]
)
def test_a_faulty_line_is_refused(fields, tmp_path):
    """Refuse an unknown cause, a missing name, a size that is no number and an unknown mark."""
    path = tmp_path / "failings.csv"
    values = LINE.model_dump() | fields
    path.write_text(f"{','.join(values)}\n{','.join(map(str, values.values()))}\n")
    with pytest.raises(FailingsError, match=re.escape(f"failings.csv:2: {next(iter(fields))}: ")):
        read(path)


def test_a_line_that_is_there_twice_is_refused(tmp_path):
    """Name the line."""
    path = tmp_path / "failings.csv"
    write([LINE, line(largest=9.0)], path)
    said = r"several lines of mujoco recommended ball_snip overlap\.max a-b"
    with pytest.raises(FailingsError, match=said):
        read(path)


def test_sizes_are_a_quarter_over_what_was_measured(table_of_failings, tmp_path):
    """Sizes follow from rows, rounded up to two digits; what meets its limit goes, others stay."""
    assert (bounded(-0.0431), bounded(0.1)) == (0.054, 0.13)
    table_of_failings()
    kept = line(scenario="volley")
    old = {
        one.key: one
        for one in (LINE, line(subject="a-c"), kept, line(engine="dart", subject="*", largest=None))
    }
    rows = [
        replace(ROW, value=-1.6),
        replace(ROW, value=2.4),
        replace(ROW, value=0.5, subject="a-c"),
        replace(ROW, value=1.2, engine="dart", dt=ENGINES["dart"].profiles["recommended"], subject="b-c"),
        replace(ROW, value=9.0, scenario="cradle"),  # nobody knows it
        replace(ROW, value=9.0, scenario="volley", dt=1 / 6000),
    ]
    now = measured(old, rows)
    found = {one.key: one.largest for one in now.values()}
    dart = ("dart", *LINE.key[1:4])
    assert found == {LINE.key: 3.0, kept.key: 2.5, (*dart, "*"): None, (*dart, "b-c"): 1.5}
    write(now.values(), tmp_path / "failings.csv")
    assert read(tmp_path / "failings.csv") == now


def test_a_chaotic_size_is_ten_times_the_largest(table_of_failings):
    """One line takes the largest of all pairs, and stays if all meet their limit."""
    table_of_failings()
    chaotic = line(subject="*", largest=1.0, chaotic=True)
    rows = [replace(ROW, subject=pair, value=value) for pair, value in (("a-b", 2.0), ("b-c", 1.1))]
    tenfold = line(subject="*", largest=20.0, chaotic=True)
    assert measured({chaotic.key: chaotic}, rows) == {chaotic.key: tenfold}
    met = [replace(ROW, value=0.1)]
    assert measured({chaotic.key: chaotic}, met) == {chaotic.key: chaotic}


def test_measure_writes_the_file_and_prints_the_difference(
    table_of_failings, touchstone, tmp_path, monkeypatch
):
    """`touchstone failings measure` rewrites what a run measured, and says what changed."""
    table_of_failings()
    monkeypatch.setattr(failings, "FILE", tmp_path / "failings.csv")
    write([LINE, line(subject="a-c")], failings.FILE)
    (tmp_path / "run").mkdir()
    save(table([ROW, replace(ROW, value=4.0), replace(ROW, subject="a-c", value=0.5)]), tmp_path / "run")
    code, out, err = touchstone("failings measure run")
    assert code == 0, err
    assert "size: mujoco recommended ball_snip overlap.max a-b: 2.5 -> 5" in out
    assert "gone: mujoco recommended ball_snip overlap.max a-c: meets its limit" in out
    assert read(failings.FILE) == {LINE.key: line(largest=5.0)}
