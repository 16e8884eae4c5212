"""The command line: one clear line for every wrong input, exit codes that mean something, whole folders."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from math import nan
from pathlib import Path

import pandas as pd
import pytest

from adapters.children import Outcome
from adapters.registry import ENGINES, missing_reason
from reports import cli, limits
from reports import run as study
from reports.limits import Limit
from reports.metrics import METRICS
from reports.results import COLUMNS, Row
from scenarios.catalogue import built, catalogue, scene
from scenarios.families import snip

HEAVY = ("numpy", "pandas", "numba", "scipy", "pyarrow", "mujoco", "pybullet", "dartpy", "coal", "fcl")
REFERENCE = ("--engine", "reference")
RUN = ("run", "ball_snip", "--engine", "reference", "--profile", "balanced")


@pytest.fixture
def touchstone(monkeypatch, capfd, tmp_path):
    """Call the program in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["touchstone", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, err = capfd.readouterr()
        return end.value.code or 0, out, err

    return call


@pytest.fixture
def quick(monkeypatch, registry):
    """Children that hand over the session's recordings in place of playing."""

    def play(self, jobs, progress):
        outcomes = []
        for job in jobs:
            progress(f"{job.engine} {job.settings.profile}", 0)
            registry.played(job.scenario.name, job.engine).save(job.recording)
            outcomes.append(Outcome(job, "done"))
        return outcomes

    monkeypatch.setattr(study.Children, "play", play)


def left(folder):
    return sorted(path.name for path in Path(folder).iterdir())


def test_help_imports_nothing_heavy():
    """`touchstone --help` names the commands and imports neither numpy, pandas, numba nor any engine."""
    code = (
        "import sys; sys.argv = ['touchstone', '--help']\n"
        "from reports.cli import main\n"
        "try:\n    main()\nexcept SystemExit as end:\n"
        f"    print([m for m in {HEAVY} if m in sys.modules], end.code or 0, file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.stderr.strip() == "[] 0"
    for command in ("run", "list", "show", "doctor"):
        assert command in done.stdout


def test_the_program_is_installed():
    """The console script runs, and a wrong name ends it with one line and no traceback."""
    program = Path(sys.executable).with_name("touchstone")
    if not program.exists():
        pytest.skip("the project is not installed with its script")
    done = subprocess.run([program, "run", "bal_snip"], capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")
    valid = ", ".join(catalogue())
    assert done.stderr.startswith("touchstone: unknown scenario 'bal_snip'; did you mean 'ball_snip'")
    assert done.stderr.endswith(f"? (valid: {valid})\n")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["bal_snip"], "unknown scenario 'bal_snip'; did you mean 'ball_snip'"),
        (["--engine", "bulet"], "unknown engine 'bulet'; did you mean 'bullet'?"),
        (["--engine", "zzz"], "unknown engine 'zzz' (valid: reference, dart, bullet, mujoco)"),
        (["--metric", "overlp.max"], "unknown metric 'overlp.max'; did you mean 'overlap.max'"),
        (["--tag", "galery"], "unknown tag 'galery'; did you mean 'gallery'?"),
        (["--profile", "equal_step"], "unknown profile 'equal_step'; did you mean 'equal-step'?"),
        (["--engine", "dart", "--profile", "paper"], "no engine of dart has the profile paper"),
        (["--dt", "1/7"], "--dt 1/7: dt = 0.142857 s does not divide the frame of 1/60 s"),
        (["--set", "frction=stick"], "unknown setting 'frction'; did you mean 'friction'"),
        (["--set", "x"], "unknown setting 'x' (valid: friction, "),
        (
            [*REFERENCE, "--set", "friction=stik"],
            "unknown value of friction 'stik'; did you mean 'stick'? (valid: always, stick)",
        ),
        ([*REFERENCE, "--set", "friction"], "unknown value of friction '' (valid: always, stick)"),
        (
            [*REFERENCE, "--set", "event_rows=-1"],
            "--set event_rows: found '-1' (valid: whole, 0 to 1e+09)",
        ),
        ([*REFERENCE, "--set", "event_rows=2.5"], "--set event_rows: found '2.5' (valid: whole"),
        ([*REFERENCE, "--set", "event_rows=nan"], "--set event_rows: found 'nan'"),
        (
            [*REFERENCE, "--set", "flight=euler", "--set", "flight=exact"],
            "--set flight: given as flight=euler and flight=exact",
        ),
        (["--set", "friction=stick"], "--set: dart has none of these settings; choose --engine reference"),
        (["--dt", "x"], "--dt x: "),
        (["--dt", "1/0"], "--dt 1/0: "),
        (["--dt", "0"], "--dt 0: "),
        (["--dt", "-1/60"], "--dt -1/60: "),
        (["--dt", "nan"], "--dt nan: "),
        (["--dt", "1e400"], "--dt 1e400: "),
    ],
)
def test_wrong_input_is_one_line(touchstone, tmp_path, arguments, said):
    """A wrong argument ends in exit 2 and one line with it and the nearest valid; nothing is written."""
    code, out, err = touchstone("run", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"touchstone: {said}")
    assert err.count("\n") == 1
    assert left(tmp_path) == []


