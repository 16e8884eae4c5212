"""The compile cache, and one signature per kernel."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import touchstone.reference_impl
from touchstone.reference_impl.core.kernel_cache import (
    noted_seconds,
    read_entry,
    remove_old_folders,
    source_key,
    write_entry,
)

SOURCE = Path(touchstone.reference_impl.__file__).resolve().parent
ROOT = SOURCE.parent

INNER = """
from touchstone.reference_impl.core.kernel import kernel


@kernel
def inner(x):
    return x + 1.0
"""
OUTER = """
from touchstone.reference_impl.inner import inner
from touchstone.reference_impl.core.kernel import kernel


@kernel
def outer(x):
    return inner(x)
"""

SIGNATURES = """
import json
from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import Player
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.reference_impl.core import kernel
from touchstone.reports.studies.inverse_kinematics import rows
from touchstone.scenarios.catalogue import catalogue

engine, scenario = ReferenceEngine(), catalogue()["ball_snip"]
for profile, dt in engine.profiles.items():
    player = Player(engine.build(scenario, Settings(profile, dt)), scenario, Settings(profile, dt))
    player.play(scenario.frame_count)
    player.world.cross()
rows(30, 0, lambda label, count: None)
found = {}
for one in kernel.KERNELS:
    # the cache has a file for every signature, also of kernels that were compiled into others
    name = f"{one.py_func.__module__}.{one.py_func.__qualname__}"
    found[name] = len({path.name.rsplit(".", 2)[0] for path in kernel.CACHE_FOLDER.glob(f"{name}.*.*.nbc")})
print(json.dumps(found))
"""


def fresh(code: str, **environment: str) -> str:
    """Standard output of Python code in a fresh process."""
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


FORKS = """
import json, os, sys, traceback
import numba.core.caching, numba.extending

for line in sys.stdin:
    code, folder, environment = json.loads(line)
    if process := os.fork():
        print(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), flush=True)
        continue
    os.chdir(folder)
    os.environ.update(environment)
    sys.path[0] = folder
    for k, name in ((1, "out.txt"), (2, "err.txt")):
        os.dup2(os.open(name, os.O_CREAT | os.O_TRUNC | os.O_WRONLY), k)
    try:
        exec(code, {"__name__": "__main__"})
    except BaseException:
        traceback.print_exc()
        os._exit(1)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)
