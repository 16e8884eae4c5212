"""`--format`, `--out` and `--quiet` of every command, and what they do to the commands that print a table."""

import json

import pandas as pd
import pytest
import typer

from touchstone.reports.cli import main
from touchstone.reports.cli.cheapest import rows
from touchstone.reports.results import Row, save, table
from touchstone.reports.studies.work_precision.cheapest import Answer, MeasuredSetting

WITHOUT = {
    "nightly": {"--format": "its folder has the table", "--out": "a night belongs to its --store"},
    "challenge": {"--format": "prints two counts; its folder has both tables"},
    "accept": {"--format": "one line", "--out": "one line", "--quiet": "one line"},
    "failings measure": {
        "--format": "prints what changed",
        "--out": "writes the table of known failings",
        "--quiet": "prints what changed",
    },
    "env add": {"--format": "one line", "--out": "one line", "--quiet": "one line"},
    "env list": {"--quiet": "has no verdict"},
    "env remove": {"--format": "one line", "--out": "one line", "--quiet": "one line"},
    "docs": {"--format": "writes pages", "--quiet": "prints their paths"},
    "schema": {"--format": "is JSON", "--quiet": "prints nothing else"},
    "export": {"--quiet": "prints a path"},
    "reproduce": {"--format": "writes a program"},
    "view": {"--format": "writes a page", "--quiet": "prints its path"},
    "list": {"--quiet": "has no verdict"},
    "show": {"--quiet": "has no verdict"},
}
"""Options that a command does not have, and why."""


def commands():
    """Every command by its name, those of groups too."""
    top = typer.main.get_command(main.app)
    for name, command in top.commands.items():
        inner = getattr(command, "commands", None)
        yield from (
            {f"{name} {sub}": one for sub, one in inner.items()}.items() if inner else [(name, command)]
        )


@pytest.mark.parametrize(
    ("name", "command"), list(commands()), ids=lambda part: part if isinstance(part, str) else ""
)
def test_commands_have_the_same_options(name, command):
    """Every command has all three, but for those whose reason WITHOUT states."""
    has = {option for parameter in command.params for option in parameter.opts}
    assert {"--format", "--out", "--quiet"} - has == WITHOUT.get(name, {}).keys()


@pytest.fixture
def runs(tmp_path):
    """Two runs; in the second a metric is worse."""
    for name, value in (("a", 1.0), ("b", 2.0)):
        (tmp_path / name).mkdir()
        row = Row("run", "fall", "mujoco", "recommended", 0.01, "truth.position", value, "1")
        save(table([row]), tmp_path / name)


def test_what_is_printed_goes_to_a_new_file(touchstone, tmp_path):
    """`--out` leaves standard output empty, and replaces no file."""
    assert touchstone("list", "profiles", "--format", "json", "--out", "p.json")[:2] == (0, "")
    assert json.loads((tmp_path / "p.json").read_text())
    code, _, err = touchstone("list", "profiles", "--out", "p.json")
    assert (code, "--out p.json: exists" in err) == (2, True), err
    assert touchstone("schema", "--out", "s.json")[0] == 0
    assert json.loads((tmp_path / "s.json").read_text())["title"] == "touchstone scene"
    code, _, err = touchstone("list", "profiles", "--out", "no/such/p.json")
    assert (code, err) == (2, "touchstone: --out no/such/p.json: No such file or directory\n")


def test_a_verdict_is_written_with_its_exit_code(touchstone, runs, tmp_path):
    """A comparison that is worse writes its table and exits with 1; one that is refused writes nothing."""
    code, out, _ = touchstone("compare", "a", "b", "--format", "csv", "--out", "c.csv")
    assert (code, out) == (1, "")
    assert pd.read_csv(tmp_path / "c.csv").kind.tolist() == ["worse"]
    assert touchstone("compare", "a", "none", "--out", "d.csv")[0] == 2
    assert not (tmp_path / "d.csv").exists()


def test_quiet_prints_what_decides_the_exit_code(touchstone, runs):
    """`compare --quiet` names what is worse on standard error, and nothing where all is well."""
    code, out, err = touchstone("compare", "a", "b", "--quiet")
    assert (code, out) == (1, "")
    assert err == "worse: fall mujoco recommended truth.position: by 1\n"
    assert touchstone("compare", "a", "a", "--quiet") == (0, "", "")


@pytest.mark.slow
def test_doctor_is_read_by_programs(touchstone):
    """Every engine has a status; `--quiet` prints what fails alone."""
    code, out, err = touchstone("doctor", "--format", "json")
    found = {row["name"]: row for row in json.loads(out)}
    assert found["reference"]["status"] == "done", err
    assert found["drake"]["status"] in ("done", "missing")
    assert found["kernel cache"]["value"]
    code, out, err = touchstone("doctor", "--quiet")
    assert (code, out) == (0, "")
    assert {line.partition(":")[0] for line in err.splitlines()} <= {
        name for name, row in found.items() if row["status"] not in ("", "done")
    }


def test_the_cheapest_setting_is_read_by_programs():
    """A row per setting with its place, errors and command; JSON has no infinity."""
    one, two, three = (
        MeasuredSetting(
            engine,
            "balanced",
            "",
            1 / 60,
            t,
            t,
            t,
            {"overlap": error, "energy": 0.1},
            0.5,
            "overlap",
            "again",
        )
        for engine, t, error in (
            ("reference", 1.0, 1e-6),
            ("mujoco", 2.0, 1e-4),
            ("bullet", 3.0, float("inf")),
        )
    )
    found = rows(Answer(True, one, two, three, (two,)), {"overlap": 1e-3})
    assert [(row["place"], row["engine"]) for row in found] == [
        ("cheapest", "reference"),
        ("cannot tell apart", "mujoco"),
        ("next engine", "bullet"),
    ]
    assert found[0]["error overlap"] == 1e-6
    assert found[0]["limit overlap"] == 1e-3
    assert "error energy" not in found[0]
    assert json.loads(json.dumps(found, allow_nan=False))[2]["error overlap"] is None