@pytest.fixture
def added(monkeypatch):
    """Add a scene to the catalogue, or put another one in its place."""

    def add(build):
        monkeypatch.setattr(snip, "added", scene(build), raising=False)
        built.cache_clear()

    yield add
    built.cache_clear()


def test_lost_samples_are_refused_or_held(touchstone, added, registry, monkeypatch, tmp_path):
    """Refuse a tracker's sample that is no number, with its path; under `--hold-last` tell how many."""
    recording, good = registry.played("ball_snip", "reference"), catalogue()["ball_snip"]
    glove = good.trackers[0]

    def losing(*lost):
        places = tuple((nan,) * 3 if k in lost else place for k, place in enumerate(glove.positions))
        return lambda: replace(good, name="broken", trackers=(replace(glove, positions=places),))

    def play(self, jobs, progress):
        for job in jobs:
            recording.save(job.recording)
        return [Outcome(job, "done") for job in jobs]

    monkeypatch.setattr(study.Children, "play", play)
    run = ("run", "broken", *REFERENCE, "--profile", "balanced", "--metric", "overlap.max", "--out", "out")
    added(losing(5, 6, 9))
    code, out, err = touchstone(*run)
    assert (code, out) == (2, "")
    assert err.splitlines()[1] == "  trackers[0].positions[5]: found nan, expected finite numbers"
    assert left(tmp_path) == []
    code, out, err = touchstone(*run, "--hold-last")
    assert code == 0
    count = len(glove.times)
    assert f"broken: trackers[0] holds its last good sample at 3 of {count} keyframes\n" in err
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert manifest["scenarios"]["broken"]["held_samples"] == [3]
    # there is nothing to hold before the first good one
    added(losing(0))
    code, out, err = touchstone(*run, "--hold-last")
    assert (code, "trackers[0].positions[0]: found nan" in err) == (2, True)


def test_a_tracker_that_starts_stuck_is_told(touchstone, added, lab):
    """Tell frame, pair and depth where walls leave no room: a row with its reason, and exit 1."""
    walls = [lab.block(f"wall_{s}", (0.5, 0.5, 3.0), (0.0, 0.6 * s, 0.0), kind="fixed") for s in (-1, 1)]
    person = lab.person()
    added(lambda: replace(person, name="stuck", bodies=(*person.bodies, *walls)))
    code, out, _ = touchstone("run", "stuck", *REFERENCE, "--profile", "balanced", "--format", "csv")
    rows = list(csv.DictReader(io.StringIO(out)))
    assert code == 1
    assert [(row["metric"], row["verdict"]) for row in rows] == [("run", "error")]
    told = r"reference: trackers\[0\] starts stuck: in frame 1 '\w+' and 'wall_-?1' overlap by 0\.\d+ m"
    assert re.search(told, rows[0]["reason"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--engine", "bulet"], "unknown engine 'bulet'; did you mean 'bullet'?"),
        (["--profile", "tunde"], "unknown profile 'tunde'; did you mean 'tuned'?"),
        (["--engine", "reference", "--profile", "tuned"], "no engine of reference has the profile tuned"),
        (["--out", "full"], "--out full: exists and is not an empty folder"),
    ],
)
def test_wrong_input_of_a_study_is_one_line(touchstone, tmp_path, arguments, said):
    """A wrong argument of `study calibration` ends in exit 2 and one line, and nothing is written."""
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").touch()
    code, out, err = touchstone("study", "calibration", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"touchstone: {said}")
    assert err.count("\n") == 1
    assert left(tmp_path) == ["full"]


