"""A fifth engine needs one registry entry: tables and pictures take name, colour and marker from it."""

from pathlib import Path

import pytest

from touchstone.adapters.registry import ENGINES, Entry
from touchstone.reports.results import Row, table
from touchstone.reports.runner.request import Request, Results, columns_of
from touchstone.reports.views.comparison_pictures import draw
from touchstone.reports.views.markdown import report
from touchstone.reports.views.pictures import INK, color_of, detector_color, marker_of
from touchstone.scenarios.catalogue import catalogue

FIFTH = "fifth"


@pytest.fixture
def fifth(monkeypatch):
    """The registry with a fifth engine, which needs a package that every machine has."""
    monkeypatch.setitem(ENGINES, FIFTH, Entry("nowhere:Engine", "numpy", {"recommended": 1 / 240}))
    return FIFTH


def test_an_entry_without_looks_has_some(fifth):
    """The colour and the marker that no entry states are those of no other engine."""
    others = [name for name in ENGINES if name != fifth]
    assert color_of(fifth) not in map(color_of, others)
    assert marker_of(fifth) not in map(marker_of, others)
    assert detector_color(f"{fifth}.tight") == color_of(fifth)
    assert detector_color("unknown") == INK


def test_pictures_and_report_show_it(fifth, tmp_path: Path):
    """Pictures of the differences and the report are drawn with a column of the fifth engine."""
    columns = columns_of(ENGINES, ["balanced", "recommended"])
    request = Request((catalogue()["fall"],), columns, tmp_path)
    rows = [
        Row("run", "fall", engine, profile, ENGINES[engine].profiles[profile], "overlap.max", 1e-3 * k, "m")
        for k, (engine, profile) in enumerate(columns)
    ]
    results = Results(table(rows))
    draw(request, results, tmp_path)
    assert fifth in report(request, results)
    drawn = [path.read_bytes()[:4] for path in tmp_path.glob("*.png")]
    assert drawn
    assert set(drawn) == {b"\x89PNG"}
