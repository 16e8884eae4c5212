"""The study `effects`: time saved and outcome changed by a plan and by each effect.

Per scene and engine the study compares the scene's plan with all effects. On the reference it also toggles
one effect at a time: off where the plan has it, on where it has not. Frames of all variants are interleaved.
Means over all frames are compared, because a plan saves different work in different frames. A frame is the
fastest of PASSES or ENGINE_PASSES, so that what other processes take of the machine counts little; on the
reference it is net of the crossing from Python (an empty call with all arguments of a step), which is half of
a probe's frame. Where a plan leaves an engine the same world, the scene is played once and the plan saves 0.
Outcomes are compared in every displayed frame: `identical` to the bit, `within tolerance`, `matters`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd
from rich.text import Text

from touchstone.adapters.contract import Array, Engine, Settings
from touchstone.adapters.recorder import planned_for
from touchstone.adapters.registry import installed, load
from touchstone.adapters.workers.pool import Ended
from touchstone.adapters.workers.process import COMPILE_PATIENCE
from touchstone.adapters.workers.variants import Pace, Variant, plan_seconds, play
from touchstone.reports.bootstrap import median_interval, time_ratio
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.tasks import Task, own_profile, own_settings, played
from touchstone.reports.studies.study import (
    MICRO,
    kept,
    limit_text,
    missing_rows,
    remarks,
    value_text,
    with_interval,
)
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.pictures import INK, PALE, by, looks, rule, save
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.effects import EFFECT_TABLE, PLANNED
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Scenario

GROUPS = ("gallery", "probe")
"""Tags of the default scenes; means are computed per tag."""
REFERENCE, ALL = "reference", "all"
IDENTICAL, WITHIN, MATTERS = "identical", "within tolerance", "matters"
TOGGLED = tuple(name for name, effect in EFFECT_TABLE.items() if effect.only != "engines")
"""Effects that are toggled one at a time: those that the reference has."""


STUDY = "effects"
TOLERANCE = 1e-6
"""Difference of outcomes that is below every limit on overlap or gap [m, rad]."""
BUDGET = 0.25
"""Seconds of an engine's steps in a scene and pass, of both variants; the reference plays all frames."""
ENGINE_PASSES = 4
"""Timed passes of the frames of other engines."""
PASSES = 8
"""Timed passes of the reference's frames; each variant is first in half of them."""
JUDGED = ("effects.changed", "time.left", "time.slower", "time.plan")


def scenes() -> list[Scenario]:
    """The gallery and the probes without seeds, each once."""
    found = {s.name: s for tag in GROUPS for s in tagged(tag) if not {"seeded", "heap"} & set(s.tags)}
    return list(found.values())


