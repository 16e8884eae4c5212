"""`report.html` of a run.

Page of one scene of a stored run, from its recordings.

A folder of `touchstone versions` holds a run per version: its columns are called ENGINE==VERSION.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from touchstone.adapters.engines.entry import ENGINES, Entry
from touchstone.adapters.recording import RecordingError, load, scene_of_text
from touchstone.reports.changes import RunError, label_of, recordings_of, table_of
from touchstone.reports.machine import machine, origin
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.time_series import Course, course
from touchstone.reports.page.charts import NOT_DRAWN, force_charts
from touchstone.reports.page.html import Content
from touchstone.reports.page.page import pack_text, page
from touchstone.reports.page.playback import packed
from touchstone.reports.results import write_text
from touchstone.reports.views.findings import published_part
from touchstone.reports.views.matrix import verdict_of
from touchstone.reports.views.tables import Column, first_columns
from touchstone.scenarios.files.safe_paths import regular
from touchstone.scenarios.scenario import Scenario

if TYPE_CHECKING:
    from touchstone.reports.runner.request import Request, Results


def packed_scene(scenario: Scenario, played: Mapping[tuple[str, str], Context]) -> dict[str, str]:
    """The recordings of a scene for the page, each engine in its first profile that played."""
    own = {column: played[column] for column in first_columns(played)}
    return {scenario.name: pack_text(packed(scenario, own))} if own else {}


def write_page(request: Request, results: Results, manifest: Mapping[str, Any], folder: Path) -> None:
    """Write `report.html` into the folder of a run; charts that cannot be drawn are a fault."""
    level, verdict = verdict_of(results.frame)
    identity = machine() | origin()
    del identity["command"]
    courses: dict[str, tuple[Scenario, dict[tuple[str, str], Course]]] = {}
    for scenario in request.scenarios:  # each engine in its first profile that played
        own = first_columns(key[1:] for key in results.courses if key[0] == scenario.name)
        courses[scenario.name] = scenario, {column: results.courses[scenario.name, *column] for column in own}
    content = Content(
        title="touchstone run",
        level=level,
        verdict=verdict,
        frame=results.frame,
        command=request.command,
        identity=list(identity.items()),
        playback=results.playback,
        forces=force_charts(courses),
        settings=manifest["engines"],
        published=published_part(results.frame, request.scenarios),
        summaries={scenario.name: scenario.summary for scenario in request.scenarios},
    )
    text = page(content)
    write_text(folder / "report.html", text)
    if NOT_DRAWN in text:
        results.faults.append("report.html lacks charts, and says why; results are stored")


VERSION_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours of versions, in their order; they differ for colour-blind readers too."""
VERSION_MARKERS = "o^sDvP"


def scenes_of(run: Path) -> dict[str, dict[Column, Path]]:
    """Recordings of a run by scene and (engine, profile), engines in the order of the registry, versions in
    that of their command; raises RunError."""
    found: dict[str, dict[Column, Path]] = {}
    for version, folder in folders_of(run).items():
        for path, recording in recordings_of(folder):
            scene, engine, label = label_of(path, recording)
            found.setdefault(scene, {})[_named(engine, version), label] = path
    order = {name: k for k, name in enumerate(ENGINES)}
    return {
        scene: dict(sorted(columns.items(), key=lambda item: order.get(item[0][0], len(order))))
        for scene, columns in found.items()
    }


def folders_of(run: Path) -> dict[str, Path]:
    """Version -> folder of its run; "" -> the folder of a run that knows no versions."""
    try:
        versions = json.loads(regular(run / "manifest.json").read_text("utf-8")).get("versions", ())
    except (OSError, ValueError, AttributeError):
        versions = ()
    names = [str(one) for one in versions] if isinstance(versions, list) else []
    kept = {one: run / one for one in names if (run / one / "recordings").is_dir()}
    return kept or {"": run}


def _named(engine: str, version: str) -> str:
    return f"{engine}=={version}" if version else engine


def results_of(run: Path) -> pd.DataFrame:
    """Long table of a run, or of all versions of a folder of versions; raises RunError."""
    parts = [
        frame.assign(engine=[_named(engine, version) for engine in frame.engine])
        for version, frame in ((version, table_of(folder)) for version, folder in folders_of(run).items())
    ]
    return pd.concat(parts, ignore_index=True)


@contextmanager
def _with_colors(engines: Sequence[str]) -> Iterator[None]:
    """Give versions entries of their own in the registry, with colours and markers, for a time."""
    added = [name for name in engines if name not in ENGINES and "==" in name]
    for k, name in enumerate(added):
        entry = ENGINES.get(name.partition("==")[0]) or Entry("", "", {})
        color = VERSION_COLORS[k % len(VERSION_COLORS)]
        ENGINES[name] = replace(entry, color=color, marker=VERSION_MARKERS[k % len(VERSION_MARKERS)])
    try:
        yield
    finally:
        for name in added:
            del ENGINES[name]


def own_columns(columns: Mapping[Column, Path]) -> dict[Column, Path]:
    """One column of each engine: its own profile, or the first that was played."""
    found: dict[str, Column] = {}
    for column in columns:
        engine = column[0].partition("==")[0]
        own = next(iter(ENGINES[engine].profiles)) if engine in ENGINES else ""
        if column[0] not in found or column[1] == own:
            found[column[0]] = column
    return {column: columns[column] for column in found.values()}


def scene_page(run: Path, scene: str, columns: Mapping[Column, Path]) -> str:
    """Page with the playback of some recordings of a scene, and the rows of the run's table for them.

    Raises:
        RunError: a recording cannot be read.
    """
    played = {}
    for column, path in columns.items():
        try:
            recording = load(path)
        except RecordingError as error:
            raise RunError(str(error)) from error
        played[column] = Context(recording, scene_of_text(recording.scenario))
    scenario = next(iter(played.values())).scenario
    frame = results_of(run)
    chosen = pd.MultiIndex.from_frame(frame[["engine", "profile"]]).isin(list(columns))
    mine = frame[(frame.scenario == scene) & chosen]
    level, verdict = verdict_of(mine)
    content = Content(
        title=f"touchstone: {scene}",
        level=level,
        verdict=verdict,
        frame=mine,
        command=f"touchstone view {run} {scene}",
        playback={scene: pack_text(packed(scenario, played))},
        settings={f"{scene}/{'/'.join(column)}": one.recording.facts for column, one in played.items()},
        summaries={scene: scenario.summary},
    )
    with _with_colors([engine for engine, _ in columns]):
        courses = {column: course(context) for column, context in played.items()}
        return page(replace(content, forces=force_charts({scene: (scenario, courses)})))
