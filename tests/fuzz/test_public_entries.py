"""Damaged input at every public entry: an error of the project that names the place, and no traceback."""

from __future__ import annotations

import json
import os
import re
import sys
from copy import deepcopy
from dataclasses import replace
from functools import reduce
from operator import getitem
from pathlib import Path
from time import process_time

import numpy as np
import pytest
from fake_world import FakeWorld
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import RecordingError, load
from touchstone.adapters.registry import installed
from touchstone.adapters.registry import load as load_engine
from touchstone.reports.cli.main import main
from touchstone.reports.results import Row
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.store import Done, Store, StoreError
from touchstone.reports.studies.stability.play import play_scenario
from touchstone.reports.verdict.outcomes import CLASSES
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.difficulty.checks import Checks
from touchstone.scenarios.difficulty.family import hard_scene
from touchstone.scenarios.files.read import SceneFileError, read_scene
from touchstone.scenarios.files.tracker_file import TrackerFileError, keyframes
from touchstone.scenarios.files.write import scene_data
from touchstone.scenarios.scenario import Scenario, ScenarioError

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")
EXAMPLES = int(os.environ.get("TOUCHSTONE_FUZZ", "60"))
"""Cases of each kind; a release is tried with 1,000."""
FUZZ = settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
QUICK = settings(
    max_examples=int(os.environ.get("TOUCHSTONE_FUZZ", "15")),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
"""The same where each case runs a command."""
NUMBERS = st.one_of(st.floats(), st.integers(-(10**400), 10**400), st.none(), st.text(max_size=5))
"""Values in place of a number."""
SCRAMBLED = st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=20)
"""Bytes that are changed: place and new value."""
FOREIGN = st.one_of(st.none(), st.binary(max_size=200))
"""Random bytes in place of those of the file."""


RECORDED = ("fall", "stick_slip", "press")
"""Without contacts; with joints and contacts; with a driven body."""


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Bytes of valid recordings, by scene."""
    path, found = tmp_path_factory.mktemp("saved") / "run.npz", {}
    for name in RECORDED:
        record(load_engine("reference"), catalogue()[name], Settings("balanced", 1 / 60)).save(path)
        found[name] = path.read_bytes()
    return found


@pytest.fixture(scope="module")
def cells(tmp_path_factory):
    """Bytes of a valid file of a store."""
    folder = tmp_path_factory.mktemp("cells")
    with Store(folder).opened() as store:
        row = Row("sweep", "fall", "reference", "balanced", 1 / 60, "run", value=1.0)
        store.append([Done(Cell("fall", "reference", "balanced", 1 / 60), (row,), series={"run": [0, 1]})])
        (path,) = (folder / "cells").iterdir()
    return path.read_bytes()


def damaged(data: bytes, changes, cut: int) -> bytes:
    """Bytes with some of them changed, cut off at an end."""
    found = bytearray(data)
    for place, value in changes:
        found[place % len(found)] = value
    return bytes(found[: len(found) - cut % len(found)])


@FUZZ
@given(
    name=st.sampled_from(RECORDED),
    changes=SCRAMBLED,
    cut=st.one_of(st.just(0), st.integers(0, 10**6)),
    foreign=FOREIGN,
)
def test_a_damaged_recording_is_refused_or_read(saved, tmp_path, name, changes, cut, foreign):
    """Bytes of a recording may change anywhere: it is read, or refused with its path, as are random bytes."""
    path = tmp_path / "run.npz"
    path.write_bytes(damaged(saved[name], changes, cut) if foreign is None else foreign)
    message = ""
    try:
        load(path)
    except RecordingError as error:
        message = str(error)
    assert str(path) in message or (not message and foreign is None)
    assert "\n" not in message


@FUZZ
@given(changes=SCRAMBLED, cut=st.one_of(st.just(0), st.integers(0, 10**4)), foreign=FOREIGN)
def test_a_damaged_store_is_refused_or_read(cells, tmp_path, changes, cut, foreign):
    """Bytes of a store's file may change anywhere: it is read, or refused with its path, as are random
    bytes."""
    with Store(tmp_path).opened() as store:
        path = tmp_path / "cells" / "one.parquet"
        path.write_bytes(damaged(cells, changes, cut) if foreign is None else foreign)
        message = ""
        try:
            store.table()
        except StoreError as error:
            message = str(error)
    assert str(path) in message or (not message and foreign is None)
    assert "\n" not in message


def places(data, path=()):
    """Paths of all values in a nested document."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from places(value, (*path, key))
    elif isinstance(data, list):
        for key, value in enumerate(data):
            yield from places(value, (*path, key))
    yield path


