"""What goes wrong in a run: rows with their reason, exit codes that mean something."""

import csv
import io
import json
import re
from dataclasses import replace
from math import nan

import pytest
import typer

from touchstone.adapters.registry import missing_reason
from touchstone.adapters.workers.children import Outcome
from touchstone.reports.cli.options import exit_for
from touchstone.reports.run import study
from touchstone.reports.verdict import failings, limits
from touchstone.reports.verdict.limits import Limit
from touchstone.scenarios.catalogue import catalogue

pytestmark = pytest.mark.usefixtures("unpictured")
RUN = "run ball_snip --engine reference --profile balanced"


@pytest.fixture
def hand_over(played_by):
    """Children that hand over a recording, complete or up to a failure, in place of playing."""

    def hand(recording, failure=""):
        def outcome(job):
            recording.save(job.recording)
            return Outcome(job, "error" if failure else "done", failure)

        played_by(outcome)

    return hand


def test_lost_samples_are_refused_or_held(touchstone, added, registry, hand_over, tmp_path, left):
    """Refuse a tracker's sample that is no number, with its path; under `--hold-last` report how many."""
    recording, good = registry.played("ball_snip", "reference"), catalogue()["ball_snip"]
    glove = good.trackers[0]

    def losing(*lost):
        places = tuple((nan,) * 3 if k in lost else place for k, place in enumerate(glove.positions))
        return lambda: replace(good, name="broken", trackers=(replace(glove, positions=places),))

    hand_over(recording)
    run = "run broken --engine reference --profile balanced --metric overlap.max --out out"
    added(losing(5, 6, 9))
    code, out, err = touchstone(run)
    assert (code, out) == (2, "")
    reported = "scenario 'broken': trackers[0].positions[5]: found nan, expected finite numbers"
    assert err.splitlines()[0].endswith(reported)
    assert left(tmp_path) == []
    code, out, err = touchstone(f"{run} --hold-last")
    assert code == 0
    count = len(glove.times)
    assert f"broken: trackers[0] holds its last good sample at 3 of {count} keyframes\n" in err
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["scenarios"]["broken"]["held_samples"] == [3]
    # there is nothing to hold before the first good one
    added(losing(0))
    code, out, err = touchstone(f"{run} --hold-last")
    assert (code, "trackers[0].positions[0]: found nan" in err) == (2, True)


