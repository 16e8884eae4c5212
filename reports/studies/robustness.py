"""The study `robustness`: random scenes for which nothing was tuned, assessed without a closed form.

At most two processes play the scenes of consecutive seeds (`scenarios.random_scenes`). Each run belongs to
one class of RANDOM_CLASSES. The rows hold, per kind of scene and for `all`, the number of runs of each class
and the spread of the figures; `runs.csv` has one line per run. Limits apply to the reference, over all kinds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import cycle
from pathlib import Path
from time import process_time

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import AdapterError, Engine, Settings, Unsupported
from touchstone.adapters.recorder import Player, ready
from touchstone.adapters.registry import installed, load
from touchstone.adapters.workers.pool import HANG, Ended, Loader
from touchstone.reference_impl.solver.tolerances import RESIDUAL_OPEN
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of, write_beside
from touchstone.reports.runner.tasks import Task, own_step, played
from touchstone.reports.studies.study import Column, kept, missing_rows
from touchstone.reports.verdict.judge import judged
from touchstone.reports.verdict.outcomes import (
    COUNTERS,
    EXACT,
    FIRST_ORDER,
    RANDOM_CLASSES,
    Assessment,
    RunBounds,
    class_of_end,
    judge_random,
)
from touchstone.reports.views.pictures import DASHES, by, grid, log_axis, rule, save, strips
from touchstone.reports.views.render import Part
from touchstone.scenarios.plural import plural
from touchstone.scenarios.random_scenes import ALL_KINDS, kind_of, random_scene
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import perturbed

FRAME_SECONDS = 5.0
"""Time of a frame from which a run counts as hanging [s]: three hundred times a frame of 60 Hz."""
SCENE_SECONDS = 120.0
"""Processor time of a whole run from which it counts as hanging [s]: one that waits ends after PATIENCE."""
PATIENCE = 300.0
"""Time without an answer after which the process is terminated [s]: longer than a cold compilation."""


@dataclass(frozen=True, slots=True)
class SeededTask:
    """One run: the scene of a seed on an engine; `perturbation` displaces each body by that distance [m]."""

    engine: str
    settings: Settings
    seed: int
    kind: str | None = None
    perturbation: float = 0.0

    @property
    def scenario(self) -> Scenario:
        """The scene to play."""
        scenario = random_scene(self.seed, self.kind)
        return perturbed(scenario, self.perturbation, self.seed) if self.perturbation else scenario


def assess(engine: Engine, scenario: Scenario, settings: Settings, bounds: RunBounds) -> Assessment:
    """Play a scene in this process and classify the run; a failed run is assessed up to its failure."""
    player: Player | None = None
    outcome, reason = "", ""
    try:
        player = ready(engine, scenario, settings)
        outcome = _play(player, scenario)
    except Unsupported as error:
        return Assessment("skipped", str(error))
    except AdapterError as error:
        outcome, reason = class_of_end(str(error), "error"), str(error)
    if player is None:
        return Assessment(outcome, reason)
    recording = player.recording(reason)
    player.world.close()
    return judge_random(recording, scenario, bounds, outcome, reason)


def _play(player: Player, scenario: Scenario) -> str:
    """Play frame by frame until the end or a timeout; returns "" or "hang"."""
    start = process_time()
    for _ in range(scenario.frame_count):
        before = player.seconds_played
        player.play(1)
        if player.seconds_played - before > FRAME_SECONDS or process_time() - start > SCENE_SECONDS:
            return "hang"
    return ""


def assess_task(engine: Engine, task: Task | SeededTask) -> Assessment:
    """Play a task in this process, with the bounds of its engine."""
    bounds = EXACT if task.engine == "reference" else FIRST_ORDER
    return assess(engine, task.scenario, task.settings, bounds)


def assessment_of(found: Assessment | Ended) -> Assessment:
    """Assessment of a task, or the class of one that ended its process."""
    if not isinstance(found, Ended):
        return found
    skipped = found.status if found.status == "skipped" else "error"
    return Assessment(HANG if found.process == HANG else skipped, found.reason)


STUDY = "robustness"
ALL = "all"
"""Scenario name of the rows over all kinds."""
PROFILES = ("balanced", "accurate", "recommended")
WORST = 8
SPREADS: dict[str, tuple[tuple[str, float], ...]] = {
    # metric: percentiles
    "rise": (("p50", 50), ("p99", 99), ("max", 100)),
    "residual": (("p50", 50), ("p995", 99.5), ("max", 100)),
    "overlap": (("max", 100),),
    "momentum": (("max", 100),),
    "dropped_time": (("p99", 99), ("max", 100)),
    "slowest": (("p50", 50), ("max", 100)),
}
UNITS = {"rise": "1", "residual": "m/s", "overlap": "m", "momentum": "1", "dropped_time": "s", "slowest": "s"}
COUNTS = tuple(f"{STUDY}.{outcome.replace(' ', '_')}" for outcome in RANDOM_CLASSES)
OPEN = f"{STUDY}.solves.open"
"""Metric: share of contact solves with a residual over RESIDUAL_OPEN [1]."""
METRICS = (*COUNTS, *(f"{STUDY}.{name}.{part}" for name, parts in SPREADS.items() for part, _ in parts), OPEN)
Assessed = tuple[SeededTask, Assessment]


def tasks(
    columns: Iterable[Column], scenes: int, seed: int, kind: str | None = None, size: float = 0.0
) -> list[SeededTask]:
    """The runs of `scenes` seeds from `seed` on, per (engine, profile) of an installed engine."""
    return [
        SeededTask(engine, Settings(profile, own_step(engine, profile)), seed + k, kind, size)
        for engine, profile in columns
        if installed(engine)
        for k in range(scenes)
    ]


def run(
    columns: Sequence[Column],
    asked: Sequence[SeededTask],
    out: Path,
    progress: Progress,
    loader: Loader = load,
    patience: float = PATIENCE,
) -> pd.DataFrame:
    """Play all tasks and judge the columns; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        output = folder / "output"
        found = played(assess_task, asked, output, progress, loader=loader, patience=patience)
        runs = list(zip(asked, map(assessment_of, found)))
        lines = table_of_runs(runs)
        write_beside(folder / "runs.csv", lambda part: lines.to_csv(part, index=False))
        rows = [*missing_rows(STUDY, columns), *(judged(row, ()) for row in rows_of_runs(runs))]
        seeds = [task.seed for task in asked]
        facts = {"study": STUDY, "seeds": [min(seeds), max(seeds)] if seeds else []}
        return kept(rows, folder, facts, {"robustness.png": lambda _, part: picture(lines, part)})