def run(scenarios: Sequence[Scenario], engines: Sequence[str], out: Path, progress: Progress) -> pd.DataFrame:
    """Measure each engine in turn, judge and store; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        tags = {scenario.name: scenario.tags for scenario in scenarios}
        columns = [(engine, own_profile(engine)) for engine in engines]
        rows = missing_rows(STUDY, columns)
        for engine in filter(installed, engines):
            asked = [Task(one, engine, own_settings(engine)) for one in scenarios]
            output = folder / "output"
            found = played(measure, asked, output, progress, patience=COMPILE_PATIENCE, processes=1)
            for task, one in zip(asked, found):
                rows += rows_of_scene(task, one)
        summed = means(rows, tags)
        # limits on means are those of whole groups: a selection may need all that a plan could leave out
        if {one.name for one in scenes()} <= set(tags):
            rows, summed = [*rows, *summed], []
        facts = {"study": STUDY, "tolerance": TOLERANCE, "budget": BUDGET, "scenarios": list(tags)}
        judged_rows = [judged(row, tags.get(row.scenario, ())) for row in rows] + summed
        return kept(judged_rows, folder, facts, {"effects.png": savings})


def measure(engine: Engine, task: Task) -> tuple[Array, dict[str, Variant]]:
    """Seconds of planning (empty but on the reference), and the plan (""), all effects and, on the reference,
    every toggled effect, played side by side."""
    ours = task.engine == REFERENCE
    seconds = plan_seconds(task.scenario) if ours else np.zeros(0)
    wanted = {"": None, ALL: PLANNED, **(toggles(task.scenario) if ours else {})}
    settings = [replace(task.settings, effects=effects) for effects in wanted.values()]
    how = (np.inf, PASSES) if ours else (BUDGET, ENGINE_PASSES)
    if not ours and _world(engine, task, settings[0]) == _world(engine, task, settings[1]):
        (one,) = play(engine, task.scenario, settings[:1], BUDGET)
        return seconds, {"": one, ALL: one}
    return seconds, dict(zip(wanted, play(engine, task.scenario, settings, *how)))


def _world(engine: Engine, task: Task, settings: Settings) -> tuple[object, ...]:
    """What an engine other than the reference gets, and what it reads back: a plan and all effects that agree
    in both are one world, which no clock tells apart."""
    scene, left, _ = planned_for(task.engine, task.scenario, settings)
    world = engine.build(scene, left)
    try:
        manifest = replace(world.describe(), profile="")  # it names the effects
    finally:
        world.close()
    return scene.bodies, scene.trackers, scene.chains, scene.acting_gravity, left.sleeping, manifest


def rows_of_scene(task: Task, found: tuple[Array, dict[str, Variant]] | Ended) -> list[Row]:
    """Rows of a scene: planning, the plan against all effects, and on the reference every toggled effect."""
    base = Row(STUDY, task.scenario.name, task.engine, task.settings.profile, task.settings.dt, "run")
    if isinstance(found, Ended):
        return [replace(base, verdict=found.status, reason=found.reason)]
    seconds, variants = found
    rows = []
    if len(seconds):
        rows.append(with_interval(base, median_interval(seconds), metric="time.plan", unit="s"))
    if variants[""].ended:
        return [*rows, replace(base, verdict="error", reason=variants[""].ended)]
    return rows + rows_of_variants(base, variants)


def toggles(scenario: Scenario) -> dict[str, tuple[str, ...]]:
    """Effects to run per toggle: "+friction" where the plan has none, "-friction" where it has."""
    from touchstone.adapters.motion_bounds import planned

    stages = set(planned(scenario).stages)
    named: dict[str, tuple[str, ...]] = {}
    for effect in TOGGLED:
        sign = "-" if effect in stages else "+"
        named[sign + effect] = tuple(e for e in PLANNED if e in stages ^ {effect})
    return named


def costs(scenario: Scenario, passes: int = PASSES) -> dict[str, float]:
    """What each effect costs on the reference in a scene, relative to the time of its plan [1]: what a frame
    takes longer with it than without. Effects that the scene cannot be played without are absent.

    An effect that the plan lacks is added to it. One that it has is left out of all effects: without it the
    bounds of the plan do not hold, so that the plan and what is left of it test different pairs.
    """
    named = toggles(scenario)
    added = {name[1:]: effects for name, effects in named.items() if name.startswith("+")}
    left = {name[1:]: tuple(e for e in PLANNED if e != name[1:]) for name in named if name.startswith("-")}
    groups = [(None, added | {ALL: PLANNED}, 1), (PLANNED, left, -1)]
    found, frame = {}, np.nan
    for first, others, sign in groups:
        settings = [own_settings(REFERENCE, effects=effects) for effects in (first, *others.values())]
        _, *variants = play(load(REFERENCE), scenario, settings, np.inf, passes)
        if first is None:
            frame = float(variants[-1].beside.net.mean())
        for name, one in zip(others, variants):
            if not one.ended and name != ALL:
                found[name] = sign * float(one.pace.net.mean() - one.beside.net.mean()) / frame
    return found


def rows_of_variants(base: Row, played: Mapping[str, Variant]) -> list[Row]:
    """Time saved by the plan, and the difference of the outcome from the plan's, by variant."""
    rows = []
    frame = median_interval(_times(base, played[""].pace), middle=np.mean)
    rows.append(with_interval(base, frame, metric="time.frame", unit="s"))
    for subject, other in played.items():
        if not subject:
            continue
        row = replace(base, subject=subject)
        if other.ended:
            rows.append(replace(row, metric="run", verdict="known", reason=f"{subject}: {other.ended}"))
            continue
        rows += _saved(row, other)
        word = IDENTICAL if other.same else WITHIN if max(other.moved, other.turned) <= TOLERANCE else MATTERS
        row = replace(row, reason=word, reason_code=word)
        rows.append(replace(row, metric="effects.moved", unit="m", value=other.moved))
        rows.append(replace(row, metric="effects.turned", unit="rad", value=other.turned))
        rows.append(replace(row, metric="effects.changed", unit="1", value=float(not other.same)))
    return rows


