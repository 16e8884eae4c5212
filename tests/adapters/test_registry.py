"""The registry: names that load, hints that help, and nothing imported before it is asked for."""

import re
import shlex
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from touchstone.adapters import registry as module
from touchstone.adapters.contract import AdapterError, NotInstalled
from touchstone.adapters.recorder import substeps
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.scenarios.catalogue import catalogue

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]


@pytest.mark.parametrize("name", ENGINES)
def test_every_entry_loads_as_what_it_says(registry, name):
    """An engine answers to the name and the profiles it is registered under."""
    engine = registry.engine(name)
    assert engine.name == name
    assert engine.profiles == ENGINES[name].profiles
    assert re.match(r"\d+(\.\d+)*", engine.version())


@pytest.mark.parametrize("name", ENGINES)
def test_every_step_divides_the_frame_of_every_scene(name):
    """The native step of every profile fits the frame of every scene of the catalogue."""
    for dt in ENGINES[name].profiles.values():
        for scenario in catalogue().values():
            assert substeps(scenario, dt) == round(1 / scenario.frame_rate / dt)


@pytest.mark.parametrize("name", ENGINES)
def test_the_hint_names_something_pip_can_install(name):
    """The hint for a missing engine names a package that the project requires, itself or by an extra."""
    (asked,) = shlex.split(re.fullmatch(r"not installed \(pip install (.*)\)", missing_reason(name))[1])
    wanted = PROJECT["optional-dependencies"].get(name, PROJECT["dependencies"])
    assert asked in {*wanted, *(re.split("[>;]", one)[0] for one in wanted)}
    assert asked.startswith(ENGINES[name].package)


@pytest.mark.parametrize("package", ["no_such_package", "left_behind"])
def test_a_missing_package_is_told_with_its_hint(monkeypatch, tmp_path, package):
    """An engine without its package, or with its folder alone, is missing; loading it says how to get it."""
    (tmp_path / "left_behind").mkdir()
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = replace(ENGINES["mujoco"], package=package)
    monkeypatch.setitem(module.ENGINES, "mujoco", entry)
    assert not installed("mujoco")
    with pytest.raises(NotInstalled, match="pip install mujoco"):
        load("mujoco")


@pytest.mark.parametrize("ask", [load, installed])
def test_an_unknown_name_is_told_the_valid_ones(ask):
    """A name that is not registered is an AdapterError that lists those that are."""
    with pytest.raises(AdapterError, match=r"unknown engine 'bulet'.*reference, dart, bullet, mujoco"):
        ask("bulet")


def test_looking_imports_no_engine():
    """Asking what is installed imports neither an engine nor numpy's heavy friends."""
    text = (
        "import sys; from touchstone.adapters.registry import ENGINES, installed; "
        "[installed(n) for n in ENGINES];"
        "print([m for m in ('mujoco', 'pybullet', 'dartpy', 'numba', 'coal', 'fcl', 'pandas') "
        "if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_missing_wheel_is_told(monkeypatch):
    """Beyond its last wheel the reason names both versions; up to it, pip alone."""
    entry = ENGINES["bullet"]
    monkeypatch.setitem(ENGINES, "bullet", replace(entry, last_wheel=(3, 8)))
    mine = ".".join(map(str, sys.version_info[:2]))
    assert module.missing_reason("bullet") == (
        "not installed (pip install pybullet; wheels end with Python 3.8, "
        f"on {mine} pip compiles it for minutes in silence)"
    )
    monkeypatch.setitem(ENGINES, "bullet", replace(entry, last_wheel=sys.version_info[:2]))
    assert module.missing_reason("bullet") == "not installed (pip install pybullet)"
