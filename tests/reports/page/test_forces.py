"""Contact forces drawn over time: in the page, in a picture, and as a table."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reports.metrics.motion.time_series import FORCE, Course
from touchstone.reports.page import charts as forces
from touchstone.reports.page.charts import force_chart, force_charts
from touchstone.reports.page.page import page
from touchstone.reports.results import Row, table
from touchstone.reports.runner.request import Request, Results
from touchstone.reports.views.comparison import FORCE_PICTURE, force_panels
from touchstone.reports.views.comparison_pictures import draw_forces
from touchstone.reports.views.markdown import report
from touchstone.scenarios.catalogue import catalogue

TIME = np.arange(121) / 60
COLUMNS = (("reference", "balanced"), ("mujoco", "recommended"))


def courses(*pairs: str) -> dict[tuple[str, str], Course]:
    """Forces of pairs, the later the larger: nothing for a second, then a load; twice as much on `mujoco`."""
    load = np.where(TIME > 1, 10.0, 0.0)
    load[0] = np.nan
    return {
        column: Course(TIME, {(FORCE, pair): (i + 1) * (k + 1) * load for k, pair in enumerate(pairs)})
        for i, column in enumerate(COLUMNS)
    }


def test_a_chart_has_the_heaviest_pairs_and_the_truth() -> None:
    """A panel per pair, a line per engine, a dashed rule per window; heaps and scenes without have none."""
    scene = catalogue()["platform_lift"]
    pytest.importorskip("vl_convert")
    svg = force_chart(scene, courses("a", "b", "c", "platform-load"))
    assert [f">{pair}<" in svg for pair in ("a", "b", "c", "platform-load")] == [False, True, True, True]
    assert svg.count("stroke-dasharray") == len(scene.forces)
    assert svg.count("var(--engine-mujoco)") >= 3
    assert force_chart(scene, courses()) == ""
    assert force_chart(replace(scene, tags=("heap",)), courses("a")) == ""
    assert force_chart(replace(scene, forces=()), courses("platform-load")).count("stroke-dasharray") == 0


def test_a_page_has_charts_within_its_budget(made, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first scenes that fit have a chart, in the part of their scene."""
    pytest.importorskip("vl_convert")
    scenes = {name: (catalogue()[name], courses("a")) for name in ("stack", "slide", "fall")}
    found = force_charts(scenes)
    assert list(found) == list(scenes)
    monkeypatch.setattr(forces, "MOST_CHARACTERS", len(found["stack"]) + len(found["slide"]))
    assert list(force_charts(scenes)) == ["stack", "slide"]
    scene = made.content.frame.scenario[0]
    text = page(replace(made.content, forces={scene: found["stack"]}))
    assert found["stack"] in text[text.index(f'id="scene-{scene}"') :]


def test_the_report_has_a_table_and_a_picture(tmp_path) -> None:
    """Pairs with their figures on every engine; of many scenes, the gallery and those with a truth."""
    names = ("platform_lift", "slide")
    figures = (("mean", "N", 9.81), ("peak", "N", 12.8), ("impulse", "N s", 19.6))
    rows = [
        Row("run", name, *COLUMNS[0], 1 / 60, f"force.contact.{figure}", value, unit, subject="platform-load")
        for name in names
        for figure, unit, value in figures
    ]
    rows.append(Row("run", names[0], *COLUMNS[1], 1 / 540, "overlap.max", 0.0, "m"))
    results = Results(table(rows))
    request = Request(tuple(catalogue()[name] for name in names), COLUMNS, tmp_path)
    for name in names:
        for column, course in courses("platform-load").items():
            results.courses[name, *column] = course
    assert [panel.scenario.name for panel in force_panels(request, results)] == list(names)
    draw_forces(request, results, tmp_path)
    assert (tmp_path / FORCE_PICTURE).read_bytes().startswith(b"\x89PNG")
    text = report(request, results)
    assert "| platform_lift | platform-load | 9.81, 12.8, 19.6 | - |" in text
    assert f"]({FORCE_PICTURE})" in text
    many = replace(
        request, scenarios=(*request.scenarios, *(catalogue()[f"bounce_e0{k}"] for k in "358")) * 2
    )
    assert {panel.scenario.name for panel in force_panels(many, results)} == {"platform_lift"}
    nothing = SimpleNamespace(frame=results.frame, courses={}, recordings={})
    draw_forces(request, nothing, tmp_path / "none")
    assert not (tmp_path / "none").exists()