def test_a_study_is_printed_for_machines(touchstone, monkeypatch):
    """Print the long table of `study calibration` as CSV and nothing else, and end well."""
    from reports.studies import calibration

    tiny = {"restitutions": (0.5,), "speeds": (2.0,), "frictions": (0.3,), "ladder": (), "steps": ()}
    monkeypatch.setattr(calibration, "Grid", partial(calibration.Grid, pairs=("sphere-box",), **tiny))
    arguments = ("--engine", "reference", "--profile", "balanced", "--format", "csv", "--out", "r", "--quiet")
    code, out, err = touchstone("study", "calibration", *arguments)
    assert (code, err) == (0, "")
    frame = pd.read_csv(io.StringIO(out))
    achieved = frame[frame.metric == "restitution.achieved"]
    assert achieved.value.tolist() == pytest.approx([0.5], abs=1e-4)
    assert achieved.reason.tolist() == ["asked 0.5"]


@pytest.mark.parametrize("arguments", [["--engien", "dart"], ["rnu"], ["list", "things"], ["show"], []])
def test_wrong_usage_shows_no_traceback(touchstone, arguments):
    """Unknown options, commands and kinds of lists are usage errors, never tracebacks."""
    code, out, err = touchstone(*arguments)
    assert code == 2
    assert "Traceback" not in out + err


def test_a_run_writes_a_whole_folder(touchstone, quick, tmp_path):
    """A run leaves table, CSV, manifest, report, recordings and outputs, and nothing beside them."""
    code, out, err = touchstone(*RUN, "--out", "here/results")
    assert code == 0
    assert left(tmp_path) == ["here"]
    assert left("here") == ["results"]
    tables = ("report.md", "results.csv", "results.parquet")
    wanted = ["frame_budget.png", "manifest.json", "output", "recordings", *tables]
    assert left("here/results") == wanted
    assert left("here/results/recordings") == ["ball_snip-reference-balanced.npz"]
    assert "results: here/results" in out
    assert "overlap.max" in out
    assert "reference balanced: judge" in err
    manifest = json.loads(Path("here/results/manifest.json").read_text())
    assert manifest["command"] == " ".join(["touchstone", *RUN, "--out", "here/results"])
    assert manifest["engines"]["ball_snip/reference/balanced"]["engine"] == "reference"
    report = Path("here/results/report.md").read_text()
    results = pd.read_csv("here/results/results.csv")
    # metrics in the order of their table, each where it applies; two have tables of their own
    applies = set(results[results.value.notna()].metric) - {"work", "time.share", "run"}
    assert len(applies) > 20
    assert all((f"`{name}`" in report) == (name in applies) for name in METRICS)


@pytest.mark.parametrize("form", ["json", "csv"])
def test_machine_output_parses_and_stands_alone(touchstone, quick, form):
    """Standard output is the table and nothing else, columns in order, with every digit of the file's."""
    code, out, _ = touchstone(*RUN, "--out", "r", "--format", form)
    assert code == 0
    rows = json.loads(out) if form == "json" else list(csv.DictReader(io.StringIO(out)))
    assert all(tuple(row) == COLUMNS for row in rows)
    kept = pd.read_parquet("r/results.parquet")
    assert [row["metric"] for row in rows] == kept.metric.tolist()
    assert {row["metric"] for row in rows} >= set(METRICS)
    for row, value in zip(rows, kept.value):
        if value == value:
            # JSON shows 15 decimals: a femtometre
            assert float(row["value"]) == pytest.approx(value, rel=1e-12, abs=1e-15)
        else:
            assert row["value"] in (None, "")


def test_quiet_says_nothing(touchstone, quick):
    """`--quiet` prints neither progress nor table."""
    assert touchstone(*RUN, "--out", "r", "--quiet") == (0, "", "")


