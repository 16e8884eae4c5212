"""Forged tables of results, wherever a command reads them: a result or one line, and no traceback."""

import shutil

import pandas as pd
import pytest
from forged_tables import JSONS, WAYS, forge

from touchstone.reports.results import save_manifest, table

pytestmark = pytest.mark.slow


SOUND = (0, 1, 2)
"""Exit codes of a command that did its work, or refused its input in one line."""


def code_of(found):
    """Exit code of a command; None if it ended in a traceback, or refused its input in more than one line."""
    code, out, err = found
    refused = (out, err.removeprefix("finished before\n").count("\n")) == ("", 1)
    return code if (code != 2 or refused) and "Traceback" not in err + out else None


@pytest.fixture
def run(touchstone, registry, tmp_path):
    """A stored run, and what `touchstone docs` needs; returns the program."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").touch()
    frame = table(registry.judged_rows("fall", "reference"))
    for name in ("run", "other"):
        (tmp_path / name).mkdir()
        frame.to_parquet(tmp_path / name / "results.parquet", index=False)
        save_manifest(tmp_path / name, {"command": "touchstone run fall"})
    return touchstone


@pytest.mark.parametrize("way", WAYS)
def test_a_forged_run_is_refused_or_read(run, tmp_path, way):
    """`compare`, `tolerances` and `docs` read what is there, or name the file."""
    forge(tmp_path / "run" / "results.parquet", way)
    for command in ("compare other run", "compare run other --all", "tolerances run other", "docs run"):
        assert code_of(run(command)) in SOUND


@pytest.mark.parametrize("text", JSONS.values(), ids=JSONS)
def test_a_forged_manifest_is_refused_or_read(run, tmp_path, text):
    """`docs` reads the manifest."""
    (tmp_path / "run" / "manifest.json").write_text(text)
    assert code_of(run("docs run")) in SOUND


@pytest.mark.parametrize("study", ["../x", "run.x", "bench x", "bench ", "effects", "ik", "", "a b", "[/x]"])
def test_docs_name_a_study_that_they_cannot_show(run, tmp_path, study):
    """A table of a study that does not exist, or of another study than its rows are of."""
    path = tmp_path / "run" / "results.parquet"
    pd.read_parquet(path).assign(study=study).to_parquet(path, index=False)
    assert code_of(run("docs run")) in SOUND


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A store of a sweep, as the command below leaves it."""
    return tmp_path_factory.mktemp("swept") / "store"


SWEEP = "sweep fall --engine reference --profile balanced --jobs 1 --out store"


@pytest.mark.parametrize("way", WAYS)
def test_a_forged_store_of_a_sweep_is_refused_or_read(touchstone, swept, tmp_path, way):
    """A sweep shows what its store holds, or names the file."""
    if not swept.exists():
        assert touchstone(SWEEP)[0] == 0
        shutil.copytree("store", swept)
    shutil.rmtree("store", ignore_errors=True)
    shutil.copytree(swept, "store")
    for path in (tmp_path / "store" / "cells").iterdir():
        forge(path, way)
    assert code_of(touchstone(SWEEP)) in SOUND


@pytest.mark.parametrize("text", JSONS.values(), ids=JSONS)
def test_a_forged_description_of_a_store_is_refused(touchstone, tmp_path, text):
    """`store.json` of a sweep."""
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "store.json").write_text(text)
    assert code_of(touchstone(SWEEP)) == (0 if '"format": 1,' in text and "999" not in text else 2)
