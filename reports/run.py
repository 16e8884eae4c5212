"""The study `run`: play scenes on engines, judge the recordings, and keep everything in one folder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import inf, isfinite, isnan
from pathlib import Path

import numpy as np
import pandas as pd

from adapters.contract import DRIVES, MISSING, Settings
from adapters.engines.reference.settings import changes
from adapters.recording import Recording, load
from adapters.registry import ENGINES, installed, missing_reason
from adapters.workers.children import Children, Job, Outcome
from reports.bootstrap import time_ratio
from reports.cli.progress import Progress
from reports.metrics import DRIVEN_METRICS, IMPULSE_METRICS, METRICS, PAIR_METRICS
from reports.metrics.contacts.contact import AUDIT_LIMIT, DRIVEN_AUDIT_LIMIT, driven_pairs
from reports.metrics.context import ROUNDING, Evidence, JudgeMissing, NotMeasured, Value
from reports.metrics.motion.events import subjects
from reports.metrics.motion.time_series import Course, course
from reports.noisy_limits import judged
from reports.output_folder import OutputError, output_folder
from reports.results import UNAUDITED, UNJUDGED, Row, save, save_manifest, table, write_beside
from reports.views.unresolved import warning
from scenarios.scenario import Scenario

STUDY = "run"
REFERENCE = "reference"
RATIO_LIMIT, PROBE_RATIO_LIMIT, EQUAL_RATIO_LIMIT = 0.5, 1.0, 1.0
"""The reference's time over the fastest engine's at its recommended step; in probes, where a frame may hold
next to nothing and an engine's is a few microseconds; at equal steps, where many contacts hold."""
MANY_CONTACTS = 10
"""Contacts of the reference's median frame beyond which a probe is held to RATIO_LIMIT too."""
SAME_DEPTH = 1e-8
"""Overlap below which none is larger [m]: the oracle's tolerance."""
MACHINE_PROFILE, EQUAL_PROFILE = "recommended", "equal-step"
NEEDED = ("overlap.max", "contact.impulse_balance", "contact.impulse_balance.driven")
"""Metrics that others are judged by."""
DEFAULT_PROFILES = ("balanced", "recommended", "equal-step")

__all__ = ["OutputError", "Request", "Results", "columns_of", "measured", "run", "step_text"]


@dataclass(frozen=True, slots=True)
class Request:
    """What to run: scenes, (engine, profile) columns, an own native step [s] or none, and where to put it.

    Changed settings call for columns of the reference alone.
    """

    scenarios: tuple[Scenario, ...]
    columns: tuple[tuple[str, str], ...]
    out: Path
    dt: float | None = None
    metrics: tuple[str, ...] = ()
    command: str = ""
    changes: tuple[str, ...] = ()  # "key=value" in the reference's profiles
    effects: tuple[str, ...] | None = None  # to run whatever a scene calls for; None: what it calls for
    drive: str = "native"  # of hinges in DART, Bullet and MuJoCo
    tracker: str = "ideal"  # the variant of the trackers that the scenes have
    budget: float = inf  # seconds of native steps after which a column leaves out the rest of a scene

    def settings(self, engine: str, profile: str) -> Settings:
        """How a column runs."""
        dt = self.dt or ENGINES[engine].profiles[profile]
        changed = changes(profile, self.changes) if self.changes else ()
        # the reference poses hinges, whatever drives those of engines
        drive = DRIVES[0] if engine == REFERENCE else self.drive
        return Settings(profile, dt, changed, self.effects, drive=drive, tracker=self.tracker)


@dataclass
class Results:
    """What a run gave: the long table; per (scenario, engine, profile) the recording, of a run that failed
    what it did before, and what a recording does over time, the last where several engines play; a line per
    run that left contacts unresolved."""

    frame: pd.DataFrame
    recordings: dict[tuple[str, str, str], Recording] = field(default_factory=dict)
    ended: dict[tuple[str, str, str], Recording] = field(default_factory=dict)
    courses: dict[tuple[str, str, str], Course] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def warn(self, base: Row, evidence: Evidence) -> None:
        """Keep the warning of a run, if it calls for one."""
        line = warning(base, evidence)
        self.warnings += [line] if line else []