def test_chosen_metrics_alone_are_reported(touchstone, quick):
    """`--metric` leaves only its rows."""
    _, out, _ = touchstone(
        *RUN, "--out", "r", "--format", "json", "--metric", "overlap.max", "--metric", "work"
    )
    assert {row["metric"] for row in json.loads(out)} == {"overlap.max", "work"}


def test_what_is_not_asked_is_not_measured(registry):
    """Measure what is named and what that is judged by; the values are those of a whole run."""
    scenario, recording = catalogue()["ball_snip"], registry.played("ball_snip", "reference")
    base = Row("run", "ball_snip", "reference", "balanced", 1 / 60, "run")
    some = study.measured(base, scenario, recording, ("events.roll.spread", "friction.cone"))
    assert {row.metric for row in some} == {"events.roll", "friction.cone", *study.NEEDED}
    every = study.measured(base, scenario, recording)
    assert {row.metric for row in every} == set(METRICS)
    assert set(map(repr, some)) <= set(map(repr, every))


def test_changed_settings_are_told_everywhere(touchstone, tmp_path):
    """File results under profile and changes, in rows, table, recordings, report and manifest."""
    changed = ("--set", "event_rows=100.0", "--set", "removal=eq1", "--set", "friction=always")
    arguments = ("run", "fall", *REFERENCE, "--out", "r", "--metric", "overlap.max")
    code, out, err = touchstone(*arguments, *changed)
    label = "balanced, friction=always, event_rows=100"
    assert code == 0
    assert "friction=always" in out
    assert f"reference {label}: judge" in err
    assert set(pd.read_csv("r/results.csv").profile) == {label}
    assert left("r/recordings") == ["fall-reference-balanced+friction=always+event_rows=100.npz"]
    told = json.loads(Path("r/manifest.json").read_text())["engines"][f"fall/reference/{label}"]
    assert told["profile"] == label
    assert (told["settings"]["friction"], told["settings"]["event_rows"]) == ("always", 100)
    assert label in Path("r/report.md").read_text()


def test_differences_are_shown_again_by_their_commands(touchstone, registry, tmp_path):
    """Tell two engines apart in the page and a picture, and get the same value from the command it names."""
    registry.engine("mujoco")
    engines = ("--engine", "reference", "--engine", "mujoco")
    profiles = ("--profile", "balanced", "--profile", "recommended")
    wanted = (*engines, *profiles, "--metric", "energy.loss")
    code, _, _ = touchstone("run", "fall", *wanted, "--out", "r", "--quiet")
    assert code == 0
    assert "energy.png" in left("r")
    line = next(line for line in Path("r/report.md").read_text().splitlines() if "`energy.loss`" in line)
    told = line.split("| ")[-1].strip(" |`").split()
    assert told[:3] == ["touchstone", "run", "fall"]
    assert touchstone(*told[1:], "--out", "again", "--quiet")[0] == 0
    once, again = (pd.read_csv(f"{folder}/results.csv") for folder in ("r", "again"))
    assert again.engine.tolist() == ["mujoco"]
    assert again.value.tolist() == once.value[once.engine == "mujoco"].tolist()


def test_asking_twice_is_asking_once(touchstone, quick):
    """Engines, profiles and scenes named twice are played once."""
    again = ("ball_snip", "--engine", "reference", "--profile", "balanced", "--metric", "overlap.max")
    _, out, _ = touchstone(*RUN, *again, "--out", "r", "--format", "json")
    assert len(json.loads(out)) == 1


def test_a_broken_limit_is_exit_1(touchstone, quick, monkeypatch):
    """A limit that is not met ends in exit 1, with the row and its reason shown; the folder is there."""
    impossible = Limit("time.frame.median", 0.0, "nothing takes no time")
    monkeypatch.setattr(limits, "LIMITS", (impossible,))
    monkeypatch.setattr(limits, "KNOWN", ())
    code, out, _ = touchstone(*RUN, "--out", "r")
    assert code == 1
    assert "fail: reference balanced: time.frame.median" in out
    assert "nothing takes no time" in " ".join(out.split())
    assert "results.csv" in left("r")