def ends(capsys, *arguments: str) -> tuple[int, str]:
    """Exit code of the program, and what it said on standard error."""
    sys.argv = ["touchstone", *arguments]
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main()
    return int(end.value.code or 0), capsys.readouterr().err


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder in which the program runs, with arguments of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", sys.argv)
    return tmp_path


def solid(name, shape, **fields):
    """A simulated body of one shape."""
    piece = {"name": name, "shape": shape}
    return {"name": name, "kind": "simulated", "material": "wood", "mass": 0.3, "pieces": [piece], **fields}


CORNER = [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]]
OF_ALL_KINDS = {
    "duration": 0.2,
    "coefficients": [
        {"material_a": "wood", "material_b": "wood", "restitution": 0.3, "friction": 0.4}
        | {"static_friction": 0.5, "rolling_friction": 1e-3, "torsional_friction": 2e-3}
    ],
    "bodies": [
        {"name": "ground", "kind": "fixed", "material": "wood"}
        | {"pieces": [{"name": "ground", "shape": {"type": "half_space"}}]},
        solid("cone", {"type": "cone", "radius": 0.1, "half_length": 0.1}, position=[0, 0, 0.11]),
        solid("box", {"half_extents": [0.1, 0.1, 0.1], "radius": 0.02}, position=[0.5, 0, 0.13]),
        solid("hull", {"vertices": CORNER, "radius": 0.02}, position=[1, 0, 0.1]),
        solid("can", {"type": "cylinder", "radius": 0.1, "half_length": 0.1}, position=[1.5, 0, 0.5]),
        solid("egg", {"half_axes": [0.1, 0.12, 0.14]}, position=[2, 0, 0.5]),
        solid("pill", {"radius": 0.1, "half_length": 0.1}, position=[2.5, 0, 0.5]),
    ],
    "body_joints": [
        {"name": "hinge", "type": "hinge", "parent": "", "child": "box", "anchor": [0.5, 0, 0.4]}
        | {"axis": [0, 1, 0], "lower": -1, "upper": 1, "damping": 0.1, "target_rate": 2, "largest_force": 3},
        {"name": "slide", "type": "slider", "parent": "cone", "child": "can", "anchor": [1, 0, 0.3]}
        | {"axis": [0, 0, 1], "lower": -0.1, "upper": 0.1, "stiffness": 50},
        {"name": "ball", "type": "ball", "parent": "can", "child": "egg", "anchor": [1.75, 0, 0.5]},
        {"name": "weld", "type": "fixed", "parent": "egg", "child": "pill", "anchor": [2.25, 0, 0.5]},
    ],
    "contact_exclusions": [["cone", "hull"]],
}
"""Each shape, type of joint and law of friction; names and values as a person writes them."""
DOCUMENTS = {
    "all": OF_ALL_KINDS,
    **{name: scene_data(catalogue()[name]) for name in ("bounce_e05", "press", "belt", "turntable")},
    **{name: scene_data(catalogue()[name]) for name in ("gripper_lifts", "slider_crank", "rolls_to_rest")},
}
"""Simulated, driven, moving, prescribed and joined bodies."""


@QUICK
@given(
    data=st.data(),
    name=st.sampled_from(sorted(DOCUMENTS)),
    value=st.one_of(NUMBERS, st.lists(NUMBERS, max_size=4), st.dictionaries(st.text(), NUMBERS)),
)
def test_a_changed_scene_file_is_refused_or_a_scene(here, capsys, data, name, value):
    """Any value of a scene file may be any other: it is a scene, or it is refused in a few lines; its plan
    too."""
    document = deepcopy(DOCUMENTS[name])
    path = data.draw(st.sampled_from([place for place in places(document) if place]))
    reduce(getitem, path[:-1], document)[path[-1]] = value
    (here / "scene.json").write_text(json.dumps(document))
    found: object
    try:
        found = read_scene(here / "scene.json")
    except (SceneFileError, ScenarioError) as error:
        found = str(error)
    assert isinstance(found, Scenario) or found
    code, reported = ends(capsys, "show", "scene.json", "--effects")
    assert code in (0, 2), reported
    assert "Traceback" not in reported
    assert code == 0 or reported.startswith("touchstone: "), reported


