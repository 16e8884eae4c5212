"""The study `effects`: time saved and outcome changed by a plan and by each effect.

Per scene and engine the study compares the scene's plan with all effects. On the reference it also toggles
one effect at a time: off where the plan has it, on where it has not. Frames of all variants are interleaved.
Means over all frames are compared, because a plan saves different work in different frames. A frame is the
fastest of PASSES or ENGINE_PASSES, so that what other processes take of the machine counts little; on the
reference it is net of the crossing from Python (an empty call with all arguments of a step), which is half of
a probe's frame. Outcomes are compared in every displayed frame: `identical` to the
bit, `within tolerance`, `matters`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import MISSING, Array, Settings
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.adapters.workers.process import COMPILE_PATIENCE
from touchstone.adapters.workers.stepping import Loader
from touchstone.adapters.workers.variants import Pace, Variant, VariantPlayer, play
from touchstone.reports.bootstrap import median_interval, time_ratio
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, illustrate, save, save_manifest, table
from touchstone.reports.studies.effects.definitions import (
    ALL,
    GROUPS,
    IDENTICAL,
    MATTERS,
    REFERENCE,
    TOGGLED,
    WITHIN,
)
from touchstone.reports.studies.effects.picture import savings
from touchstone.reports.verdict.judge import judged
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

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
"""Metrics of this study that have limits."""


def scenes() -> list[Scenario]:
    """The gallery and the probes without seeds, each once."""
    found = {s.name: s for tag in GROUPS for s in tagged(tag) if not {"seeded", "heap"} & set(s.tags)}
    return list(found.values())


def steps(scenarios: Sequence[Scenario], engines: Sequence[str]) -> int:
    """Number of progress steps of a run: scenes times engines."""
    return len(scenarios) * len(engines)


def run(
    scenarios: Sequence[Scenario],
    engines: Sequence[str],
    out: Path,
    progress: Progress,
    loader: Loader = load,
) -> pd.DataFrame:
    """Measure, judge and store; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        (folder / "output").mkdir()
        rows: list[Row] = []
        tags = {scenario.name: scenario.tags for scenario in scenarios}
        for engine in engines:
            if installed(engine):
                rows += rows_of_engine(engine, scenarios, folder / "output", progress, loader)
            else:
                base = Row(STUDY, ALL, engine, _profile(engine), _step(engine), "run")
                rows.append(replace(base, verdict=MISSING, reason=missing_reason(engine)))
        rows += means(rows, tags)
        frame = table(judged(row, tags.get(row.scenario, ())) for row in rows)
        save(frame, folder)
        facts = {"study": STUDY, "tolerance": TOLERANCE, "budget": BUDGET, "scenarios": list(tags)}
        save_manifest(folder, facts)

        illustrate(folder / "effects.png", lambda part: savings(frame, part))
    return frame


def _profile(engine: str) -> str:
    return next(iter(ENGINES[engine].profiles))


def _step(engine: str) -> float:
    return ENGINES[engine].profiles[_profile(engine)]


def rows_of_engine(
    engine: str, scenarios: Sequence[Scenario], output: Path, progress: Progress, loader: Loader
) -> list[Row]:
    """Rows of one engine in a process of its own, which restarts for the next scene if it died."""
    rows: list[Row] = []
    child: VariantPlayer | None = None
    try:
        for scenario in scenarios:
            progress(f"{engine}: {scenario.name}", 1)
            child = child or VariantPlayer(engine, output / f"{engine}.txt", loader, COMPILE_PATIENCE)
            base = Row(STUDY, scenario.name, engine, _profile(engine), _step(engine), "")
            found = _rows_of_scene(child, base, scenario)
            if child.failure is not None:
                status, reason = child.failure
                found, child = [replace(base, metric="run", verdict=status, reason=reason)], None
            rows += found
    finally:
        if child is not None:
            child.stop()
    return rows


def _rows_of_scene(child: VariantPlayer, base: Row, scenario: Scenario) -> list[Row]:
    """Rows of a scene: planning, the plan against all effects, and on the reference every toggled effect."""
    ours = base.engine == REFERENCE
    wanted: dict[str, tuple[str, ...] | None] = {"": None, ALL: PLANNED}
    rows = []
    if ours:
        seconds = child.ask("plan", scenario)
        if seconds is None:
            return []
        value, low, high = median_interval(seconds)
        rows.append(replace(base, metric="time.plan", unit="s", value=value, low=low, high=high))
        wanted |= toggles(scenario)
    settings = [Settings(base.profile, base.dt, effects=effects) for effects in wanted.values()]
    how = (np.inf, PASSES) if ours else (BUDGET, ENGINE_PASSES)
    variants = child.ask("play", (scenario, settings, *how))
    if variants is None:
        return []
    played = dict(zip(wanted, variants))
    if played[""].ended:
        return [*rows, replace(base, metric="run", verdict="error", reason=played[""].ended)]
    return rows + rows_of_variants(base, played)


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
    takes longer with it than without. Effects that the scene cannot be played without are absent."""
    profile, dt = _profile(REFERENCE), _step(REFERENCE)
    wanted = toggles(scenario)
    settings = [Settings(profile, dt, effects=effects) for effects in (None, *wanted.values())]
    _, *variants = play(load(REFERENCE), scenario, settings, np.inf, passes)
    found = {}
    for name, variant in zip(wanted, variants):
        if not variant.ended:
            change = float(variant.pace.net.mean() / variant.beside.net.mean()) - 1
            found[name[1:]] = -change if name.startswith("-") else change
    return found


def rows_of_variants(base: Row, played: Mapping[str, Variant]) -> list[Row]:
    """Time saved by the plan, and the difference of the outcome from the plan's, by variant."""
    rows = []
    value, low, high = median_interval(_times(base, played[""].pace), middle=np.mean)
    rows.append(replace(base, metric="time.frame", unit="s", value=value, low=low, high=high))
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
    saved = replace(
        row, metric="time.saved", unit="1", value=1 - ratio.value, low=1 - ratio.high, high=1 - ratio.low
    )
    slower = replace(row, metric="time.slower", unit="1", value=max(0.0, ratio.low - 1))
    return [saved, slower] if row.subject == ALL else [saved]


def means(rows: Sequence[Row], tags: Mapping[str, Sequence[str]]) -> list[Row]:
    """Geometric means of the plan's time over that with all effects, by engine and group of scenes; the
    interval assumes that scenes are independent."""
    found = []
    for engine in dict.fromkeys(row.engine for row in rows):
        for group in GROUPS:
            mine = [
                row
                for row in rows
                if (row.engine, row.metric, row.subject) == (engine, "time.saved", ALL)
                and group in tags[row.scenario]
            ]
            if not mine:
                continue
            left = np.log([[1 - row.value, 1 - row.high, 1 - row.low] for row in mine])
            middle = left[:, 0].mean()
            down, up = (np.sqrt(((left[:, k] - left[:, 0]) ** 2).sum()) / len(mine) for k in (1, 2))
            value, low, high = (float(np.exp(x)) for x in (middle, middle - down, middle + up))
            base = replace(mine[0], scenario=group, metric="time.left", reason=f"{len(mine)} scenes")
            found.append(replace(base, value=value, low=low, high=high))
    return found
