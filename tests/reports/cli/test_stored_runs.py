"""`touchstone judge` and `touchstone compare` on stored runs."""

import json
import os
import re
import signal
from pathlib import Path
from types import SimpleNamespace
from uuid import uuid4

import numpy as np
import pandas as pd
import pytest
from forged_recordings import WAYS, forge, rewrite
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from touchstone.adapters import registry
from touchstone.adapters.recording import ARRAYS, CONTACTS
from touchstone.reports.changes import NEEDED, NUMBERS, label_of
from touchstone.reports.results import save
from touchstone.reports.run import ratios
from touchstone.reports.verdict import judge

RUN = "run ball_snip --engine reference --profile balanced --quiet --out old"

EXTREMES = (np.nan, np.inf, -np.inf, 1e308, -1e155, 1e39, 9e29, 1e15, 1e4, -1.0, 0.0, 5e-324, 1e-310)
"""Numbers at which arithmetic overflows, loses all digits, or takes long."""
LONGEST = 60
"""Time of a command [s]: ten times the longest that is known."""


@pytest.fixture
def old(touchstone, quick, stored_run, tmp_path):
    """A stored run of one scene, which `--quiet` plays without a word; returns the program."""

    def play():
        assert touchstone(RUN) == (0, "", "")

    stored_run(play, tmp_path / "old")
    return touchstone


def test_a_run_is_judged_again(old, tmp_path):
    """Today's verdicts are those of the run; a stricter limit of a file is worse, and exit 1."""
    assert old("judge old --out new --quiet")[0] == 0
    tables = [pd.read_parquet(tmp_path / name / "results.parquet") for name in ("old", "new")]
    columns = ["metric", "subject", "verdict"]
    assert tables[0][columns].equals(tables[1][columns])
    assert json.loads((tmp_path / "new" / "manifest.json").read_text())["judged"] == "old"
    code, out, _ = old("compare old new")
    assert (code, " 0 worse" in out) == (0, True)
    (tmp_path / "l.toml").write_text('[[limits]]\nmetric = "work"\nlargest = 0\n')
    code, _, err = old("judge old --limits l.toml --metric 'wor*' --out strict --quiet")
    assert code == 1
    assert "fail: ball_snip reference balanced: work" in err
    code, out, _ = old("compare old strict --metric work")
    assert (code, " 0 worse" in out) == (1, False)
    code, out, _ = old("compare old strict --metric work --format csv")
    assert out.startswith("kind,study,scenario,engine,")
    assert "pass: limit of the file" not in out
    assert "no verdict -> fail: " in out


def test_engines_of_a_stored_run_are_known(monkeypatch):
    """One that plays only when it is named is registered again, with its step; what is gone has no step."""
    monkeypatch.setattr(registry, "ENGINES", engines := dict(registry.ENGINES))
    monkeypatch.setattr(judge, "ENGINES", engines)
    engines.pop("rapier", None)
    own = {}
    for name in ("rapier", "gone"):
        facts = {"engine": name, "profile": "recommended"}
        stored = SimpleNamespace(scenario='{"name": "fall"}', facts=facts)
        found = label_of(Path(f"fall-{name}-recommended.npz"), stored)
        assert found == ("fall", name, "recommended")
        own[name] = ratios.Timed(name, "recommended", 1 / 60, np.zeros((1, 1)), np.zeros(1, bool)).at_own_step
    assert own == {"rapier": True, "gone": False}


def test_what_is_gone_fails(old, tmp_path):
    """Exit 1 where the later run lacks a scene, an engine or a figure, or has another step."""
    frame = pd.read_parquet("old/results.parquet")
    lacking = {
        "scene": frame.assign(scenario="fall"),
        "engine": frame.assign(engine="mujoco"),
        "figure": frame[frame.metric != "overlap.max"],
        "step": frame.assign(dt=1 / 240),
        "settings": frame.assign(profile="balanced, removal=least_motion"),
    }
    for name, table in lacking.items():
        (tmp_path / name).mkdir()
        save(table, tmp_path / name)
        code, out, _ = old(f"compare old {name}")
        assert (code, "gone: 1" in out, " 1 gone" in out) == (1, True, True), name
        assert old(f"compare old {name} --allow-gone")[0] == 0, name
        code = old(f"compare old {name} --match profile")[0]
        assert code == (0 if name in ("step", "settings") else 1), name


@pytest.mark.parametrize("way", list(WAYS)[::6])
def test_a_forged_recording_exits_with_one_line(refused, registry, tmp_path, way):
    """Each command that reads recordings exits with 2 and a line that names file and field."""
    path = tmp_path / "forged" / "recordings" / "a.npz"
    path.parent.mkdir(parents=True)
    path.write_bytes(registry.saved("ball_snip", "reference"))
    named = forge(path, way)
    for command in ("view forged --no-open", "judge forged", f"export '{path}' --format glb"):
        assert re.match(rf"\S*a\.npz: .*{re.escape(named)}", refused(command))


