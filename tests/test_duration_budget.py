"""The budget of the tests' durations."""

from pathlib import Path

import pytest

SHARED = Path(__file__).parent / "shared"
pytest_plugins = ["pytester"]

BUSY = """
import time
import pytest

def busy(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass

def test_short():
    busy(0.05)

@pytest.mark.slow
def test_marked():
    busy(0.3)
"""


@pytest.mark.parametrize(
    ("test_budget", "session_budget", "code", "line"),
    [(60, 0, 0, ""), (0.02, 0, 1, "test_short took"), (60, 0.1, 1, "all tests took")],
)
def test_a_test_or_a_session_over_budget_fails(pytester, test_budget, session_budget, code, line):
    """A slow test may take its time; another fails its session beyond the budget, and so do all together."""
    pytester.makepyfile(BUSY)
    pytester.makeini(f"[pytest]\nmarkers = slow\npythonpath = {SHARED}")
    plugin = ["import duration_budget", f"duration_budget.TEST_BUDGET = {test_budget}"]
    pytester.makeconftest("\n".join([*plugin, "pytest_plugins = ['duration_budget']"]))
    found = pytester.runpytest_subprocess("-p", "no:cacheprovider", f"--cpu-budget={session_budget}")
    assert found.ret == code
    assert line in "\n".join(out for out in found.outlines if "over budget" in out)
