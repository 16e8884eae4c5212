"""Scenes from files on the command line: played, shown, judged by their own limits."""

import csv
import io
import json
from dataclasses import replace

import pytest

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.write import scene_json, scene_toml
from touchstone.scenarios.scenario import MetricLimit

REFERENCE = ("--engine", "reference", "--profile", "balanced")


def rows(out: str) -> dict[tuple[str, str], dict[str, str]]:
    return {(row["metric"], row["subject"]): row for row in csv.DictReader(io.StringIO(out))}


def test_a_foreign_scene_has_no_limits_but_its_own(here, tmp_path):
    """Our limits judge scenes with our tags only; a scene's own and a file's come before ours."""
    bounce = catalogue()["bounce_e05"]
    foreign = replace(bounce, name="mine", tags=("private",), expectations=(), truths=())
    own = (MetricLimit("restitution.error", 1e-12, "too strict"), MetricLimit("contact.gap", 1.0))
    scenes = {
        "none.toml": replace(foreign, name="none"),
        "own.json": replace(foreign, limits=own),
        "ours.toml": replace(bounce, name="ours"),
    }
    for name, scenario in scenes.items():
        text = scene_json(scenario) if name.endswith("json") else scene_toml(scenario)
        (tmp_path / name).write_text(text)
    code, out, err = here("run", "none.toml", *REFERENCE, "--format", "csv", "--out", "a")
    assert (code, {row["verdict"] for row in rows(out).values()} <= {"", "skipped"}) == (0, True), err
    code, out, _ = here("run", "own", *REFERENCE, "--format", "csv", "--out", "b")
    found = rows(out)
    assert code == 1
    assert found["restitution.error", ""]["verdict"] == "fail"
    assert found["restitution.error", ""]["reason"] == "too strict"
    assert found["contact.gap", "floor-ball"]["verdict"] == "pass"
    assert found["overlap.max", ""]["verdict"] == ""
    code, out, _ = here("run", "ours.toml", *REFERENCE, "--format", "csv", "--out", "c")
    assert rows(out)["overlap.max", ""]["verdict"] == "pass"


def test_a_file_adds_limits_and_replaces_ours(here, tmp_path):
    """`--limits` judges what had no limit, replaces ours where it covers a row, and removes by inf."""
    (tmp_path / "l.toml").write_text(
        '[[limits]]\nmetric = "time.read"\nlargest = 0\n'
        '[[limits]]\nmetric = "contact.gap"\nlargest = inf\nscenario = "bounce_e05"\n'
    )
    run = ("run", "bounce_e05", *REFERENCE, "--format", "csv")
    code, out, _ = here(*run, "--limits", "l.toml", "--out", "a")
    found = rows(out)
    assert (code, found["time.read", ""]["verdict"], found["time.read", ""]["reason"]) == (
        1,
        "fail",
        "limit of the file",
    )
    assert found["contact.gap", "floor-ball"]["limit"] == ""
    assert rows(here(*run, "--out", "b")[1])["contact.gap", "floor-ball"]["verdict"] == "pass"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('[[limits]]\nmetric = "overlap.mx"\nlargest = 1', "l.toml:2: limits[0].metric: unknown metric"),
        ('[[limits]]\nmetric = "overlap.max"', "l.toml:1: limits[0].largest: missing"),
        (
            '[[limits]]\nmetric = "work"\nlargest = 1\nmost = 2',
            "l.toml:4: limits[0].most: unknown field 'most'",
        ),
        ('[[limits]]\nmetric = "work"\nlargest = 1\nengine = "bulet"', "l.toml:4: limits[0].engine: unknown"),
        ("limit = 1", "l.toml:1: limits: missing"),
    ],
)
def test_wrong_limits_exit_with_their_line(touchstone, tmp_path, text, line):
    """Name file, line and field, and exit with 2 before anything is played."""
    (tmp_path / "l.toml").write_text(text)
    code, out, err = touchstone("run", "fall", "--limits", "l.toml")
    assert (code, out) == (2, "")
    assert line in err


def test_metrics_by_pattern(here):
    """A pattern reports every metric that fits; one that fits none names the nearest."""
    code, out, _ = here("run", "slide", *REFERENCE, "--metric", "friction.*", "--format", "csv", "--out", "a")
    metrics = {row["metric"] for row in csv.DictReader(io.StringIO(out))}
    assert code == 0
    assert "friction.stop" in metrics
    assert all(name.startswith("friction.") for name in metrics)
    code, _, err = here("run", "slide", *REFERENCE, "--metric", "frction.*")
    assert (code, "unknown metric 'frction.*'; did you mean 'friction." in err) == (2, True)


def test_what_show_prints_is_a_scene_file(touchstone, tmp_path):
    """The JSON of `show` can be shown, with the same bodies; `schema` prints what describes it."""
    _, out, _ = touchstone("show", "ball_snip", "--format", "json")
    (tmp_path / "again.json").write_text(out)
    assert touchstone("show", "again.json", "--format", "json")[1] == out
    code, out, _ = touchstone("schema")
    assert (code, json.loads(out)["title"]) == (0, "touchstone scene")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("run", "none.toml"), "touchstone: none.toml: No such file or directory"),
        (("run", "none.py"), "touchstone: none.py: No such file or directory"),
        (("run", "fal"), "touchstone: unknown scenario 'fal'; did you mean 'fall'"),
        (("run", "fall", "fall.json"), "fall.json: two scenes of this run are called 'fall'"),
        (("show", "bad.json"), "touchstone: bad.json:2: duration: found 'x', expected a valid number"),
        (("show", "limit.json"), "limit: limits[0].metric: unknown metric 'overlap'"),
    ],
)
def test_wrong_files_exit_with_one_line(touchstone, tmp_path, arguments, line):
    """Exit with 2 and the file's name, without a traceback."""
    text = scene_json(catalogue()["fall"])
    (tmp_path / "fall.json").write_text(text)
    (tmp_path / "bad.json").write_text('{"coefficients": [], "bodies": [],\n "duration": "x"}')
    limited = replace(catalogue()["fall"], name="limit", limits=(MetricLimit("overlap", 1.0),))
    (tmp_path / "limit.json").write_text(scene_json(limited))
    arguments = ("run", *arguments[1:]) if "limit.json" in arguments else arguments
    code, out, err = touchstone(*arguments)
    assert (code, out) == (2, "")
    assert line in err
    assert "Traceback" not in err