def _times(row: Row, pace: Pace) -> Array:
    """Seconds of a row's frames; the reference's exclude the crossing."""
    return pace.net if row.engine == REFERENCE else pace.seconds


def _saved(row: Row, other: Variant) -> list[Row]:
    """Share of the variant's time that the plan saves, and the lower bound of its slowdown."""
    mine, theirs = _times(row, other.beside), _times(row, other.pace)
    if min(len(mine), len(theirs)) == 0:
        return []
    ratio = time_ratio(mine, theirs, middle=np.mean)
    interval = (1 - ratio.value, 1 - ratio.high, 1 - ratio.low)
    saved = with_interval(row, interval, metric="time.saved", unit="1")
    slower = replace(row, metric="time.slower", unit="1", value=max(0.0, ratio.low - 1))
    return [saved, slower] if row.subject == ALL else [saved]


def means(rows: Sequence[Row], tags: Mapping[str, Sequence[str]]) -> list[Row]:
    """Geometric means of the plan's time over that with all effects, by engine and group of scenes; the
    interval assumes that scenes are independent."""
    found = []
    rows = [row for row in rows if (row.metric, row.subject) == ("time.saved", ALL)]
    for engine in dict.fromkeys(row.engine for row in rows):
        for group in GROUPS:
            mine = [row for row in rows if row.engine == engine and group in tags[row.scenario]]
            if not mine:
                continue
            left = np.log([[1 - row.value, 1 - row.high, 1 - row.low] for row in mine])
            middle = left[:, 0].mean()
            down, up = (np.sqrt(((left[:, k] - left[:, 0]) ** 2).sum()) / len(mine) for k in (1, 2))
            interval = (float(np.exp(middle)), float(np.exp(middle - down)), float(np.exp(middle + up)))
            fields = {"scenario": group, "metric": "time.left", "reason": plural(len(mine), "scene")}
            found.append(with_interval(mine[0], interval, **fields))
    return found


