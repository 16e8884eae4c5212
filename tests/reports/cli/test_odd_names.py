"""Bodies with any printable name: every output of a run has them as they are."""

import json
import time

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchstone.adapters.registry import installed
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.read import SceneFileError, read_scene
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.truths.pair_names import PairName, ambiguities

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
    engines = [name for name in plays if installed(name)]
    options = [word for name in engines for word in ("--engine", name)]
    code, _, err = here("run", "odd.json", *options, "--profile", "balanced", "--profile", "recommended")
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
        assert all(name in here("show", "odd.json")[1] for name in NAMES)
    assert not any(frame[frame.subject.isin(["", *NAMES])].body_a)
    assert "error" not in set(frame.verdict)
    recording = next((run / "recordings").glob("*.npz"))
    forms = ("mjcf", "urdf", "toml") if document is scene else ("json", "toml")
    for arguments in (
        ("show", "odd.json"),
        ("show", "odd.json", "--effects"),
        ("judge", run),
        ("compare", run, run, "--all"),
        ("view", run, "--no-open"),
        *(("export", "odd.json", "--format", form, "--out", form) for form in forms),
        *(("export", recording, "--format", form, "--out", f"r.{form}") for form in ("glb", "csv")),
    ):
        code, _, err = here(*arguments)
        assert code == 0, (arguments, err)


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
