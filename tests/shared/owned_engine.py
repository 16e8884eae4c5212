"""A made-up engine with an environment of its own, which pip finds in a folder of wheels."""

import zipfile
from pathlib import Path

import pytest

from touchstone.adapters.engines.entry import ENGINES, Entry
from touchstone.adapters.registry import own_environment

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


def install_from(wheels: Path, cache: Path, patch: pytest.MonkeyPatch) -> None:
    """Let pip find packages in a folder of wheels alone, and environments be made in a folder of caches."""
    patch.setenv("PIP_NO_INDEX", "1")
    patch.setenv("PIP_FIND_LINKS", str(wheels))
    patch.setenv("XDG_CACHE_HOME", str(cache))


@pytest.fixture
def owned(monkeypatch, tmp_path):
    """A registered engine with an environment of its own, which pip finds in a folder."""
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    own = {"owned_physics/__init__.py": "", "owned_physics/adapter.py": ADAPTER}
    wheel(wheels, "owned_physics", "1.0", own)
    wheel(wheels, CONFLICTING, "99.0", {f"{CONFLICTING}/__init__.py": "VERSION = '99.0'"})
    install_from(wheels, tmp_path / "cache", monkeypatch)
    pins = "owned_physics==1.0", f"{CONFLICTING}==99.0"
    entry = Entry("owned_physics.adapter:Engine", "owned_physics", {"default": 1 / 240}, pins=pins)
    monkeypatch.setitem(ENGINES, "owned", entry)
    return own_environment("owned")
