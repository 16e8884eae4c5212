"""The pytest plug-in: fixtures, markers, options, readable failures and properties, in a session of its
own."""

import multiprocessing
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import touchstone as ts
from touchstone.reports.assertions.invariants import check
from touchstone.reports.assertions.player import PlayCache
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.solids import ball, block, slab

ROOT = Path(__file__).resolve().parents[3]
TESTS = """
import pathlib

import pytest
import touchstone as ts


@pytest.mark.engine("toy_engine:ToyEngine")
@pytest.mark.scenario("bounce_e05", "slide")
def test_sound(play, scenario, engine):
    ts.assert_no_overlap(play(scenario, engine), limit=0.02)


@pytest.mark.engine("toy_engine:ToyEngine")
@pytest.mark.scenario("bounce_e05")
def test_broken(play, scenario, engine):
    ts.assert_no_overlap(play(scenario, engine), limit=1e-3)


@pytest.mark.engine("faulty_engine:Faulty")
def test_faulty(play, engine):
    play("bounce_e05", engine)


def test_default(play, engine):
    assert engine == "reference"
    assert play("fall") is play("fall", engine)


@pytest.mark.parametrize("engine", [1])
def test_own_argument(engine):
    assert engine == 1


def test_unknown(play):
    play("bounce_e5", "toy_engine:ToyEngine")


def test_misspelt_engine(play):
    play("fall", "mujocco")


@pytest.mark.scenario("mine.toml")
def test_file(play, scenario):
    run = play(pathlib.Path("mine.toml"), "toy_engine:ToyEngine")
    assert play(scenario, "toy_engine:ToyEngine") is run
    ts.assert_no_overlap(run, limit=1e-3)


def test_several(play):
    play("several.py")
"""
SEVERAL = """
from touchstone.scenarios.catalogue import catalogue, scene

@scene
def two():
    return catalogue()["fall"], catalogue()["slide"]
"""
KEEPING = """
import pytest


def test_first(play):
    import touchstone as ts

    ts.assert_no_overlap(play("bounce_e05", "toy_engine:ToyEngine"), limit=0.02)


test_second = test_first


@pytest.fixture
def sound(play):
    test_first(play)


def test_third(sound):
    pass
"""
FAULTY = """
from toy_engine import ToyEngine, ToyWorld

class Faulty(ToyEngine):
    name = "faulty"
    def build(self, scenario, settings):
        raise RuntimeError("no licence")
"""


@pytest.fixture
def session(tmp_path):
    """Run pytest with the plug-in in a fork, in a folder with the toy engine: (exit code, output)."""
    shutil.copy(ROOT / "docs" / "toy_engine.py", tmp_path)
    (tmp_path / "faulty_engine.py").write_text(FAULTY)

    def run(*arguments: str, cached: bool = False) -> tuple[int, str]:
        process = multiprocessing.get_context("fork").Process(target=inside, args=(cached, *arguments))
        process.start()
        process.join()
        return process.exitcode, (tmp_path / "out.txt").read_text()

    def inside(cached: bool, *arguments: str) -> None:
        os.chdir(tmp_path)
        sys.path.insert(0, str(tmp_path))
        out = os.open("out.txt", os.O_CREAT | os.O_TRUNC | os.O_WRONLY)
        os.dup2(out, 1)
        os.dup2(out, 2)
        sys.stdout, sys.stderr = (os.fdopen(k, "w", closefd=False) for k in (1, 2))
        # The plug-in may be installed or not; it is loaded once either way.
        os.environ |= {"PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
        cache = "cacheprovider" if cached else "no:cacheprovider"
        code = pytest.main(["-p", "touchstone.reports.pytest_plugin", "-rA", "-p", cache, *arguments])
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)

    return run


