"""`touchstone docs` and `--set` in our pages: they are current, and what they name exists."""

import csv
import re
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest
import typer

from touchstone.adapters.knobs import SettingError
from touchstone.adapters.registry import changes_of, settings_of
from touchstone.reports.cli.main import app
from touchstone.reports.docs import reference
from touchstone.reports.docs.reference import NoResults, engines_page, page_of
from touchstone.reports.results import Row, save, save_manifest, table
from touchstone.reports.run import study
from touchstone.reports.runner import sweep
from touchstone.scenarios.catalogue import tagged

GENERATED = Path(__file__).resolve().parents[3] / "docs" / "generated"
SETTINGS = GENERATED.with_name("settings")


def test_generated_pages_are_current():
    """Pages that follow from the code equal those in docs/; else run `touchstone docs`."""
    pictures = {scene.name: f"pictures/{scene.name}.png" for scene in tagged("gallery")}
    pages = {
        "commands.md": reference.commands_page(typer.main.get_command(app)),
        **reference.list_pages(pictures),
    }
    pages["../engines.md"] = engines_page(GENERATED.parents[1])
    stale = [name for name, text in pages.items() if (GENERATED / name).read_text() != text]
    assert not stale, "run `touchstone docs`"


def test_pages_of_settings_are_current():
    """The page of every engine that is installed equals that in docs/settings; else run `touchstone docs`."""
    pages = reference.settings_pages(SETTINGS)
    stale = [name for name, text in pages.items() if (SETTINGS / name).read_text() != text]
    assert not stale, "run `touchstone docs`"
    assert all("to paste" in text and "reviewed by" in text for text in pages.values())
    for engine in pd.read_csv(SETTINGS / reference.EFFECTS).engine.unique():
        assert "## The best for each tolerance" in (SETTINGS / f"{engine}.md").read_text()


def test_every_setting_has_a_source():
    """Each setting of an engine with a page has a line with its source; no line is of one that is gone."""
    with open(reference.SOURCES, newline="", encoding="utf-8") as file:
        lines = {(row["engine"], row["setting"]): row["source"] for row in csv.DictReader(file)}
    known = {(engine, name) for engine in reference.MANUALS for name in settings_of(engine)}
    assert set(lines) == known
    assert all(lines.values())


def test_every_gallery_scene_has_a_still():
    """A scene of the gallery has a picture in docs/; else run `touchstone docs --stills`."""
    stills = {path.stem for path in (GENERATED / "pictures").glob("*.png")}
    assert {scene.name for scene in tagged("gallery")} <= stills


@pytest.fixture
def results(tmp_path):
    """A folder as the study `predictability` leaves it."""
    folder = tmp_path / "run"
    folder.mkdir()
    row = Row("run", "fall", "reference", "balanced", 1 / 60, "overlap.max", 2e-3, "m", verdict="fail")
    save(table([row]), folder)
    save_manifest(folder, {"command": "touchstone run fall"})
    (folder / "overlap.png").write_bytes(b"picture")
    return folder


def test_a_page_shows_the_table_and_its_origin(results):
    """The page of a folder names the command and holds the table as printed, and its pictures."""
    name, text, pictures = page_of(results)
    assert name == "run.md"
    assert "`touchstone run fall`" in text
    assert "overlap.max" in text
    assert "2.00 ✗" in text
    assert pictures == {"run-overlap.png": results / "overlap.png"}
    assert "![run-overlap](pictures/run-overlap.png)" in text


@pytest.mark.parametrize("damage", [lambda f: (f / "manifest.json").unlink(), lambda f: f.rename("x"), None])
def test_a_folder_without_results_is_named(results, damage, tmp_path, monkeypatch):
    """A folder that is absent, incomplete or without rows is refused by its name."""
    monkeypatch.chdir(tmp_path)
    if damage:
        damage(results)
    else:
        pd.DataFrame({"study": []}).to_parquet(results / "results.parquet")
    with pytest.raises(NoResults, match="run: no results"):
        page_of(results)


def test_docs_needs_a_checkout(refused, left, tmp_path):
    """Outside a checkout the command writes nothing and exits with 2."""
    assert "index.md is missing" in refused("docs")
    assert left(tmp_path) == []


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
    code, _, err = touchstone(line.removeprefix("touchstone "))
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