"""
"""Runs code in forks of a process that has imported Numba, which takes most of the time of a fresh one."""


@pytest.fixture(scope="module")
def forks() -> Iterator[subprocess.Popen[str]]:
    """A process that runs FORKS."""
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", FORKS], stdin=pipe, stdout=pipe, text=True) as process:
        yield process
        process.stdin.close()


@pytest.fixture
def run(forks: subprocess.Popen[str]) -> Callable[..., str]:
    """As `fresh`, in a fork of a process in which Numba is imported, and none of our modules."""

    def forked(code: str, **environment: str) -> str:
        folder = Path(environment["PYTHONPATH"])
        print(json.dumps((code, str(folder), environment)), file=forks.stdin, flush=True)
        assert forks.stdout.readline() == "0\n", (folder / "err.txt").read_text()
        return (folder / "out.txt").read_text()

    return forked


@pytest.fixture
def package(tmp_path: Path) -> dict[str, str]:
    """A package of `kernel*.py` and two kernels, one calling the other; the environment that finds it."""
    folder = tmp_path / "touchstone" / "reference_impl"
    core = folder / "core"
    core.mkdir(parents=True)
    (folder.parent / "__init__.py").touch()
    (folder / "__init__.py").touch()
    (core / "__init__.py").touch()
    for source in (SOURCE / "core").glob("kernel*.py"):
        (core / source.name).write_bytes(source.read_bytes())
    (folder / "inner.py").write_text(INNER)
    (folder / "outer.py").write_text(OUTER)
    return {"PYTHONPATH": str(tmp_path), "TOUCHSTONE_CACHE": str(tmp_path / "cache")}


CALL = (
    "from touchstone.reference_impl.outer import outer; "
    "from touchstone.reference_impl.core import kernel; print(outer(1.0)); "
)
FOLDER = "print(kernel.CACHE_FOLDER)"
COUNT = "print(kernel.compile_count())"


@pytest.fixture
def named(package: dict[str, str]) -> dict[str, str]:
    """The package with every kernel named, though it is small, and a third one between the two, inlined."""
    folder = Path(package["PYTHONPATH"]) / "touchstone" / "reference_impl"
    linking = folder / "core" / "kernel_linking.py"
    linking.write_text(re.sub(r"LINES_COPIED = \d+", "LINES_COPIED = 0", linking.read_text()))
    (folder / "middle.py").write_text(
        OUTER.replace("import kernel", "import inlined_kernel").replace("@kernel", "@inlined_kernel")
    )
    (folder / "outer.py").write_text(OUTER.replace("inner import inner", "middle import outer as inner"))
    return package


SYMBOLS = (
    "from touchstone.reference_impl.core import kernel_linking; print(*sorted(kernel_linking._owners)); "
)


@pytest.mark.parametrize(("made", "kernels"), [("package", "2"), ("named", "3")])
def test_an_edited_inner_kernel_reaches_its_callers(run, request, made: str, kernels: str) -> None:
    """Compile the caller again when a kernel in another file changes, copied or named, and only then."""
    package = request.getfixturevalue(made)
    assert run(CALL + COUNT, **package).split() == ["2.0", kernels]
    assert run(CALL + COUNT, **package).split() == ["2.0", "0"]
    inner = Path(package["PYTHONPATH"]) / "touchstone" / "reference_impl" / "inner.py"
    inner.write_text(INNER.replace("1.0", "100.0"))
    assert run(CALL + COUNT, **package).split() == ["101.0", kernels]
    inner.write_text("# comment\n" + INNER.replace("1.0", "100.0"))
    assert run(CALL + COUNT, **package).split() == ["101.0", "0"]


def test_an_edit_between_imports_stays_out_of_the_cache(run, package: dict[str, str]) -> None:
    """Keep code that was imported after an edit out of the folder of the sources before it."""
    inner = Path(package["PYTHONPATH"]) / "touchstone" / "reference_impl" / "inner.py"
    edit = "from touchstone.reference_impl.core import kernel; import pathlib; "
    edit += f"file = pathlib.Path({str(inner)!r}); "
    edit += "file.write_text(file.read_text().replace('1.0', '100.0')); "
    for _ in range(2):
        assert run(edit + CALL, **package).split() == ["101.0"]
        inner.write_text(INNER)
        assert run(CALL, **package).split() == ["2.0"]


def test_a_named_kernel_is_called_after_a_load(run, named: dict[str, str]) -> None:
    """Call a kernel by its symbol in the process that compiled it, and in one that loaded its caller."""
    first = run(CALL + COUNT + ";" + SYMBOLS, **named).split()
    assert first[:2] == ["2.0", "3"]
    assert [symbol.rpartition(".")[0] for symbol in first[2:]] == ["touchstone.reference_impl.inner.inner"]
    assert run(CALL + COUNT + ";" + SYMBOLS, **named).split() == ["2.0", "0", *first[2:]]


def test_a_kernel_may_recurse(run, named: dict[str, str]) -> None:
    """Compile a kernel that calls itself, called by another kernel."""
    inner = Path(named["PYTHONPATH"]) / "touchstone" / "reference_impl" / "inner.py"
    inner.write_text(INNER.replace("return x", "if x < 3.0:\n        return inner(x + 1.0)\n    return x"))
    for _ in range(2):
        assert run(CALL, **named).split() == ["4.0"]


def test_every_signature_has_its_symbol(run, named: dict[str, str]) -> None:
    """Give a kernel a name of its own for every signature, the same in every process."""
    middle = Path(named["PYTHONPATH"]) / "touchstone" / "reference_impl" / "middle.py"
    middle.write_text(middle.read_text().replace("inner(x)", "inner(x) + inner(int(x))"))
    first = run(CALL + SYMBOLS, **named).split()
    assert first[0] == "4.0"
    assert len(set(first[1:])) == 2
    assert run(CALL + SYMBOLS, **named).split() == first


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "emptied": lambda data: b"",
    "halved": lambda data: data[: len(data) // 2],
    "last byte lost": lambda data: data[:-1],
    "zeros": lambda data: bytes(len(data)),
    "zeros in the middle": lambda data: data[:1000] + bytes(len(data) - 2000) + data[-1000:],
    "garbage": lambda data: bytes(range(256)) * (len(data) // 256),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_is_noticed(tmp_path: Path, damage: str) -> None:
    """Read a file that was not written to its end, or was overwritten, as one that is missing; remove it."""
    entry, content = tmp_path / "entry.nbc", os.urandom(10_000)
    write_entry(entry, content)
    assert read_entry(entry) == content
    entry.write_bytes(DAMAGES[damage](entry.read_bytes()))
    assert read_entry(entry) is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("kernel", "how"),
    [("inner", "damaged"), ("outer", "damaged"), ("inner", "lost"), ("inner", "unreadable")],
)
def test_an_entry_that_cannot_be_read_is_compiled_again(run, named, kernel: str, how: str) -> None:
    """Compile a named kernel whose file is damaged or missing before its caller is loaded, and the caller."""
    folder = Path(run(CALL + FOLDER, **named).split()[1])
    (entry,) = folder.glob(f"*{kernel}.{kernel}[.-]*.nbc")
    content = entry.read_bytes()
    entry.unlink()
    if how == "damaged":
        entry.write_bytes(DAMAGES["halved"](content))
    elif how == "unreadable":
        entry.mkdir()  # for root too
    *told, value, count = run("import sys; sys.stderr = sys.stdout; " + CALL + COUNT, **named).splitlines()
    assert (value, count) == ("2.0", "1")
    if how == "unreadable":
        assert told[0].endswith("Is a directory; kernels compile in every process")
    else:
        assert run(CALL + COUNT, **named).split() == ["2.0", "0"]


@pytest.mark.parametrize("call", ["write_bytes", "replace"])
def test_a_disk_that_fills_up_ends_no_process(run, named: dict[str, str], call: str) -> None:
    """Compile in memory when no file can be written, with one line, and leave no parts of files."""
    full = "import errno, os, pathlib, sys; sys.stderr = sys.stdout\n"
    full += (
        f"def fail(*_): raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))\npathlib.Path.{call} = fail\n"
    )
    told, value, folder = run(full + CALL + FOLDER, **named).splitlines()
    assert value == "2.0"
    assert told == (
        f"touchstone: kernel cache {folder}: No space left on device; kernels compile in every process"
    )
    assert [one.name for one in Path(folder).iterdir() if not one.name.startswith("sources-")] == []
    assert run(CALL + COUNT, **named).split() == ["2.0", "3"]


SPACE = """
import shutil
from pathlib import Path
free = {free}
usage = shutil.disk_usage
shutil.disk_usage = lambda path: usage(path)._replace(free=free.get(Path(path).parents[1].name, 0))
"""


def test_a_full_disk_falls_back(run, package: dict[str, str], tmp_path: Path) -> None:
    """Take the next folder where space is less than the kernels need, and none where all disks are full."""
    environment = {**package, "XDG_CACHE_HOME": str(tmp_path / "home")}
    ask = CALL + FOLDER + "; from touchstone.reference_impl.core import kernel_cache as c; print(c.REJECTED)"
    first, second = str(tmp_path / "cache"), str(tmp_path / "home" / "touchstone")
    value, folder, rejected = run(SPACE.format(free={"touchstone": 10**9}) + ask, **environment).splitlines()
    assert value == "2.0"
    assert Path(folder).is_relative_to(second)
    assert rejected == str([f"{first}/kernels: 0 MB free, 100 MB needed"])
    value, folder, rejected = run(SPACE.format(free={}) + ask, **environment).splitlines()
    assert (value, folder, rejected.count("0 MB free")) == ("2.0", "None", 3)


def test_a_complete_folder_need_not_be_written(run, package: dict[str, str]) -> None:
    """Use a folder with all kernels where its disk is full or read-only."""
    folder = Path(run(CALL + FOLDER, **package).split()[1])
    (folder / "compile_seconds.txt").write_text("1.0")
    locked = "import errno, os, pathlib\n"
    locked += "def fail(*_, **__): raise OSError(errno.EROFS, os.strerror(errno.EROFS))\n"
    locked += "os.utime = pathlib.Path.touch = pathlib.Path.write_bytes = fail\n"
    code = SPACE.format(free={}) + locked + CALL + COUNT + ";" + FOLDER
    assert run(code, **package).split() == ["2.0", "0", str(folder)]


def test_processes_share_a_cold_cache(named: dict[str, str]) -> None:
    """Compile the same kernels in several processes at once, each with the right answer."""
    with ThreadPoolExecutor() as pool:
        answers = [pool.submit(fresh, CALL, **named) for _ in range(3)]
        assert [one.result().split() for one in answers] == [["2.0"]] * 3
    assert fresh(CALL + COUNT, **named).split() == ["2.0", "0"]


def test_numba_has_the_parts_that_naming_uses() -> None:
    """Notice a version of Numba that lacks a private part, before compilation becomes slow."""
    kernel_linking = pytest.importorskip("touchstone.reference_impl.core.kernel_linking")
    assert kernel_linking.missing_parts() == []
    assert kernel_linking.missing_parts([(Path, "no_part")]) == ["Path.no_part"]


PLAIN = """
import warnings
from numba.core import caching

