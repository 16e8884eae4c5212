"""The metric of published values, and their table on the terminal, in the report and on the page."""

from dataclasses import replace
from math import nan
from pathlib import Path

import pytest

from touchstone.reports.page.html import Content
from touchstone.reports.page.page import page
from touchstone.reports.results import Row, table
from touchstone.reports.runner.request import Request, Results
from touchstone.reports.views.findings import PUBLISHED_TITLE, published_part
from touchstone.reports.views.markdown import report
from touchstone.scenarios.catalogue import catalogue

SLIP = catalogue()["slip"]
FIRST, SECOND, THIRD = SLIP.published


def rows(*engines: str) -> list[Row]:
    """Rows of `slip`: the reference is right, others are two tolerances fast; the first did not play."""
    base = Row("run", SLIP.name, "", "", 1 / 60, "published.error", unit="1")
    absent = replace(base, metric="run", engine="drake", profile="recommended", verdict="missing")
    found = [absent]
    for engine in engines:
        error = 0.0 if engine == "reference" else 2.0
        mine = replace(base, engine=engine, profile="balanced" if engine == "reference" else "recommended")
        found += [
            replace(mine, subject=one.name, value=error, verdict="fail" if error else "pass")
            for one in (FIRST, SECOND)
        ]
        found.append(replace(mine, subject=THIRD.name, value=nan, verdict="skipped"))
        found.append(replace(mine, profile="accurate", subject=FIRST.name, value=9.0))
    return [replace(absent, engine="all", verdict=""), *found]


def test_error_over_tolerance(recordings, known):
    """What follows the truth has no error; a tolerance more is an error of 1; the remark has both values."""
    right = known.ideal(recordings, SLIP)
    found = known.value("published.error", right, SLIP)
    assert list(found) == [one.name for one in SLIP.published]
    assert all(abs(one.value) < 1e-9 for one in found.values())
    assert found[FIRST.name].reason == "1.42857 of 1.42857 m/s"
    velocity = right.linear_velocity.copy()
    velocity[-1, SLIP.body_index(FIRST.body), 0] += FIRST.tolerance
    faster = known.value("published.error", replace(right, linear_velocity=velocity), SLIP)
    assert faster[FIRST.name].value == pytest.approx(1.0)
    assert faster[SECOND.name].value == found[SECOND.name].value


def test_error_relative_to_another_body(recordings, known):
    """A load that stays while its platform moves has slipped by the way of the platform."""
    scene = catalogue()["platform_stick"]
    still = recordings.recording(replace(scene, truths=()))
    moved = still.position.copy()
    moved[-1, scene.body_index("platform"), 0] += 3 * scene.published[0].tolerance
    found = known.value("published.error", replace(still, position=moved), scene)
    assert found["slip"].value == pytest.approx(3.0)


def test_reach_of_a_heap(recordings, known):
    """Grains that all move on by the published run-out have no error; one that rolls on adds none."""
    scene = catalogue()["column_10"]
    (one,) = scene.published
    still = recordings.recording(scene)
    moved = still.position.copy()
    grains = [k for k, body in enumerate(scene.bodies) if body.name.startswith("grain_")]
    moved[-1, grains, 0] += one.value
    moved[-1, grains[0], 0] += 1.0
    found = known.value("published.error", replace(still, position=moved), scene)
    assert found["front"].value == pytest.approx(0.0, abs=0.05)


def test_what_is_not_measured(recordings, known):
    """Scenes without published values, and runs that ended early, have a reason."""
    fall = catalogue()["fall"]
    said = known.unmeasured("published.error", recordings.recording(fall), fall)
    assert "states no published value" in said
    short = recordings.recording(replace(SLIP, duration=0.5, truths=(), published=()))
    assert "the end was not played" in known.unmeasured("published.error", short, SLIP)


def test_the_table():
    """A line per value with its source's number; a column per engine, in its first profile, with marks."""
    found = published_part(table(rows("reference", "dart")), [catalogue()["fall"], SLIP])
    heads, lines, (_, *sources) = found.heads, found.rows, found.notes
    assert heads == ["scene", "value", "unit", "published", "±", "drake", "reference", "dart"]
    assert lines[0] == ["slip", "0° speed [1]", "m/s", "1.429", "0.014", "missing", "1.429", "1.457 ✗"]
    assert [line[-1] for line in lines] == ["1.457 ✗", "1.457 ✗", "skipped"]
    assert sources == [f"[1] {FIRST.source}"]


def test_nothing_where_nothing_was_measured(shown):
    """Runs of other metrics, and of scenes without published values, have no table."""
    assert not published_part(table(rows()), [SLIP]).rows
    assert not published_part(table(rows("dart")), [catalogue()["fall"]]).rows
    assert shown([published_part(table(rows()), [SLIP])]) == ""


def test_terminal_report_and_page(shown):
    """All three have the table, the note and the sources in full."""
    frame = table(rows("reference", "dart"))
    request = Request((SLIP,), (("reference", "balanced"), ("dart", "recommended")), Path("runs/one"))
    markdown = report(request, Results(frame))
    found = published_part(frame, [SLIP])
    html = page(Content("t", "good", "v", frame, published=found))
    for text in (shown([found]), markdown, html):
        assert PUBLISHED_TITLE in text
        assert "1.457 ✗" in text
        assert " ".join(FIRST.source.split()) in " ".join(text.split())
    assert f"## {PUBLISHED_TITLE}" in markdown
    assert 'id="published"' in html
    assert 'id="published"' not in page(Content("t", "good", "v", frame))
