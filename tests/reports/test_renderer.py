"""Charts are drawn in a process of their own: where it ends, a picture is missing and all else is stored."""

import json
import os
from pathlib import Path

import altair as alt
import pandas as pd
import pytest

from touchstone.reports.page.charts import NOT_DRAWN, svg_of
from touchstone.reports.views import renderer
from touchstone.reports.views.renderer import TRIES, RendererError, png, svg

CHART = alt.Chart(pd.DataFrame({"x": [1.0, 2.0]})).mark_point().encode(x="x:Q").to_dict()
DEADLY = {"mark": "ends the process"}


class Dies:
    """A process that a deadly chart ends."""

    def handle(self, command, text):
        if text == json.dumps(DEADLY):
            os._exit(5)
        return f"{command} by {os.getpid()}"


@pytest.fixture
def fake(monkeypatch):
    """Processes that end where a chart is deadly."""
    monkeypatch.setattr(renderer, "_renderers", [])
    monkeypatch.setattr(renderer, "Vega", Dies)


def test_one_process_draws_all_charts(monkeypatch):
    """Draw SVG and PNG in the process that the first chart started."""
    started = []
    child = renderer.ChildProcess
    monkeypatch.setattr(renderer, "_renderers", [])
    monkeypatch.setattr(renderer, "ChildProcess", lambda *given: started.append(1) or child(*given))
    assert svg(CHART).startswith("<svg")
    assert png(CHART) == png(CHART)
    assert png(CHART).startswith(b"\x89PNG")
    assert started == [1]


def test_a_chart_that_ends_its_process_costs_itself(fake):
    """Say how it ended; another process draws what follows."""
    first = svg(CHART)
    for _ in range(TRIES + 1):
        with pytest.raises(RendererError, match=r"^the process that draws died during 'png': exit code 5$"):
            png(DEADLY)
        assert svg(CHART) != first


def test_processes_that_end_at_their_first_chart_are_not_started_for_ever(fake, monkeypatch):
    """After TRIES of them all charts end with the last reason, without a process."""
    started = []
    child = renderer.ChildProcess
    monkeypatch.setattr(renderer, "ChildProcess", lambda *given: started.append(1) or child(*given))
    for _ in range(TRIES + 3):
        with pytest.raises(RendererError, match=r"exit code 5$"):
            svg(DEADLY)
    assert len(started) == TRIES


def test_a_chart_of_a_page_says_why_it_is_missing(fake, monkeypatch):
    """A paragraph is in its place."""
    monkeypatch.setattr(alt.Chart, "to_dict", lambda chart: DEADLY)
    assert (
        svg_of(alt.Chart())
        == f"<p>{NOT_DRAWN}: the process that draws died during &#x27;svg&#x27;: exit code 5</p>"
    )


def test_a_run_outlives_its_pictures(fake, monkeypatch, touchstone):
    """Rows and both reports are stored where every chart ends its process, and a line names each picture."""
    monkeypatch.setattr(Dies, "handle", lambda *_: os._exit(5))
    code, _, err = touchstone("run slip --engine reference --profile balanced --out r --quiet")
    assert code == 70
    lines = [line for line in err.splitlines() if "results are stored" in line]
    reason = "results are stored: RendererError: the process that draws died during 'png': exit code 5"
    assert lines == [
        "report.html lacks charts, and says why; results are stored",
        f"frame_budget.png could not be written; {reason}",
        f"forces.png could not be written; {reason}",
    ]
    names = {path.name for path in Path("r").iterdir()}
    assert {"results.parquet", "results.csv", "report.md", "report.html", "manifest.json"} <= names
    assert not [name for name in names if "png" in name]
