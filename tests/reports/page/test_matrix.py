"""Cells of the matrix: worst subject, marks of every broken limit, colours from the limit on."""

import re
from dataclasses import replace

import pytest

from touchstone.reports.page.page import facts, matrix_table, title, worst_part
from touchstone.reports.results import Row
from touchstone.reports.views.matrix import LIMITS, SHADES, entries, worst_of

OURS, THEIRS = ("reference", "balanced"), ("mujoco", "recommended")


def row(metric, value=float("nan"), column=THEIRS, unit="1", **other):
    """A row of one scene."""
    return Row("run", "slide", *column, 1 / 60, metric, value, unit, **other)


def overlap(value, limit=1e-3, verdict="pass", column=THEIRS):
    """A row of the deepest overlap [m]."""
    return row("overlap.max", value, column, "m", limit=limit, verdict=verdict)


def cell(rows, topic, column=THEIRS):
    """The cell of a topic."""
    return entries(rows, [OURS, THEIRS])[topic, column]


def test_a_broken_time_limit_marks_the_time():
    """The mark of a ratio of times is in the reference's time, its figures in the hover."""
    rows = [
        row("time.frame.median", 2e-5, OURS, "s"),
        row("time.frame.median", 1e-4, unit="s"),
        row("ratio.time", 0.8, OURS, limit=0.15, verdict="fail", subject="mujoco recommended", reason="slow"),
    ]
    found = cell(rows, "time", OURS)
    assert (found.text, found.mark, found.verdict) == ("20.0", "✗", "fail")
    assert "✗ mean frame time with contact, over that of mujoco recommended: 0.800, limit 0.150" in title(
        found
    )
    assert any("slow" in fact for _, fact in facts(found)["facts"])
    assert facts(found)["command"] == (
        "touchstone run slide --engine reference --engine mujoco --profile balanced --profile recommended"
        " --metric ratio.time"
    )
    html, _ = matrix_table({"slide": entries(rows, [OURS, THEIRS])}, [OURS, THEIRS])
    assert re.findall(r'class="\w+ shade\d fail[^>]*><button[^>]*aria-label="([^"]*)"', html) == [
        "slide, reference, limits: 0/1 ✗",
        "slide, reference, time: 20.0 ✗",
    ]
    assert cell(rows, "time").mark == ""


@pytest.mark.parametrize(("verdict", "mark"), [("fail", "✗"), ("known", "†"), ("unjudged", "?")])
def test_a_mark_comes_from_any_metric_of_the_topic(verdict, mark):
    """A missed limit on the cone marks the friction cell, which shows the share."""
    rows = [
        row("friction.deficit", 0.01, limit=0.05, verdict="pass"),
        row("friction.cone", 0.3, limit=1e-6, verdict=verdict),
        row("friction.creep", 0.3, OURS, "m/s", limit=1e-3, verdict=verdict),
    ]
    found = cell(rows, "friction")
    assert (found.text, found.mark) == ("0.0100", mark)
    # a column without the figure of the topic has the mark
    assert (cell(rows, "friction", OURS).text, cell(rows, "friction", OURS).mark) == ("-", mark)
    assert "creep while sticking: 300 mm/s, limit 1.00" in title(cell(rows, "friction", OURS))


def test_limits_of_no_topic_are_counted():
    """The first group counts all limits that are met, and marks those that are not."""
    rows = [overlap(1e-4), row("rest.speed", 0.2, unit="m/s", limit=0.1, verdict="fail", reason="it moves")]
    found = cell(rows, "limits")
    assert (found.text, found.mark) == ("1/2", "✗")
    assert title(found) == "limits met: 1/2\n✗ speed at rest: 0.200 m/s, limit 0.100"
    assert facts(found)["command"] == "touchstone run slide --engine mujoco --profile recommended --dt 1/60"


def test_a_cell_shows_its_worst_pair():
    """Each engine shows its own worst pair, named in the hover; the difference is that of the same pair."""
    rows = [
        row("friction.deficit", 0.02, OURS, subject="floor-box"),
        row("friction.deficit", 0.01, OURS, subject="floor-ball"),
        row("friction.deficit", 0.01, subject="floor-box"),
        row("friction.deficit", -0.4, subject="floor-ball"),
    ]
    ours, theirs = cell(rows, "friction", OURS), cell(rows, "friction")
    assert title(ours) == "missing share of friction floor-box (worst of 2): 0.0200"
    assert title(theirs) == "missing share of friction floor-ball (worst of 2): -0.400"
    assert theirs.apart == "-0.410"
    broken = replace(rows[2], limit=0.001, verdict="fail")
    assert cell([*rows[:2], broken, rows[3]], "friction").row.subject == "floor-box"
    html, _ = matrix_table({"slide": entries(rows, [OURS, THEIRS])}, [OURS, THEIRS])
    assert 'title="missing share of friction floor-ball (worst of 2): -0.400"' in html


