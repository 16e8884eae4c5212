"""Page of one scene of a stored run, from its recordings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from touchstone.adapters.engines.entry import ENGINES
from touchstone.adapters.recording import RecordingError, load
from touchstone.reports.compare.judge_again import scene_of
from touchstone.reports.compare.stored import RunError, label_of, recordings_of, table_of
from touchstone.reports.metrics.context import Context
from touchstone.reports.page.content import Column, Content, verdict_of
from touchstone.reports.page.page import pack_text, page
from touchstone.reports.page.playback import packed


def scenes_of(run: Path) -> dict[str, dict[Column, Path]]:
    """Recordings of a run by scene and (engine, profile), engines in the order of the registry; raises
    RunError."""
    found: dict[str, dict[Column, Path]] = {}
    for path, recording in recordings_of(run):
        scene, engine, label = label_of(path, recording)
        found.setdefault(scene, {})[engine, label] = path
    order = {name: k for k, name in enumerate(ENGINES)}
    return {
        scene: dict(sorted(columns.items(), key=lambda item: order.get(item[0][0], len(order))))
        for scene, columns in found.items()
    }


def own_columns(columns: Mapping[Column, Path]) -> dict[Column, Path]:
    """One column of each engine: its own profile, or the first that was played."""
    found: dict[str, Column] = {}
    for column in columns:
        own = next(iter(ENGINES[column[0]].profiles)) if column[0] in ENGINES else ""
        if column[0] not in found or column[1] == own:
            found[column[0]] = column
    return {column: columns[column] for column in found.values()}


def scene_page(run: Path, scene: str, columns: Mapping[Column, Path]) -> str:
    """Page with the playback of some recordings of a scene, and the rows of the run's table for them.

    Raises:
        RunError: a recording cannot be read, or its scene is of another version.
    """
    played = {}
    for column, path in columns.items():
        try:
            recording = load(path)
        except RecordingError as error:
            raise RunError(str(error)) from error
        played[column] = Context(recording, scene_of(path, recording))
    scenario = next(iter(played.values())).scenario
    frame = table_of(run)
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
    return page(content)
