"""`docs/tour.md`: every command runs in an empty folder and prints what the page says."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^```(bash|text|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MAIN = "from touchstone.reports.cli.main import main; main()"


def steps(page: str) -> Iterator[tuple[str, list[str]]]:
    """Commands of a page with the lines that they print; writes the files of its Python blocks."""
    command = ""
    for kind, text in BLOCK.findall((ROOT / "docs" / page).read_text()):
        if kind == "python":
            Path(text.splitlines()[0].removeprefix("# ").strip()).write_text(text)
        elif kind == "bash":
            command = text
        else:
            yield command, text.splitlines()


def programs(folder: Path, plugin: str) -> None:
    """`touchstone`, `pytest` and `python` of this interpreter."""
    folder.mkdir()
    lines = {"touchstone": f"-c '{MAIN}'", "pytest": f"-m pytest {plugin} -p no:cacheprovider", "python": ""}
    for name, arguments in lines.items():
        script = folder / name
        script.write_text(f'#!/bin/sh\nexec {sys.executable} {arguments} "$@"\n')
        script.chmod(0o755)


def unversioned(folder: str, names: list[str]) -> list[str]:
    """Entries of the repository's own folder that a wheel is not made of; `reports/cli/runs` is kept."""
    return [name for name in names if name in (".git", ".venv", "build", "runs") and Path(folder) == ROOT]


def walk(monkeypatch, folder: Path, path: str, plugin: str, off: str) -> int:
    """Run all commands of the tour in an empty folder; returns their number."""
    programs(folder.parent / "bin", plugin)
    monkeypatch.chdir(folder)
    for name in ("toy_engine.py", "test_toy_engine.py"):
        shutil.copy(ROOT / "docs" / name, folder)
    environment = os.environ | {
        "PYTHONPATH": path,
        "PATH": f"{folder.parent / 'bin'}:{os.environ['PATH']}",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": off,
        "COLUMNS": "160",
    }
    if not off:
        del environment["PYTEST_DISABLE_PLUGIN_AUTOLOAD"]
    ran = 0
    for command, expected in steps("tour.md"):
        done = subprocess.run(
            ["bash", "-c", command], env=environment, capture_output=True, text=True, timeout=600
        )
        reported = done.stdout + done.stderr
        for line in expected:
            assert line in reported, f"{command}{reported}"
        ran += 1
    return ran


@pytest.mark.slow
def test_the_tour_from_the_source_tree(monkeypatch, tmp_path):
    """The tour works with the sources of this checkout."""
    (tmp_path / "empty").mkdir()
    named = any(entry.name == "touchstone" for entry in entry_points(group="pytest11"))
    plugin = "-p touchstone" if named else "-p touchstone.reports.pytest_plugin"
    assert walk(monkeypatch, tmp_path / "empty", str(ROOT), plugin, "1") >= 7


@pytest.mark.slow
def test_the_tour_from_a_wheel(monkeypatch, tmp_path):
    """The tour works with the wheel, which brings the plug-in of pytest by its entry point."""
    source = tmp_path / "source"
    shutil.copytree(ROOT, source, ignore=unversioned)
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, "wheel", "--no-deps", "-w", tmp_path, source], check=True, timeout=300)
    wheel = next(tmp_path.glob("touchstone_contact-*.whl"))
    subprocess.run([*pip, "install", "--no-deps", "--target", tmp_path / "site", wheel], check=True)
    (tmp_path / "empty").mkdir()
    assert walk(monkeypatch, tmp_path / "empty", str(tmp_path / "site"), "", "") >= 7