def test_a_tracker_that_starts_stuck_is_told(touchstone, added, lab):
    """Tell frame, pair and depth where walls leave no room: a row with its reason, and exit 5."""
    walls = [lab.block(f"wall_{s}", (0.5, 0.5, 3.0), (0.0, 0.6 * s, 0.0), kind="fixed") for s in (-1, 1)]
    person = lab.person()
    added(lambda: replace(person, name="stuck", bodies=(*person.bodies, *walls)))
    code, out, _ = touchstone("run stuck --engine reference --profile balanced --format csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert code == 5
    assert [(row["metric"], row["verdict"]) for row in rows] == [("run", "error")]
    reported = r"reference: trackers\[0\] starts stuck: in frame 1 'wall_-?1' and '\w+' overlap by 0\.\d+ m"
    assert re.search(reported, rows[0]["reason"])


def test_a_broken_limit_is_exit_1(touchstone, quick, monkeypatch, left):
    """A limit that is not met ends in exit 1, with the row and its reason shown; the folder is there."""
    impossible = Limit("time.frame.median", 0.0, "nothing takes no time")
    monkeypatch.setattr(limits, "LIMITS", (impossible,))
    monkeypatch.setattr(failings, "known", dict)
    code, out, _ = touchstone(f"{RUN} --out r")
    assert code == 1
    assert "fail: reference balanced: time.frame.median" in out
    assert "nothing takes no time" in " ".join(out.split())
    assert "results.csv" in left("r")


def test_an_engine_that_dies_is_exit_5(touchstone, played_by):
    """An engine that dies is a row with its reason, and exit 5; `--quiet` still tells."""
    said = "died during 'play': signal SIGSEGV"
    played_by(lambda job: Outcome(job, "error", said))
    code, out, _ = touchstone(f"{RUN} --out r --format json")
    rows = json.loads(out)
    assert code == 5
    assert [(row["metric"], row["verdict"], row["reason"]) for row in rows] == [("run", "error", said)]
    quiet = touchstone(f"{RUN} --out s --quiet")
    assert quiet == (5, "", f"error: ball_snip reference balanced: {said}\n")


@pytest.mark.parametrize(("named", "wanted"), [(False, 0), (True, 3)])
def test_a_missing_engine_is_skipped_with_a_hint(touchstone, quick, monkeypatch, named, wanted):
    """A missing engine is a skipped row with pip's hint: exit 0 by default, 3 when asked for by name."""
    monkeypatch.setattr(study, "installed", lambda name: name == "reference")
    run = "run ball_snip --profile balanced --profile recommended"
    run += " --engine reference --engine mujoco" if named else ""
    code, out, err = touchstone(f"{run} --out r")
    assert code == wanted
    for name in ("mujoco",) if named else ("dart", "bullet", "mujoco"):
        assert f"missing: {name} recommended: {missing_reason(name)}" in out
    assert "Traceback" not in err
    said = f"missing: mujoco: {missing_reason('mujoco')}\n" if named else ""
    assert touchstone(f"{run} --out s --quiet") == (wanted, "", said)


@pytest.mark.parametrize(
    ("verdicts", "named", "wanted"),
    [
        ([], True, 0),
        (["pass", "known", "skipped", ""], True, 0),
        (["missing", "pass"], False, 0),
        (["missing", "pass"], True, 3),
        (["unimportable"], False, 3),
        (["missing", "unimportable", "fail"], True, 1),
        (["fail", "error"], True, 1),
        (["missing", "error", "unjudged"], True, 5),
        (["missing", "unjudged", "pass"], True, 4),
        (["unjudged", "fail"], False, 1),
    ],
)
def test_verdicts_decide_the_exit_code(verdicts, named, wanted):
    """A broken limit is 1, before an engine that failed, 5, an unjudged row, 4, and a missing engine, 3."""
    try:
        exit_for(verdicts, named)
        code = 0
    except typer.Exit as end:
        code = end.exit_code
    assert code == wanted


def test_an_engine_that_cannot_be_imported_is_exit_3(touchstone, played_by, monkeypatch, registry):
    """An engine that is installed but fails to import is a row with its reason; the others finish."""
    said = "cannot be imported: libGL.so.1: no such file"

    def outcome(job):
        if job.engine == "mujoco":
            return Outcome(job, "unimportable", said)
        registry.played(job.scenario.name, "reference").save(job.recording)
        return Outcome(job, "done")

    played_by(outcome)
    monkeypatch.setattr(study, "installed", lambda name: name in ("reference", "mujoco"))
    run = "run ball_snip --profile balanced --profile recommended --metric overlap.max"
    code, out, _ = touchstone(f"{run} --out r")
    assert code == 3
    assert f"unimportable: mujoco recommended: {said}" in " ".join(out.split())
    quiet = touchstone(f"{run} --out s --quiet")
    assert quiet == (3, "", f"unimportable: mujoco: {said}\n")
    assert "overlap.max" in out


def test_a_run_without_its_judge_says_so(touchstone, quick, without_coal):
    """Without the libraries that measure overlap nothing of it passes: a line on standard error, exit 4."""
    code, out, err = touchstone(f"{RUN} --out r --format json")
    rows = json.loads(out)
    assert code == 4
    assert "overlap, gaps and passages cannot be judged: " in err
    assert {r["metric"] for r in rows if r["verdict"] == "unjudged"} >= {"overlap.max", "overlap.tunnelled"}
    for row in rows:
        assert not (row["metric"].startswith(("overlap.", "contact.gap")) and row["verdict"] == "pass")
    shown = " ".join(touchstone(f"{RUN} --out s")[1].split())
    assert re.search(r"unjudged: \S.*overlap\.max, .*: import of coal halted", shown)
    code, out, err = touchstone(f"{RUN} --out t --quiet")
    reasons = {row["reason"] for row in rows if row["verdict"] == "unjudged"}
    assert (code, out, len(err.splitlines())) == (4, "", len(reasons))
    assert err.startswith("unjudged: some figures: ")
    assert "import of coal halted" in err
    for command in ("study robustness", "study predictability"):
        code, _, err = touchstone(command)
        assert (code, "cannot be judged" in err) == (4, True)


def test_unresolved_contacts_are_one_warning(touchstone, hand_over, registry):
    """Print one warning per run on standard error that names scene, profile and frame, whatever is asked for;
    none where nobody wants to be told."""
    recording = registry.played("ball_snip", "reference")
    work = recording.work.copy()
    work[11, recording.work_names.tolist().index("residual")] = 3e-5
    work[[11, 12], recording.work_names.tolist().index("dropped_time")] = 1e-3

    hand_over(replace(recording, work=work))
    code, out, err = touchstone(f"{RUN} --out r")
    reported = [line for line in err.splitlines() if "warning" in line]
    assert len(reported) == 1
    start = "warning: reference balanced ball_snip: contact solve left 3e-05 m/s in frame 12"
    assert reported[0].startswith(start)
    assert "0.002 s were not simulated, most of it in frame 12" in reported[0]
    assert code == 1
    assert "fail: reference balanced: solver.residual" in out
    code, out, err = touchstone(f"{RUN} --metric overlap.max --out s --format json")
    assert [line.startswith(start) for line in err.splitlines() if "warning" in line] == [True]
    assert {row["metric"] for row in json.loads(out)} == {"overlap.max"}
    quiet = touchstone(f"{RUN} --out t --quiet")[2].splitlines()
    assert [line.partition(": ")[0] for line in quiet] == ["fail"] * len(quiet)


def test_a_failed_run_keeps_its_recording(touchstone, hand_over, registry, left):
    """Leave what a run recorded before it diverged in the folder of results, beside its row, its warning and
    exit 5."""
    said = "diverged: the position of 'ball' is not finite, in frame 40 at 0.6667 s"
    recording = registry.played("ball_snip", "reference")
    work = recording.work.copy()
    work[39, recording.work_names.tolist().index("residual")] = 0.5

    hand_over(replace(recording, ended=said, work=work), said)
    code, out, err = touchstone(f"{RUN} --out r --format json")
    assert code == 5
    assert [(row["verdict"], row["reason"]) for row in json.loads(out)] == [("error", said)]
    # why it failed is worth a warning, too
    assert "warning: reference balanced ball_snip: contact solve left 0.5 m/s in frame 40" in err
    assert left("r/recordings") == ["ball_snip-reference-balanced.npz"]
