"""What a run of several scenes prints: the first screen, and the tables of many scenes at a glance."""

from math import nan
from pathlib import Path
from typing import NamedTuple

import pytest

from touchstone.reports.results import Row, table
from touchstone.reports.views import terminal
from touchstone.reports.views.tables import MARKS
from touchstone.reports.views.terminal import SCENES_IN_FULL, TOTALS, overview, report

COLUMNS = (("reference", "balanced", 1 / 60), ("dart", "recommended", 1 / 1020))


def row(scene, k, metric, value=nan, **more):
    """A row of the k-th column."""
    return Row("run", scene, *COLUMNS[k], metric, value, more.pop("unit", "1"), **more)


class Scene(NamedTuple):
    """A scene, its limits met per column, and metric -> unit and values."""

    name: str
    outcome: list[str]
    rows: dict[str, list[str]]


class Seen(NamedTuple):
    """An overview."""

    heads: list[tuple[str, ...]]
    scenes: list[Scene]
    totals: dict[str, list[int]]
    remarks: list[str]


def seen(*rows):
    """The overview of rows: heads of columns, scenes with their outcome and rows, totals, remarks."""
    figures, totals = overview(table(rows))
    scenes: list[Scene] = []
    for line in ([str(cell) for cell in row] for row in figures.rows if row):
        if line[0].startswith(" "):
            scenes[-1].rows[line[0].strip()] = line[1:]
        else:
            scenes.append(Scene(line[0], line[2:], {}))
    heads = [tuple(head.split("\n")) for head in figures.heads[2:]]
    counts = {name: list(map(int, line)) for name, *line in totals.rows}
    return Seen(heads, scenes, counts, totals.lines)


def test_limits_are_counted_per_scene_and_column():
    """Each scene tells how many limits were met of those that apply, and the worst that happened."""
    found = seen(
        row("fall", 0, "truth.position", 0.0, verdict="pass"),
        row("fall", 0, "energy.gain", 0.0, verdict="pass"),
        row("fall", 0, "time.read", 1e-6),
        row("fall", 1, "truth.position", 1e-3, verdict="pass"),
        row("fall", 1, "energy.gain", 0.2, verdict="known", reason="it drifts"),
        row("roll", 0, "truth.position", 1.0, verdict="fail", reason="far", limit=0.5),
        row("roll", 0, "energy.gain", 0.0, verdict="known", reason="known"),
        row("roll", 1, "run", verdict="error", reason="died"),
    )
    assert found.heads == [("reference", "balanced", "1/60 s"), ("dart", "recommended", "1/1020 s")]
    fall, roll = found.scenes
    assert (fall.name, roll.name) == ("fall", "roll")
    assert fall.outcome == ["2 of 2", f"1 of 2{MARKS['known']}"]
    assert roll.outcome == [f"0 of 2{MARKS['fail']}", f"error{MARKS['error']}"]
    assert [dict(zip(TOTALS, counts)) for counts in found.totals.values()] == [
        dict.fromkeys(TOTALS, 0) | {"limits": 4, "met": 2, "known": 1, "causes": 1, "broken": 1},
        dict.fromkeys(TOTALS, 0) | {"limits": 2, "met": 1, "known": 1, "causes": 1, "errors": 1},
    ]


def test_every_column_has_the_same_limits():
    """A metric counts once, by its worst subject; what does not apply is counted apart, with the reason."""
    found = seen(
        row("fall", 0, "truth.position", 0.0, verdict="pass"),
        row("fall", 0, "restitution.error", 0.0, subject="#1", verdict="pass"),
        row("fall", 0, "restitution.error", 9.0, subject="#2", verdict="fail", reason="far", limit=0.5),
        row("fall", 0, "joint.limit", 0.0, verdict="pass", basis="construction"),
        row("fall", 0, "solver.caps", 0.0, verdict="pass"),
        row("fall", 1, "truth.position", 1e-3),
        row("fall", 1, "restitution.error", 0.0, subject="#1", verdict="pass"),
        row("fall", 1, "joint.limit", verdict="skipped", reason="the scene has no joints"),
        row("fall", 1, "overlap.max", verdict="unjudged", reason="no coal"),
    )
    assert found.scenes[0].outcome == [f"3 of 5 (1){MARKS['fail']}", f"1 of 5 (3){MARKS['unjudged']}"]
    ours, theirs = (dict(zip(TOTALS, counts)) for counts in found.totals.values())
    assert (ours["limits"], ours["met"], ours["by construction"], ours["broken"]) == (5, 3, 1, 1)
    assert (theirs["limits"], theirs["met"], theirs["unjudged"], theirs["not applicable"]) == (5, 1, 1, 3)
    assert found.remarks[-3:] == [
        "does not apply, 2 times: not among the rows of this run: overlap.max, solver.caps",
        "does not apply, 1 times: no limit for this column: truth.position",
        "does not apply, 1 times: the scene has no joints: joint.limit",
    ]


