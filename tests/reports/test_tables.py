"""Cells of the table: numbers a reader can take in, and the one value that stands apart."""

from math import inf, isnan, nan
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchstone.reports.metrics import METRICS
from touchstone.reports.results import Row, table
from touchstone.reports.runner.request import Request, Results
from touchstone.reports.views.markdown import report
from touchstone.reports.views.tables import HIDDEN, MARKS, grid, number
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.truths.pair_names import PairName

COLUMNS = (
    ("reference", "balanced"),
    ("dart", "recommended"),
    ("bullet", "recommended"),
    ("mujoco", "recommended"),
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"), (-0.0, "0"), (1e-13, "0"), (-1e-13, "0"), (1.0, "1.00"), (-2.5, "-2.50"),
        (0.30049, "0.300"), (0.099999, "0.100"), (0.00999999, "0.0100"), (9.999, "10.0"), (99.96, "100"),
        (999.7, "1000"), (12.345, "12.3"), (1234.6, "1235"), (9999.4, "9999"), (9999.6, "1.0e+04"),
        (12345.0, "1.2e+04"), (0.0012345, "0.00123"), (0.00099999, "0.00100"), (0.00099, "9.9e-04"),
        (2.4e-6, "2.4e-06"), (inf, "inf"), (-inf, "-inf"), (nan, "nan"),
    ],
)  # fmt: skip
def test_numbers_in_words(value, text):
    """Three significant digits between 1e-3 and 1e4, two and an exponent beyond, nothing for rounding."""
    assert number(value) == text


@given(st.floats(min_value=1e-3, max_value=9.9e3), st.sampled_from((1, -1)))
def test_numbers_are_close_and_short(value, sign):
    """A shown number is within half a unit of its third digit and has three digits, four above a thousand."""
    text = number(sign * value)
    assert float(text) == pytest.approx(sign * value, rel=0.00501)
    digits = text.strip("-").replace(".", "").lstrip("0")
    assert len(digits) == 3 or (len(digits) == 4 and "." not in text)


def frame(*rows):
    """The long table of (engine index, metric, value, more)."""
    return table(
        Row("run", "scene", *COLUMNS[k], 1 / 240, metric, value, METRICS[metric].unit, **more)
        for k, metric, value, more in rows
    )


def row_of(cells, metric, subject=""):
    return next(row for row in cells.rows if row[:2] == (metric, subject))


@pytest.mark.parametrize(
    ("values", "outlier"),
    [
        ((1.0, 1.01, 1.02, 5.0), 3),
        ((1.0, 1.0, 1.0, 1.05), None),  # within a tenth
        ((1.0, 1.0, 1.0, 1.2), 3),
        ((1.0, 2.0, 3.0, 4.0), None),  # all apart
        ((0.0, 0.0, 0.0, 0.0), None),
        ((1.0, nan, 1.0, 9.0), None),  # three do not make a rule
        ((-7.0, 1.0, 1.1, 0.9), 0),
    ],
)
def test_the_outlier_is_marked(values, outlier):
    """The one value that stands apart from the others is marked, if there are four and it does."""
    rows = [
        (k, "overlap.max", value, {"verdict": "" if value == value else "skipped"})
        for k, value in enumerate(values)
    ]
    *_, cells = row_of(grid(frame(*rows), "scene"), "overlap.max")
    assert [cell.outlier for cell in cells] == [k == outlier for k in range(4)]


def test_cells_show_value_unit_and_verdict():
    """Values stand in the unit of tables with their marks; what is not measured is a dash."""
    rows = [
        (0, "overlap.max", 1e-3, {"verdict": "pass"}),
        (1, "overlap.max", 0.0123, {"verdict": "known"}),
        (2, "overlap.max", 0.5, {"verdict": "fail"}),
        (3, "overlap.max", nan, {"verdict": "skipped", "reason": "why"}),
    ]
    _, _, unit, cells = row_of(grid(frame(*rows), "scene"), "overlap.max")
    assert unit == "mm"
    marked = [cell.marked for cell in cells]
    assert marked == ["1.00", f"12.3{MARKS['known']}", f"500{MARKS['fail']}", "-"]


def test_a_missed_event_never_happened():
    """An event that fails without a time is shown as never; a run that broke shows its verdict everywhere."""
    data = table(
        [
            Row("run", "scene", *COLUMNS[0], 1 / 60, "events.touch", nan, "s", "a-b", verdict="fail"),
            Row("run", "scene", *COLUMNS[1], 1 / 60, "run", verdict="error", reason="died"),
            Row("run", "scene", *COLUMNS[2], nan, "run", verdict="skipped", reason="not installed"),
        ]
    )
    cells = grid(data, "scene")
    assert cells.heads == [
        ("reference", "balanced", "1/60"),
        ("dart", "recommended", "1/60"),
        ("bullet", "recommended", "-"),
    ]
    *_, shown = row_of(cells, "events.touch", "a-b")
    assert [cell.text for cell in shown] == ["never", "error", "skipped"]
    assert shown[1].marked == "error" + MARKS["error"]


def test_what_applies_has_a_row_in_order():
    """Rows follow the METRICS table, one per subject; what applies nowhere and what has a table of its own is
    left out."""
    rows = [(0, "restitution.achieved", 0.3, {"subject": s}) for s in ("x #1", "x #2")]
    away = [(k, "friction.stop", nan, {"verdict": "skipped", "reason": "why"}) for k in range(2)]
    some = [(0, "work", 1.0, {}), (1, "overlap.max", 0.1, {}), (0, "contact.gap", nan, {"verdict": "error"})]
    cells = grid(frame(*rows, *away, *some), "scene")
    names = [metric for metric, *_ in cells.rows]
    assert names == ["overlap.max", "contact.gap", "restitution.achieved", "restitution.achieved"]
    assert set(names).isdisjoint(HIDDEN)


def test_scenes_do_not_mix():
    """A scene's table has the columns and rows of that scene alone."""
    data = frame(*((k, "overlap.max", float(k), {}) for k in range(4)))
    data.loc[3, "scenario"] = "other"
    assert [head[0] for head in grid(data, "scene").heads] == ["reference", "dart", "bullet"]
    assert not isnan(data.value.sum())


def test_the_page_shows_asked_beside_achieved():
    """Put the restitution of a bounce and the friction of a slide beside what the scene asks for."""
    scenario = catalogue()["ball_snip"]
    rows = [
        Row(
            "run", "ball_snip", engine, "recommended", 1 / 240, metric, value, subject=str(pair), **vars(pair)
        )
        for engine, e, deficit in (("dart", 0.298, -0.05), ("bullet", 0.348, float("nan")))
        for metric, pair, value in (
            ("restitution.achieved", PairName("floor", "ball", 1), e),
            ("friction.deficit", PairName("palm", "ball"), deficit),
        )
    ]
    columns = (("dart", "recommended"), ("bullet", "recommended"))
    page = report(Request((scenario,), columns, Path("out")), Results(table(rows)))
    assert "|  | asked | dart recommended | bullet recommended |" in page
    assert "| restitution floor-ball #1 | 0.300 | 0.298 | 0.348 |" in page
    # wood on human: 0.2
    assert "| friction palm-ball | 0.200 | 0.210 | - |" in page