HEADS = (*("scene", "engine", "[µs]", "saved [%]", "95 %", "moved [m]", "outcome"), "plan [ms]")
MEANS = ("scenes", "engine", "left [%]", "95 % interval", "limit", "of")
NOTES = (
    "saved: of the mean frame with all effects, by the plan; the reference net of the call from Python",
    "outcome: largest difference over frames and bodies; identical: to the bit",
    "one by one: M off, and it matters   ~ off, within tolerance   = off, identical though needed",
    "            . on, identical   ! on, and it changes something   x cannot be played so",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """Savings and outcomes, effects one by one, means, and every limit that is broken."""
    rows = {(r.scenario, r.engine, r.metric, r.subject): r for r in rows_of(frame)}
    figures = [_cells(rows, scene, engine) for scene, engine, metric, _ in rows if metric == "time.frame"]
    scenes = [key[0] for key in rows if key[1:3] == (REFERENCE, "time.frame")]
    toggles = [[scene, *(mark(rows, scene, effect) for effect in TOGGLED)] for scene in scenes]
    shorts = [EFFECT_TABLE[effect].short for effect in TOGGLED]
    means: list[list[str | Text]] = []
    for (scenario, engine, metric, _), row in rows.items():
        if metric == "time.left" and scenario in GROUPS:
            between = f"{100 * row.low:.0f} to {100 * row.high:.0f}"
            left, count = f"{100 * row.value:.0f}", row.reason.partition(";")[0]
            means.append([scenario, engine, left, between, limit_text(row), count])
    return [
        Part("effects: the plan against all effects", HEADS, figures, words=2),
        Part("effects: one by one, on the reference", ["scene", *shorts], toggles) if toggles else Part(),
        Part("effects: geometric means of what the plan leaves of the time", MEANS, means, words=2),
        remarks(frame, NOTES),
    ]


def mark(rows: dict[tuple[str, str, str, str], Row], scenario: str, effect: str) -> str:
    """Mark of the outcome of toggling an effect on the reference."""
    for sign, words in (("-", {MATTERS: "M", WITHIN: "~", IDENTICAL: "="}), ("+", {IDENTICAL: "."})):
        row = rows.get((scenario, REFERENCE, "effects.moved", sign + effect))
        if row is not None:
            return words.get(row.reason_code, "!")
    return "x"


def _cells(rows: dict[tuple[str, str, str, str], Row], scenario: str, engine: str) -> list[str]:
    def of(metric: str, subject: str = ALL) -> Row | None:
        return rows.get((scenario, engine, metric, subject))

    saved, moved, plan = of("time.saved"), of("effects.moved"), of("time.plan", "")
    return [
        scenario,
        engine,
        value_text(of("time.frame", ""), MICRO),
        "" if saved is None else _percent(saved.value),
        "" if saved is None else f"{_percent(saved.low)} to {_percent(saved.high)}",
        *(("", "") if moved is None else (f"{moved.value:.1e}" if moved.value else "0", moved.reason_code)),
        "" if plan is None else exact_number(1e3 * plan.value),
    ]


def _percent(share: float) -> str:
    return f"{100 * share + 0.0:.0f}"


CELLS = {
    "M": ("#0072B2", "needed, and it matters"),
    "~": ("#8FC3E3", "needed, within tolerance"),
    "=": ("#F0C878", "needed by its bounds, yet identical"),
    ".": ("#F2F2F2", "not needed: identical"),
    "!": ("#D55E00", "not needed, yet it changes something"),
    "x": ("#FFFFFF", "cannot be played so"),
}


def savings(frame: pd.DataFrame, path: Path) -> None:
    """Draw savings per scene and engine with their intervals, beside a grid of single toggled effects."""
    saved = frame[(frame.metric == "time.saved") & (frame.subject == ALL)]
    saved = saved.assign(**{name: 100 * saved[name] for name in ("value", "low", "high")})
    scenes, engines = (list(dict.fromkeys(saved[name])) for name in ("scenario", "engine"))
    rows = {(r.scenario, r.engine, r.metric, r.subject): r for r in rows_of(frame)}
    meanings = {sign: meaning for sign, (_, meaning) in CELLS.items()}
    marked = [(scene, effect, meanings[mark(rows, scene, effect)]) for scene in scenes for effect in TOGGLED]
    cells = pd.DataFrame(marked, columns=["scenario", "effect", "outcome"])
    cells["effect"] = cells.effect.str.replace("_", " ")
    marks, order = looks(engines), {"sort": scenes, "title": None}
    y = alt.Y("scenario:N", axis=alt.Axis(grid=False, ticks=False), **order)
    base = alt.Chart(saved).encode(y=y, yOffset=alt.YOffset("engine:N", sort=engines), color=marks["color"])
    x = alt.X("value:Q", title="saved by the plan, of the frame with all effects [%]")
    points = base.mark_point(filled=True, size=20, opacity=1).encode(x=x, shape=marks["shape"])
    points = base.mark_rule().encode(x="low:Q", x2="high:Q") + points + rule([], INK, x=0)
    top = alt.Axis(orient="top", labelAngle=-60, ticks=False, domain=False)
    effects = alt.X("effect:N", sort=None, title="each effect alone, on the reference", axis=top)
    colors = {meaning: color for color, meaning in CELLS.values() if meaning in set(cells.outcome)}
    legend = alt.Legend(columns=2, symbolStrokeColor=PALE)
    squares = (
        alt.Chart(cells)
        .mark_rect(stroke="white")
        .encode(
            x=effects,
            y=alt.Y("scenario:N", axis=None, **order),
            color=by(alt.Color, "outcome", colors, legend=legend),
        )
    )
    height = 16 * len(scenes)
    panels = points.properties(width=330, height=height) | squares.properties(width=220, height=height)
    save(panels.resolve_scale(color="independent", shape="independent"), path)
