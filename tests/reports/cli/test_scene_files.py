"""Scenes from files on the command line: played, shown, judged by their own limits, with any names."""

import csv
import io
import json
import time
from dataclasses import replace

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchstone.adapters.registry import installed
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.read import SceneFileError, read_scene
from touchstone.scenarios.files.write import scene_json, scene_toml
from touchstone.scenarios.scenario import MetricLimit, Scenario
from touchstone.scenarios.truths.pair_names import PairName, ambiguities

REFERENCE = "--engine reference --profile balanced"


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
    code, out, err = here(f"run none.toml {REFERENCE} --format csv --out a")
    assert (code, {row["verdict"] for row in rows(out).values()} <= {"", "skipped"}) == (0, True), err
    code, out, _ = here(f"run own {REFERENCE} --format csv --out b")
    found = rows(out)
    assert code == 1
    assert found["restitution.error", ""]["verdict"] == "fail"
    assert found["restitution.error", ""]["reason"] == "too strict"
    assert found["contact.gap", "floor-ball"]["verdict"] == "pass"
    assert found["overlap.max", ""]["verdict"] == ""
    code, out, _ = here(f"run ours.toml {REFERENCE} --format csv --out c")
    assert rows(out)["overlap.max", ""]["verdict"] == "pass"


def test_commands_name_the_file_of_a_scene(here, tmp_path):
    """A scene of a file is played again by its file, also where the catalogue has another of its name."""
    path = tmp_path / "my scenes" / "fall.toml"
    path.parent.mkdir()
    path.write_text(scene_toml(replace(catalogue()["fall"], duration=0.1, expectations=())))
    _, out, err = here(f"run 'my scenes/fall.toml' {REFERENCE} --metric overlap.max --out a")
    assert "fall.toml: 'fall' alone names another scene, of the catalogue" in err
    report = (tmp_path / "a" / "report.md").read_text()
    assert "Reproduce: `touchstone run 'my scenes/fall.toml'`" in report
    assert "run fall" not in out + report


def test_a_file_adds_limits_and_replaces_ours(here, tmp_path):
    """`--limits` judges what had no limit, replaces ours where it covers a row, and removes by inf."""
    (tmp_path / "l.toml").write_text(
        '[[limits]]\nmetric = "time.read"\nlargest = 0\n'
        '[[limits]]\nmetric = "contact.gap"\nlargest = inf\nscenario = "bounce_e05"\n'
    )
    run = f"run bounce_e05 {REFERENCE} --format csv"
    code, out, _ = here(f"{run} --limits l.toml --out a")
    found = rows(out)
    read = found["time.read", ""]
    assert (code, read["verdict"], read["reason"]) == (1, "fail", "limit of the file")
    assert found["contact.gap", "floor-ball"]["limit"] == ""
    assert rows(here(f"{run} --out b")[1])["contact.gap", "floor-ball"]["verdict"] == "pass"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('[[limits]]\nmetric = "overlap.mx"\nlargest = 1', "l.toml:2: limits[0].metric: unknown metric"),
        ('[[limits]]\nmetric = "overlap.max"', "l.toml:1: limits[0].largest: missing"),
        ('[[limits]]\nmetric = "work"\nlargest = 1\nmost = 2', "l.toml:4: limits[0].most: unknown field"),
        ('[[limits]]\nmetric = "work"\nlargest = 1\nengine = "bulet"', "l.toml:4: limits[0].engine: unknown"),
        ('[[limits]]\nmetric = "work"\nlargest = nan', "l.toml:3: limits[0].largest: found nan, expected"),
        ('[[limits]]\nmetric = "work"\nlargest = -1', "l.toml:3: limits[0].largest: found -1, expected"),
        ("limits = []\nlimit = 1", "l.toml:2: limit: unknown field 'limit'"),
        ("", "l.toml:1: limits: missing"),
    ],
)
def test_wrong_limits_exit_with_their_line(refused, tmp_path, text, line):
    """Name file, line and field, and exit with 2 before anything is played."""
    (tmp_path / "l.toml").write_text(text)
    assert line in refused("run fall --limits l.toml")


