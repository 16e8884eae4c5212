"""The first screen of a run of several scenes: one matrix, what is broken, and where to look."""

from io import StringIO
from math import nan
from pathlib import Path

import pytest

from touchstone.reports.results import Row, table
from touchstone.reports.views import first_screen
from touchstone.reports.views.render import FittingConsole, print_parts
from touchstone.reports.views.terminal import SCENES_IN_FULL

COLUMNS = (("reference", "balanced", 1 / 60), ("dart", "recommended", 1 / 1020))


def row(scene, k, metric, value=nan, verdict="pass", **more):
    """A row of the k-th column."""
    return Row("run", scene, *COLUMNS[k], metric, value, verdict=verdict, **more)


def played(scene, overlap=2e-5, verdict="pass", **more):
    """Rows of a scene on both columns; the second has the overlap."""
    rows = [
        figure
        for k in (0, 1)
        for figure in (
            row(scene, k, "energy.injected", 1.5e-3, unit="J"),
            row(scene, k, "time.frame.median", 2e-4, "", unit="s"),
        )
    ]
    mine = row(scene, 1, "overlap.max", overlap, verdict, unit="m", limit=1e-3, **more)
    return [*rows, row(scene, 0, "overlap.max", 0.0, unit="m"), mine]


def printed(rows, width=100):
    """The lines of the first screen."""
    text = StringIO()
    print_parts(
        first_screen.first_screen(table(rows), Path("runs/one")), FittingConsole(file=text, width=width)
    )
    return [line.rstrip() for line in text.getvalue().splitlines()]


def line_of(lines, start):
    """Words of the first line that begins with `start`."""
    return next(line for line in lines if line.strip().startswith(start)).split()


def test_a_few_scenes_have_a_line_for_each_column():
    """A line has limits met, figures with the marks of their topic, and other metrics that miss a limit."""
    gap = row("slide", 1, "contact.gap", 5e-3, "known", limit=1e-4, reason="soft", unit="m")
    lines = printed([*played("fall"), *played("slide", 4e-3, "known", reason="it sinks"), gap])
    assert line_of(lines, "fall") == [*("fall", "reference", "balanced", "2/2", "0", "1.50", "-", "200")]
    dart = [line.split() for line in lines if line.strip().startswith("dart")]
    assert dart[0] == ["dart", "recommended", "2/2", "0.0200", "1.50", "-", "200"]
    assert dart[1] == ["dart", "recommended", "1/3", "†", "4.00", "†", "1.50", "-", "200", "contact.gap"]
    text = "\n".join(lines)
    assert "All 7 limits met (2 known failings)." in text
    assert "† known failings: dart recommended 2 of 2 causes" in text
    assert "page: runs/one/report.html; a scene's table: touchstone run fall; all tables: --details" in text


def test_many_scenes_have_a_line_each():
    """A line has limits met, the letters of topics that miss one, and the time of each column."""
    rows = [one for k in range(SCENES_IN_FULL) for one in played(f"fall_{k}")]
    failed = [row("thrown", 0, "run", verdict="error", reason="diverged")]
    lines = printed([*rows, *played("slide", 4e-3, "known", reason="it sinks"), *failed])
    assert line_of(lines, "fall_3") == ["fall_3", "2/2", "200", "2/2", "200"]
    assert line_of(lines, "slide") == ["slide", "2/2", "200", "1/2", "†o", "200"]
    assert line_of(lines, "thrown") == ["thrown", "error", "✗", "-"]


def test_what_is_broken_comes_once_per_cause_with_its_command():
    """The worst place of a cause, the others, and the command that repeats it; known failings are counted."""
    rows = [
        *played("fall", 4e-3, "fail", reason="visible"),
        *played("slide", 9e-3, "fail", reason="visible"),
        row("thrown", 0, "run", verdict="error", reason="diverged"),
        row("belt", 0, "run", verdict="skipped", reason="no belts"),
    ]
    lines = printed(rows, 120)
    at = lines.index("✗ dart recommended, slide: overlap.max 9.00 mm, limit 1.00; also in fall: visible")
    assert lines[at + 1] == "  touchstone run slide --engine dart --profile recommended --metric overlap.max"
    assert "✗ reference balanced, thrown: the run failed: diverged" in lines
    assert "skipped: no belts (1 scene)" in lines


@pytest.mark.parametrize("width", [100, 120])
@pytest.mark.parametrize("count", [2, SCENES_IN_FULL + 1])
def test_it_fits_the_terminal(width, count):
    """No line is longer than the terminal is wide."""
    rows = [one for k in range(count) for one in played(f"incline_slides_{k}", 1e-2, "fail", reason="x" * 90)]
    assert max(map(len, printed(rows, width))) <= width