def test_fixtures_markers_and_failures(session, tmp_path: Path):
    """Tests play each scene on each engine, skip what an engine refuses, and fail in readable words."""
    (tmp_path / "test_mine.py").write_text(TESTS)
    (tmp_path / "mine.toml").write_text(scene_toml(catalogue()["bounce_e05"]))
    (tmp_path / "several.py").write_text(SEVERAL)
    code, reported = session("--strict-markers", "--junit-xml=out.xml", "test_mine.py")
    assert code == 1
    assert "6 failed, 3 passed, 1 skipped" in reported, reported
    assert "SKIPPED [1]" in reported
    assert "toy: 'box_0' is neither a ball nor a fixed box" in reported
    assert "m, limit 0.001 m: bounce_e05 (toy, default, step 1/240 s)" in reported
    assert "FAILED test_mine.py::test_file[mine.toml] - overlap.max is 0.00" in reported  # the summary
    assert "run mine.toml --engine toy_engine:ToyEngine --profile default --metric overlap.max" in reported
    assert "unknown engine 'mujocco'; did you mean 'mujoco'" in reported
    assert "several.py: 2 scenes; expected a file of one" in reported
    assert "where: floor and ball, in frame" in reported
    assert "test_mine.py:17: ts.assert_no_overlap(play(scenario, engine), limit=1e-3)" in reported
    assert "faulty default on bounce_e05: RuntimeError: no licence (faulty_engine.py, line 7)" in reported
    assert "unknown scene 'bounce_e5'; did you mean 'bounce_e05'" in reported
    assert "Traceback" not in reported
    cases = {case.get("name"): case for case in ElementTree.parse(tmp_path / "out.xml").iter("testcase")}
    case = next(case for name, case in cases.items() if name.startswith("test_broken"))
    kept = {one.get("name"): float(one.get("value")) for one in case.iter("property")}
    assert kept["overlap.max limit [m]"] == 1e-3
    assert kept["overlap.max [m]"] > 1e-3


def test_a_later_session_plays_what_has_changed_only(session, tmp_path: Path):
    """Recordings and refusals are kept, and judged as before; an edited engine plays again."""
    (tmp_path / "test_mine.py").write_text(TESTS)
    asked = ("-k", "test_sound or test_broken", "test_mine.py")
    code, reported = session(*asked, cached=True)
    assert (code, "earlier sessions" in reported) == (1, False), reported
    code, reported = session(*asked, cached=True)
    assert code == 1
    assert "touchstone: 0 runs played, 2 kept from earlier sessions" in reported, reported
    assert "where: floor and ball, in frame" in reported
    assert "toy: 'box_0' is neither a ball nor a fixed box" in reported
    with (tmp_path / "toy_engine.py").open("a") as engine:
        engine.write("# edited\n")
    assert "earlier sessions" not in session(*asked, cached=True)[1]


@pytest.mark.parametrize("workers", [(), pytest.param(("-p", "xdist", "-n", "1"), marks=pytest.mark.slow)])
def test_every_test_keeps_its_measured_values(session, tmp_path: Path, workers):
    """The first test of a session or of a worker has its properties too, also those measured in a fixture."""
    (tmp_path / "test_mine.py").write_text(KEEPING)
    code, reported = session(*workers, "--junit-xml=out.xml", "test_mine.py")
    assert code == 0, reported
    cases = ElementTree.parse(tmp_path / "out.xml").iter("testcase")
    names = {case.get("name"): [one.get("name") for one in case.iter("property")] for case in cases}
    wanted = ["overlap.max [m]", "overlap.max limit [m]"]
    assert names == {"test_first": wanted, "test_second": wanted, "test_third": wanted}


@pytest.mark.slow
@pytest.mark.parametrize("option", ["--touchstone-no-cache", "--cache-clear"])
def test_options_of_the_cache(session, tmp_path: Path, option):
    """Both options play again; the first keeps nothing."""
    (tmp_path / "test_mine.py").write_text(TESTS)
    asked = ("-k", "test_broken", "test_mine.py")
    session(*asked, cached=True)
    assert "earlier sessions" not in session(option, *asked, cached=True)[1]
    assert "1 kept from earlier sessions" in session(*asked, cached=True)[1]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--touchstone-tag", "prob"], "--touchstone-tag prob: unknown (valid: "),
        (["--touchstone-engine", "mujco"], "unknown engine 'mujco'; did you mean 'mujoco'"),
        (["--touchstone-engine", "toy_engine:ToyEngin"], "has no 'ToyEngin'; did you mean 'ToyEngine'?"),
    ],
)
def test_wrong_options_are_one_line(session, arguments, said):
    """An unknown tag or engine ends the session with a usage error that names the valid ones."""
    code, reported = session(*arguments)
    assert code == 4
    assert said in reported
    assert "Traceback" not in reported


@pytest.mark.slow
def test_our_invariants_over_ones_engine(session):
    """`--touchstone-engine` and `--touchstone-tag` run our invariants, without any test file."""
    suite = ("--touchstone-engine", "toy_engine:ToyEngine", "--touchstone-tag", "isolated")
    code, reported = session(*suite, "-k", "collide_central or tumble_stable")
    assert code == 0, reported
    assert "toy_engine:ToyEngine" in reported
    assert "PASSED" in reported
    assert "momentum_kept" in reported


@pytest.mark.slow
def test_a_broken_invariant_of_ours_is_reported_by_its_message(session):
    """A failure begins with what is broken, not with a line of pytest or of ours."""
    suite = ("--touchstone-engine", "toy_engine:ToyEngine", "--touchstone-tag", "isolated")
    code, reported = session(*suite, "-k", "break_15 and order_independent")
    assert code == 1
    assert re.search(r"\norder is 0\.4\d+ m, .*: break_15 \(toy, default, step 1/240 s\)", reported)
    assert "pluggy" not in reported.partition("FAILURES")[2]


