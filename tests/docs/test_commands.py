"""Every command of README and of the pages parses; the slow test runs it in a folder with what it names.

It compares the exit code with that of the page: 0, or N of a comment `# exit N` or `exit N` in a table row;
and a time beside it, in a comment, its row, or "takes ... minutes" below it, with its processor time.
Figures of `docs/answers.md` are compared with what its commands measure.

`docs/tour.md` and `docs/your_scene.md` have tests of their own, which compare what their commands print.
"""

from __future__ import annotations

import os
import re
import resource
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import pytest
import typer

from touchstone.adapters.registry import OPTIONAL_ENGINES, installed, missing_reason
from touchstone.reports.cli import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
ELSEWHERE = ("tour.md", "your_scene.md")
COMMAND = re.compile(
    r"^(?:    |\$ )\s*(?:\$ )?(touchstone .*)$|^\|(?:.* \|)? `(touchstone [^`]*)`(?= and | \||[,;] | \()"
)
"""A line of a block, or the start of a cell of a table."""
EXIT = re.compile(r"# exit (\d+)$|^\|.*\bexit (\d+)\b")
COUNTS = {"a": 1, "an": 1, "one": 1, "two": 2, "three": 3, "four": 4, "five": 5, "nine": 9, "ten": 10}
COUNT = rf"(\d+|{'|'.join(COUNTS)})"
TAKES = re.compile(
    rf"\b(?:(?:takes|in) (?:{COUNT} to )?{COUNT}|(under an?|tens of)) (s|minute|hour)s?\b(?! of processor)"
)
UNITS = {"s": 1.0, "minute": 60.0, "hour": 3600.0}
FACTOR = 3.0
"""Factor up to which a time on a page is that of its command."""
OPTIONAL = re.compile(r"\[[^]]*\b[A-Z]+\b[^]]*\](\.\.\.)?")
"""An optional part with a placeholder, which is left out; others are taken without their brackets."""
TOSSES = "tests/reports/studies/tosses"
STANDS_FOR = {
    "mypkg.adapter:MyEngine": "toy_engine:ToyEngine",
    "runs/TIME": "runs/a",
    "runs/main": "runs/a",
    "runs/branch": "runs/b",
    "runs/soak-.../soak_123_overlap.toml": "my_scene.toml",
    "SCENE": "slip",
    "--engine NAME": "--engine dart",
    "FILE": "detector_reports.json",
    "tosses tosses": f"tosses {TOSSES}",
}
NOT_RUN = {
    "touchstone versions": "downloads wheels; tests/reports/studies",
    "touchstone view runs/versions-TIME": "needs the versions of a package index; tests/reports/studies",
    "touchstone sweep --tag probe --dask": "needs a cluster; tests/reports/runner",
    "touchstone failings measure": "writes the table of a checkout; tests/reports/verdict/test_failings.py",
    "touchstone env add": "downloads 600 MB; tests/reports/cli/test_own_environments.py",
    "touchstone docs": "writes the pages of a checkout; tests/reports/cli/test_docs.py",
    "touchstone nightly --store nights ": "half an hour; its --quick is run",
    "touchstone accept last": "needs two nights; tests/reports/nightly",
    "touchstone study stability [": "an hour; its --quick is run",
    "touchstone study ablation [": "an hour; tests/reports/studies",
    "touchstone tune SCENE": "all options; README's line is run",
    "touchstone soak": "plays as long as it is asked to; tests/reports/studies",
}
"""Start of a command that the slow test leaves out, and why."""
LONGEST = 1800
"""Time of a command [s]: three times the longest on an idle machine."""


class Documented(NamedTuple):
    """A command, the page that has it, and its exit code there."""

    page: str
    text: str
    code: int
    takes: tuple[float, float] | None

    @property
    def arguments(self) -> list[str]:
        """Its words, with what stands for placeholders."""
        text = OPTIONAL.sub("", self.text).replace("[", "").replace("]", "")
        for name, value in STANDS_FOR.items():
            text = text.replace(name, value)
        words = shlex.split(re.split(r" && | > ", text)[0])
        return words[1:]


def documented() -> Iterator[Documented]:
    """Commands of all pages, each once."""
    seen: set[str] = set()
    for page in PAGES:
        lines = page.read_text("utf-8").splitlines() if page.name not in ELSEWHERE else []
        for k, (line, follows) in enumerate(zip(lines, [*lines[1:], ""])):
            if not (found := COMMAND.match(line)):
                continue
            more = f" {follows.strip()}" if follows.strip().startswith("--") else ""
            text = ((found[1] or found[2]) + more).partition(" #")[0]
            if text.strip() not in seen:
                seen.add(text.strip())
                code = EXIT.search(line)
                number = int(code[1] or code[2]) if code else 0
                yield Documented(page.name, text.strip(), number, _takes(lines, k))


