"""The study `ablation`: every constant of the reference varied alone, and every mechanism switched off.

One process plays all of it, in a reference that reads its constants from memory
(`adapters/engines/reference/variable.py`). Rows tell in how many scenes the motion differs at all, which
limits are then broken or kept, how the error against closed forms changes, and what a frame costs: what
accuracy costs in time within the reference. What changes no motion and saves no time can go.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from hashlib import sha256
from math import exp, isfinite, isnan, log, nan
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
from scipy.stats import bootstrap

from touchstone.adapters.contract import AdapterError, Engine, Settings, State
from touchstone.adapters.engines.reference import variable
from touchstone.adapters.engines.reference.settings import PAPER
from touchstone.adapters.recorder import build, frame_seconds, ready
from touchstone.adapters.registry import load
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.runner.tasks import own_step, played
from touchstone.reports.studies.study import RefusedError, kept, with_interval
from touchstone.reports.verdict.judge import judged
from touchstone.reports.verdict.outcomes import EXACT, judge, judge_random
from touchstone.reports.verdict.rows import measured
from touchstone.reports.views.pictures import PALE, color_of, log_axis, rule, save
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.difficulty.checks import Checks
from touchstone.scenarios.difficulty.family import families, hard_scene
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import Scenario

STUDY, ENGINE = "ablation", "reference"
FACTOR = 4.0
"""Factor by which a constant is multiplied and divided [1]."""
OFF = "off"
LEAST_TIME, MOST_TIME = 1e-2, 0.3
"""Times of all frames of a scene between which its time is compared [s]: shorter ones are noise."""
METRICS = (
    *("truth.position", "truth.velocity", "overlap.max", "overlap.tunnelled", "energy.injected"),
    *("friction.deficit", "friction.cone", "restitution.error", "contact.gap"),
    *("force.error", "solver.residual"),
)
PATIENCE = 20.0
"""Time of the frames of a scene, over that as landed plus a second, at which a run is cut off [1]."""
HANGING = 900.0
"""Time without an answer after which a variation counts as endless [s]: the first one may compile."""
FLOOR = 1e-12
"""Error against a closed form that counts as none, in the metric's unit."""
LISTED = 3


@dataclass(frozen=True, slots=True)
class Variation:
    """One task: a constant, by "module.NAME", at another value, or a mechanism, by its name, switched off."""

    settings: Settings
    subject: str
    change: str
    value: float = nan
    scenes: int = 16
    """Random scenes, from seed 0 on."""
    engine: str = ENGINE

    def apply(self) -> None:
        """Vary the reference of this process."""
        if self.change == OFF:
            variable.vary({}, [self.subject])
        else:
            variable.vary({self.subject: self.value})


@dataclass(slots=True)
class Effect:
    """What a variation does: scenes whose motion differs, limits newly broken and newly kept, logarithms of
    the ratios of errors, and ratios of times."""

    changed: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)
    mended: list[str] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    times: list[float] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Case:
    """A scene, and how it is judged: by its checks, as a random one, or by limits."""

    scenario: Scenario
    checks: Checks | None = None
    random: bool = False


@dataclass(frozen=True, slots=True)
class Played:
    """A run: what was found of it, digits of its states, and the time of its frames [s]."""

    failures: frozenset[str]
    errors: Mapping[str, float] = field(default_factory=dict)
    digits: str = ""
    seconds: float = 0.0


def measure(engine: Engine, task: Variation) -> Effect:
    """Play all scenes as landed, once in a process, and as varied."""
    found = Effect()
    for name, case in _cases(task.scenes).items():
        variable.vary({})
        plain, before = _plain(name, task.settings, task.scenes), nan
        timed = LEAST_TIME < plain.seconds < MOST_TIME
        if timed:
            before = _play(engine, case, task.settings)[1]
        task.apply()
        digits, seconds = _play(engine, case, task.settings, PATIENCE * plain.seconds + 1)
        if timed and digits:
            found.times.append(seconds / before)
        if digits != plain.digits:
            found.changed.append(name)
            run = _judged(engine, case, task.settings, PATIENCE * plain.seconds + 1)
            found.broken += sorted(run.failures - plain.failures)
            found.mended += sorted(plain.failures - run.failures)
            pairs = [(run.errors[key], plain.errors[key]) for key in run.errors.keys() & plain.errors.keys()]
            found.errors += [log(max(one, FLOOR) / max(before, FLOOR)) for one, before in pairs]
    variable.vary({})
    return found