def test_metrics_by_pattern(here, refused):
    """A pattern reports every metric that fits; one that fits none names the nearest."""
    code, out, _ = here(f"run slide {REFERENCE} --metric 'friction.*' --format csv --out a")
    metrics = {row["metric"] for row in csv.DictReader(io.StringIO(out))}
    assert code == 0
    assert "friction.stop" in metrics
    assert all(name.startswith("friction.") for name in metrics)
    said = refused(f"run slide {REFERENCE} --metric 'frction.*'")
    assert "unknown metric 'frction.*'; did you mean 'friction." in said


def test_what_show_prints_is_a_scene_file(touchstone, tmp_path):
    """The JSON of `show` can be shown, with the same bodies."""
    _, out, _ = touchstone("show ball_snip --format json")
    (tmp_path / "again.json").write_text(out)
    assert touchstone("show again.json --format json")[1] == out


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("run none.toml", "none.toml: No such file or directory"),
        ("run none.py", "none.py: No such file or directory"),
        ("run fall.txt", "expected a scene file that ends in .toml, .json, .py; touchstone import makes one"),
        ("run fall fall.json", "fall.json: two scenes of this run are called 'fall'"),
        ("show bad.json", "bad.json:1: duration: found 'x', expected a valid number"),
        ("run limit.json", "limit: limits[0].metric: unknown metric 'overlap'"),
        ("run boundless.json", "boundless: limits[0].largest: found -1, expected a number from 0 on"),
    ],
)
def test_wrong_files_exit_with_one_line(refused, tmp_path, command, line):
    """Exit with 2 and the file's name, without a traceback."""
    text = scene_json(catalogue()["fall"])
    for name in ("fall.json", "fall.txt"):
        (tmp_path / name).write_text(text)
    (tmp_path / "bad.json").write_text(json.dumps(json.loads(text) | {"duration": "x"}))
    limited = replace(catalogue()["fall"], name="limit", limits=(MetricLimit("overlap", 1.0),))
    (tmp_path / "limit.json").write_text(scene_json(limited))
    boundless = replace(limited, name="boundless", limits=(MetricLimit("overlap.max", -1.0),))
    (tmp_path / "boundless.json").write_text(scene_json(boundless))
    assert line in refused(command)


NAMES = (
    *("my ball", "-ball", "ball", "ball 2", "ball-2", "[red]ball[/red]", "[/x]", "bäll 球", "a/b", "../x"),
    *("$x^2$", "_hidden", "<b>&\"'", "all", "reference", "run", ":smile:", "%s {0}", "a|b", "`c`", "\\n"),
    *("world", "None", "nan", "0", "a.b", "--out", "x" * 100),
)


def scene(names, fixed="floor [1]"):
    """Document of a scene: balls of these names fall on a floor, a driven ball presses on it."""

    def body(name, kind, shape, **fields):
        piece = {"name": name, "shape": shape}
        return {"name": name, "kind": kind, "material": "wood [a]", "pieces": [piece], **fields}

    ball = {"radius": 0.05}
    simulated = [
        body(name, "simulated", ball, mass=0.2, position=[0.3 * k, 0, 0.12], linear_velocity=[0.5, 0, 0])
        for k, name in enumerate(names)
    ]
    floor = body(fixed, "fixed", {"half_extents": [400, 400, 0.5]}, position=[0, 0, -0.5])
    places = [[0, 0.3, 0.2], [0, 0.3, 0.04]]
    tracker = {"root": "hand-1", "times": [0, 0.6], "positions": places, "orientations": [[1, 0, 0, 0]] * 2}
    return {
        "duration": 0.6,
        "coefficients": [
            {"material_a": "wood [a]", "material_b": "wood [a]", "restitution": 0.5, "friction": 0.3}
        ],
        "bodies": [floor, *simulated, body("hand-1", "driven", ball, mass=0.4)],
        "trackers": [tracker],
        "expectations": [
            {"event": "touch", "body": fixed, "other": names[0], "earliest": 0.0, "latest": 0.5}
        ],
    }


def joined(names):
    """Document of a scene: a ball joint and a hinge of each name; each ball hangs by both from the world."""
    document = scene(names)
    document["bodies"], document["trackers"], document["expectations"] = document["bodies"][:-1], [], []
    balls = document["bodies"][1:]
    for body in balls:
        body["position"][2], body["linear_velocity"] = 2.0, [0, 0, 0]
    document["body_joints"] = [
        {"name": name, "type": kind, "parent": "", "child": ball["name"]}
        | {"anchor": [ball["position"][0], 0, 2.3], "axis": [0, 1, 0]}
        | ({"lower": -0.5, "upper": 0.5, "stiffness": 1.0} if kind == "hinge" else {})
        for k, (name, ball) in enumerate(zip(names, balls))
        for kind in (("hinge", "ball")[k % 2],)
    ]
    return document


