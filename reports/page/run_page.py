"""`report.html` of a run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from touchstone.reports.machine import machine, origin
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.time_series import Course
from touchstone.reports.page.content import Content
from touchstone.reports.page.forces import force_charts
from touchstone.reports.page.page import pack_text, page
from touchstone.reports.page.playback import packed
from touchstone.reports.results import write_beside
from touchstone.reports.views.matrix import verdict_of
from touchstone.reports.views.published import NOTE, published_table
from touchstone.scenarios.scenario import Scenario

if TYPE_CHECKING:
    from touchstone.reports.run.request import Request, Results


def packed_scene(scenario: Scenario, played: Mapping[tuple[str, str], Context]) -> dict[str, str]:
    """The recordings of a scene for the page, each engine in its first profile that played."""
    own: dict[str, tuple[str, str]] = {}
    for column in played:
        own.setdefault(column[0], column)
    if not own:
        return {}
    return {scenario.name: pack_text(packed(scenario, {column: played[column] for column in own.values()}))}


def write_page(request: Request, results: Results, manifest: Mapping[str, Any], folder: Path) -> None:
    """Write `report.html` into the folder of a run."""
    level, verdict = verdict_of(results.frame)
    heads, lines, sources = published_table(results.frame, request.scenarios)
    content = Content(
        title="touchstone run",
        level=level,
        verdict=verdict,
        frame=results.frame,
        command=request.command,
        identity=[
            *machine().items(),
            *((name, value) for name, value in origin().items() if name != "command"),
        ],
        playback=results.playback,
        forces=force_charts(_courses(request, results)),
        settings=manifest["engines"],
        published=([heads, *lines], [NOTE, *sources]) if lines else ((), ()),
        summaries={scenario.name: scenario.summary for scenario in request.scenarios},
    )
    text = page(content)
    write_beside(folder / "report.html", lambda part: part.write_text(text, "utf-8"))


def _courses(
    request: Request, results: Results
) -> dict[str, tuple[Scenario, Mapping[tuple[str, str], Course]]]:
    """Time series of each scene, each engine in its first profile that played."""
    found: dict[str, tuple[Scenario, Mapping[tuple[str, str], Course]]] = {}
    for scenario in request.scenarios:
        own: dict[str, tuple[str, str]] = {}
        for scene, engine, profile in results.courses:
            if scene == scenario.name:
                own.setdefault(engine, (engine, profile))
        courses = {column: results.courses[scenario.name, *column] for column in own.values()}
        found[scenario.name] = scenario, courses
    return found
