"""What the tests of benchmarks share."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pandas as pd
import pytest

from touchstone.reports.views.render import print_parts


def shown(bench: ModuleType, rows: pd.DataFrame) -> str:
    """What is printed on a terminal of 112 columns."""
    from rich.console import Console

    console = Console(width=112, record=True, file=open("/dev/null", "w"))  # noqa: SIM115
    print_parts(bench.report(rows), console)
    return console.export_text()


@pytest.fixture(scope="session", name="shown")
def _shown():
    """What a bench prints of its rows."""
    return shown


@pytest.fixture
def fakes(monkeypatch):
    """Let this process and its children, which inherit its path, import the fakes."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    import fake_detectors
    import fake_steppers

    return fake_steppers.load, fake_detectors.load