def numbers(data) -> list:
    """Numbers of a document with their places."""
    found = ((place, reduce(getitem, place, data)) for place in places(data))
    return [(place, value) for place, value in found if type(value) in (int, float)]


@QUICK
@given(
    data=st.data(),
    name=st.sampled_from(sorted(DOCUMENTS)),
    power=st.one_of(st.integers(-12, 12), st.sampled_from([-300, -30, 30, 300])),
    shift=st.sampled_from([0.0, 1.0, -1.0]),
)
def test_a_scene_of_any_magnitudes_is_refused_or_has_an_outcome(tmp_path, data, name, power, shift):
    """A few numbers of a scene file may have any size and sign: it is refused, or its first frames have an
    outcome within their announced time."""
    document = deepcopy(DOCUMENTS[name])
    document["duration"] = 0.2
    document["expectations"] = document["truths"] = document["forces"] = document["published"] = []
    for place, value in data.draw(st.lists(st.sampled_from(numbers(document)), min_size=1, max_size=3)):
        reduce(getitem, place[:-1], document)[place[-1]] = (value + shift) * 10.0**power
    (tmp_path / "scene.json").write_text(json.dumps(document))
    try:
        scene = read_scene(tmp_path / "scene.json")
    except (SceneFileError, ScenarioError):
        return
    start = process_time()
    shown = replace(scene, duration=min(scene.duration, 12 / scene.frame_rate))
    found = play_scenario(
        load_engine("reference"), shown, Checks(), Settings("balanced", 1 / scene.frame_rate), BUDGET
    )
    assert found.name in CLASSES
    assert found.name != "error", found.reason
    assert "\n" not in found.reason
    assert process_time() - start < SLOWEST


BUDGET, SLOWEST = 2.0, 20.0
"""Time of the frames of a case after which no further one is played, and processor time of a case [s]: a
thousand times what a few frames of at most ten bodies take."""
TRACKER = (
    "time,x,y,z,qw,qx,qy,qz,a,b.angle\n0,0,0,0,1,0,0,0,0,0\n0.5,1,0,0,0,1,0,0,0.5,-1\n1,2,0,0,1,0,0,0,0,1\n"
)


@FUZZ
@given(changes=SCRAMBLED, cut=st.integers(0, 60), packed=st.booleans(), value=NUMBERS)
def test_a_changed_tracker_file_is_refused_or_keyframes(tmp_path, changes, cut, packed, value):
    """Bytes of a CSV or NPZ may change anywhere, or a cell: keyframes, or one line that names the file."""
    path = tmp_path / ("track.npz" if packed else "track.csv")
    if packed:
        np.savez(
            path,
            time=[0.0, 1.0],
            position=np.zeros((2, 3)),
            orientation=[[1, 0, 0, 0]] * 2,
            angle=[[0, 1]] * 2,
        )
    else:
        path.write_text(TRACKER.replace("0.5", str(value), 1), "utf-8", errors="replace")
    path.write_bytes(damaged(path.read_bytes(), changes, cut))
    try:
        found = keyframes(path, ("a", "b"))
    except TrackerFileError as error:
        found, message = {}, str(error)
    else:
        message = f"{path.name}: {', '.join(sorted(found))}"
    assert path.name in message
    assert "\n" not in message
    assert not found or {"times", "positions", "orientations", "angles"} == found.keys()


