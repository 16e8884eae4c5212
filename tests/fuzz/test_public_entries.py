"""Damaged input at every public entry: an error of the project that names the place, and no traceback."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from fake_world import FakeWorld
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import RecordingError, load
from touchstone.adapters.registry import load as load_engine
from touchstone.reports.cli.main import main
from touchstone.reports.outcome.classes import CLASSES
from touchstone.reports.studies.stability.play import play_scenario
from touchstone.reports.sweep.store import Store, StoreError
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.difficulty.family import hard_scene
from touchstone.scenarios.files.read import SceneFileError, read_scene
from touchstone.scenarios.files.write import scene_data
from touchstone.scenarios.scenario import Scenario, ScenarioError

FUZZ = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
NUMBERS = st.one_of(st.floats(), st.integers(-(10**400), 10**400), st.none(), st.text(max_size=5))
"""Values in place of a number."""
SCRAMBLED = st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=20)
"""Bytes that are changed: place and new value."""


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """Bytes of a valid recording."""
    path = tmp_path_factory.mktemp("saved") / "run.npz"
    record(load_engine("reference"), catalogue()["fall"], Settings("balanced", 1 / 60)).save(path)
    return path.read_bytes()


def damaged(data: bytes, changes, cut: int) -> bytes:
    """Bytes with some of them changed, cut off at an end."""
    found = bytearray(data)
    for place, value in changes:
        found[place % len(found)] = value
    return bytes(found[: len(found) - cut % len(found)])


@FUZZ
@given(changes=SCRAMBLED, cut=st.one_of(st.just(0), st.integers(0, 10**6)))
def test_a_damaged_recording_is_refused_or_read(saved, tmp_path, changes, cut):
    """Bytes of a recording may change anywhere: it is read, or refused with its path."""
    path = tmp_path / "run.npz"
    path.write_bytes(damaged(saved, changes, cut))
    message = ""
    try:
        load(path)
    except RecordingError as error:
        message = str(error)
    assert not message or str(path) in message
    assert "\n" not in message


@FUZZ
@given(content=st.binary(max_size=200))
def test_any_bytes_are_no_recording_and_no_store(tmp_path, content):
    """Random bytes are refused as a recording, and in a store."""
    path = tmp_path / "run.npz"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"run\.npz"):
        load(path)
    store = tmp_path / "store"
    with Store(store).opened():
        (store / "cells" / "one.parquet").write_bytes(content)
    with pytest.raises(StoreError, match=r"one\.parquet"), Store(store).opened() as opened:
        opened.table()


def places(data, path=()):
    """Paths of all values in a nested document."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from places(value, (*path, key))
    elif isinstance(data, list):
        for key, value in enumerate(data):
            yield from places(value, (*path, key))
    yield path


@FUZZ
@given(
    data=st.data(),
    value=st.one_of(NUMBERS, st.lists(NUMBERS, max_size=4), st.dictionaries(st.text(), NUMBERS)),
)
def test_a_changed_scene_file_is_refused_or_a_scene(tmp_path, data, value):
    """Any value of a scene file may be any other: it is a scene, or it is refused with a reason."""
    document = scene_data(catalogue()["bounce_e05"])
    path = data.draw(st.sampled_from([place for place in places(document) if place]))
    inner = document
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(document))
    found: object
    try:
        found = read_scene(file)
    except (SceneFileError, ScenarioError) as error:
        found = str(error)
    assert isinstance(found, Scenario) or found


@FUZZ
@given(text=st.text(max_size=300))
def test_any_text_is_no_scene_file(tmp_path, text):
    """Random text is refused as TOML."""
    file = tmp_path / "scene.toml"
    file.write_text(text, encoding="utf-8", errors="surrogatepass")
    with pytest.raises((SceneFileError, ScenarioError)):
        read_scene(file)


WORDS = st.text(
    st.characters(blacklist_categories=["Cs"], blacklist_characters="\0"), min_size=1, max_size=12
)
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