def test_an_engine_that_dies_is_exit_1(touchstone, monkeypatch):
    """An engine that dies is a row with its reason, and exit 1."""
    said = "died during 'play': signal SIGSEGV"
    crash = lambda self, jobs, progress: [Outcome(job, "error", said) for job in jobs]  # noqa: E731
    monkeypatch.setattr(study.Children, "play", crash)
    code, out, _ = touchstone(*RUN, "--out", "r", "--format", "json")
    rows = json.loads(out)
    assert code == 1
    assert [(row["metric"], row["verdict"], row["reason"]) for row in rows] == [("run", "error", said)]


@pytest.mark.parametrize(("named", "wanted"), [(False, 0), (True, 3)])
def test_a_missing_engine_is_skipped_with_a_hint(touchstone, quick, monkeypatch, named, wanted):
    """A missing engine is a skipped row with pip's hint: exit 0 by default, 3 when asked for by name."""
    monkeypatch.setattr(study, "installed", lambda name: name == "reference")
    chosen = ["--engine", "reference", "--engine", "mujoco"] if named else []
    options = ("--profile", "balanced", "--profile", "recommended", "--out", "r")
    code, out, err = touchstone("run", "ball_snip", *chosen, *options)
    assert code == wanted
    for name in ("mujoco",) if named else ("dart", "bullet", "mujoco"):
        assert f"skipped: {name} recommended: {missing_reason(name)}" in out
    assert "Traceback" not in err


def test_a_folder_in_use_is_refused(touchstone, tmp_path):
    """A folder that is not empty, or a file, is refused in one line before anything is played; it stays."""
    full = tmp_path / "full"
    full.mkdir()
    (full / "thesis.txt").write_text("kept")
    for out in (full, full / "thesis.txt"):
        code, _, err = touchstone(*RUN, "--out", out)
        assert code == 2
        assert err == f"touchstone: --out {out}: exists and is not an empty folder\n"
    assert (full / "thesis.txt").read_text() == "kept"
    assert left(tmp_path) == ["full"]


def test_an_empty_folder_is_used(touchstone, quick, tmp_path):
    """A folder that exists and is empty is filled."""
    (tmp_path / "empty").mkdir()
    code, *_ = touchstone(*RUN, "--out", "empty", "--quiet")
    assert code == 0
    assert "results.csv" in left("empty")


@pytest.mark.parametrize("out", ["file/below", ".", "..", "file/deep/er"])
def test_a_folder_that_cannot_be_is_one_line(touchstone, tmp_path, out):
    """A place where no folder can be is exit 2 and one line, and nothing is left."""
    (tmp_path / "file").write_text("a file")
    code, _, err = touchstone(*RUN, "--out", out)
    assert code == 2
    assert err.startswith(f"touchstone: --out {out}: ")
    assert err.count("\n") == 1
    assert left(tmp_path) == ["file"]


def test_a_full_disk_leaves_nothing_half_written(touchstone, quick, monkeypatch, tmp_path):
    """When the disk fills up while results are written: exit 2, one line, no part of the folder."""

    def full(self, path, **options):
        Path(path).write_bytes(b"half")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(pd.DataFrame, "to_parquet", full)
    code, out, err = touchstone(*RUN, "--out", "r", "--quiet")
    assert (code, out, err) == (2, "", "touchstone: --out r: No space left on device\n")
    assert left(tmp_path) == []


def interrupted(tmp_path, marker):
    """Run two engines in a session of their own, and send all of it SIGINT once `marker` is told."""
    arguments = [
        "run",
        "ball_snip",
        "--engine",
        "reference",
        "--engine",
        "mujoco",
        "--out",
        str(tmp_path / "r"),
    ]
    code = f"import sys; sys.argv = ['touchstone', *{arguments}]; from reports.cli import main; main()"
    program = subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    told = []
    for line in program.stderr:
        told.append(line)
        if marker in line:
            break
    os.killpg(program.pid, signal.SIGINT)
    out, err = program.communicate(timeout=60)
    return program, out, told, err.splitlines()


def alive(session):
    """Processes of a session that still run."""
    found = []
    for process in filter(str.isdigit, os.listdir("/proc")):
        try:
            fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] not in "ZX":
            found.append(int(process))
    return found