@pytest.mark.parametrize("document", [scene, pytest.param(joined, marks=pytest.mark.slow)])
def test_every_output_has_any_name(here, tmp_path, document):
    """Tables, pages, comparisons and exports of a run whose bodies or joints have all odd names at once."""
    (tmp_path / "odd.json").write_text(json.dumps(document(NAMES)))
    plays = ("reference", "mujoco", "dart", "bullet") if document is scene else ("reference", "mujoco")
    engines = " ".join(f"--engine {name}" for name in plays if installed(name))
    code, _, err = here(f"run odd.json {engines} --profile balanced --profile recommended")
    assert code == 0, err
    assert "could not be written" not in err
    assert "is not written" not in err
    run = next((tmp_path / "runs").iterdir())
    frame = pd.read_parquet(run / "results.parquet")
    if document is scene:
        assert "| restitution floor [1]-a\\|b #1 | 0.5" in (run / "report.md").read_text()
        assert {f"floor [1]-{name} #1" for name in NAMES} <= set(frame.subject)
        bounces = frame[frame.metric == "restitution.achieved"]
        assert {("floor [1]", name) for name in NAMES} <= set(zip(bounces.body_a, bounces.body_b))
    else:
        assert all(name in here("show odd.json")[1] for name in NAMES)
    assert not any(frame[frame.subject.isin(["", *NAMES])].body_a)
    assert "error" not in set(frame.verdict)
    recording = next((run / "recordings").glob("*.npz"))
    forms = ("mjcf", "urdf", "toml") if document is scene else ("json", "toml")
    for command in (
        "show odd.json",
        "show odd.json --effects",
        f"judge '{run}'",
        f"compare '{run}' '{run}' --all",
        f"view '{run}' --no-open",
        *(f"export odd.json --format {form} --out {form}" for form in forms),
        *(f"export '{recording}' --format {form} --out r.{form}" for form in ("glb", "csv")),
    ):
        code, _, err = here(command)
        assert code == 0, (command, err)


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (("a\nb",), "bodies[1].name: found 'a\\nb', expected at most 100 printable characters"),
        (("x" * 101,), f"bodies[1].name: found '{'x' * 100}', expected at most 100"),
        (("\u202egnp",), "expected at most 100 printable characters"),
        (("a", "b-c", "a-b", "c"), "'a' and 'b-c' make the same pair as 'a-b' and 'c'; rename one"),
        (("ball", "ball #2"), "bodies[2].name: 'ball #2' reads as a numbered event of 'ball'; rename one"),
    ],
)
def test_names_that_results_cannot_tell_apart_are_refused(tmp_path, names, line):
    """Control characters, overlong names, and names that give two pairs one name, each with its body."""
    path = tmp_path / "s.json"
    path.write_text(json.dumps(scene(names)))
    with pytest.raises(SceneFileError) as refused:
        read_scene(path)
    assert line in str(refused.value)


WORDS = st.lists(
    st.text(st.sampled_from("ab-# 12"), min_size=1, max_size=6), min_size=2, max_size=6, unique=True
)


@given(WORDS)
def test_no_two_pairs_share_a_name(names):
    """The names of any bodies' pairs differ and know both bodies; else the bodies' names are refused."""
    pairs = [PairName(a, b, event) for a in names for b in names if a != b for event in (0, 1, 12)]
    if list(ambiguities(names)):
        return
    assert len(set(pairs)) == len(pairs)
    assert all(str(pair).startswith(f"{pair.body_a}-{pair.body_b}") for pair in pairs)


def test_a_thousand_bodies_are_checked_at_once():
    """Names of a thousand bodies cost no time, and no scene of ours is refused."""
    start = time.process_time()
    assert list(ambiguities([f"box-{k}-{k % 7}" for k in range(1000)])) == []
    assert time.process_time() - start < 0.5
    assert all(isinstance(one, Scenario) for one in catalogue().values())
    assert not any(list(ambiguities([b.name for b in one.bodies])) for one in catalogue().values())
