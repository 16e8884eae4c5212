"""Processor time of tests: the slowest are printed, and a test or a session over its budget fails.

Processor time, children included, does not depend on what else a machine does. Time in which the reference is
compiled before the tests start is not part of it.
"""

import os
from collections import defaultdict
from collections.abc import Iterator

import pytest

TEST_BUDGET = 60.0
"""Processor time of one test that is not marked slow [s]."""
SHOWN = 15
"""Number of tests that are printed."""
OPTION = "--cpu-budget"
KEY = "cpu seconds"

spent: dict[str, float] = defaultdict(float)
quick: set[str] = set()


def cpu_seconds() -> float:
    """Processor time of this process and of its children that ended [s]."""
    return sum(os.times()[:4])


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the budget of a session."""
    parser.addoption(OPTION, type=float, default=0.0, help="processor time of all tests [s]; 0: no budget")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Start the clock of a test."""
    item.stash[START] = cpu_seconds()
    return (yield)


START: pytest.StashKey[float] = pytest.StashKey()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    """Note the processor time of a phase in its report, which reaches the first process."""
    report = yield
    now = cpu_seconds()
    report.user_properties = [*report.user_properties, (KEY, now - item.stash[START])]
    report.user_properties += [("slow", item.get_closest_marker("slow") is not None)]
    item.stash[START] = now
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add the time of a phase to its test."""
    reported = dict(report.user_properties)
    spent[report.nodeid] += reported.get(KEY, 0.0)
    if not reported.get("slow", False):
        quick.add(report.nodeid)


def over_budget(budget: float) -> list[str]:
    """One line per test, and one for the session, that took more than its budget."""
    lines = [
        f"{test} took {seconds:.2f} s of processor time, at most {TEST_BUDGET:g} s: mark it slow"
        for test, seconds in spent.items()
        if test in quick and seconds > TEST_BUDGET
    ]
    total = sum(spent.values())
    if 0 < budget < total:
        lines.append(f"all tests took {total:.2f} s of processor time, at most {budget:g} s")
    return lines


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail a session over budget."""
    first = not hasattr(session.config, "workerinput")
    if first and session.exitstatus == 0 and over_budget(session.config.getoption(OPTION)):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the slowest tests and what is over budget."""
    slowest = sorted(spent.items(), key=lambda entry: -entry[1])[:SHOWN]
    if len(spent) > SHOWN:
        total = sum(spent.values())
        terminalreporter.section(f"processor time: {total:.0f} s, of which the slowest tests")
        for test, seconds in slowest:
            terminalreporter.write_line(f"{seconds:7.2f} s  {test}")
    for line in over_budget(config.getoption(OPTION)):
        terminalreporter.write_line(f"over budget: {line}", red=True)
