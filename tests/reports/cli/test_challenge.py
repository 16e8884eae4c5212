"""`touchstone challenge`: a settings file beside `recommended`; a wrong file is one line with its place."""

from pathlib import Path

import pytest

from touchstone.adapters.registry import ENGINES, changes_of, installed
from touchstone.reports.cli.challenge import settings_file

FILES = sorted((Path(__file__).parents[3] / "challenges").glob("*.toml"))
SOFT = 'engine = "mujoco"\nsource = "https://mujoco.org"\nby = "me"\n[settings]\nsolref = "{}"\n'


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_the_files_are_valid(path):
    """Each names an engine, a profile of it, and settings that change this profile."""
    found = settings_file(path)
    assert found.profile in ENGINES[found.engine].profiles
    texts = [f"{key}={value}" for key, value in found.settings.items()]
    assert len(changes_of(found.engine, found.profile, texts)) == len(texts)


@pytest.mark.slow
def test_worse_settings_are_exit_1(touchstone, tmp_path):
    """Contacts of 0.2 s break limits of a stack that `recommended` meets; those of 5 ms break none."""
    if not installed("mujoco"):
        pytest.skip("mujoco is not installed")
    path, found = tmp_path / "soft.toml", {}
    for value in ("0.2", "0.005"):
        path.write_text(SOFT.format(value))
        code, out, _ = touchstone("challenge", str(path), "stack", "--out", str(tmp_path / value))
        found[value] = code
        assert f"solref={value}" in out
        assert ("worse: stack +" in out) == bool(code)
    assert found == {"0.2": 1, "0.005": 0}
    code, _, err = touchstone("challenge", str(path), "stack", "--out", str(tmp_path / "0.2"))
    assert code == 2
    assert "exists" in err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('engine = "mujoco"', "settings: missing"),
        (SOFT.format("0.01").replace("by", "profil"), "profil"),
        (SOFT.format("0.01").replace("mujoco", "mujco"), "did you mean 'mujoco'?"),
        (SOFT.format("0.01").replace("solref", "solrf"), "did you mean 'solref'?"),
        (SOFT.format("-1"), "solref: found '-1'"),
        ('dt = "1/7"\n' + SOFT.format("0.01"), "--dt 1/7:"),
        ('profile = "recomended"\n' + SOFT.format("0.01"), "did you mean 'recommended'?"),
    ],
)
def test_a_wrong_file_is_one_line(text, message, touchstone, tmp_path):
    """What was found and what is valid, exit 2, and nothing is played."""
    if not installed("mujoco"):
        pytest.skip("mujoco is not installed")
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    code, out, err = touchstone("challenge", str(path), "stack", "--out", str(tmp_path / "out"))
    assert (code, out) == (2, "")
    assert message in err
    assert not (tmp_path / "out").exists()
