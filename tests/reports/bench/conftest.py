"""What the tests of benchmarks share."""

from pathlib import Path

import pytest


@pytest.fixture
def fakes(monkeypatch):
    """Let this process and its children, which inherit its path, import the fakes."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    import fake_detectors
    import fake_steppers

    return fake_steppers.load, fake_detectors.load
