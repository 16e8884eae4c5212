"""The study `run`: simulate scenes on engines, judge the recordings, and store all results in one folder.

Recordings of an earlier run are judged again; where no run has a figure of a metric, it is said why.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial
from math import inf, isnan, nan
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import MISSING, Settings
from touchstone.adapters.recording import Recording, load, scene_of_text
from touchstone.adapters.registry import installed, missing_reason
from touchstone.adapters.workers.children import Children, Job, Outcome
from touchstone.reports.changes import RunError, label_of, recordings_of, table_of
from touchstone.reports.metrics import HORIZON, PARITY, SPREAD
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.time_series import course
from touchstone.reports.output_folder import output_folder
from touchstone.reports.page.run_page import packed_scene, write_page
from touchstone.reports.progress import SCENE, Progress
from touchstone.reports.results import Row, rows_of, save, save_manifest, table, write_text
from touchstone.reports.run.farthest_apart import apart_rows, measured_horizon, parity_rows
from touchstone.reports.run.ratios import ratio_rows, timed
from touchstone.reports.runner.request import EVERY_ENGINE, MACHINE_PROFILE, STUDY, Request, Results
from touchstone.reports.verdict.judge import judged_in, lost
from touchstone.reports.verdict.limits import Limit
from touchstone.reports.verdict.rows import excused, measured_of
from touchstone.reports.views.comparison import draw
from touchstone.reports.views.frame_budget import BUDGET_PICTURE, write_picture
from touchstone.reports.views.markdown import report
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario

HEAP_BUDGET, LARGE_BUDGET = 60.0, 180.0
"""Time of an engine's steps after which its column skips the rest of a heap, and of a large one [s]: the
reference takes 80 s for 1,000 grains; a frame of DART's takes seconds once hundreds of pairs touch."""


def spreads_of(scenario: Scenario, rows: list[Row]) -> list[Row]:
    """Spread of every event over the reference and the engines in profile `recommended`; names the
    outlier."""
    found = []
    events = sorted({(r.metric, r.subject, r.unit) for r in rows if r.metric.startswith("events.")})
    for metric, subject, unit in events:
        values = {
            r.engine: r.value
            for r in rows
            if (r.metric, r.subject) == (metric, subject) and r.profile in (MACHINE_PROFILE, "balanced")
        }
        if len(values) < 2 or any(isnan(value) for value in values.values()):
            continue
        middle = float(np.median(list(values.values())))
        outlier = max(values, key=lambda engine: abs(values[engine] - middle))
        spread = max(values.values()) - min(values.values())
        key = (STUDY, scenario.name, EVERY_ENGINE, MACHINE_PROFILE, nan, f"{metric}.spread")
        reason = f"outlier {outlier}: {values[outlier]:.4g}, median {middle:.4g}"
        found.append(Row(*key, spread, unit, subject, reason=reason))
    return found


Listener = Callable[[pd.DataFrame], None]


def run(request: Request, progress: Progress, judged_scene: Listener = lambda frame: None) -> Results:
    """Simulate, judge and store; the folder appears complete when all is done, or not at all.

    `judged_scene` receives the rows of each scene as soon as it is judged.
    """
    with output_folder(request.out) as folder:
        (folder / "recordings").mkdir()
        (folder / "output").mkdir()
        rows: list[Row] = []
        results = Results(table(rows))
        with Children() as children:
            for number, scenario in enumerate(request.scenarios, start=1):
                progress(f"{SCENE}{number} of {len(request.scenarios)}: {scenario.name}", 0)
                found = measure_scene(request, scenario, folder, children, results, progress)
                rows += [r for r in found if not request.metrics or r.metric in (*request.metrics, "run")]
                judged_scene(table([row for row in rows if row.scenario == scenario.name]))
        results.frame = table(rows)
        save(results.frame, folder)
        played = results.recordings | results.ended
        manifest = {
            "command": request.command,
            "tracker": request.tracker,
            "scenarios": {
                s.name: {"tags": s.tags, "seed": s.seed, "held_samples": [t.held for t in s.trackers]}
                for s in request.scenarios
            },
            "engines": {"/".join(key): recording.facts for key, recording in played.items()},
        }
        save_manifest(folder, manifest)

        results.write("report.md", lambda: write_text(folder / "report.md", report(request, results)))
        results.write("report.html", lambda: write_page(request, results, manifest, folder))
        results.write(BUDGET_PICTURE, lambda: write_picture(results.recordings, folder))
        results.write("pictures", lambda: draw(request, results, folder))
    return results


def measure_scene(
    request: Request,
    scenario: Scenario,
    folder: Path,
    children: Children,
    results: Results,
    progress: Progress,
) -> list[Row]:
    """Play and judge one scene; `folder` has `recordings` and `output`; `results` collects recordings."""
    jobs = [job_of(request, scenario, *column, folder) for column in request.columns if installed(column[0])]
    missing = [
        Row(STUDY, scenario.name, engine, profile, nan, "run", verdict=MISSING, reason=missing_reason(engine))
        for engine, profile in request.columns
        if not installed(engine)
    ]
    outcomes = children.play(jobs, progress)

    def horizon() -> float:
        played = next(outcome.job for outcome in outcomes if outcome.status == "done")
        return measured_horizon(scenario, played, children, progress)

    return judge_outcomes(request, scenario, outcomes, results, progress, horizon) + missing


