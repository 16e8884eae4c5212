"""The package `touchstone` of the four source folders: from a checkout, and in the wheel."""

import os
import re
import runpy
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
FOLDERS = PROJECT["tool"]["setuptools"]["package-dir"]
SITE = os.pathsep.join(path for path in sys.path if "site-packages" in Path(path).parts)
"""Installed packages without what their path files add: for `python -S`, which finds no editable install."""


def tracked() -> dict[str, str]:
    """Git's mode of every file of the repository; skips where git does not know them."""
    call = ["git", "-C", str(ROOT), "ls-files", "--stage"]
    if not (ROOT / ".git").exists() or shutil.which("git") is None:
        pytest.skip("no git repository")
    lines = subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines()
    modes = (line.split("\t") for line in lines)
    return {name: mode.split()[0] for mode, name in modes if os.path.lexists(ROOT / name)}


def sources() -> set[str]:
    """Paths in the wheel of all files that git tracks in the package."""
    inside = {"touchstone", *FOLDERS.values()}
    names = [name for name in tracked() if name.partition("/")[0] in inside]
    return {name if name.startswith("touchstone/") else f"touchstone/{name}" for name in names}


def test_no_link_is_tracked():
    """A file system without links can hold the repository."""
    assert [name for name, mode in tracked().items() if mode == "120000"] == []


def test_every_package_is_found_in_this_checkout():
    """Every folder with modules is a package, and imports find it where its sources are."""
    folders = {path.parent for layer in FOLDERS.values() for path in (ROOT / layer).rglob("*.py")}
    assert len(folders) > 50
    for folder in folders:
        found = find_spec(".".join(("touchstone", *folder.relative_to(ROOT).parts)))
        assert found is not None, folder
        assert found.origin == str(folder / "__init__.py")


def test_packages_and_their_data_are_listed(monkeypatch):
    """`setup.py` names every package of the sources, and package-data every other file."""
    setuptools = pytest.importorskip("setuptools")
    given: dict[str, list[str]] = {}
    monkeypatch.setattr(setuptools, "setup", lambda **settings: given.update(settings))
    monkeypatch.chdir(ROOT)
    runpy.run_path("setup.py")
    known = sources()
    folders = {name.rpartition("/")[0] for name in known if name.endswith(".py")}
    assert sorted(given["packages"]) == sorted(folder.replace("/", ".") for folder in folders)
    data = PROJECT["tool"]["setuptools"]["package-data"]
    listed = {f"{package.replace('.', '/')}/{pattern}" for package in data for pattern in data[package]}
    others = {name for name in known if not name.endswith(".py")}
    assert [name for name in others if not any(Path(name).match(pattern) for pattern in listed)] == []


@pytest.mark.parametrize(
    "command",
    [
        ("-c", "from touchstone.reports.cli.main import main; main()"),
        ("-m", "pytest", "tests/test_packaging.py"),
        ("-m", "pytest", "-n", "1", "tests/test_packaging.py"),
    ],
)
def test_an_old_install_is_said_in_one_line(command):
    """Without an install that maps the folders, commands and pytest say how to make one, and nothing else."""
    environment = os.environ | {"PYTHONPATH": SITE}
    call = [sys.executable, "-S", *command]
    done = subprocess.run(call, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    line = (
        "touchstone: not installed, or installed before its sources moved; "
        f"run: {sys.executable} -m pip install -e {ROOT}\n"
    )
    assert done.stdout + done.stderr == line


@pytest.fixture
def other(tmp_path: Path) -> Callable[[], str]:
    """What `import touchstone` says in another checkout, `tmp_path`, with this one installed."""
    (tmp_path / "touchstone").mkdir()
    shutil.copy(ROOT / "touchstone" / "__init__.py", tmp_path / "touchstone")
    (tmp_path / "pyproject.toml").touch()

    def said() -> str:
        call = [sys.executable, "-c", "import touchstone"]
        done = subprocess.run(call, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 1
        return done.stdout + done.stderr

    return said


def test_old_links_are_said_in_one_line(other, tmp_path: Path):
    """Links that an older checkout has left are named with the command that removes them."""
    link = tmp_path / "touchstone" / "reports"
    try:
        link.symlink_to(Path("..") / "reports")
    except OSError:
        pytest.skip("no links on this file system")
    assert other() == (
        f"touchstone: links of an older checkout are in the way; run: rm {link} && "
        f"{sys.executable} -m pip install -e {tmp_path}\n"
    )


def test_two_checkouts_are_not_mixed(other, tmp_path: Path):
    """A checkout that is not the installed one says so: it would import the folders of the other.

    The command also removes an install under the earlier name `touchstone`, which would still come first.
    """
    assert other() == (
        f"touchstone: this Python has another checkout installed, {ROOT}; "
        f"run: {sys.executable} -m pip uninstall -y touchstone && "
        f"{sys.executable} -m pip install -e {tmp_path}\n"
    )


def test_no_hint_installs_a_foreign_package():
    """Another project has the name `touchstone` on PyPI, and ours is on no index: no text names either."""
    assert PROJECT["project"]["name"] != "touchstone"
    hint = re.compile(r"pip[3x}]? install\b[^\n`|&;]*?[\s'\"]touchstone(-contact)?(?![\w/.-])")
    found = []
    for name in tracked():
        if name == "tests/test_packaging.py" or Path(name).suffix in (".png", ".npz"):
            continue
        lines = (ROOT / name).read_text("utf-8").splitlines()
        found += [f"{name}: {line}" for line in lines if hint.search(line)]
    assert found == []


@pytest.mark.slow
def test_the_wheel_holds_the_sources(tmp_path: Path):
    """An sdist of the tracked files, and a wheel built of it alone, hold all files of the package."""
    source, backend = tmp_path / "source", tmp_path / "backend"
    for name in tracked():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, source / name)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    required = PROJECT["build-system"]["requires"]
    subprocess.run([*pip, "--target", backend, *required], check=True)

    def build(kind: str, folder: Path) -> Path:
        """A distribution of a folder."""
        code = f"import sys; from setuptools import build_meta; build_meta.build_{kind}(sys.argv[1])"
        environment = os.environ | {"PYTHONPATH": str(backend)}
        call = [sys.executable, "-c", code, str(tmp_path)]
        subprocess.run(call, cwd=folder, env=environment, check=True, capture_output=True)
        return max(tmp_path.glob("touchstone_contact-*.*"), key=lambda path: path.stat().st_mtime_ns)

    with tarfile.open(build("sdist", source)) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    with zipfile.ZipFile(build("wheel", next((tmp_path / "unpacked").iterdir()))) as wheel:
        held = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert held == sources()