def rows_of_runs(runs: Sequence[Assessed]) -> list[Row]:
    """Counts and spreads per column, over all kinds and per kind, and the worst runs with their commands."""
    rows: list[Row] = []
    columns = dict.fromkeys((task.engine, task.settings) for task, _ in runs)
    for engine, settings in columns:
        mine = [(task, found) for task, found in runs if (task.engine, task.settings) == (engine, settings)]
        for kind in (ALL, *ALL_KINDS):
            part = [found for task, found in mine if kind in (ALL, kind_of(task.seed, task.kind))]
            base = Row(STUDY, kind, engine, settings.label, settings.dt, "")
            rows += _figures(base, part) if part else []
        rows += _worst(Row(STUDY, "", engine, settings.label, settings.dt, "run"), mine)
    return rows


def _figures(base: Row, found: list[Assessment]) -> list[Row]:
    outcomes = [one.outcome for one in found]
    rows = [
        replace(base, metric=metric, value=float(outcomes.count(outcome)), unit="1")
        for metric, outcome in zip(COUNTS, RANDOM_CLASSES)
    ]
    rows[-1] = replace(rows[-1], reason=f"of {len(found)}")
    for name, parts in SPREADS.items():
        each = (one.residuals if name == "residual" else (getattr(one, name),) for one in found)
        values = np.array([value for some in each for value in some])
        values = values[np.isfinite(values)]
        for part, percent in parts if len(values) else ():
            value = float(np.percentile(values, percent, method="higher"))
            rows.append(replace(base, metric=f"{STUDY}.{name}.{part}", value=value, unit=UNITS[name]))
    solves, unsolved = (float(np.nansum(column)) for column in zip(*(one.solves for one in found)))
    if solves > 0:
        said = f"{unsolved:.0f} of {solves:.0f} contact solves leave more than {RESIDUAL_OPEN:g} m/s"
        rows.append(replace(base, metric=OPEN, value=unsolved / solves, unit="1", reason=said))
    return rows


