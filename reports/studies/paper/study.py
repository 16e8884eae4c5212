"""The study `paper`: the experiments of Schmidl and Lin (2004) on the reference's profile `paper`.

Scenes are played in turn, several times in one process; a frame's time is the median over its plays. Counters
and poses repeat exactly. All effects are on: the paper has neither plans nor fat bounds, so collisions are
detected in every frame. Claims of the paper are judged on these series (`claims.py`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import AdapterError, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, illustrate, save, save_manifest, table
from touchstone.reports.studies.paper.claim import CLAIMS, Scenes
from touchstone.reports.studies.paper.claims import SCENES
from touchstone.reports.studies.paper.picture import draw
from touchstone.reports.studies.paper.series import JOINTS, PAIRS, PASSES, Series, series_of
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED

STUDY, ENGINE, PROFILE = "paper", "reference", "paper"
SETTINGS = Settings(PROFILE, ENGINES[ENGINE].profiles[PROFILE], effects=PLANNED)
COLUMN = (ENGINE, SETTINGS.label, SETTINGS.dt)
CLAIM, REPRODUCED, NOT_REPRODUCED = f"{STUDY}.claim", "reproduced", "not reproduced"


def steps(repeats: int) -> int:
    """Number of progress steps of a run: plays of scenes, one of each untimed."""
    return len(SCENES) * (1 + repeats)


def run(repeats: int, out: Path, progress: Progress, engine: Engine | None = None) -> pd.DataFrame:
    """Play, judge and store; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        scenes, failures = played(engine or load(ENGINE), repeats, progress)
        frame = table([*failures, *rows_of_scenes(scenes), *rows_of_claims(scenes)])
        save(frame, folder)
        save_manifest(folder, {"study": STUDY, "scenes": list(scenes), "repeats": repeats})
        for kind in ("png", "svg"):
            illustrate(folder / f"paper.{kind}", lambda part, kind=kind: draw(scenes, part, kind))  # type: ignore[misc]
    return frame


def played(engine: Engine, repeats: int, progress: Progress) -> tuple[Scenes, list[Row]]:
    """Series of every scene, in the order of the mean frame; rows of those that failed."""
    chosen = {name: catalogue()[name] for name in SCENES}
    plays: dict[str, list[Recording]] = {name: [] for name in chosen}
    failures: dict[str, Row] = {}
    for turn in range(1 + repeats):
        for name, scenario in chosen.items():
            progress(f"play {turn} of {repeats}", 1)
            if name in failures:
                continue
            try:
                recording = record(engine, scenario, SETTINGS)
            except AdapterError as error:
                failures[name] = Row(STUDY, name, *COLUMN, "run", verdict="error", reason=str(error))
                continue
            if turn:
                plays[name].append(recording)
    found = [series_of(one, plays[name]) for name, one in chosen.items() if name not in failures]
    found.sort(key=lambda series: float(series.frame.mean()))
    return {series.scenario.name: series for series in found}, list(failures.values())


def rows_of_scenes(scenes: Scenes) -> list[Row]:
    """Times, shares and work of every scene; means of work over the frames that have any."""
    return [
        Row(STUDY, name, *COLUMN, f"{STUDY}.{metric}", value, unit, subject)
        for name, series in scenes.items()
        for metric, subject, unit, value in _figures(series)
    ]


def _figures(series: Series) -> list[tuple[str, str, str, float]]:
    frame = series.frame
    found = [
        ("frame", "mean", "s", float(frame.mean())),
        ("frame", "median", "s", float(np.median(frame))),
        ("frame", "p95", "s", float(np.percentile(frame, 95))),
        ("rate", "p95", "1/s", 1 / float(np.percentile(frame, 95))),
        *(("share", stage, "1", series.share(stage)) for stage in series.stages),
    ]
    for metric, counter in (("passes", PASSES), ("joints", JOINTS), ("pairs", PAIRS)):
        counts = series.counts[counter]
        found.append((metric, "mean", "1", float(counts[counts > 0].mean()) if counts.any() else 0.0))
        found.append((metric, "peak", "1", float(counts.max())))
    return found


def rows_of_claims(scenes: Scenes) -> list[Row]:
    """A row per claim: the deciding value with its bound, the outcome, and the evidence."""
    found = []
    for claim in CLAIMS:
        key = (STUDY, ", ".join(claim.scenes), *COLUMN, CLAIM)
        missing = [name for name in claim.scenes if name not in scenes]
        if missing:
            reason = f"not played: {', '.join(missing)}"
            found.append(Row(*key, subject=claim.name, verdict="skipped", reason=reason))
            continue
        value, bound, unit, evidence, why, _ = finding = claim.rule(scenes)
        holds = claim.holds(finding)
        found.append(
            Row(
                *(*key, value, unit, claim.name),
                limit=bound,
                basis=claim.basis,
                reason=evidence if holds else f"{evidence}. Why: {why}",
                reason_code=REPRODUCED if holds else NOT_REPRODUCED,
            )
        )
    return found
