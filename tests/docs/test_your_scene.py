"""The tour of `docs/your_scene.md`: its files are written, its commands run, its outputs compared."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import installed, load
from touchstone.adapters.workers.children import Children, Outcome
from touchstone.reports.cli import main as cli
from touchstone.reports.run import study

TOUR = Path(__file__).parents[2] / "docs" / "your_scene.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"(?:#|<!--) file: (\S+)(?: -->)?\n")


def steps() -> list[tuple[str, object]]:
    """(name, text) of each file, and (command, (exit code, expected lines)) of each command, in order."""
    found: list[tuple[str, object]] = []
    for kind, text in BLOCK.findall(TOUR.read_text(encoding="utf-8")):
        named = FILE.match(text)
        if kind != "console" and named:
            # The name's line stays, so that lines have the numbers of the page; CSV has no comments.
            found.append((named[1], text[named.end() :] if named[1].endswith(".csv") else text))
            continue
        for part in text.split("$ ")[1:]:
            command, *lines = part.strip().splitlines()
            command, _, code = command.partition("  # exit ")
            found.append((command, (int(code or 0), lines)))
    return found


def play(self, jobs, progress):
    """Play in this process: a tour has small scenes."""
    outcomes = []
    for job in jobs:
        try:
            record(load(job.engine), job.scenario, job.settings).save(job.recording)
            outcomes.append(Outcome(job, "done"))
        except AdapterError as error:
            outcomes.append(Outcome(job, error.status, str(error)))
    return outcomes


def follow(call) -> int:
    """Write the files and run the commands; returns the number of commands."""
    count = 0
    for what, content in steps():
        if isinstance(content, str):
            Path(what).write_text(content, encoding="utf-8")
            continue
        wanted, lines = content
        code, text = call(shlex.split(what)[1:])
        assert code == wanted, f"{what}: exit {code}\n{text}"
        for line in lines:
            assert " ".join(line.split()) in text, f"{what}: no {line!r} in\n{text}"
        assert "Traceback" not in text
        count += 1
    return count


@pytest.mark.skipif(not installed("mujoco"), reason="the tour imports a robot, which needs MuJoCo")
def test_the_tour_works(monkeypatch, tmp_path, capfd):
    """Every command ends with the code and the lines that the page shows."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Children, "play", play)
    for drawing in ("draw", "write_picture", "write_page", "packed_scene"):
        monkeypatch.setattr(study, drawing, lambda *arguments: {})

    def call(arguments):
        monkeypatch.setattr(sys, "argv", ["touchstone", *arguments])
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code or 0, " ".join("".join(capfd.readouterr()).split())

    assert follow(call) >= 12


@pytest.mark.slow
@pytest.mark.skipif(not installed("mujoco"), reason="the tour imports a robot, which needs MuJoCo")
def test_the_tour_works_as_typed(monkeypatch, tmp_path):
    """The same, each command in a process of its own."""
    monkeypatch.chdir(tmp_path)

    def call(arguments):
        program = "from touchstone.reports.cli.main import main; main()"
        done = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True)
        return done.returncode, " ".join((done.stdout + done.stderr).split())

    assert follow(call) >= 12
