"""The content hash of a cell changes with everything that decides its result, and with nothing else."""

import os
import subprocess
import sys
from dataclasses import fields, replace

import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.entry import ENGINES, Entry
from touchstone.reports.runner import content_hash
from touchstone.reports.runner.cells import TIMING, Cell
from touchstone.reports.runner.content_hash import hash_of, hash_of_run
from touchstone.scenarios.catalogue import catalogue

CELL = Cell("fall", "mujoco", "recommended", 1 / 240, ("a=1", "b=2"), options=("p=1", "q=2"))
CHANGES = {
    "scenario": "slide",
    "engine": "bullet",
    "profile": "default",
    "dt": 1 / 480,
    "changes": ("a=1", "b=3"),
    "seed": 1,
    "effects": True,
    "measure": "touchstone.reports.machine:machine",
    "source": "touchstone.reports.runner.cells:perturbed_scene",
    "options": ("p=1",),
    "repeat": 1,
}


@pytest.fixture(autouse=True)
def _fresh():
    """No digest of another test is kept."""
    yield
    _fresh_caches()


@pytest.mark.parametrize("field", [field.name for field in fields(Cell)])
def test_every_field_counts(field):
    """A cell that differs in one field has another hash."""
    assert hash_of(replace(CELL, **{field: CHANGES[field]})) != hash_of(CELL)


def test_order_and_process_do_not_count():
    """The order of changes, the process and its random seed leave the hash as it is."""
    reordered = replace(CELL, changes=CELL.changes[::-1], options=CELL.options[::-1])
    assert hash_of(reordered) == hash_of(CELL)
    code = f"from touchstone.reports.runner.{{}} import *; print(hash_of({CELL!r}))"
    code = code.replace("{}", "content_hash").replace("*", "Cell, hash_of")
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONHASHSEED": "7"},
    )
    assert done.stdout.strip() == hash_of(CELL), done.stderr


def test_the_processor_counts_for_timing_only(monkeypatch):
    """Times of another processor are measured again, accuracy is not."""
    before = [hash_of(replace(CELL, measure=measure)) for measure in (CELL.measure, TIMING)]
    content_hash._processor.cache_clear()
    monkeypatch.setattr(content_hash, "machine", lambda: {"processor": "another"})
    after = [hash_of(replace(CELL, measure=measure)) for measure in (CELL.measure, TIMING)]
    assert after[0] == before[0]
    assert after[1] != before[1]


@pytest.mark.parametrize(
    ("engine", "source", "counts"),
    [
        ("reference", "reference_impl/core/rotation.py", True),
        ("mujoco", "reference_impl/core/rotation.py", False),
        ("mujoco", "adapters/engines/mujoco/model.py", True),
        ("mujoco", "adapters/engines/bullet/tables.py", False),
        ("mujoco", "adapters/recorder.py", True),
        ("mujoco", "reports/metrics/contacts/overlap.py", True),
        ("mujoco", "reports/runner/measures.py", True),
        ("mujoco", "reports/runner/sweep.py", False),
        ("mujoco", "scenarios/effects.py", True),
        ("mujoco", "scenarios/families/coin.py", False),
    ],
)
def test_sources_count(monkeypatch, engine, source, counts):
    """An edit of a source that takes part in a run changes the hash, an edit of any other does not."""
    cell = replace(CELL, engine=engine)
    before = hash_of(cell)
    _fresh_caches()
    read = content_hash._text
    edited = (content_hash.ROOT / source).resolve()
    monkeypatch.setattr(content_hash, "_text", lambda path: read(path) + b"#" * (path.resolve() == edited))
    assert edited.exists()
    assert (hash_of(cell) != before) == counts


@pytest.mark.parametrize("package", ["mujoco", "numpy", "coal"])
def test_versions_count(monkeypatch, package):
    """Another version of the engine, of numpy or of a judge is another result."""
    before = hash_of(CELL)
    _fresh_caches()
    reported = content_hash._version
    monkeypatch.setattr(content_hash, "_version", lambda name: reported(name) + "+1" * (name == package))
    assert hash_of(CELL) != before


def test_the_scene_counts(monkeypatch):
    """A scene that was edited under the same name has another hash."""
    before = hash_of(CELL)
    _fresh_caches()
    text = content_hash.scenario_json
    monkeypatch.setattr(content_hash, "scenario_json", lambda one: text(one).replace("9.81", "9.82"))
    assert hash_of(CELL) != before


def _fresh_caches():
    for cached in vars(content_hash).values():
        if hasattr(cached, "cache_clear"):
            cached.cache_clear()
    content_hash._scenes.clear()


@pytest.fixture
def plugged(tmp_path, monkeypatch):
    """An engine of others, in a module with one beside it."""
    (tmp_path / "their_engine.py").write_text("import their_forces\n")
    (tmp_path / "their_forces.py").write_text("G = 9.81\n")
    (tmp_path / "test_theirs.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(ENGINES, "theirs", Entry("their_engine:Theirs", "their_engine", {"default": 1 / 240}))
    return tmp_path


def run_hash(**changes):
    """Hash of a run on that engine, without what another hash has kept."""
    _fresh_caches()
    given = {"scenario": catalogue()["fall"], "settings": Settings("default", 1 / 240), "repeat": 0} | changes
    return hash_of_run(given["scenario"], "theirs", given["settings"], given["repeat"])


def test_a_run_changes_with_all_that_decides_it(plugged, monkeypatch):
    """Scene, settings, repeat, the engine's module and those beside it, and any installed package count."""
    before = run_hash()
    assert run_hash() == before
    found = [
        run_hash(scenario=replace(catalogue()["fall"], duration=0.5)),
        run_hash(settings=Settings("default", 1 / 480)),
        run_hash(settings=Settings("default", 1 / 240, changes=("a=1",))),
        run_hash(repeat=1),
    ]
    (plugged / "their_forces.py").write_text("G = 1.62\n")
    found.append(run_hash())
    monkeypatch.setattr(content_hash, "distributions", lambda: iter(()))
    found.append(run_hash())
    monkeypatch.setattr(content_hash, "_tree", lambda folders: "another recorder")
    found.append(run_hash())
    assert len({before, *found}) == len(found) + 1


def test_tests_beside_an_engine_do_not_count(plugged):
    """An edited test plays nothing again."""
    before = run_hash()
    (plugged / "test_theirs.py").write_text("assert True\n")
    assert run_hash() == before


def test_cells_on_an_engine_of_others_change_with_its_source(plugged):
    """A sweep plays an edited engine again."""
    cell = replace(CELL, engine="theirs", profile="default", changes=())
    before = hash_of(cell)
    (plugged / "their_forces.py").write_text("G = 1.62\n")
    _fresh_caches()
    assert hash_of(cell) != before
