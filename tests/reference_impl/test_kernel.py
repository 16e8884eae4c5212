"""The compile cache, and one signature per kernel."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import reference_impl
from reference_impl.kernel_cache import remove_old_folders, source_key

SOURCE = Path(reference_impl.__file__).parent
ROOT = SOURCE.parent

INNER = """
from reference_impl.kernel import kernel


@kernel
def inner(x):
    return x + 1.0
"""
OUTER = """
from reference_impl.inner import inner
from reference_impl.kernel import kernel


@kernel
def outer(x):
    return inner(x)
"""

SIGNATURES = """
import json
from adapters.engine import Settings
from adapters.record import Player
from adapters.reference_engine import ReferenceEngine
from reference_impl import kernel
from reports.studies.inverse_kinematics import rows
from scenarios.catalogue import catalogue

engine, scenario = ReferenceEngine(), catalogue()["ball_snip"]
for profile, dt in engine.profiles.items():
    player = Player(engine.build(scenario, Settings(profile, dt)), scenario, Settings(profile, dt))
    player.play(scenario.frame_count)
    player.world.cross()
rows(30, 0, lambda label, count: None)
found = {}
for one in kernel.KERNELS:
    # the cache's index knows every signature, also of kernels that were compiled into others
    found[f"{one.py_func.__module__}.{one.py_func.__name__}"] = len(one._cache._cache_file._load_index())
print(json.dumps(found))
"""


def run(code: str, **environment: str) -> str:
    """Standard output of Python code in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=environment["PYTHONPATH"],  # `-c` puts the working folder before the path
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def package(tmp_path: Path) -> dict[str, str]:
    """A package of `kernel*.py` and two kernels, one calling the other; the environment that finds it."""
    folder = tmp_path / "reference_impl"
    folder.mkdir()
    (folder / "__init__.py").touch()
    for source in SOURCE.glob("kernel*.py"):
        (folder / source.name).write_bytes(source.read_bytes())
    (folder / "inner.py").write_text(INNER)
    (folder / "outer.py").write_text(OUTER)
    return {"PYTHONPATH": str(tmp_path), "TOUCHSTONE_CACHE": str(tmp_path / "cache")}


CALL = "from reference_impl.outer import outer; from reference_impl import kernel; print(outer(1.0)); "
FOLDER = "print(kernel.CACHE_FOLDER)"


def test_an_edited_inner_kernel_reaches_its_callers(package: dict[str, str]) -> None:
    """Compile the caller anew when a kernel in another file changes, and only then."""
    count = "print(kernel.compile_count())"
    assert run(CALL + count, **package).split() == ["2.0", "2"]
    assert run(CALL + count, **package).split() == ["2.0", "0"]
    inner = Path(package["PYTHONPATH"]) / "reference_impl" / "inner.py"
    inner.write_text(INNER.replace("1.0", "100.0"))
    assert run(CALL + count, **package).split() == ["101.0", "2"]


def test_constants_and_numbers_share_a_signature(package: dict[str, str]) -> None:
    """Compile a kernel once for the constants that callers hand to it."""
    outer = Path(package["PYTHONPATH"]) / "reference_impl" / "outer.py"
    outer.write_text(OUTER.replace("return inner(x)", "return inner(1) + inner(2) + inner(int(x))"))
    counted = "from reference_impl.inner import inner; print(len(inner.signatures))"
    assert run(CALL + counted, **package).split() == ["7.0", "1"]


def test_an_unwritable_cache_falls_back(package: dict[str, str], tmp_path: Path) -> None:
    """Take the next folder when one cannot be written, and compile without a cache when none can."""
    blocked = tmp_path / "blocked"
    blocked.touch()  # a file where a folder is wanted: unwritable for root too
    home = tmp_path / "home"
    environment = {**package, "TOUCHSTONE_CACHE": str(blocked), "XDG_CACHE_HOME": str(home)}
    value, folder = run(CALL + FOLDER, **environment).split()
    assert value == "2.0"
    assert Path(folder).is_relative_to(home)
    environment |= {"XDG_CACHE_HOME": str(blocked)}
    nowhere = f"import tempfile; tempfile.tempdir = {str(blocked)!r}; "
    assert run(nowhere + CALL + FOLDER, **environment).split() == ["2.0", "None"]


def test_the_cache_is_keyed_by_source(tmp_path: Path) -> None:
    """Change the key with any source's name or text."""
    keys = set()
    for name, text in (("a.py", "x = 1"), ("a.py", "x = 2"), ("b.py", "x = 2"), ("b.py", "x = '2'")):
        for old in tmp_path.glob("*.py"):
            old.unlink()
        (tmp_path / name).write_text(text)
        keys.add(source_key(tmp_path))
    assert len(keys) == 4


def test_comments_and_docstrings_are_no_part_of_the_key(tmp_path: Path) -> None:
    """Keep the key when comments, docstrings or line breaks change, and nothing else."""
    plain = "X = 1\ndef f(x):\n    return 'a', x\n"
    laid_out = (
        "X = 1\n\n\ndef f(x):\n    '''One.'''\n    # two\n    return (\n        'a',\n        x,\n    )\n"
    )
    keys = []
    for text in (plain, f"'''Module.'''\n{laid_out}", plain.replace("'a'", "'b'")):
        (tmp_path / "a.py").write_text(text)
        keys.append(source_key(tmp_path))
    assert keys[0] == keys[1] != keys[2]


def test_old_cache_folders_are_removed(tmp_path: Path) -> None:
    """Keep the folders that were used last."""
    for age in range(5):
        folder = tmp_path / f"folder_{age}"
        folder.mkdir()
        (folder / "entry").touch()
        os.utime(folder, (1e9 - age, 1e9 - age))
    remove_old_folders(tmp_path, 3)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["folder_0", "folder_1", "folder_2"]


@pytest.mark.slow
def test_every_kernel_has_one_signature() -> None:
    """Compile every kernel, each for one signature, by playing `ball_snip` in all profiles, and the
    arm's inverse kinematics.

    Runs on a cache of its own: other tests call kernels with other kinds of array.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    found = json.loads(
        run(SIGNATURES, TOUCHSTONE_CACHE=f"{home}/touchstone-signatures", PYTHONPATH=str(ROOT))
    )
    assert len(found) > 120
    unused = sorted(name for name, count in found.items() if count == 0)
    assert unused == []
    assert {name: count for name, count in found.items() if count != 1} == {}
