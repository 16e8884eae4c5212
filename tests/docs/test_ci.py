"""`docs/ci.md`: its workflows are YAML whose commands exist, and its steps are green and red as it says."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from touchstone.adapters.registry import installed
from touchstone.reports.cli import main

yaml = pytest.importorskip("yaml", reason="not installed (pip install pyyaml)")

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "ci.md").read_text("utf-8")
BLOCK = re.compile(r"^```(\w+)\n# (?:file|step): (\S+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS = {name: text for _, name, text in BLOCK.findall(PAGE)}
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


def lines_of(workflow: object) -> list[str]:
    """Shell lines of a GitHub or GitLab workflow."""
    if isinstance(workflow, list):
        return [line for one in workflow for line in ([one] if isinstance(one, str) else lines_of(one))]
    found: list[str] = []
    for key, value in workflow.items() if isinstance(workflow, dict) else ():
        found += value.splitlines() if key == "run" else lines_of(value)
    return found


def parsed(line: str) -> None:
    """Parse a line of the program; raises where a command, an option or a kind of value does not exist."""
    command, (name, *arguments) = typer.main.get_command(main.app), shlex.split(line)
    # commands are built once a session, and keep the help options of their first context
    context = command.context_class(command, **command.context_settings)
    while hasattr(command, "commands"):
        name, *arguments = arguments
        command = command.commands[name]
    command.make_context(name, arguments, context)


@pytest.mark.parametrize(
    "text",
    [BLOCKS[".github/workflows/physics.yml"], BLOCKS[".gitlab-ci.yml"], *(p.read_text() for p in WORKFLOWS)],
    ids=["github", "gitlab", *(path.stem for path in WORKFLOWS)],
)
def test_commands_of_workflows_exist(text, monkeypatch, tmp_path):
    """Every line that calls the program parses; every job installs or checks something."""
    monkeypatch.chdir(tmp_path)
    lines = lines_of(yaml.safe_load(text))
    assert lines
    for line in lines:
        if line.startswith("touchstone "):
            parsed(line)


def test_both_workflows_call_the_same():
    """GitHub's and GitLab's recipes have the same lines, those of the steps among them."""
    github, gitlab = (
        lines_of(yaml.safe_load(BLOCKS[n])) for n in (".github/workflows/physics.yml", ".gitlab-ci.yml")
    )
    ours = [line for line in gitlab if line.startswith(("touchstone", "python"))]
    assert [line for line in github if line.startswith(("touchstone", "python"))] == ours
    steps = [*BLOCKS["before"].splitlines(), *BLOCKS["after"].splitlines()]
    assert [line for line in ours if line.startswith(("touchstone run", "touchstone compare"))] == steps


@pytest.mark.slow
@pytest.mark.engines
@pytest.mark.skipif(not installed("mujoco"), reason="the recipe plays MuJoCo")
def test_the_recipe_is_green_and_red(tmp_path):
    """Without a change the steps end with 0; with a softer contact `compare` ends with 1."""
    (tmp_path / "tolerances.toml").write_text(BLOCKS["tolerances.toml"])
    program = tmp_path / "bin" / "touchstone"
    program.parent.mkdir()
    code = "from touchstone.reports.cli.main import main; main()"
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -c "{code}" "$@"\n')
    program.chmod(0o755)

    def step(text: str) -> subprocess.CompletedProcess:
        path = {"PATH": f"{program.parent}:/usr/bin:/bin", "HOME": str(Path.home())}
        return subprocess.run(
            ["bash", "-e", "-c", text], cwd=tmp_path, env=path, capture_output=True, text=True, check=False
        )

    assert step(BLOCKS["before"]).returncode == 0
    green = step(BLOCKS["after"])
    assert green.returncode == 0, green.stdout + green.stderr
    assert ": 0 worse, 0 gone" in green.stdout
    softer = BLOCKS["after"].replace("runs/branch --quiet", "runs/softer --quiet --set solref=0.08 || true")
    red = step(softer.replace("runs/main runs/branch", "runs/main runs/softer --match profile"))
    assert red.returncode == 1, red.stdout + red.stderr
    assert re.search(r"worse: \d+", red.stdout)


def test_the_citation_is_of_this_version():
    """CITATION.cff has the fields that its format requires; the changelog and it have this version."""
    import tomllib

    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert {"cff-version", "message", "title", "authors"} <= cited.keys()
    assert (cited["version"], cited["license"]) == (project["version"], project["license"])
    assert re.search(r"^## (.*)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1] == project["version"]


@pytest.mark.parametrize("path", sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")))
def test_issue_templates_ask_for_the_command(path):
    """A form has name, description and a required command or setting."""
    form = yaml.safe_load(path.read_text())
    assert {"name", "description", "body"} <= form.keys()
    required = [part["id"] for part in form["body"] if part.get("validations", {}).get("required")]
    assert {"command", "engine"} & set(required)