def _worst(base: Row, runs: Sequence[Assessed]) -> list[Row]:
    """The worst runs of every class but `ok`, with the command that repeats each."""
    rows = []
    for outcome in RANDOM_CLASSES[:-1]:
        these = [(task, found) for task, found in runs if found.outcome == outcome]
        figure_of = outcome if outcome in ("residual", "overlap", "rise", "momentum") else "gain"
        these.sort(key=lambda one: -np.nan_to_num(getattr(one[1], figure_of), nan=0.0))
        for task, found in these[:WORST]:
            kind, value = kind_of(task.seed, task.kind), float(getattr(found, figure_of))
            row = replace(base, scenario=kind, seed=task.seed, subject=outcome, value=value)
            row = replace(row, unit=UNITS.get(figure_of, "1"), reason=found.reason)
            rows.append(replace(row, reproduce=line(task)))
    return rows


def line(task: SeededTask) -> str:
    """The command that repeats a task."""
    extra = f" --kind {task.kind}" if task.kind else ""
    extra += f" --perturbation {task.perturbation:g}" if task.perturbation else ""
    return (
        f"touchstone study {STUDY} --scenes 1 --seed {task.seed} --engine {task.engine} "
        f"--profile {task.settings.profile}{extra}"
    )


def table_of_runs(runs: Sequence[Assessed]) -> pd.DataFrame:
    """Table with one line per run."""
    lines = []
    for task, found in runs:
        facts = asdict(found)
        residuals, counters = facts.pop("residuals"), facts.pop("counters")
        entry = {"seed": task.seed, "kind": kind_of(task.seed, task.kind)}
        entry |= {"engine": task.engine, "profile": task.settings.label, **facts, "residual": found.residual}
        entry["unsolved_frames"] = sum(value > RESIDUAL_OPEN for value in residuals)
        lines.append(entry | dict(zip(COUNTERS, counters)))
    return pd.DataFrame(lines)