def run(request: Request, progress: Progress) -> Results:
    """Play, judge and store; the folder appears whole when all is done, or not at all."""
    with output_folder(request.out) as folder:
        (folder / "recordings").mkdir()
        (folder / "output").mkdir()
        rows: list[Row] = []
        results = Results(table(rows))
        with Children() as children:
            for scenario in request.scenarios:
                outcomes, missing = _play(request, scenario, folder, children, progress)
                rows += _judge(request, scenario, outcomes, results, progress) + missing
        wanted = [r for r in rows if not request.metrics or r.metric in (*request.metrics, "run")]
        results.frame = table(wanted)
        save(results.frame, folder)
        manifest = {
            "command": request.command,
            "tracker": request.tracker,
            "scenarios": {
                s.name: {"tags": s.tags, "seed": s.seed, "held_samples": [t.held for t in s.trackers]}
                for s in request.scenarios
            },
            "engines": {
                "/".join(key): recording.facts
                for key, recording in (results.recordings | results.ended).items()
            },
        }
        save_manifest(folder, manifest)
        from reports.views.comparison_pictures import draw
        from reports.views.frame_budget_picture import write_picture
        from reports.views.markdown import report

        write_picture(results.recordings, folder)
        draw(request, results, folder)
        write_beside(folder / "report.md", lambda part: part.write_text(report(request, results)))
    return results


def _play(
    request: Request, scenario: Scenario, folder: Path, children: Children, progress: Progress
) -> tuple[list[Outcome], list[Row]]:
    jobs, missing = [], []
    for engine, profile in request.columns:
        if not installed(engine):
            row = Row(STUDY, scenario.name, engine, profile, float("nan"), "run")
            missing.append(replace(row, verdict=MISSING, reason=missing_reason(engine)))
            continue
        settings = request.settings(engine, profile)
        name = f"{scenario.name}-{engine}-{settings.label.replace(', ', '+')}"
        recording, output = folder / "recordings" / f"{name}.npz", folder / "output" / f"{name}.txt"
        jobs.append(Job(engine, scenario, settings, recording, output, request.budget))
    return children.play(jobs, progress), missing


def _judge(
    request: Request,
    scenario: Scenario,
    outcomes: list[Outcome],
    results: Results,
    progress: Progress,
) -> list[Row]:
    """Rows of all metrics of one scene, and those that need several engines; recordings go into `results`."""
    rows: list[Row] = []
    several = len({outcome.job.engine for outcome in outcomes}) > 1
    played: dict[tuple[str, str], Recording] = {}
    for outcome in outcomes:
        job = outcome.job
        label = job.settings.label
        base = Row(STUDY, scenario.name, job.engine, label, job.settings.dt, "run")
        if outcome.status != "done":
            rows.append(replace(base, verdict=outcome.status, reason=outcome.reason))
            if outcome.recorded:
                recording = results.ended[scenario.name, job.engine, label] = load(job.recording)
                results.warn(base, Evidence(recording, scenario))
            continue
        progress(f"{job.engine} {label}: judge", 0)
        recording = load(job.recording)
        played[job.engine, label] = recording
        results.recordings[scenario.name, job.engine, label] = recording
        evidence = Evidence(recording, scenario)
        found = measured_of(base, evidence, request.metrics)
        if several:
            results.courses[scenario.name, job.engine, label] = course(evidence)
        rows += [_excused(row, recording, scenario.tags) for row in found]
        results.warn(base, evidence)
    rows += _ratios(scenario, played, rows) + _spreads(scenario, rows)
    return [judged(row, scenario.tags) for row in rows]


def _excused(row: Row, recording: Recording, tags: tuple[str, ...]) -> Row:
    """The row; known where it breaks a limit and a needed effect was left out because that was asked for."""
    told: dict[str, str] = recording.facts.get("effects", {})
    removed = [effect for effect, state in told.items() if state.startswith("forced off")]
    found = judged(row, tags)
    if not removed or found.verdict != "fail":
        return row
    reason = f"played without {', '.join(removed)}, as asked for; limit: {found.reason}"
    return replace(found, verdict="known", reason=reason)