def _takes(lines: list[str], at: int) -> tuple[float, float] | None:
    """Least and largest time [s] that a page states of the command in a line."""
    above = at
    while lines[above - 1].startswith("    # "):
        above -= 1
    below = at + 1
    while (
        not lines[at].startswith("|")
        and below < len(lines)
        and not re.match("#|    (touchstone|#) ", lines[below])
    ):
        below += 1
    found = TAKES.search(" ".join(line.strip() for line in lines[above:below]))
    if found is None:
        return None
    low, high, about, unit = found.groups()
    if about:
        least, most = (0, 1) if about.startswith("under") else (10, 60)
    else:
        least, most = (int(COUNTS.get(word, word)) for word in (low or high, high))
    return least * UNITS[unit], most * UNITS[unit]


ALL = list(documented())


def test_the_pages_have_commands():
    """What is left out is documented: no reason outlives its command."""
    assert len(ALL) > 40
    assert sum(one.takes is not None for one in ALL) > 8
    for start in NOT_RUN:
        assert any(one.text.startswith(start.rstrip()) for one in ALL), start


@pytest.mark.parametrize("one", ALL, ids=lambda one: f"{one.page} {one.text[:60]}")
def test_a_documented_command_parses(one, monkeypatch, tmp_path):
    """Its command, options and the kinds of their values exist."""
    monkeypatch.chdir(tmp_path)
    command = typer.main.get_command(main.app)
    # commands are built once a session, and keep the help options of their first context
    context, arguments = command.context_class(command, **command.context_settings), one.arguments
    while hasattr(command, "commands"):
        name, *arguments = arguments
        command = command.commands[name]
    assert command.make_context(name, arguments, context).params


@pytest.fixture(scope="module")
def home(tmp_path_factory) -> Path:
    """A folder with what the pages name: a scene, a robot, an engine, pairs of shapes, and two runs."""
    folder = tmp_path_factory.mktemp("home")
    page = (ROOT / "docs" / "your_scene.md").read_text("utf-8")
    for name, target in (("drop.toml", "my_scene.toml"), ("arm.urdf", "robot.urdf")):
        block = re.search(rf"```\w+\n(?:#|<!--) file: {re.escape(name)}.*?\n(.*?)```", page, re.DOTALL)
        assert block is not None
        (folder / target).write_text(block[1], "utf-8")
    shutil.copy(ROOT / "docs" / "toy_engine.py", folder)
    shutil.copy(ROOT / "tests" / "reports" / "studies" / "detector_reports.json", folder)
    shutil.copytree(ROOT / TOSSES, folder / TOSSES)
    shutil.copytree(ROOT / "challenges", folder / "challenges")
    for name in ("a", "b"):
        code, text = call(folder, ["run", "slip", "--out", f"runs/{name}"])
        assert code == 0, text
    return folder


def play(folder: Path, arguments: list[str]) -> subprocess.CompletedProcess[str]:
    """The program in a folder."""
    program = "import sys; from touchstone.reports.cli.main import main; main()"
    return subprocess.run(
        [sys.executable, "-c", program, *arguments],
        cwd=folder,
        env=os.environ | {"BROWSER": "true"},  # a program that opens nothing
        capture_output=True,
        text=True,
        timeout=LONGEST,
        check=False,
    )


def call(folder: Path, arguments: list[str]) -> tuple[int, str]:
    """Exit code of the program in a folder, and the end of what it said."""
    done = play(folder, arguments)
    return done.returncode, f"{done.stdout[-3000:]}\n{done.stderr[-3000:]}"


@pytest.mark.slow
@pytest.mark.engines
@pytest.mark.timeout(LONGEST + 60)
@pytest.mark.parametrize("one", ALL, ids=lambda one: f"{one.page} {one.text[:60]}")
def test_a_documented_command_exits_as_its_page_says(one, home):
    """In a folder with the files that it names; without a traceback."""
    for start, reason in NOT_RUN.items():
        if f"{one.text} ".startswith(start) and "--quick" not in one.text:
            pytest.skip(reason)
    for name in OPTIONAL_ENGINES:
        if name in one.arguments and not installed(name):
            pytest.skip(missing_reason(name))
    before = processor_time()
    code, text = call(home, one.arguments)
    spent = processor_time() - before
    assert code == one.code, f"exit {code}\n{text}"
    assert "Traceback" not in text
    if one.takes is not None:  # on two idle cores it takes between half of its processor time and all
        least, most = one.takes
        assert spent / 2 < FACTOR * most, f"{spent:.0f} s of processor time"
        assert spent > least / FACTOR, f"{spent:.0f} s of processor time"