ROBOT = """<robot name="r"><link name="base"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
<link name="rod"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><cylinder radius="0.02" length="0.4"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="5" velocity="1"/></joint>
<link name="slide"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><sphere radius="0.05"/></geometry></collision></link>
<joint name="k" type="prismatic"><parent link="rod"/><child link="slide"/><origin xyz="0 0 0.4"/>
<axis xyz="0 0 1"/><limit lower="-0.1" upper="0.2" effort="5" velocity="1"/><dynamics damping="0.5"/></joint>
<link name="wheel"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="l" type="continuous"><parent link="base"/><child link="wheel"/><origin xyz="1 0 0"/>
<axis xyz="0 1 0"/><mimic joint="j" multiplier="2" offset="0.1"/></joint></robot>"""
MODEL = """<mujoco model="m"><compiler angle="radian"/><worldbody><geom type="plane" size="1 1 1"/>
<body name="base" pos="0 0 1"><freejoint name="f"/><geom type="box" size="0.1 0.1 0.1" mass="2"/>
<body name="arm" pos="0 0 0.2"><joint name="j" type="hinge" axis="0 1 0" range="-1 1" stiffness="3"
springref="0.1" damping="0.5"/><geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02" mass="1"/>
<body name="tip" pos="0 0 0.3"><joint name="k" type="slide" axis="0 0 1" range="-0.1 0.2"/>
<joint name="l" type="slide" axis="1 0 0"/><geom type="sphere" size="0.03" mass="0.5"/></body></body>
<body name="leg" pos="0 0.2 0"><joint name="b" type="ball" damping="0.1"/>
<geom type="cylinder" size="0.02 0.1" mass="1"/></body></body></worldbody>
<equality><joint joint1="k" joint2="l" polycoef="0 1 0 0 0"/></equality><actuator>
<position joint="j" kp="10" ctrlrange="-1 1" forcerange="-5 5"/>
<motor joint="k" gear="2"/></actuator></mujoco>"""
ROBOTS = {"robot.urdf": ROBOT, "robot.xml": MODEL}
NUMBER = re.compile(r'["\s](-?[0-9.]+)')
READERS = (
    ("check-robot", "{}"),
    ("import", "{}", "--as", "robot", "--force"),
    ("import", "{}", "--as", "robot", "--force", "--free", "--hold"),
)


@QUICK
@pytest.mark.skipif(not installed("mujoco"), reason="the importer needs MuJoCo")
@given(
    name=st.sampled_from(sorted(ROBOTS)),
    reader=st.sampled_from(READERS),
    place=st.integers(0, 200),
    value=NUMBERS,
    changes=SCRAMBLED,
    scrambled=st.booleans(),
)
def test_a_changed_robot_is_refused_or_read(here, capsys, name, reader, place, value, changes, scrambled):
    """Numbers and bytes of a URDF or MJCF may be any other: it is checked or imported, or refused by name."""
    found = list(NUMBER.finditer(ROBOTS[name]))
    one = found[place % len(found)]
    text = ROBOTS[name][: one.start(1)] + str(value).replace('"', "") + ROBOTS[name][one.end(1) :]
    content = text.encode("utf-8", "replace")
    (here / name).write_bytes(damaged(content, changes, 0) if scrambled else content)
    code, reported = ends(capsys, *(word.format(name) for word in reader))
    assert code in (0, 1, 2), reported
    assert "Traceback" not in reported
    assert code != 2 or f"touchstone: {name}" in reported, reported


@FUZZ
@given(text=st.text(max_size=300))
def test_any_text_is_no_scene_file(tmp_path, text):
    """Random text is refused as TOML."""
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8", errors="surrogatepass")
    with pytest.raises((SceneFileError, ScenarioError)):
        read_scene(file)