def test_the_plugin_imports_nothing_heavy():
    """A session that uses no fixture pays for no import."""
    text = (
        "import sys, touchstone.reports.pytest_plugin;"
        "print([m for m in ('numpy', 'numba', 'pandas', 'coal', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


@pytest.fixture
def recording(registry, tmp_path):
    """A recording and its file."""
    (tmp_path / "run").mkdir()
    path = tmp_path / "run" / "run.npz"
    run = registry.played("fall", "reference")
    run.save(path)
    return run, path


@pytest.fixture
def folder(tmp_path):
    """An empty folder of a cache."""
    home = tmp_path / "cache"
    home.mkdir()
    return home


def test_a_damaged_recording_is_played_again(recording, folder):
    """It is removed, not raised."""
    cache = PlayCache(folder)
    cache.put("a", "done", "", recording[1])
    (folder / "a.npz").write_bytes(recording[1].read_bytes()[:500])
    assert cache.get("a") is None
    assert list(folder.iterdir()) == []


def test_what_is_used_is_kept_longest(recording, folder):
    """Beyond its size the cache loses what was not used for the longest time."""
    cache = PlayCache(folder)
    for age, key in enumerate("abc"):
        cache.put(key, "done", "", recording[1])
        os.utime(folder / f"{key}.npz", (age, age))
    cache.get("a")
    cache.trim(2 * recording[1].stat().st_size)
    assert sorted(path.stem for path in folder.iterdir()) == ["a", "c"]


FRAMES, MOVING = 1000, 19
CALLS = 10 * FRAMES
"""Calls of an assertion [1]: 1563 to 7505 measured; one per frame and body would be 19,000."""
PLACES = [(0.3 * (k % 5), 0.3 * (k // 5), 0.05) for k in range(MOVING)]
BODIES = {
    "balls": [ball(f"b{k}", "wood", 0.05, 1.0, place) for k, place in enumerate(PLACES)],
    "boxes": [block(f"b{k}", "wood", (0.05, 0.05, 0.05), 1.0, place) for k, place in enumerate(PLACES)],
}


def at_rest(kind: str, height: float) -> tuple[Scenario, dict]:
    """Bodies that rest at a height above a floor, and the arrays of their run with all contacts."""
    pairs = (ts.PairCoefficients("wood", "wood", 0.5, 0.5),)
    bodies = (slab("floor", "wood"), *BODIES[kind])
    scenario = Scenario("rest", "bodies at rest", (), bodies, (FRAMES - 1) / 60, pairs)
    position = np.tile([body.position for body in bodies], (FRAMES, 1, 1))
    position[:, 1:, 2] += height + np.random.default_rng(0).normal(0, 1e-6, (FRAMES, MOVING))
    still = np.zeros_like(position)
    count = MOVING * (FRAMES - 1)
    contacts = {
        "time": np.repeat(np.arange(FRAMES - 1) / 60, MOVING),
        "body_a": np.zeros(count, dtype=int),
        "body_b": np.tile(np.arange(1, MOVING + 1), FRAMES - 1),
        "normal": np.tile([0.0, 0.0, 1.0], (count, 1)),
        "impulse": np.tile([0.0, 0.0, 9.81 / 60], (count, 1)),
    }
    orientation = np.tile([body.orientation for body in bodies], (FRAMES, 1, 1))
    given = {"orientation": orientation, "linear_velocity": still, "angular_velocity": still}
    return scenario, {"position": position, **given, "contacts": contacts}


@pytest.mark.parametrize(
    ("kind", "height", "invariant"),
    [
        *((kind, height, "no_overlap") for kind in BODIES for height in (0.0, 0.5)),
        *((kind, 0.0, "no_tunnelling") for kind in BODIES),
        *((kind, 0.0, "energy_not_created") for kind in BODIES),
        ("boxes", 0.0, "friction_cone"),
    ],
)
def test_calls(kind, height, invariant):
    """An assertion makes few calls a frame and none per body: this decides its time, on any machine."""
    scenario, given = at_rest(kind, height)
    if invariant != "friction_cone":
        del given["contacts"]
    calls = Counter()
    for _ in range(2):  # the first fills caches
        run = ts.recording(scenario, **given)
        calls.clear()
        sys.setprofile(lambda frame, event, argument: calls.update([event]))
        try:
            check(invariant, run, scenario, limit=1.0)
        finally:
            sys.setprofile(None)
    assert 0 < calls["call"] + calls["c_call"] < CALLS
