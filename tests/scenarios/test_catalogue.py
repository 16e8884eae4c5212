"""A broken file among the scenes, or a function that gives none: named in a line, the others stay."""

import importlib
import sys

import pytest

from touchstone.scenarios import catalogue as scenes
from touchstone.scenarios import families
from touchstone.scenarios.families import fall  # noqa: F401

RETURNS = "from touchstone.scenarios.catalogue import scene\n\n\n@scene\ndef odd():\n    return {}\n"


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """Add a file to the families; returns the names of the scenes that are left, and the lines told."""
    (tmp_path / "fall.py").touch()  # imported already: the family of the package
    monkeypatch.setattr(families, "__path__", [str(tmp_path)])

    def add(text: str):
        (tmp_path / "zz_broken.py").write_text(text)
        sys.modules.pop("touchstone.scenarios.families.zz_broken", None)
        importlib.invalidate_caches()
        scenes.built.cache_clear()
        return set(scenes.catalogue()), scenes.faults()

    yield add
    scenes.built.cache_clear()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("import no_such_package\n", "families/zz_broken.py:1: ModuleNotFoundError: No module named"),
        ("x = (\n", "families/zz_broken.py:1: SyntaxError: '(' was never closed"),
        ("\n\nraise SystemExit(3)\n", "families/zz_broken.py:3: SystemExit: 3"),
        (RETURNS.format(3), "families/zz_broken.py: scene odd returns int, expected Scenario or several"),
        (RETURNS.format("(1,)"), "families/zz_broken.py: scene odd returns int, expected Scenario"),
        (RETURNS.format("1 / 0"), "families/zz_broken.py: scene odd:6: ZeroDivisionError: division by zero"),
        (
            "from touchstone.scenarios.families.fall import fall\n",
            "families/zz_broken.py: two scenes are called 'fall'",
        ),
        (
            "from dataclasses import replace\nfrom touchstone.scenarios.families.fall import fall as f\n"
            + RETURNS.format("replace(f(), frame_rate=0)"),
            "families/zz_broken.py: scene odd: scenario 'fall': frame_rate: found 0, expected a whole number",
        ),
    ],
)
def test_one_line_names_what_is_broken(broken, text, line):
    """Name file, line and function; all other scenes can be played."""
    left, lines = broken(text)
    assert left == {"fall"}
    assert lines[0].startswith(line)
    assert all("\n" not in one for one in lines)