@cache
def _cases(scenes: int) -> Mapping[str, Case]:
    """All scenes: probes, driven and curved ones, joined ones with a truth, the hardest level of each family
    that is possible, and random ones."""
    found = {one.name: Case(one) for tag in ("probe", "driven", "curved", "gallery") for one in tagged(tag)}
    found |= {one.name: Case(one) for one in tagged("joints") if one.truths}
    for family in families().values():
        name = family.scene_name(family.levels[len(family.levels) // 2])
        found[name] = Case(*hard_scene(name))
    return found | {f"random {seed}": Case(random_scene(seed), random=True) for seed in range(scenes)}


@cache
def _plain(name: str, settings: Settings, scenes: int) -> Played:
    engine, case = loaded(ENGINE), _cases(scenes)[name]
    digits, _ = _play(engine, case, settings)
    _, seconds = _play(engine, case, settings)
    return replace(_judged(engine, case, settings), digits=digits, seconds=seconds)


def _play(engine: Engine, case: Case, settings: Settings, longest: float = 60.0) -> tuple[str, float]:
    """Digits of the states at the quarters of a run, and the time of its frames [s]; no digits where it ends
    early."""
    scenario, seconds, states = case.scenario, 0.0, []
    try:
        world, settings, _ = build(engine, scenario, settings)
        state = State(scenario)
        reads = {round(quarter * scenario.frame_count / 4) for quarter in range(1, 5)}
        for frame in range(scenario.frame_count):
            seconds += frame_seconds(world, scenario, settings, frame)
            if frame + 1 in reads:
                world.read(state)
                states.append(state.values.tobytes())
            if seconds > longest:
                return "", seconds
        world.close()
    except AdapterError:
        return "", seconds
    return sha256(b"".join(states)).hexdigest(), seconds


def _judged(engine: Engine, case: Case, settings: Settings, longest: float = 60.0) -> Played:
    """What is found of a run: its class if that is not ok, or the limits that it breaks, and its errors."""
    scenario, ended, errors = case.scenario, "", {}
    name = scenario.name
    try:
        player = ready(engine, scenario, settings)
    except AdapterError:
        return Played(failures=frozenset([f"{name} not played"]))
    try:
        while player.frames_played < scenario.frame_count and not ended:
            player.play(1)
            ended = "slow" if player.seconds_played > longest else ""
    except AdapterError as error:
        ended = str(error)
    recording = player.recording(ended)
    player.world.close()
    if case.checks is not None:
        failures = {judge(recording, scenario, case.checks, ended).name} - {"ok"}
    elif case.random:
        failures = {judge_random(recording, scenario, EXACT, "hang" if ended else "", ended).outcome} - {"ok"}
    elif ended:
        failures = {"ends early"}
    else:
        base = Row(STUDY, name, ENGINE, settings.label, settings.dt, "")
        rows = [judged(row, scenario.tags) for row in measured(base, scenario, recording, METRICS)]
        failures = {row.metric for row in rows if row.verdict in ("fail", "error")}
        truths = [row for row in rows if row.metric.startswith("truth.") and isfinite(row.value)]
        errors = {f"{row.metric} {row.subject}": abs(row.value) for row in truths}
    return Played(failures=frozenset(f"{name} {what}" for what in failures), errors=errors)


@cache
def loaded(name: str) -> Engine:
    """The reference with its constants in memory; loads it into this process."""
    variable.install()
    return load(name)


def variations(only: Sequence[str], profile: str, scenes: int) -> list[Variation]:
    """Every mechanism off, then every constant times and over FACTOR; `only`: those whose name has one of
    the texts.

    Raises:
        RefusedError: no name has one of them, or the profile has none of these mechanisms.
    """
    if profile == PAPER:
        raise RefusedError("profile paper has none of the mechanisms that vary: it is the method as printed")
    settings = Settings(profile, own_step(ENGINE, profile))
    asked = [Variation(settings, one.name, OFF, scenes=scenes) for one in variable.MECHANISMS]
    for one in variable.constants():
        for factor, word in ((FACTOR, f"times {FACTOR:g}"), (1 / FACTOR, f"over {FACTOR:g}")):
            if one.times(factor) != one.value:
                subject = f"{one.module}.{one.name}"
                asked.append(Variation(settings, subject, word, one.times(factor), scenes))
    named = {f"{one.subject} {one.change}": one for one in asked}
    for text in only:
        if not any(text in name for name in named):
            raise RefusedError(f"no constant or mechanism of the reference is called {text!r}")
    return [one for name, one in named.items() if not only or any(text in name for text in only)]


def run(asked: Sequence[Variation], out: Path, progress: Progress) -> pd.DataFrame:
    """Play all variations; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        found = played(measure, asked, folder / "output", progress, loader=loaded, patience=HANGING)
        rows = [row for task, one in zip(asked, found) for row in rows_of(task, one)]
        facts = {"study": STUDY, "factor": FACTOR, "scenes": list(_cases(asked[0].scenes))}
        return kept(rows, folder, facts, {"ablation.png": mechanisms_picture})


def rows_of(task: Variation, found: Effect | Ended) -> Iterator[Row]:
    """Rows of one variation."""
    base = Row(STUDY, "all", ENGINE, task.settings.label, task.settings.dt, "")
    base = replace(base, subject=f"{task.subject} {task.change}", unit="1")
    if isinstance(found, Ended):
        yield replace(base, metric="ablation.broken", value=nan, reason=found.reason)
        return
    for name in ("changed", "broken", "mended"):
        listed = getattr(found, name)
        more = f" and {len(listed) - LISTED} more" if len(listed) > LISTED else ""
        reason = ", ".join(listed[:LISTED]) + more
        yield replace(base, metric=f"ablation.{name}", value=float(len(listed)), reason=reason)
    if found.errors:
        yield replace(base, metric="ablation.error", value=exp(float(np.mean(found.errors))))
    if len(found.times) > 2:
        times = np.array(found.times)
        resampled = bootstrap((times,), np.median, n_resamples=999, rng=0, method="percentile")
        low, high = resampled.confidence_interval
        interval = (float(np.median(times)), float(low), float(high))
        yield with_interval(replace(base, metric="ablation.time"), interval)


HEADS = ("varied", "value", "change", "moves", "breaks", "mends", "error", "time")
NOTES = (
    "moves: scenes whose motion differs in any bit; breaks, mends: limits and classes of outcome that are",
    "broken or kept other than as landed; error: geometric mean of its ratio against closed forms; time: of",
    "a frame, median ratio over scenes, with its interval of 95 %. What breaks:",
)


def lines_of(frame: pd.DataFrame) -> list[list[str]]:
    """One line per variation, in the order of the rows, as in HEADS; constants without their folder."""
    values = {f"{one.module}.{one.name}": one.value for one in variable.constants()}
    lines = []
    for subject, part in frame.groupby("subject", sort=False):
        name, change = _split(str(subject))
        rows: dict[str, Any] = {str(row["metric"]): row for row in part.to_dict("records")}
        short = ".".join(name.split(".")[-2:])
        line = [short, number(values[name]) if name in values else "", change]
        for metric in ("ablation.changed", "ablation.broken", "ablation.mended"):
            value = float(rows[metric]["value"]) if metric in rows else nan
            line.append("ended" if isnan(value) else f"{value:.0f}")
        error, time = rows.get("ablation.error"), rows.get("ablation.time")
        line.append(f"{error['value']:.3g}" if error else "")
        line.append(f"{time['value']:.2f} ({time['low']:.2f} to {time['high']:.2f})" if time else "")
        lines.append(line)
    return lines


def _split(subject: str) -> tuple[str, str]:
    for change in (OFF, f"times {FACTOR:g}", f"over {FACTOR:g}"):
        if subject.endswith(f" {change}"):
            return subject.removesuffix(f" {change}"), change
    raise ValueError(subject)


def report(frame: pd.DataFrame) -> list[Part]:
    """One line per variation, and what moves nothing."""
    broken = frame[(frame.metric == "ablation.broken") & (frame.reason != "")]
    lines = [f"{subject}: {reason}" for subject, reason in zip(broken.subject, broken.reason)]
    if still := idle(frame):
        lines += ["", f"moves no scene in either direction: {', '.join(still)}"]
    title = "ablation: what each mechanism and constant buys and costs"
    return [Part(title, HEADS, lines_of(frame), NOTES, lines)]


def idle(frame: pd.DataFrame) -> list[str]:
    """Names whose variations change no bit of any scene."""
    rows = frame[frame.metric == "ablation.changed"]
    most: dict[str, float] = {}
    for subject, value in zip(rows.subject, rows.value):
        name = _split(str(subject))[0]
        most[name] = max(most.get(name, 0.0), float(value))
    return [name for name, value in most.items() if value == 0]


def mechanisms_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw per mechanism what leaving it out breaks, and what a frame then takes."""
    parts = {_split(str(name))[0]: part for name, part in frame.groupby("subject", sort=False)
             if _split(str(name))[1] == OFF}  # fmt: skip
    broken = pd.Series({name: _value(part, "broken") for name, part in parts.items()}, dtype=float)
    times = [part[part.metric == "ablation.time"].iloc[:1].assign(name=name) for name, part in parts.items()]
    order = list(broken.sort_values(ascending=False).index)
    found = broken.rename_axis("name").reset_index(name="broken")
    y = alt.Y("name:N", sort=order, title=None, axis=alt.Axis(grid=False, ticks=False))
    left = alt.Chart(found).mark_bar(color=color_of(ENGINE), height=9)
    left = left.encode(x=alt.X("broken:Q", title="limits and outcomes broken without it"), y=y)
    text, ticks = "time of a frame without it, over that with it [1]", (0.5, 0.7, 1, 1.4, 2)
    ratio = log_axis(alt.X, "value", text, (0.4, 2.5), values=ticks)
    base = alt.Chart(pd.concat(times)).encode(y=alt.Y("name:N", sort=order, axis=None))
    right = (
        base.mark_rule(color=PALE, strokeWidth=2.5).encode(x="low:Q", x2="high:Q")
        + base.mark_point(filled=True, size=20, color=color_of(ENGINE), opacity=1).encode(x=ratio)
        + rule(x=1)
    )
    panels = (one.properties(width=240, height=alt.Step(16)) for one in (left, right))
    save(alt.hconcat(*panels), path, "Mechanisms of the reference: what each buys and costs")


def _value(part: pd.DataFrame, name: str) -> float:
    found = part[part.metric == f"ablation.{name}"].value
    return float(found.iloc[0]) if len(found) and found.iloc[0] == found.iloc[0] else 0.0
