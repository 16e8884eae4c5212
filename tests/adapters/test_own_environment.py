"""Environments of their own: made from a folder of wheels, whole or absent, and found by children alone."""

import shutil
from dataclasses import replace
from importlib.metadata import version
from types import SimpleNamespace

import pytest
from fake_server import library_version
from owned_engine import ADAPTER, CONFLICTING

from touchstone.adapters.contract import NotInstalled
from touchstone.adapters.engines.entry import ENGINES
from touchstone.adapters.registry import installed, load, missing_reason, own_environment, packages_of
from touchstone.adapters.workers.import_check import try_imports
from touchstone.adapters.workers.play import play
from touchstone.adapters.workers.pool import EngineProcess
from touchstone.scenarios.catalogue import catalogue


def test_an_engine_plays_in_its_environment(owned):
    """Children of the engine find its pins, this process and other engines' children ours; one process that
    plays several engines is replaced for each."""
    assert not installed("owned")
    assert missing_reason("owned") == "not installed (touchstone env add owned)"
    owned.add()
    assert installed("owned")
    assert try_imports(["owned"])["owned"].text == "99.0"
    run = play(catalogue()["fall"], ["owned"])["owned", "default"]
    assert (run.status, run.recording.facts["version"]) == ("done", "99.0")
    ours = version(CONFLICTING)
    assert ours != "99.0"
    child = EngineProcess(library_version, owned.folder.parent / "output.txt")
    found = [
        child.ask("play", SimpleNamespace(engine=engine, library=CONFLICTING))
        for engine in ("owned", "reference", "owned")
    ]
    child.stop()
    assert (found, child.failure) == (["99.0", ours, "99.0"], None)
    with pytest.raises(NotInstalled, match=r"not found in this process, but in .*owned-"):
        load("owned")


def test_the_folder_depends_on_the_pins(owned, monkeypatch):
    """Other pins are another folder; `remove` takes both."""
    owned.add()
    before = owned.folder
    entry = ENGINES["owned"]
    monkeypatch.setitem(ENGINES, "owned", replace(entry, pins=entry.pins[:1]))
    other = own_environment("owned")
    assert packages_of("owned") is None
    other.add()
    assert packages_of("owned") == other.folder != before
    assert set(other.remove()) == {before, other.folder}
    assert list(before.parent.iterdir()) == []


def test_a_broken_environment_is_named(owned):
    """Say which file or package is missing or changed."""
    owned.add()
    assert owned.fault() == ""
    assert owned.size() > len(ADAPTER)
    file = owned.folder / "owned_physics" / "adapter.py"
    file.write_text(ADAPTER + "\n")
    assert owned.fault() == "owned_physics: owned_physics/adapter.py is missing or changed"
    file.unlink()
    assert owned.fault() == "owned_physics: owned_physics/adapter.py is missing or changed"
    said = "its environment is broken: owned_physics: owned_physics/adapter.py is missing or changed"
    assert f"{said} (touchstone env add owned)" in try_imports(["owned"])["owned"].text
    (owned.folder / f"{CONFLICTING}-99.0.dist-info" / "METADATA").unlink()
    (owned.folder / f"{CONFLICTING}-99.0.dist-info").rename(owned.folder / "gone")
    file.write_text(ADAPTER)
    assert owned.fault() == f"{CONFLICTING}==99.0 is missing"
    shutil.rmtree(file.parent)
    said = "its environment is broken: owned_physics: owned_physics/__init__.py is missing or changed"
    assert f"{said} (touchstone env add owned)" in try_imports(["owned"])["owned"].text