def test_one_cause_counts_once():
    """A cause that shows in six metrics is one, however often it is listed."""
    names = ("overlap.max", "contact.gap", "energy.gain", "friction.creep", "rest.drift", "joint.limit")
    rows = [
        row("a", 1, name, 1.0, verdict="known", reason="of x; it is soft", reproduce=f"touchstone run {name}")
        for name in names
    ]
    counts = dict(zip(TOTALS, seen(*rows).totals["dart recommended"]))
    assert (counts["known"], counts["causes"]) == (6, 1)


def test_only_what_stands_out_has_a_row():
    """A scene shows its first figure that is not 0 and what misses a limit, of the worst subject."""
    found = seen(
        row("slide", 0, "truth.position", 0.0, verdict="pass"),
        row("slide", 0, "overlap.max", 2e-6, verdict="pass", unit="m"),
        row("slide", 0, "friction.cone", 0.0, verdict="pass"),
        row("slide", 0, "friction.stop", 0.01, subject="a", verdict="pass"),
        row("slide", 0, "friction.stop", -0.2, subject="b", verdict="fail", reason="far", limit=0.1),
        row("slide", 0, "friction.stop", 0.15, subject="c", verdict="fail", reason="far", limit=0.1),
        row("slide", 0, "time.read", 1.0),
        row("slide", 1, "friction.stop", 0.03, subject="a", verdict="pass"),
        row("slide", 1, "friction.stop", -0.04, subject="b", verdict="pass"),
    )
    (scene,) = found.scenes
    assert scene.rows == {
        "overlap.max": ["mm", "0.00200", "-"],
        "friction.stop": ["", f"-0.200{MARKS['fail']}", "-0.0400"],
    }


def test_each_reason_is_told_once():
    """Remarks group the figures by reason, the broken first, without the body's name and the command."""
    found = seen(
        row("a", 1, "energy.gain", 0.2, verdict="known", reason="of ball; it is soft"),
        row("b", 1, "energy.gain", 0.3, verdict="known", reason="it is soft"),
        row("b", 0, "overlap.max", 0.1, unit="m", verdict="fail", limit=0.01, reason="deep"),
        row("c", 1, "run", verdict="skipped", reason="dart: no such shape"),
        row("c", 0, "energy.loss", verdict="skipped", reason="not tagged conservative"),
    )
    assert found.remarks == [
        "fail: reference balanced: deep: b overlap.max 0.100 m (limit 0.01)",
        "known: dart recommended: it is soft: a energy.gain 0.200, b energy.gain 0.300",
        "skipped: dart recommended: dart: no such shape: c",
        "does not apply, 2 times: not among the rows of this run: overlap.max, energy.gain",
    ]
    counts = dict(zip(TOTALS, found.totals["dart recommended"]))
    assert (counts["known"], counts["causes"], counts["not run"]) == (2, 1, 1)


def test_ratios_are_told_in_one_line():
    """Judged time ratios count as limits and are printed with their range; the others are not."""
    found = seen(
        *(
            row(scene, 0, "ratio.time", value, subject="dart recommended", verdict="pass", limit=1.0)
            for scene, value in (("a", 0.5), ("b", 0.125), ("c", 0.25))
        ),
        row("a", 0, "ratio.time", 9.0, subject="dart equal-step"),
    )
    assert found.remarks == [
        "ratio.time, one run: the reference takes 0.125 (b) to 0.500 (a) of the fastest engine's mean frame "
        "with contact"
    ]
    assert [scene.outcome[0] for scene in found.scenes] == ["1 of 1"] * 3