@pytest.mark.parametrize("marker", ["reference balanced: build", "mujoco recommended: start"])
def test_ctrl_c_ends_everything_in_one_line(tmp_path, marker):
    """Ctrl-C, while children start or play: exit 130, one line, no folder, no child left."""
    program, out, told, err = interrupted(tmp_path, marker)
    assert program.returncode == 130
    assert out == ""
    # progress that was told meanwhile, then the one line
    assert err[-1] == "touchstone: interrupted; nothing was written"
    assert all(line.startswith(("reference ", "mujoco ")) for line in err[:-1])
    assert marker in told[-1]
    assert left(tmp_path) == []
    # multiprocessing's own tracker of resources ends a moment after its parent
    patience = time.monotonic() + 5
    while alive(program.pid) and time.monotonic() < patience:
        time.sleep(0.02)
    assert alive(program.pid) == []


@pytest.mark.parametrize("form", ["table", "json", "csv"])
@pytest.mark.parametrize("what", ["scenarios", "engines", "metrics", "profiles"])
def test_lists_in_every_format(touchstone, what, form):
    """Each list names all there is, parses in its format, and writes nothing else."""
    code, out, err = touchstone("list", what, "--format", form)
    assert (code, err) == (0, "")
    wanted = {
        "scenarios": list(catalogue()),
        "engines": list(ENGINES),
        "metrics": list(METRICS),
        "profiles": [profile for entry in ENGINES.values() for profile in entry.profiles],
    }[what]
    if form == "json":
        names = [next(iter(row.values())) for row in json.loads(out)]
    elif form == "csv":
        names = [row[0] for row in csv.reader(io.StringIO(out))][1:]
    else:
        names = [line.split()[0] for line in out.splitlines()][1:]
    assert names == wanted


@pytest.mark.parametrize("form", ["table", "json", "csv"])
def test_show_in_every_format(touchstone, form):
    """A scene is shown with all its bodies; JSON is the whole scenario."""
    code, out, err = touchstone("show", "ball_snip", "--format", form)
    assert (code, err) == (0, "")
    scenario = catalogue()["ball_snip"]
    bodies = [body.name for body in scenario.bodies]
    if form == "json":
        shown = json.loads(out)
        assert [body["name"] for body in shown["bodies"]] == bodies
        assert shown["trackers"][0]["times"] == list(scenario.trackers[0].times)
    elif form == "csv":
        assert [row["body"] for row in csv.DictReader(io.StringIO(out))] == bodies
    else:
        assert [line.split()[0] for line in out.splitlines()][-len(bodies) :] == bodies
        assert "expects land ball-floor from 1 to 1.8 s" in out


@pytest.mark.parametrize(
    ("scene", "line"),
    [
        ("bounce_e05", "truth ball: from 0.24731 s at (0, 0, 0.05) m, v = (0, 0, 1.21305) m/s"),
        ("bounce_e05", "arcs more"),
        ("slide", "truth box_0: from 1.22324 s at (3.66972, 0, 0.05) m, at rest"),
        ("slip", "dw/dt = (0, 147.15, 0) rad/s^2"),
        ("spring", "truth light: follows its tracker by Eq. 6, solved in closed form"),
        ("tumble_stable", "truth box: turns freely, by elliptic functions"),
    ],
)
def test_show_tells_the_truth(touchstone, scene, line):
    """A probe is shown with how its bodies must move."""
    code, out, err = touchstone("show", scene)
    assert (code, err) == (0, "")
    assert line in out


def test_show_knows_the_nearest_name(touchstone):
    """An unknown scene is one line there too."""
    code, out, err = touchstone("show", "ball_snap")
    assert (code, out) == (2, "")
    assert "did you mean 'ball_snip'" in err


def test_a_closed_pipe_is_no_error():
    """A reader that stops reading, as `head` does, sees no traceback."""
    arguments = ["touchstone", "show", "ball_snip", "--format", "json"]
    code = f"import sys; sys.argv = {arguments}; from reports.cli import main; main()"
    program = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    program.stdout.read(10)
    program.stdout.close()
    err = program.stderr.read()
    program.wait(30)
    program.stderr.close()
    assert "Traceback" not in err
