"""`touchstone env` and `--install`: one line for each environment, in words that say what to do."""

from pathlib import Path

import pytest

from touchstone.adapters import registry
from touchstone.adapters.engines.entry import ENGINES
from touchstone.reports.cli import doctor


@pytest.fixture(autouse=True)
def only(owned, monkeypatch):
    """The made-up engine is the only one that needs an environment."""
    monkeypatch.setattr(registry, "OURS", {})


def test_an_environment_is_added_listed_and_removed(touchstone, owned):
    """Each command prints one line; what is there is not installed again, and a broken one is."""
    code, out, _ = touchstone("env list --format csv")
    assert (code, out.splitlines()[1:]) == (0, [f"owned,not added,,{owned.folder}"])
    code, out, err = touchstone("env add owned")
    assert (code, err) == (0, "owned: installing 2 packages\n")
    assert out.startswith(f"owned: {owned.folder}, 0 MB, added in ")
    assert touchstone("env add owned") == (0, f"owned: {owned.folder}\n", "")
    (file,) = owned.folder.glob("*/adapter.py")
    file.unlink()
    said = "broken: owned_physics: owned_physics/adapter.py is missing or changed"
    assert doctor.environment_rows() == [("owned folder", f"{said}, 0 MB, {owned.folder}", "broken")]
    assert touchstone("env add owned")[0] == 0
    assert doctor.environment_rows() == [("owned folder", f"ok, 0 MB, {owned.folder}", "")]
    assert touchstone("env remove owned") == (0, f"removed: {owned.folder}\n", "")
    assert touchstone("env remove owned") == (0, "owned: no environment\n", "")


@pytest.mark.spawned
def test_a_run_adds_what_it_needs_if_asked(touchstone, owned):
    """Without `--install` the engine is missing, exit 3; with it the engine plays."""
    run = "run fall --engine owned --quiet"
    code, _, err = touchstone(f"{run} --out missing")
    assert (code, err) == (3, "missing: owned: not installed (touchstone env add owned)\n")
    code, _, err = touchstone(f"{run} --out played --install")
    assert err.splitlines()[0] == "owned: installing 2 packages"
    assert code in (0, 1)  # of first order: it may miss a limit
    assert owned.fault() == ""


FAULTS = {
    "changed": ("mdurl.parse_all(0)", "AttributeError: module 'mdurl' has no attribute 'parse_all'"),
    "dies": ("os.kill(os.getpid(), signal.SIGSEGV)", "died during 'warm up': signal SIGSEGV"),
    "nan": ("self.position[:, 2] *= np.float32('nan')", "diverged: the position of 'ball' is not finite"),
    "broken": ("", "its environment is broken: owned_physics: owned_physics/adapter.py is missing"),
}
"""What goes wrong in an environment -> what a step then does, and what is said of it."""


@pytest.mark.slow
@pytest.mark.spawned
def test_what_fails_in_an_environment_is_one_line(touchstone, owned, monkeypatch):
    """A version without what the adapter uses, a crash of native code, a state that is not finite, and an
    environment with a file less end one column each; the other engine finishes."""
    for name, (line, _) in FAULTS.items():
        monkeypatch.setitem(ENGINES, name, ENGINES["owned"])
        own = registry.own_environment(name)
        own.add()
        adapter = own.folder / "owned_physics" / "adapter.py"
        text = adapter.read_text().replace("def step(self):", f"def step(self):\n        {line}")
        adapter.write_text(f"import os, signal\nimport numpy as np\n{text}")
        if not line:
            adapter.unlink()
    engines = " ".join(f"--engine {name}" for name in (*FAULTS, "mujoco"))
    code, _, err = touchstone(f"run fall {engines} --quiet --out played")
    lines = err.splitlines()
    assert (code, len(lines)) == (5, len(FAULTS))
    for name, (_, said) in FAULTS.items():
        assert sum(f" {name}" in line and said in line for line in lines) == 1
    assert (Path("played") / "results.csv").exists()


@pytest.mark.parametrize("command", ["add", "remove"])
def test_unknown_names_are_one_line(refused, command):
    """Name the engines that have an environment."""
    said = refused(f"env {command} own")
    assert said == "unknown environment 'own'; did you mean 'owned'? (valid: owned)"


def test_what_pip_does_not_find_is_one_line(touchstone, owned, monkeypatch):
    """No wheel: exit 3, and nothing is left."""
    monkeypatch.setenv("PIP_FIND_LINKS", "")
    code, out, err = touchstone("env add owned")
    assert (code, out) == (3, "")
    assert err.splitlines()[1].startswith("touchstone: owned: pip finds no owned for Python 3.")
    assert list(owned.folder.parent.iterdir()) == []
