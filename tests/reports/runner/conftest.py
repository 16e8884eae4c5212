"""What the tests of sweeps share."""

from pathlib import Path

import pytest


@pytest.fixture
def fakes(monkeypatch):
    """Let this process and its children, which inherit its path, import the fake measures; returns a function
    that makes cells of one."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    from fake_measures import cells

    return cells
