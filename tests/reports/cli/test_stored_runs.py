"""`touchstone judge` and `touchstone compare` on stored runs."""

from __future__ import annotations

import json

import pandas as pd
import pytest

from touchstone.reports.results import save

RUN = ("run", "ball_snip", "--engine", "reference", "--profile", "balanced", "--quiet", "--out", "old")


@pytest.fixture
def old(touchstone, quick, tmp_path):
    """A stored run of one scene; returns the program."""
    assert touchstone(*RUN)[0] == 0
    return touchstone


def test_a_run_is_judged_again(old, tmp_path):
    """Today's verdicts are those of the run; a stricter limit of a file is worse, and exit 1."""
    assert old("judge", "old", "--out", "new", "--quiet")[0] == 0
    tables = [pd.read_parquet(tmp_path / name / "results.parquet") for name in ("old", "new")]
    columns = ["metric", "subject", "verdict"]
    assert tables[0][columns].equals(tables[1][columns])
    assert json.loads((tmp_path / "new" / "manifest.json").read_text())["judged"] == "old"
    code, out, _ = old("compare", "old", "new")
    assert (code, " 0 worse" in out) == (0, True)
    (tmp_path / "l.toml").write_text('[[limits]]\nmetric = "work"\nlargest = 0\n')
    code, _, err = old("judge", "old", "--limits", "l.toml", "--metric", "wor*", "--out", "strict", "--quiet")
    assert code == 1
    assert "fail: ball_snip reference balanced: work" in err
    code, out, _ = old("compare", "old", "strict", "--metric", "work")
    assert (code, " 0 worse" in out) == (1, False)
    code, out, _ = old("compare", "old", "strict", "--metric", "work", "--format", "csv")
    assert out.startswith("kind,study,scenario,engine,")
    assert "pass: limit of the file" not in out
    assert "no verdict -> fail: " in out


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
        code, out, _ = old("compare", "old", name)
        assert (code, "gone: 1" in out, " 1 gone" in out) == (1, True, True), name
        assert old("compare", "old", name, "--allow-gone")[0] == 0, name
        code = old("compare", "old", name, "--match", "profile")[0]
        assert code == (0 if name in ("step", "settings") else 1), name


WRONG = (
    (("compare", "old", "none"), "none: no such folder"),
    (("compare", "old", "."), ".: holds neither results.parquet nor results.csv"),
    (("compare", "old", "old", "--tolerance", "no.toml"), "no.toml: No such file"),
    (("compare", "old", "old", "--metric", "wrk"), "unknown metric 'wrk'"),
    (
        ("compare", "old", "both", "--match", "profile"),
        "--match profile: a run has several columns of ball_snip",
    ),
    (("judge", "none"), "none: no such folder"),
    (("judge", "."), ".: no recordings; expected recordings/*.npz"),
    (("judge", "bad"), "a.npz: not a recording"),
    (("judge", "old", "--out", "old"), "--out old: exists and is not an empty folder"),
)


def test_wrong_runs_exit_with_one_line(old, tmp_path):
    """Exit with 2 and what is missing, without a traceback."""
    (tmp_path / "bad" / "recordings").mkdir(parents=True)
    (tmp_path / "bad" / "recordings" / "a.npz").write_bytes(b"nothing")
    frame = pd.read_parquet("old/results.parquet")
    (tmp_path / "both").mkdir()
    save(pd.concat([frame, frame.assign(dt=1 / 240)]), tmp_path / "both")
    for arguments, line in WRONG:
        code, out, err = old(*arguments)
        assert (code, out) == (2, "")
        assert line in err
        assert "Traceback" not in err