def processor_time() -> float:
    """Of all child processes that ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cells(text: str) -> dict[str, list[float]]:
    """Label -> figures of each row of a printed table, without marks."""
    rows = (re.split("  +", line.strip()) for line in text.splitlines() if re.match(r" +\w+\.\w+.*\d", line))
    return {row[0]: [float(cell.split()[0].rstrip("*")) for cell in row[-4:]] for row in rows}


@pytest.mark.engines
def test_the_table_of_readme_is_what_its_command_prints(tmp_path, monkeypatch, capfd, forked):
    """Figures agree to two digits; below 1e-9 all are rounding."""
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.chdir(tmp_path)
    readme = (ROOT / "README.md").read_text("utf-8").partition("## What a run prints")[2]
    (command,) = [
        one
        for one in ALL
        if one.text.startswith("touchstone run slip --profile balanced --profile recommended --metric")
    ]
    monkeypatch.setattr(sys, "argv", ["touchstone", *command.arguments])
    with pytest.raises(SystemExit):
        main.main()
    printed, shown = cells(capfd.readouterr().out), cells(readme.partition("`truth.position`")[0])
    assert len(shown) > 8
    assert {name: pytest.approx(row, rel=0.02, abs=1e-9) for name, row in shown.items()} == printed


QUANTITY = r"\d[\d.]*(?:e-?\d+)?(?: (?:um/s|mm|m|%))?"
FOUR = re.compile(rf"{QUANTITY}, {QUANTITY}, {QUANTITY} and {QUANTITY}")
"""Figures of `docs/answers.md`, in its order of engines; a unit that only the last has is that of all."""
SI = {"um/s": 1e-6, "mm": 1e-3, "m": 1.0, "%": 0.01, "": 1.0}
ANSWERS = {
    "Does a grip creep?": {"metric": "friction.creep"},
    "Why does the contact force differ from theory?": {"metric": "force.error"},
    "Does a force plate read the weight?": {"metric": "published.error"},
    "Why does friction depend on the heading?": {"metric": "friction.heading"},
    "Why did it pass through the wall?": {"metric": "overlap.tunnelled"},
    "Can a heavy body rest on a light one?": {"metric": "overlap.max"},
    "Does a bounce gain energy?": {"metric": "energy.gain"},
    "Are gradients through contact right?": {"subject": "d x2' / d x1, h 0.0001"},
}
"""Question -> the rows of its command's results of which each engine's largest is quoted."""


@pytest.mark.slow
@pytest.mark.engines
@pytest.mark.timeout(LONGEST)
@pytest.mark.parametrize("question", ANSWERS)
def test_an_answer_quotes_what_its_command_measures(question, tmp_path):
    """Figures agree to the digits that are quoted; below 1e-9 all are rounding."""
    lines = (ROOT / "docs" / "answers.md").read_text("utf-8").splitlines()
    (line,) = [line for line in lines if line.startswith(f"| {question} ")]
    quoted = re.split(", | and ", FOUR.search(line)[0])
    units = [one.partition(" ")[2] for one in quoted]
    units = units[-1:] * 4 if not any(units[:-1]) else units
    stated = [float(one.partition(" ")[0]) * SI[unit] for one, unit in zip(quoted, units)]
    words = shlex.split(re.search("`touchstone ([^`]*)`", line)[1])
    code, text = call(tmp_path, [*words, "--out", "found"])
    assert code == 0, text
    rows = pd.read_parquet(tmp_path / "found" / "results.parquet")
    for column, value in ANSWERS[question].items():
        rows = rows[rows[column] == value]
    rows = rows[rows.profile.isin(["balanced", "recommended"])]
    found = rows.value.abs().groupby(rows.engine).max()[["reference", "dart", "bullet", "mujoco"]]
    assert found.tolist() == pytest.approx(stated, rel=0.15, abs=1e-9)


@pytest.mark.slow
@pytest.mark.engines
@pytest.mark.timeout(LONGEST)
@pytest.mark.parametrize("question", ["Is it deterministic?", "Why does a policy fail in another simulator?"])
def test_an_answer_quotes_what_its_command_prints(question, home):
    """Each of its figures with its unit or word."""
    lines = (ROOT / "docs" / "answers.md").read_text("utf-8").splitlines()
    (line,) = [line for line in lines if line.startswith(f"| {question} ")]
    words, answer = re.search(r"`touchstone ([^`]*)` \| (.*)", line).groups()
    figures = re.findall(r"\d[\d.]* (?:mm|s|worse|gone|changed|better)\b", answer)
    assert len(figures) > 2
    printed = play(home, shlex.split(words)).stdout
    assert [figure for figure in figures if figure not in printed] == []


def test_the_answer_of_tosses_is_that_of_its_page():
    """Widths from where the cube came to rest, of the four engines, as the run of all tosses printed them."""
    answers, page = (
        (ROOT / "docs" / name).read_text("utf-8") for name in ("answers.md", "generated/reality-tosses.md")
    )
    quoted = re.search(r"a tossed cube rests (.*) widths", answers)[1]
    rows = re.findall(r"^ (reference|dart|bullet|mujoco) \w+ +(.*)$", page, re.MULTILINE)
    rest = {engine: float(cells.split()[6]) for engine, cells in rows}
    assert [float(one) for one in re.split(", | and ", quoted)] == pytest.approx(
        list(rest.values()), abs=0.005
    )
