"""Environments of their own: made from a folder of wheels, whole or absent, and found by children alone."""

from __future__ import annotations

import sys
import zipfile
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_server import library_version

from touchstone.adapters.contract import NotInstalled
from touchstone.adapters.engines.entry import ENGINES, Entry
from touchstone.adapters.registry import installed, load, missing_reason, own_environment, packages_of
from touchstone.adapters.workers.import_check import try_imports
from touchstone.adapters.workers.own_environment import OwnEnvironmentError
from touchstone.adapters.workers.play import play
from touchstone.adapters.workers.pool import EngineProcess
from touchstone.scenarios.catalogue import catalogue

CONFLICTING = "mdurl"
"""A library of ours of which the made-up engine wants another version."""
ADAPTER = """
from importlib.metadata import version
import mdurl
import touchstone as ts

class Engine:
    name, profiles = "owned", {"default": 1 / 240}
    def version(self):
        return version("mdurl")
    def build(self, scenario, settings):
        return World(scenario, settings)

class World(ts.SimpleWorld):
    engine, version = "owned", mdurl.VERSION
    def step(self):
        self.linear_velocity[self.free] += self.gravity * self.dt
        self.advance()
"""


def wheel(folder: Path, name: str, number: str, files: dict[str, str]) -> None:
    """Write a wheel of pure Python."""
    info = f"{name}-{number}.dist-info"
    files = files | {
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: {number}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    with zipfile.ZipFile(folder / f"{name}-{number}-py3-none-any.whl", "w") as archive:
        for path, text in files.items():
            archive.writestr(path, text)
        rows = (f"{path},,{len(text)}\n" for path, text in files.items())
        archive.writestr(f"{info}/RECORD", "".join(rows))


@pytest.fixture
def owned(monkeypatch, tmp_path):
    """A registered engine with an environment of its own, which pip finds in a folder."""
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    own = {"owned_physics/__init__.py": "", "owned_physics/adapter.py": ADAPTER}
    wheel(wheels, "owned_physics", "1.0", own)
    wheel(wheels, CONFLICTING, "99.0", {f"{CONFLICTING}/__init__.py": "VERSION = '99.0'"})
    for name, value in (
        ("PIP_NO_INDEX", "1"),
        ("PIP_FIND_LINKS", str(wheels)),
        ("XDG_CACHE_HOME", str(tmp_path / "cache")),
    ):
        monkeypatch.setenv(name, value)
    pins = "owned_physics==1.0", f"{CONFLICTING}==99.0"
    entry = Entry("owned_physics.adapter:Engine", "owned_physics", {"default": 1 / 240}, pins=pins)
    monkeypatch.setitem(ENGINES, "owned", entry)
    return own_environment("owned")


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
    assert "owned_physics.adapter" in try_imports(["owned"])["owned"].text
    (owned.folder / f"{CONFLICTING}-99.0.dist-info" / "METADATA").unlink()
    (owned.folder / f"{CONFLICTING}-99.0.dist-info").rename(owned.folder / "gone")
    file.write_text(ADAPTER)
    assert owned.fault() == f"{CONFLICTING}==99.0 is missing"


def test_what_pip_does_not_find_is_one_line(owned, monkeypatch):
    """Without a wheel there is no environment, nor a part of one."""
    monkeypatch.setenv("PIP_FIND_LINKS", "")
    with pytest.raises(OwnEnvironmentError) as found:
        owned.add()
    python = ".".join(map(str, sys.version_info[:2]))
    told = f"owned: pip finds no owned for Python {python}: it is not released, or there is no connection"
    assert str(found.value) == told
    assert list(owned.folder.parent.iterdir()) == []