@pytest.fixture
def hurried(touchstone):
    """The program, which fails where it waits or computes for long."""

    def end(*_):
        raise AssertionError("the program takes too long")  # no OSError, which the program expects

    def call(*arguments):
        signal.alarm(LONGEST)
        try:
            return touchstone(*arguments)
        finally:
            signal.alarm(0)

    before = signal.signal(signal.SIGALRM, end)
    yield call
    signal.signal(signal.SIGALRM, before)


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    field=st.sampled_from([(name,) for name, (_, numbers) in ARRAYS.items() if numbers])
    | st.sampled_from([("contacts", name) for name in ("time", *CONTACTS)]),
    rows=st.sampled_from([slice(None), slice(1, None), slice(-1, None)]),
    value=st.sampled_from(EXTREMES),
)
def test_an_extreme_number_ends_in_a_verdict_or_one_line(hurried, registry, tmp_path, field, rows, value):
    """Whatever number a recording holds, commands end soon, and with one line where they refuse it."""
    path = tmp_path / "forged" / "recordings" / "ball_snip-reference-balanced.npz"
    path.parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "forged" / "results.csv").write_text(",".join(NEEDED) + "\n")
    path.write_bytes(registry.saved("ball_snip", "reference"))

    def change(columns):
        array = columns[field[0]]
        for name in field[1:]:
            array = array[name]
        array[rows] = value

    rewrite(path, change)
    for command in (
        "view forged --no-open",
        f"judge forged --quiet --out {uuid4().hex}",
        f"export '{path}' --format glb --out {uuid4().hex}.glb",
    ):
        code, _, err = hurried(command)
        assert code in (0, 1, 2, 5), err
        assert code != 2 or err.count("\n") == 1
        assert "Warning" not in err


@pytest.fixture
def special(tmp_path):
    """Make a FIFO, a folder or a link to a device in the working folder."""

    def make(kind, name):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        {"FIFO": os.mkfifo, "folder": Path.mkdir, "device": lambda one: one.symlink_to("/dev/zero")}[kind](
            path
        )

    return make


READERS = (
    ("s.toml", "run s.toml"),
    ("s.json", "show s.json"),
    ("s.py", "run s.py"),
    ("l.toml", "run fall --limits l.toml"),
    ("l.toml", "judge old --limits l.toml"),
    ("t.toml", "compare old old --tolerance t.toml"),
    ("old", "compare old old"),
    ("old/results.parquet", "compare old old"),
    ("run/recordings/a.npz", "judge run"),
    ("run/recordings/a.npz", "view run --no-open"),
    ("a.npz", "export a.npz --format glb"),
    ("robot.urdf", "import robot.urdf --as robot"),
    ("robot.xml", "import robot.xml --as robot"),
    ("run/results.parquet", "docs run"),
    ("store/store.json", "sweep fall --engine reference --out store"),
)


@pytest.mark.parametrize("kind", ["FIFO", "folder", "device"])
@pytest.mark.parametrize(("name", "command"), READERS)
def test_what_is_no_regular_file_is_refused(hurried, special, tmp_path, kind, name, command):
    """A FIFO, a folder or a device in place of a file ends in one line and exit 2, at once."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").touch()
    if not name.startswith("old"):
        (tmp_path / "old").mkdir()
        (tmp_path / "old" / "results.csv").write_text(",".join(NEEDED) + "\n")
    special(kind, name)
    code, out, err = hurried(command)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("touchstone: ")


@pytest.mark.parametrize("name", NUMBERS)
def test_a_text_in_place_of_a_number_is_refused(refused, tmp_path, name):
    """A table whose column of numbers holds a text ends in one line that names the column, and exit 2."""
    row = {**dict.fromkeys(NEEDED, "a"), **dict.fromkeys(NUMBERS, 1.0)}
    for folder, changed in (("old", {}), ("new", {name: "one"})):
        (tmp_path / folder).mkdir()
        pd.DataFrame([row, row | changed]).to_csv(tmp_path / folder / "results.csv", index=False)
    assert refused("compare old new") == f"new/results.csv: {name}: expected numbers"


WRONG = (
    ("compare old none", "none: no such folder"),
    ("compare old .", ".: holds neither results.parquet nor results.csv"),
    ("compare old old --tolerance no.toml", "no.toml: No such file"),
    ("compare old old --metric wrk", "unknown metric 'wrk'"),
    ("compare old both --match profile", "--match profile: a run has several columns of ball_snip"),
    ("judge none", "none: no such folder"),
    ("judge .", ".: no recordings; expected recordings/*.npz"),
    ("judge bad", "a.npz: not a recording"),
    ("judge old --out old", "--out old: exists and is not an empty folder"),
)


def test_wrong_runs_exit_with_one_line(old, refused, tmp_path):
    """Exit with 2 and what is missing, without a traceback."""
    (tmp_path / "bad" / "recordings").mkdir(parents=True)
    (tmp_path / "bad" / "recordings" / "a.npz").write_bytes(b"nothing")
    frame = pd.read_parquet("old/results.parquet")
    (tmp_path / "both").mkdir()
    save(pd.concat([frame, frame.assign(dt=1 / 240)]), tmp_path / "both")
    for command, line in WRONG:
        assert line in refused(command)
