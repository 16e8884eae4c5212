"""`touchstone versions`: environments of released versions, and what differs between them."""

import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from owned_engine import install_from, wheel

from touchstone.adapters.registry import ENGINES, Entry, own_environment
from touchstone.adapters.workers import pip_calls as module
from touchstone.adapters.workers.environment import VersionError, environment, installed_version
from touchstone.adapters.workers.pip_calls import cache_folder, pip_reason

SAME, LIGHTER, BROKEN = "1.1", "2.0", "3.0"


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A cache folder that the tests of this file share: each version is installed once."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def released(monkeypatch, tmp_path, cache):
    """A registered engine with five released versions, which pip finds in a folder."""
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    for version, text in (
        ("1.0", "FACTOR = 1.0"),
        (SAME, "FACTOR = 1.0"),
        (LIGHTER, "FACTOR = 0.9"),
        (BROKEN, "raise ImportError('libphysics.so.3 is missing')"),
    ):
        files = {"fake_physics.py": f"VERSION = {version!r}\n{text}\n"}
        wheel(wheels, "fake_physics", version, files)
    install_from(wheels, cache, monkeypatch)
    entry = Entry("fake_adapter:Engine", "fake_physics", {"default": 1 / 240}, "fake-physics")
    monkeypatch.setitem(ENGINES, "faked", entry)
    return wheels


def test_the_installed_version_may_be_in_an_environment_of_its_own(released, monkeypatch, tmp_path):
    """Its engine's environment is what plays then, if it has been added."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "own"))
    monkeypatch.setitem(ENGINES, "faked", replace(ENGINES["faked"], pins=("fake-physics==1.0",)))
    assert installed_version("faked") == ""
    own_environment("faked").add()
    assert installed_version("faked") == "1.0"
    assert environment("faked", "1.0") == own_environment("faked").folder


def _command(*versions):
    return "versions --engine faked " + " ".join(f"--version {version}" for version in versions)


@pytest.mark.slow
def test_an_update_that_changes_physics_is_told(touchstone, refused, released, tmp_path):
    """Equal versions are the same to the bit; another law moves bodies by a known distance, exit 1; versions
    that do not exist or cannot be imported are one line each, and the others are compared."""
    command = _command("1.0", SAME, LIGHTER, BROKEN, "9.9")
    code, out, err = touchstone(f"{command} fall --rounds 1 --out found")
    assert "fake-physics 9.9: does not exist for this interpreter; newest: 1.0, 1.1, 2.0, 3.0" in err
    assert f"faked {BROKEN}: cannot be imported: libphysics.so.3 is missing" in err
    assert f"{SAME}: physics: the same to the bit as in 1.0: 1 of 1 run" in out
    # 10 % of the fall of 1 s, in steps
    assert (
        f"{LIGHTER}: physics: the same to the bit as in 1.0: 0 of 1 run; motion differs by up to 493 mm"
        in out
    )
    assert code == 1
    frame = pd.read_parquet("found/results.parquet")
    assert sorted(set(frame.version)) == ["1.0", SAME, LIGHTER]
    assert set(frame.engine) == {"faked"}
    changed = pd.read_csv("found/changes.csv", dtype={"version": str})
    assert set(changed.version) == {LIGHTER}
    assert "worse" in set(changed.kind)
    assert (tmp_path / "found" / LIGHTER / "recordings" / "fall-faked-default.npz").exists()
    # `view` shows the versions side by side, in the order of the command
    code, out, err = touchstone("view found fall --no-open")
    assert (code, out, err) == (0, "found/view-fall.html\n", "")
    text = Path("found/view-fall.html").read_text("utf-8")
    names = [f"faked=={version}" for version in ("1.0", SAME, LIGHTER)]
    places = [text.index(f'data-engine="{name}"') for name in names]
    assert places == sorted(places)
    assert f"touchstone versions fall --engine faked --profile default --version {LIGHTER}" in text
    assert not set(names) & set(ENGINES)
    assert "did you mean 'faked==" in refused("view found fall --engine faked --no-open")
    assert not list(cache_folder("engines").glob(".*"))


def test_versions_without_a_difference_are_exit_0(touchstone, released):
    """Nothing is worse: exit 0; the second time nothing is installed."""
    environment("faked", "1.0")
    environment("faked", SAME)
    shutil.rmtree(released)
    code, out, _ = touchstone(f"{_command('1.0', SAME)} fall --rounds 1 --quiet --out found")
    assert (code, out) == (0, "")


@pytest.mark.parametrize(
    ("command", "code", "said"),
    [
        ("versions", 2, "--engine: name the engine"),
        ("versions --engine mujocko --version 1", 2, "did you mean 'mujoco'"),
        ("versions --engine reference --version 1.0", 2, "commits of this program"),
        (_command(), 2, "--version: name released versions"),
        (_command("1.0"), 2, "--version installed: faked is not installed; name two versions"),
        (f"{_command('1.0', '2.0')} fal", 2, "did you mean 'fall'"),
        (_command("../x", "1.0"), 3, "fake-physics ../x: not a version"),
        (f"{_command('1.0', '2.0')} --rounds 0", 2, "--rounds"),
    ],
)
def test_wrong_arguments_are_one_line(touchstone, released, command, code, said):
    """Each says what is wrong and what would be right; nothing is written."""
    found, out, err = touchstone(command)
    assert (found, out) == (code, "")
    assert said in err
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/usr/bin/python3: No module named pip", "pip is missing: "),
        ("ERROR: ... (from versions: none)\nERROR: No matching", "pip finds no mujoco: it is not released"),
        (
            "ERROR: Cannot install a and b: conflicting dependencies\nERROR: ResolutionImpossible",
            "beside numpy",
        ),
        ("  RuntimeError: PATH is not set\n  [end of output]\nERROR: Failed", "built: RuntimeError: PATH"),
        ("", "cannot be built: pip said nothing"),
    ],
)
def test_why_pip_failed_is_one_line(text, said):
    """The cause, not pip's last line."""
    found = pip_reason(text, "mujoco")
    assert said in found
    assert "\n" not in found


def test_an_interrupted_installation_leaves_nothing(released, monkeypatch):
    """An environment is complete or absent."""

    def interrupted(*arguments, **options):
        raise KeyboardInterrupt

    monkeypatch.setenv("XDG_CACHE_HOME", str(released / "cache"))
    monkeypatch.setattr(module.subprocess, "run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        environment("faked", "1.0")
    assert list(cache_folder("engines").iterdir()) == []
    with pytest.raises(VersionError, match="not a version"):
        environment("faked", "1.0; rm")