def measured(base: Row, scenario: Scenario, recording: Recording, only: Sequence[str] = ()) -> list[Row]:
    """One row per metric and subject of a recording: of all metrics, or of those named and what they need."""
    return measured_of(base, Evidence(recording, scenario), only)


def measured_of(base: Row, evidence: Evidence, only: Sequence[str] = ()) -> list[Row]:
    """`measured`, of evidence that others look at too."""
    scenario = evidence.scenario
    rows: list[Row] = []
    asked = {name.removesuffix(".spread") for name in only} | set(NEEDED if only else METRICS)
    for metric in METRICS.values():
        if metric.name not in asked:
            continue
        row = replace(base, metric=metric.name, unit=metric.unit)
        if {"heap", "collective"} & set(scenario.tags) and metric.name in PAIR_METRICS:
            rows.append(replace(row, verdict="skipped", reason="a heap has hundreds of pairs at a time"))
            continue
        try:
            values = metric.measure(evidence)
        except NotMeasured as reason:
            verdict = UNJUDGED if isinstance(reason, JudgeMissing) else "skipped"
            rows.append(replace(row, verdict=verdict, reason=str(reason)))
            continue
        except Exception as error:  # one metric that fails must not take the run with it
            rows.append(replace(row, verdict="error", reason=f"{type(error).__name__}: {error}"))
            continue
        for subject, value in values.items():
            number, remark = (value.value, value.reason) if isinstance(value, Value) else (value, "")
            verdict = "skipped" if isnan(number) and remark else ""
            rows.append(replace(row, subject=subject, value=number, reason=remark, verdict=verdict))
    return _audited(_expected(rows, scenario), evidence)


def _expected(rows: list[Row], scenario: Scenario) -> list[Row]:
    """Events judged against the scene's expectations."""
    windows = {(f"events.{event}", subject): e for (event, subject), e in subjects(scenario).items()}
    found = []
    for row in rows:
        window = windows.get((row.metric, row.subject))
        if window is not None:
            inside = window.earliest <= row.value <= window.latest
            reason = f"the scene expects {window.earliest:g} to {window.latest:g} s"
            verdict = "pass" if inside else "fail"
            row = replace(
                row,
                low=window.earliest,
                high=window.latest,
                limit=window.latest,
                verdict=verdict,
                reason=reason,
            )
        found.append(row)
    return found


def _audited(rows: list[Row], evidence: Evidence) -> list[Row]:
    """Impulse metrics rejected where the impulses do not balance the motion, or where nobody can tell; marked
    where they rest on impulses of driven bodies that nothing balances."""
    rows = _rejected(rows, "contact.impulse_balance", AUDIT_LIMIT)
    rows = _rejected(rows, "contact.impulse_balance.driven", DRIVEN_AUDIT_LIMIT)
    audited = {r.subject for r in rows if r.metric == "contact.impulse_balance.driven" and r.subject}
    doubtful = set()
    for pair in driven_pairs(evidence):
        one, _, two = pair.partition("-")
        # what a body's own links do to each other changes no sum over them
        if one == two or not {one, two} & audited:
            doubtful.add(pair)
    if not doubtful:
        return rows
    remark = f"rests on impulses that nothing balances: {', '.join(sorted(doubtful))}"
    return [
        replace(row, basis=UNAUDITED, reason=f"{row.reason}; {remark}".removeprefix("; "))
        if row.metric in DRIVEN_METRICS and row.subject in ("", *doubtful) and isfinite(row.value)
        else row
        for row in rows
    ]


def _rejected(rows: list[Row], audit: str, limit: float) -> list[Row]:
    audits = [row.value for row in rows if row.metric == audit and row.verdict != "skipped"]
    worst = max((inf if isnan(value) else value for value in audits), default=0.0)
    if not worst > limit:
        return rows
    reason = f"the engine's impulses miss the motion by {worst:.2g}"
    return [
        replace(row, value=float("nan"), verdict="skipped", reason=reason)
        if row.metric in IMPULSE_METRICS
        else row
        for row in rows
    ]