WORDS = st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="\0"), min_size=1, max_size=9)
ARGUMENTS = st.sampled_from(
    [
        ("run", "{}"),
        ("run", "fall", "--engine", "{}"),
        ("run", "fall", "--profile", "{}"),
        ("run", "fall", "--dt", "{}"),
        ("run", "hard_{}"),
        ("run", "fall", "--set", "{}"),
        ("show", "{}"),
        ("list", "{}"),
        ("study", "stability", "{}"),
        ("study", "relations", "{}"),
        ("soak", "--minutes", "{}"),
        ("soak", "--profile", "{}"),
        ("bench", "{}"),
        ("study", "robustness", "--kind", "{}"),
        ("study", "convergence", "--engine", "{}"),
        ("study", "effects", "{}"),
        ("study", "calibration", "--profile", "{}"),
        ("study", "knobs", "--engine", "{}"),
        ("study", "narrow-phase", "--pairs", "{}"),
        ("study", "{}"),
        ("import", "{}", "--as", "robot"),
        ("import", "--check", "{}"),
        ("check-robot", "{}"),
        ("check-engine", "{}"),
        ("export", "{}", "--format", "glb"),
        ("export", "fall", "--format", "{}"),
        ("view", "{}"),
        ("judge", "{}"),
        ("compare", "{}", "{}"),
        ("tolerances", "{}", "{}"),
        ("tune", "slide", "--engine", "{}"),
        ("tune", "slide", "--engine", "reference", "--position", "{}"),
        ("cheapest", "slide", "--position", "{}"),
        ("tune", "{}", "--engine", "mujoco", "--position", "1mm"),
        ("cheapest", "{}", "--overlap", "1mm"),
        ("reproduce", "{}", "--engine", "mujoco"),
        ("reproduce", "slide", "--engine", "{}"),
        ("reproduce", "slide", "--engine", "mujoco", "--set", "{}"),
        ("sweep", "{}"),
        ("challenge", "{}", "slide"),
        ("sweep", "slide", "--dt", "{}"),
        ("nightly", "--engine", "{}"),
        ("accept", "{}"),
        ("reality", "{}"),
        ("versions", "--engine", "{}"),
        ("env", "add", "{}"),
        ("docs", "{}"),
        ("{}",),
    ]
)


@FUZZ
@given(form=ARGUMENTS, word=WORDS)
def test_wrong_arguments_end_in_one_line(tmp_path, monkeypatch, capsys, form, word):
    """A word in place of an argument: exit code 2 and one line, before anything is played or written."""
    monkeypatch.chdir(tmp_path)
    word = f"?{word}"  # valid nowhere
    monkeypatch.setattr(sys, "argv", ["touchstone", *(part.format(word) for part in form)])
    capsys.readouterr()
    with pytest.raises(SystemExit) as end:
        main()
    reported = capsys.readouterr().err
    assert end.value.code == 2, reported
    assert reported.startswith("touchstone: ")
    assert reported.count("\n") == 1, reported
    assert "Traceback" not in reported
    assert not list(Path(tmp_path).iterdir())


class Damaged:
    """Engine that writes damaged values, or raises, in a step."""

    def __init__(self, where, what, step):
        self.where, self.what, self.when = where, what, step

    def build(self, scenario, chosen):
        self._fail("build")
        return World(self, scenario, chosen)

    def _fail(self, where):
        if self.where == where:
            raise self.what


class World(FakeWorld):
    """Bodies stay where they are until the damage."""

    def step(self):
        super().step()
        if self.steps >= self.fake.when:
            self.fake._fail("step")

    def read(self, state):
        state.position[:] = [body.position for body in self.scenario.bodies]
        if self.steps >= self.fake.when and hasattr(state, self.fake.where):
            if isinstance(self.fake.what, np.ndarray):
                setattr(state, self.fake.where, self.fake.what)
            else:
                getattr(state, self.fake.where)[...] = self.fake.what


STATES = ("position", "orientation", "linear_velocity", "angular_velocity")
DAMAGE = st.one_of(
    st.tuples(st.sampled_from(STATES), st.floats()),
    st.tuples(st.sampled_from(STATES), st.sampled_from([(0,), (1, 2), (7, 3), (2, 4, 4)]).map(np.zeros)),
    st.tuples(
        st.sampled_from(("build", "step")),
        st.sampled_from(
            (ValueError("a\nb"), AdapterError("lost"), KeyError(3), OSError("disk"), MemoryError())
        ),
    ),
)


@FUZZ
@given(damage=DAMAGE, step=st.integers(1, 40))
def test_a_damaged_engine_has_an_outcome(damage, step):
    """An engine that raises, or returns values or shapes that are wrong, gets a class with one line."""
    scenario, checks = hard_scene("hard_strong_gravity_9.81")
    found = play_scenario(Damaged(*damage, step), scenario, checks, Settings("any", 1 / 60))
    assert found.name in CLASSES
    assert "\n" not in found.reason
    if damage[0] in ("build", "step") and step < 40:
        assert found.name in ("error", "gave up")