def job_of(request: Request, scenario: Scenario, engine: str, profile: str, folder: Path) -> Job:
    """The job of a column of a scene; `folder` has `recordings` and `output`."""
    settings = request.settings(engine, profile)
    name = f"{scenario.name}-{engine}-{settings.label.replace(', ', '+')}"
    files = folder / "recordings" / f"{name}.npz", folder / "output" / f"{name}.txt"
    budget = (LARGE_BUDGET if "large" in scenario.tags else HEAP_BUDGET) if "heap" in scenario.tags else inf
    return Job(engine, scenario, settings, *files, budget)


@np.errstate(all="ignore")  # what overflows is infinite or NaN in its row, and warns nobody
def judge_outcomes(
    request: Request,
    scenario: Scenario,
    outcomes: list[Outcome],
    results: Results,
    progress: Progress,
    horizon: Callable[[], float] = lambda: nan,
) -> list[Row]:
    """Rows of all metrics of one scene, with the comparisons of several engines; stores recordings in
    `results`. `horizon` measures the scene's horizon [s], where it is needed."""
    rows: list[Row] = []
    bases: list[Row] = []
    played: dict[tuple[str, str], Recording] = {}
    seen: dict[tuple[str, str], Context] = {}
    for outcome in outcomes:
        job = outcome.job
        label = job.settings.label
        base = Row(STUDY, scenario.name, job.engine, label, job.settings.dt, "run")
        if outcome.status != "done":
            rows.append(replace(base, verdict=outcome.status, reason=outcome.reason))
            if outcome.recorded:
                recording = results.ended[scenario.name, job.engine, label] = load(job.recording)
                seen[job.engine, label] = Context(recording, scenario)
                results.warn(base, seen[job.engine, label])
            continue
        recording = load(job.recording)
        if len(recording.time_frame) < scenario.frame_count:
            frames = f"{len(recording.time_frame)} of {plural(scenario.frame_count, 'frame')}"
            reason = f"slow: its steps took {recording.time_frame.sum():.3g} s for {frames}"
            rows.append(replace(base, verdict="skipped", reason=reason))
            results.ended[scenario.name, job.engine, label] = recording
            continue
        progress(f"{job.engine} {label}: judge", 0)
        played[job.engine, label] = recording
        results.recordings[scenario.name, job.engine, label] = recording
        context = seen[job.engine, label] = Context(recording, scenario)
        bases.append(base)
        found = measured_of(base, context, request.metrics)
        results.courses[scenario.name, job.engine, label] = course(context)
        rows += [excused(row, recording, scenario, request.limits) for row in found]
        results.warn(base, context)
    results.write("playback", lambda: results.playback.update(packed_scene(scenario, seen)))
    overlap = {(r.engine, r.profile): r for r in rows if r.metric == "overlap.max"}
    columns = [timed(*key, one, [one.time_frame], overlap.get(key)) for key, one in played.items()]
    rows += ratio_rows(STUDY, scenario, columns, one_run=True) + spreads_of(scenario, rows)
    if not request.metrics or SPREAD in request.metrics:
        rows += apart_rows(scenario, {column: seen[column] for column in played}, horizon)
    if not request.metrics or PARITY in request.metrics:
        rows += parity_rows(scenario, {column: seen[column] for column in played})
    rows = [judged_in(row, scenario, request.limits) for row in rows]
    if request.metrics:
        return rows
    return rows + [row for base in bases for row in lost(base, rows)]


REASONS = 2
"""Reasons that a line has [1]."""


def without_figures(asked: Sequence[str], results: Results) -> str:
    """Why scenes that played have no figure of any metric asked for, and which metrics have figures; empty
    where one has, or a verdict."""
    rows = [row for row in rows_of(results.frame) if row.metric in asked]
    if not asked or not results.recordings or any(row.verdict != "skipped" for row in rows):
        return ""
    scenes = {name: None for name, *_ in results.recordings}
    where = next(iter(scenes)) if len(scenes) == 1 else f"these {len(scenes)} scenes"
    reasons = list(dict.fromkeys(row.reason for row in rows if row.reason))
    why = "; ".join(reasons) if len(reasons) <= REASONS else "nothing in it that they measure"
    why = why or "it compares columns; name another engine or profile"
    return f"no figure in {where}: {why} (valid here: {', '.join(families(_measured(results)))})"


def families(names: Iterable[str]) -> list[str]:
    """Names of metrics; several that begin with the same word as one pattern for `--metric`."""
    of_family: dict[str, list[str]] = {}
    for name in dict.fromkeys(names):
        of_family.setdefault(name.partition(".")[0], []).append(name)
    return [mine[0] if len(mine) == 1 else f"{family}.*" for family, mine in sorted(of_family.items())]


def _measured(results: Results) -> Collection[str]:
    """Names of the metrics of which a recording has figures."""
    found: dict[str, None] = {}
    for (scene, engine, label), recording in results.recordings.items():
        base = Row(STUDY, scene, engine, label, float(recording.facts["dt"]), "run")
        rows = measured_of(base, Context(recording, scene_of_text(recording.scenario)))
        found |= dict.fromkeys(row.metric for row in rows if row.verdict != "skipped")
    return found


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
    try:
        stored = table_of(folder)
    except RunError:
        stored = table([])
    with output_folder(out) as part:
        for one in scenarios:
            mine = stored[(stored.scenario == one.name) & (stored.metric == HORIZON)]
            horizon = partial(float, mine.value.max())  # which recordings do not tell
            rows += judge_outcomes(request, one, outcomes[one.name], results, progress, horizon)
        results.frame = table([row for row in rows if not metrics or row.metric in (*metrics, "run")])
        save(results.frame, part)
        save_manifest(part, {"command": command, "judged": str(folder)})
    return results
