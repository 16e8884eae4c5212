from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from math import nan
from pathlib import Path

from touchstone.adapters.contract import Settings
from touchstone.adapters.recording import scene_of_text
from touchstone.adapters.workers.children import Job, Outcome
from touchstone.reports.changes import RunError, label_of, recordings_of, table_of
from touchstone.reports.metrics import HORIZON
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, save, save_manifest, table
from touchstone.reports.run.study import judge_outcomes
from touchstone.reports.runner.request import Request, Results
from touchstone.reports.verdict.limits import Limit
from touchstone.scenarios.scenario import Scenario


def outcomes_of(folder: Path) -> dict[str, list[Outcome]]:
    """Outcomes per scene, from the recordings of a run; raises RunError."""
    found: dict[str, list[Outcome]] = {}
    scenes: dict[str, Scenario] = {}
    for path, recording in recordings_of(folder):
        scenario = scene_of_text(recording.scenario)
        _, engine, label = label_of(path, recording)
        settings = Settings(label, float(recording.facts["dt"]))
        scenario = scenes.setdefault(scenario.name, scenario)
        job = Job(engine, scenario, settings, path, path.with_suffix(".txt"))
        status = "error" if recording.ended else "done"
        found.setdefault(scenario.name, []).append(Outcome(job, status, recording.ended))
    return found


def _stored_horizon(folder: Path, scene: str) -> float:
    """Horizon of a scene in the table of a run, which recordings do not tell; NaN without one."""
    try:
        frame = table_of(folder)
    except RunError:
        return nan
    return float(frame.value[(frame.scenario == scene) & (frame.metric == HORIZON)].max())


def judge(
    folder: Path,
    out: Path,
    progress: Progress,
    metrics: tuple[str, ...] = (),
    limits: Iterable[Limit] = (),
    command: str = "",
) -> Results:
    """Judge the recordings of a run again; writes table and manifest to a new folder.

    Args:
        metrics: report these alone; empty: all.
        limits: those of a file, which come before the scenes' own and ours.
    Raises:
        RunError: the folder holds no recordings, or one that cannot be read.
        OutputError: `out` cannot be written.
    """
    outcomes = outcomes_of(folder)
    jobs = [outcome.job for each in outcomes.values() for outcome in each]
    columns = dict.fromkeys((job.engine, job.settings.profile) for job in jobs)
    scenarios = tuple(each[0].job.scenario for each in outcomes.values())
    request = Request(scenarios, tuple(columns), out, metrics=metrics, command=command, limits=tuple(limits))
    rows: list[Row] = []
    results = Results(table(rows))
    with output_folder(out) as part:
        for scenario in scenarios:
            found = partial(_stored_horizon, folder, scenario.name)
            rows += judge_outcomes(request, scenario, outcomes[scenario.name], results, progress, found)
        results.frame = table([row for row in rows if not metrics or row.metric in (*metrics, "run")])
        save(results.frame, part)
        save_manifest(part, {"command": command, "judged": str(folder)})
    return results