@pytest.mark.parametrize(
    ("value", "limit", "shade"),
    [
        (1e-7, 1e-3, 0),
        (0.99e-3, 1e-3, 0),
        (1e-3, 1e-3, 0),
        (1.5e-3, 1e-3, 1),
        (4e-3, 1e-3, 2),
        (9e-3, 1e-2, 0),
        (2e-6, 1e-6, 0),
        (0.5e-3, float("nan"), 0),
        (2e-3, float("nan"), 1),
        (9.0, 1e-3, SHADES),
    ],
)
def test_colour_begins_at_the_limit(value, limit, shade):
    """Nothing below the limit is coloured, nor what a reader cannot see."""
    assert cell([overlap(value, limit)], "overlap").shade == shade


@pytest.mark.parametrize(
    ("value", "text", "exact"),
    [(0.0, "0", "0"), (2e-6, "<0.01", "0.00200"), (1e-5, "0.0100", "0.0100"), (0.1, "100", "100")],
)
def test_a_cell_has_no_more_digits_than_a_reader_needs(value, text, exact):
    """What is smaller than a hundredth of the unit is in the hover."""
    found = cell([overlap(value)], "overlap")
    assert (found.text, title(found)) == (text, f"deepest overlap: {exact} mm")


def test_times_are_coloured_from_twice_the_fastest():
    """A shade per factor of 2."""
    rows = [row("time.frame.median", 1e-4, OURS, "s"), row("time.frame.median", 4e-4, unit="s")]
    assert [cell(rows, "time", column).shade for column in (OURS, THEIRS)] == [0, 2]
    rows[1] = replace(rows[1], value=1.9e-4)
    assert cell(rows, "time").shade == 0


def test_a_run_that_failed_is_marked_beside_one_that_played():
    """One engine died, the other has figures: the cells of the first say so."""
    rows = [overlap(1e-5, column=OURS), row("run", verdict="error", reason="diverged")]
    assert [cell(rows, topic).mark for topic in ("limits", "overlap", "time")] == ["✗"] * 3
    assert cell(rows, "overlap").text == "error"
    assert cell(rows, "overlap", OURS).text == "0.0100"


def test_the_worst_of_each_engine_is_shown_with_its_scene():
    """The gravest verdict, then the largest share of where colour begins; limits are added up, a time is that
    over the fastest of its scene."""
    columns = [OURS, THEIRS]
    rows = {
        "slide": [overlap(4e-3, verdict="known"), overlap(1e-4, column=OURS)],
        "grip": [overlap(9e-3, limit=1e-2), overlap(2e-4, column=OURS)],
    }
    for scene, ours, theirs in (("slide", 1e-5, 9e-5), ("grip", 1e-3, 2e-3)):
        rows[scene] += [row("time.frame.median", t, c, "s") for t, c in ((ours, OURS), (theirs, THEIRS))]
    found = {
        scene: entries([replace(one, scenario=scene) for one in mine], columns)
        for scene, mine in rows.items()
    }
    worst = worst_of(found, columns)
    seen = {key: (cell.text, cell.mark, cell.row.scenario) for key, cell in worst.items()}
    assert seen["overlap", THEIRS] == ("4.00", "†", "slide")
    assert seen["overlap", OURS] == ("0.200", "", "grip")
    assert seen["time", THEIRS] == ("9.00×", "", "slide")  # noqa: RUF001
    assert seen[LIMITS, THEIRS][:2] == ("1/2", "†")
    assert seen[LIMITS, OURS][:2] == ("2/2", "")
    html = worst_part(found, columns)
    assert re.findall(r'<th scope="row">(\w+) <small>', html) == ["reference", "mujoco"]
    assert html.count('href="#scene-grip"') == 1
    assert worst_part({"slide": found["slide"]}, columns) == worst_part(found, columns[:1]) == ""