def _ratios(scenario: Scenario, played: dict[tuple[str, str], Recording], rows: list[Row]) -> list[Row]:
    """`ratio.time` of the reference against every engine; a verdict against the fastest at its own step, and
    at equal steps where `ratio_limits` asks for one."""
    found = []
    overlap = {(r.engine, r.profile): r for r in rows if r.metric == "overlap.max"}
    ours = {profile: r for (engine, profile), r in played.items() if engine == REFERENCE}
    others = {column: r for column, r in played.items() if column[0] != REFERENCE}
    for profile, mine in ours.items():
        ratios = {column: time_ratio(mine.time_frame, theirs.time_frame) for column, theirs in others.items()}
        # per class of steps, over the frames that both played
        largest_last = sorted(ratios, key=lambda column: ratios[column].value)
        fastest = {column[1]: column for column in largest_last}
        limits = ratio_limits(scenario, mine) if profile == "balanced" else {}
        for column, ratio in ratios.items():
            said, no_deeper = _compared(overlap.get((REFERENCE, profile)), overlap.get(column))
            row = Row(
                STUDY,
                scenario.name,
                REFERENCE,
                profile,
                1 / scenario.frame_rate,
                "ratio.time",
                ratio.value,
                "1",
                f"{column[0]} {column[1]}",
                low=ratio.low,
                high=ratio.high,
                reason=said,
            )
            if column == fastest[column[1]] and column[1] in limits:
                largest = limits[column[1]]
                verdict = "pass" if ratio.value <= largest and no_deeper is not False else "fail"
                if no_deeper is None and verdict == "pass":
                    verdict = UNJUDGED
                row = replace(row, limit=largest, verdict=verdict, reason=f"against the fastest; {said}")
            found.append(row)
    return found


def _compared(ours: Row | None, theirs: Row | None) -> tuple[str, bool | None]:
    """What is said of both overlaps, and whether ours is no larger; None where a number is missing that there
    should be. Where no two bodies may touch there is nothing to compare."""
    for row in (ours, theirs):
        if row is None:
            return "overlap not measured", None
        if not isfinite(row.value):
            return f"no overlap: {row.reason}", True if row.verdict == "skipped" else None
    deeper = ours.value > max(theirs.value, SAME_DEPTH)  # type: ignore[union-attr]
    return f"overlap {'larger' if deeper else 'no larger'}", not deeper


def ratio_limits(scenario: Scenario, ours: Recording) -> dict[str, float]:
    """Largest ratio of the reference's time over that of the fastest engine, per profile of the engines."""
    frames = np.floor(ours.contacts["time"] * scenario.frame_rate + ROUNDING).astype(int)
    held = np.bincount(frames, minlength=len(ours.time_frame))
    if np.median(held) > MANY_CONTACTS:
        return {MACHINE_PROFILE: RATIO_LIMIT, EQUAL_PROFILE: EQUAL_RATIO_LIMIT}
    return {MACHINE_PROFILE: PROBE_RATIO_LIMIT if "probe" in scenario.tags else RATIO_LIMIT}


def _spreads(scenario: Scenario, rows: list[Row]) -> list[Row]:
    """Spread of every event over the reference and the engines as recommended; the outlier named."""
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
        found.append(
            Row(
                STUDY,
                scenario.name,
                "all",
                MACHINE_PROFILE,
                float("nan"),
                f"{metric}.spread",
                spread,
                unit,
                subject,
                reason=f"outlier {outlier}: {values[outlier]:.4g}, median {middle:.4g}",
            )
        )
    return found


def step_text(dt: float) -> str:
    """A step as a fraction of a second: 1/240."""
    return str(Fraction(dt).limit_denominator(100_000)) if dt == dt else "-"


def columns_of(engines: Iterable[str], profiles: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """(engine, profile) columns: each engine in those of the profiles it has."""
    return tuple((e, p) for e in engines for p in profiles if p in ENGINES[e].profiles)
