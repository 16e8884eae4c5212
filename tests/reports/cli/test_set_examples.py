"""`--set` in README, CONTRIBUTING and docs/: examples are accepted, and name settings that exist."""

import re
import shlex
from contextlib import suppress
from pathlib import Path

import pytest
import typer

from touchstone.adapters.knobs import SettingError
from touchstone.adapters.registry import changes_of, settings_of
from touchstone.reports.run import study
from touchstone.reports.runner import sweep

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
TEXT = {page.relative_to(ROOT).as_posix(): page.read_text("utf-8") for page in PAGES}
COMMAND = re.compile(r"^(?:[$ ]*|.*`)(touchstone (?:[^`\n\\]|\\\n)*--set [^`\n#]*)", re.MULTILINE)
EXAMPLES = [
    (page, " ".join(found.replace("\\\n", " ").split()))
    for page, text in TEXT.items()
    for found in COMMAND.findall(text)
    if "KEY=" not in found
]
CHANGES = [
    (page, change)
    for page, text in TEXT.items()
    for change in re.findall(r"--set ([\w.]+=[\w.:,+-]+)", text)
    if "KEY=" not in change
]


@pytest.mark.parametrize(("page", "line"), EXAMPLES)
def test_an_example_is_accepted(touchstone, monkeypatch, page, line):
    """The program accepts every example, up to the point where it plays."""
    started = []

    def start(*arguments, **options):
        started.append(arguments)
        raise typer.Exit

    monkeypatch.setattr(study, "run", start)
    monkeypatch.setattr(sweep, "sweep", start)
    code, _, err = touchstone(*shlex.split(line)[1:])
    assert (code, len(started)) == (0, 1), err


@pytest.mark.parametrize(("page", "change"), CHANGES)
def test_a_named_setting_exists(page, change):
    """A change that a text names is one of some engine, with values that it takes."""
    key, _, values = change.partition("=")
    for value in values.split(","):
        accepted = []
        for engine in ("reference", "dart", "bullet", "mujoco"):
            profile = next(p for p in settings_of(engine).profiles if not settings_of(engine).is_bare(p))
            with suppress(SettingError):
                accepted.append(changes_of(engine, profile, [f"{key}={value}"]))
        assert accepted, f"{page}: --set {key}={value}"