def test_many_scenes_are_shown_at_a_glance(shown):
    """Up to SCENES_IN_FULL scenes each have their whole table; one more turns them into one overview."""
    for count in (SCENES_IN_FULL, SCENES_IN_FULL + 1):
        rows = [row(f"scene_{k}", 0, "truth.position", 0.5, verdict="pass") for k in range(count)]
        text = shown(report(table(rows)))
        assert ("1 of 1" in text) == (count > SCENES_IN_FULL)
        assert text.count("truth.position") == count
        assert text.count("metric") == (0 if count > SCENES_IN_FULL else count)


def played(scene, overlap=2e-5, verdict="pass", **more):
    """Rows of a scene on both columns; the second has the overlap."""
    rows = [
        figure
        for k in (0, 1)
        for figure in (
            row(scene, k, "energy.injected", 1.5e-3, unit="J", verdict="pass"),
            row(scene, k, "time.frame.median", 2e-4, unit="s"),
        )
    ]
    rows.append(row(scene, 0, "overlap.max", 0.0, unit="m", verdict="pass"))
    return [*rows, row(scene, 1, "overlap.max", overlap, unit="m", limit=1e-3, verdict=verdict, **more)]


@pytest.fixture
def printed(shown):
    """The lines of the first screen."""

    def lines(rows, width=100):
        text = shown(terminal.first_screen(table(rows), Path("runs/one")), width)
        return [line.rstrip() for line in text.splitlines()]

    return lines


def line_of(lines, start):
    """Words of the first line that begins with `start`."""
    return next(line for line in lines if line.strip().startswith(start)).split()


def test_a_few_scenes_have_a_line_for_each_column(printed):
    """A line has limits met, figures with the marks of their topic, and other metrics that miss a limit."""
    gap = row("slide", 1, "contact.gap", 5e-3, verdict="known", limit=1e-4, reason="soft", unit="m")
    lines = printed([*played("fall"), *played("slide", 4e-3, "known", reason="it sinks"), gap])
    assert line_of(lines, "fall") == [*("fall", "reference", "balanced", "2/2", "0", "1.50", "-", "200")]
    dart = [line.split() for line in lines if line.strip().startswith("dart")]
    assert dart[0] == ["dart", "recommended", "2/2", "0.0200", "1.50", "-", "200"]
    assert dart[1] == ["dart", "recommended", "1/3", "†", "4.00", "†", "1.50", "-", "200", "contact.gap"]
    text = "\n".join(lines)
    assert "All 7 limits met (2 known failings)." in text
    assert "† known failings: dart recommended 2 of 2 causes" in text
    assert "page: runs/one/report.html; a scene's table: touchstone run fall; all tables: --details" in text


def test_many_scenes_have_a_line_each(printed):
    """A line has limits met, the letters of topics that miss one, and the time of each column."""
    rows = [one for k in range(SCENES_IN_FULL) for one in played(f"fall_{k}")]
    failed = [row("thrown", 0, "run", verdict="error", reason="diverged")]
    lines = printed([*rows, *played("slide", 4e-3, "known", reason="it sinks"), *failed])
    assert line_of(lines, "fall_3") == ["fall_3", "2/2", "200", "2/2", "200"]
    assert line_of(lines, "slide") == ["slide", "2/2", "200", "1/2", "†o", "200"]
    assert line_of(lines, "thrown") == ["thrown", "error", "✗", "-"]


def test_many_columns_have_a_line_each_with_their_worst_scene(printed, monkeypatch):
    """Where a matrix would not be read at a glance, each column has its limits, and its worst scenes."""
    monkeypatch.setattr(terminal, "LINES", 3)
    monkeypatch.setattr(terminal, "CROWDED", 1)
    lines = printed([*played("fall"), *played("slide", 4e-3, "known", reason="it sinks")])
    dart = line_of(lines, "dart")
    assert dart[:7] == ["dart", "recommended", "3/4", "†", "4.00", "†", "slide"]
    assert line_of(lines, "reference")[2:5] == ["4/4", "0", "fall"]


def test_what_is_broken_comes_once_per_cause_with_its_command(printed):
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
def test_it_fits_the_terminal(printed, width, count):
    """No line is longer than the terminal is wide."""
    rows = [one for k in range(count) for one in played(f"incline_slides_{k}", 1e-2, "fail", reason="x" * 90)]
    assert max(map(len, printed(rows, width))) <= width