del caching.CompileResultCacheImpl
with warnings.catch_warnings(record=True) as found:
    warnings.simplefilter("always")
    from touchstone.reference_impl.outer import outer
print(outer(1.0))
for one in found:
    print(one.message)
"""


def test_kernels_are_linked_plainly_without_a_part(run, named: dict[str, str]) -> None:
    """Copy kernels into their callers, with one warning, where Numba lacks a part; mix no cache entries."""
    for _ in range(2):
        value, warning = run(PLAIN, **named).splitlines()
        assert value == "2.0"
        assert "numba has no" in warning
        assert "CompileResultCacheImpl" in warning
        assert run(CALL, **named).split() == ["2.0"]


def test_kernels_run_uncompiled(named: dict[str, str]) -> None:
    """Leave the naming of kernels out where nothing is compiled."""
    code = CALL + "import sys; print('touchstone.reference_impl.core.kernel_linking' in sys.modules)"
    assert fresh(code, NUMBA_DISABLE_JIT="1", **named).split() == ["2.0", "False"]


def test_constants_and_numbers_share_a_signature(run, package: dict[str, str]) -> None:
    """Compile a kernel once for the constants that callers hand to it."""
    outer = Path(package["PYTHONPATH"]) / "touchstone" / "reference_impl" / "outer.py"
    outer.write_text(OUTER.replace("return inner(x)", "return inner(1) + inner(2) + inner(int(x))"))
    counted = "print(*(len(k.signatures) for k in kernel.KERNELS if k.py_func.__name__ == 'inner'))"
    assert run(CALL + counted, **package).split() == ["7.0", "0", "1"]  # called by kernels only


def test_an_unwritable_cache_falls_back(run, package: dict[str, str], tmp_path: Path) -> None:
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


def test_a_source_with_a_syntax_error_has_a_key(tmp_path: Path) -> None:
    """Find a key while a source that may not be imported is edited."""
    (tmp_path / "a.py").write_text("def f(:\n")
    assert source_key(tmp_path)


def test_old_cache_folders_are_removed(tmp_path: Path) -> None:
    """Keep the folders that were used last."""
    for age in range(5):
        folder = tmp_path / f"folder_{age}"
        folder.mkdir()
        (folder / "entry").touch()
        os.utime(folder, (1e9 - age, 1e9 - age))
    remove_old_folders(tmp_path, 3)
    assert sorted(one.name for one in tmp_path.iterdir()) == ["folder_0", "folder_1", "folder_2"]


@pytest.mark.parametrize("text", ["", "\0\0\0\0", "1.0.0", "nan", "inf", "-1"])
def test_a_damaged_note_is_none(tmp_path: Path, text: str) -> None:
    """Take kernels as not compiled where the time that a compilation notes at its end makes no sense."""
    assert noted_seconds(tmp_path) is None
    note = tmp_path / "compile_seconds.txt"
    note.write_text("37.35")
    assert noted_seconds(tmp_path) == 37.35
    note.write_text(text)
    assert noted_seconds(tmp_path) is None


@pytest.mark.slow
def test_every_kernel_has_one_signature() -> None:
    """Compile every kernel, each for one signature, by playing `ball_snip` in all profiles, and the
    arm's inverse kinematics.

    Runs on a cache of its own: other tests call kernels with other kinds of array.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    found = json.loads(
        fresh(SIGNATURES, TOUCHSTONE_CACHE=f"{home}/touchstone-signatures", PYTHONPATH=str(ROOT))
    )
    assert len(found) > 120
    unused = sorted(name for name, count in found.items() if count == 0)
    assert unused == []
    assert {name: count for name, count in found.items() if count != 1} == {}