FIGURES = {
    "rise p50": "rise.p50",
    "p99": "rise.p99",
    "max": "rise.max",
    "resid. p50": "residual.p50",
    "p99.5": "residual.p995",
    "max ": "residual.max",
    "solves": "solves.open",
    "overlap": "overlap.max",
    "dropped": "dropped_time.max",
    "frame": "slowest.max",
}
NOTES = (
    "rise: of each run, the largest rise of energy in a frame over the energy at the start [1]",
    "residual: of each frame, what the contact solver left [m/s]; solves: share of contact solves that leave",
    "more than 1e-7 m/s [1]; overlap [m]; dropped: of each run, the time not simulated [s]; frame: the",
    "slowest [s]",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """One table per column, then broken limits, then the worst runs with the commands that repeat them."""
    figures = frame[frame.metric != "run"]
    parts = [
        _column(f"robustness: {engine}, {profile}", part)
        for (engine, profile), part in figures.groupby(["engine", "profile"], sort=False)
    ]
    lines = [
        f"limit broken: {row.engine} {row.profile}: {row.metric} = {short(row.value)}, "
        f"limit {row.limit:g}: {row.reason}"
        for row in rows_of(figures[figures.verdict == "fail"])
    ]
    for row in rows_of(frame[frame.metric == "run"]):
        what = row.verdict or f"{row.subject} {short(row.value)} {row.scenario}"
        lines.append(": ".join(part for part in (what, row.reproduce, row.reason) if part))
    return [*parts, Part(notes=NOTES, lines=lines)]


def _column(title: str, part: pd.DataFrame) -> Part:
    known = set(part.metric[(part.scenario == ALL) & (part.value > 0)])
    seen = [outcome for outcome, metric in zip(RANDOM_CLASSES, COUNTS) if metric in known]
    shown = {head: f"{STUDY}.{name}" for head, name in FIGURES.items()}
    shown = {head: metric for head, metric in shown.items() if (part.metric == metric).any()}
    lines: list[list[str]] = []
    for kind in (*ALL_KINDS, ALL):
        rows = {row.metric: row for row in rows_of(part[part.scenario == kind])}
        if rows:
            counts = {outcome: int(rows[metric].value) for outcome, metric in zip(RANDOM_CLASSES, COUNTS)}
            cells = (short(rows[metric].value) if metric in rows else "" for metric in shown.values())
            lines += [[]] if kind == ALL else []
            lines.append([kind, str(sum(counts.values())), *(str(counts[one] or "") for one in seen), *cells])
    return Part(title, ["kind", "runs", *seen, *shown], lines)


def short(value: float) -> str:
    """A value as one digit and a power of ten."""
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e") if value else "0"


ACROSS = 2
FLOOR = 1e-16
"""Smaller figures, and 0, are drawn at this value: rounding."""
CEILING = 1e3
"""Larger and non-finite figures are drawn at this value: beyond it, the size of an explosion does not
matter."""
HUES = (
    "#0072B2", "#56B4E9", "#009E73", "#88CC00", "#F0E442", "#E69F00",
    "#D55E00", "#CC79A7", "#AA4499", "#882255", "#777777", "#000000",
)  # fmt: skip
FAILED = ("hang", "non-finite", "exploded")
"""Outcomes that are drawn even if the rise is unknown."""


def picture(runs: pd.DataFrame, path: Path) -> None:
    """Draw the rise over the residual, or by kind of scene where engines are compared, which report none."""
    known = runs[runs.rise.notna() | runs.outcome.isin(FAILED)] if len(runs) else runs
    several = len(known) and known.engine.nunique() > 1
    (rise_by_kind if several else rise_over_residual)(known, path)


RISE = "largest rise of energy in a frame, over that at the start [1]"


def rise_by_kind(runs: pd.DataFrame, path: Path) -> None:
    """Draw a marker per run, in a row per kind of scene and engine."""
    kinds = [kind for kind in ALL_KINDS if kind in set(runs.kind)]
    points = pd.DataFrame({"row": runs.kind, "engine": runs.engine, "rise": _drawn(runs.rise, CEILING)})
    text = "dotted: bound of the reference; dashed: of engines of first order; left edge: at most 1e-16"
    x = log_axis(alt.X, "rise", [RISE, text], (FLOOR / 2, _end(points.rise, FIRST_ORDER.rise)))
    drawn = strips(kinds, points, x) + rule(x=EXACT.rise) + rule(DASHES, x=FIRST_ORDER.rise)
    save(drawn, path, "Random scenes: rise of energy")


def rise_over_residual(runs: pd.DataFrame, path: Path) -> None:
    """Draw one panel per engine and profile."""
    points = runs.copy()
    if len(runs):
        points["residual"], points["rise"] = _drawn(runs.residual, FLOOR), _drawn(runs.rise, CEILING)
    known = [kind for kind in ALL_KINDS if kind in set(points.kind)]
    hues = by(alt.Color, "kind", dict(zip(ALL_KINDS, cycle(HUES))), legend=alt.Legend(values=known))
    span = (FLOOR / 3, _end(runs.residual, RESIDUAL_OPEN))
    x = log_axis(alt.X, "residual", "largest residual of a frame [m/s]", span)
    y = log_axis(alt.Y, "rise", RISE, (FLOOR / 3, _end(runs.rise, EXACT.rise)))
    panels = []
    for (engine, profile), part in points.groupby(["engine", "profile"], sort=False):
        marks = alt.Chart(part).mark_point(filled=True, size=14, opacity=0.75).encode(x=x, y=y, color=hues)
        drawn = marks + rule(x=RESIDUAL_OPEN) + rule(y=EXACT.rise)
        title = f"{engine}, {profile}: {plural(len(part), 'run')}"
        panels.append(drawn.properties(title=title, width=320, height=230))
    note = "dotted: bounds of a run that is ok; lower and left edges: at most 1e-16"
    save(grid(panels, ACROSS), path, "Random scenes: rise of energy and residual", note)


def _end(values: pd.Series, bound: float) -> float:
    """End of an axis: beyond all values, and a decade beyond the bound."""
    return 3 * max([10 * bound, *_drawn(values, FLOOR)])


def _drawn(values: pd.Series, unknown: float) -> np.ndarray:
    """Values clipped to the picture's range; unknown and non-finite ones are `unknown`."""
    found = values.to_numpy(dtype=float)
    return np.clip(np.where(np.isfinite(found), found, unknown), FLOOR, CEILING)
