"""The study `predictability`: amplification of small perturbations of the initial state.

Amplification is the distance of a perturbed run's final positions from the unperturbed run's, over the
perturbation, both as one vector of all bodies. Rows hold the median over random directions, with its range.
All sizes and engines use the same directions. Neither a high nor a low value is better; where there is a
closed form, its amplification is reported beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
from rich.text import Text

from touchstone.adapters.contract import Array, Engine
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, installed
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.measures import moving
from touchstone.reports.runner.tasks import Task, own_profile, own_settings, own_step, played
from touchstone.reports.studies.study import extremes, failures, kept, missing_rows, with_interval
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.pictures import (
    DOTS,
    INK,
    Looks,
    color_of,
    encoded,
    ends,
    grid,
    log_axis,
    marker_of,
    rule,
    save,
)
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number
from touchstone.scenarios.closed_form_ends import final_positions
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import shifted

STUDY, METRIC, ERROR, CLOSED_FORM = "predictability", "predictability", "predictability.error", "closed form"
SIZES = (1e-9, 1e-6, 1e-3)
"""Sizes of the perturbations [m]."""
DRAWS = 4


NEAR = 2 * SIZES[-1]
"""Gap within which bodies touch at the start [m]: perturbations neither press these together nor separate
them."""
SCENES = ("fall", "bounce_e05", "collide_oblique", "cradle", "ball_snip")


def end(engine: Engine, task: Task) -> Array:
    """Final positions (n, 3) of the bodies that count [m]."""
    return np.asarray(task.record(engine).position[-1, moving(task.scenario)])


def end_and_touching(engine: Engine, task: Task) -> tuple[Array, Array]:
    """Final positions, and `touching` at the start."""
    recording = task.record(engine)
    return recording.position[-1, moving(task.scenario)], touching(recording, task.scenario)


def steps(scenarios: Sequence[Scenario]) -> int:
    """Number of progress steps of a run: plays."""
    return len(scenarios) * sum(map(installed, ENGINES)) * (1 + len(SIZES) * DRAWS)


def run(scenarios: Sequence[Scenario], seed: int, out: Path, progress: Progress) -> pd.DataFrame:
    """Play every scene unperturbed and perturbed; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        (folder / "recordings").mkdir()
        starts = {scenario.name: [scenario] for scenario in scenarios}
        found: dict[tuple[str, int, str], Any] = {}
        normals: dict[str, Array] = {}
        for key, one in play(end_and_touching, starts, folder, progress).items():
            found[key] = one
            if not isinstance(one, Ended):
                found[key] = one[0]
                normals.setdefault(key[0], one[1])
        for scenario in scenarios:
            if scenario.name in normals:
                moved = directions(scenario, normals[scenario.name], seed)
                starts[scenario.name] += [shifted(scenario, size * one) for size in SIZES for one in moved]
        found |= play(end, starts, folder, progress, first=1)
        rows: list[Row] = []
        for scenario in scenarios:
            mine = {key[1:]: one for key, one in found.items() if key[0] == scenario.name}
            some = rows_of_scene(scenario, starts[scenario.name], mine)
            rows += [judged(row, scenario.tags) for row in some]
        facts = {"study": STUDY, "seed": seed, "sizes": SIZES, "draws": DRAWS}
        facts |= {"scenarios": {s.name: {"tags": s.tags, "seed": s.seed} for s in scenarios}}
        return kept(rows, folder, facts, {"predictability.png": amplifications})


def play(
    measure: Callable[[Engine, Task], object],
    starts: Mapping[str, Sequence[Scenario]],
    folder: Path,
    progress: Progress,
    first: int = 0,
) -> dict[tuple[str, int, str], Any]:
    """Results by scene, number of the start and engine, of the starts from number `first` on."""
    asked = {
        (name, number, engine): Task(
            scenario, engine, own_settings(engine), folder / "recordings" / f"{name}-{engine}-{number}.npz"
        )
        for name, several in starts.items()
        for number, scenario in enumerate(several)
        for engine in ENGINES
        if installed(engine) and number >= first
    }
    return dict(zip(asked, played(measure, list(asked.values()), folder / "output", progress)))


def rows_of_scene(
    scenario: Scenario, starts: Sequence[Scenario], found: Mapping[tuple[int, str], Any]
) -> list[Row]:
    """Rows of amplification per engine and size, and of the closed form's."""
    columns = [(engine, own_profile(engine)) for engine in ENGINES]
    rows = missing_rows(STUDY, columns, scenario.name)
    ends: dict[str, list[Array]] = {engine: [] for engine in ENGINES if installed(engine)}
    for (_, engine), one in found.items():
        if not isinstance(one, Ended):
            ends.get(engine, []).append(one)
        elif ends.pop(engine, None) is not None:
            rows.append(replace(_base(scenario, engine), metric="run", verdict=one.status, reason=one.reason))
    true_ends = [one for one in map(final_positions, starts) if one is not None]
    truth = _amplifications(true_ends) if len(true_ends) == len(starts) else None
    for engine, several in ends.items() if len(starts) > 1 else ():
        rows += _rows(_base(scenario, engine), _amplifications(several), truth)
    return rows + (_rows(_base(scenario, CLOSED_FORM), truth) if truth is not None else [])


def directions(scenario: Scenario, normals: Array, seed: int) -> list[Array]:
    """DRAWS unit vectors (n, 3) over the simulated bodies, or over the trackers if there are none. To first
    order they change no gap of touching pairs (`touching`)."""
    rng = np.random.default_rng([seed, scenario.seed])
    count = len(_simulated(scenario)) or len(scenario.trackers)
    found = []
    for _ in range(DRAWS):
        drawn = rng.standard_normal(3 * count)
        if len(normals):
            drawn -= np.linalg.pinv(normals) @ (normals @ drawn)
        found.append((drawn / np.linalg.norm(drawn)).reshape(count, 3))
    return found


def touching(recording: Recording, scenario: Scenario) -> Array:
    """Gradient of the gap with respect to the positions of simulated bodies: one row (3 n,) per pair that
    touches in the first frame."""
    from touchstone.adapters.oracles.overlap import measure

    start = {name: getattr(recording, name)[:1] for name in ("time", "position", "orientation")}
    distances = measure(replace(recording, **start), scenario)
    simulated, rows = _simulated(scenario), []
    for pair, distance in distances.distance.items():
        row = np.zeros((len(simulated), 3))
        for body, sign in zip(pair, (-1.0, 1.0)):
            if distance[0] < NEAR and body in simulated:
                row[simulated.index(body)] = sign * distances.normal[pair][0]
        if row.any():
            rows.append(row.ravel())
    return np.array(rows)


def _simulated(scenario: Scenario) -> list[int]:
    return [k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"]


def _amplifications(ends: list[Array]) -> Array:
    """Final distance over the perturbation (SIZES, DRAWS), from the unperturbed end state and those after
    it."""
    moved = np.reshape(ends[1:], (len(SIZES), DRAWS, -1)) - np.ravel(ends[0])
    return np.asarray(np.linalg.norm(moved, axis=-1) / np.array(SIZES)[:, None])


def _rows(base: Row, found: Array, truth: Array | None = None) -> list[Row]:
    """Per size the median over the directions with the range, and the largest error against the closed
    form's."""
    rows = []
    for k, size in enumerate(SIZES):
        row = replace(base, metric=METRIC, unit="1", subject=f"{size:g} m")
        rows.append(with_interval(row, extremes(found[k])))
        if truth is not None:
            error = float(np.abs(found[k] / truth[k] - 1).max())
            rows.append(replace(row, metric=ERROR, value=error))
    return rows


def _base(scenario: Scenario, engine: str) -> Row:
    if engine not in ENGINES:
        return Row(STUDY, scenario.name, engine, "", nan, METRIC)
    return Row(STUDY, scenario.name, engine, own_profile(engine), own_step(engine), METRIC)


NOTES = (
    f"final distance over perturbation: median of {DRAWS} random directions (least to largest)",
    "1: errors stay as they are; above: they grow; below: they are forgotten",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """One block per scene, and every remark."""
    rows: list[list[str | Text]] = []
    for scenario, scene in frame[frame.metric == METRIC].groupby("scenario", sort=False):
        rows.append([str(scenario)])
        for engine, part in scene.groupby("engine", sort=False):
            style = "dim" if engine == CLOSED_FORM else ""
            cells = (f"{number(r.value)} ({number(r.low)} to {number(r.high)})" for r in rows_of(part))
            rows.append([Text(cell, style=style) for cell in (str(engine), *cells)])
    title = "predictability: amplification of perturbations of the start"
    return [Part(title, ["engine", *(f"{size:g} m" for size in SIZES)], rows, NOTES), failures(frame)]


ACROSS = 3
FLOOR = 1e-4
"""Smaller amplifications are drawn at this value [1]: the perturbation has vanished."""
LEAST, MOST = 0.1, 100.0
"""Every panel's axis includes these amplifications [1]."""
BESIDE = 1.25
"""Factor between the abscissas of two engines, so that their ranges do not overlap."""


def amplifications(frame: pd.DataFrame, path: Path) -> None:
    """Draw the median with the range over the directions; dotted: the closed form."""
    found = frame[frame.metric == METRIC]
    engines = [engine for engine in dict.fromkeys(found.engine) if engine != CLOSED_FORM]
    beside = {engine: BESIDE ** (place - 1.5) for place, engine in enumerate(engines)} | {CLOSED_FORM: 1.0}
    size = found.subject.str.removesuffix(" m").astype(float) * found.engine.map(beside).astype(float)
    drawn = {name: found[name].clip(lower=FLOOR) for name in ("value", "low", "high")}
    found = found.assign(size=size, **drawn)
    colors, markers = [*map(color_of, engines), INK], [*map(marker_of, engines), "stroke"]
    marks = encoded(colors, markers, [*engines, CLOSED_FORM])
    panels = [_panel(str(name), part, marks) for name, part in found.groupby("scenario", sort=False)]
    note = f"marker: median of {DRAWS} directions; bar: from the least to the largest"
    save(grid(panels, ACROSS), path, "How far runs part that start a hair's breadth apart", note)


def _panel(title: str, scene: pd.DataFrame, marks: Looks) -> Any:
    low, high = min(LEAST, max(FLOOR, scene.low.min() / 2)), max(MOST, 2 * scene.high.max())
    span = ends(pd.Series(SIZES), factor=2)
    x = log_axis(alt.X, "size", "perturbation [m]", span, values=SIZES, grid=False)
    y = log_axis(alt.Y, "value", "final distance over it [1]", (low, high))
    exact, played = scene[scene.engine == CLOSED_FORM], alt.Chart(scene[scene.engine != CLOSED_FORM])
    bars = played.mark_rule(strokeWidth=3, strokeOpacity=0.25)
    drawn = (
        bars.encode(x=x, y="low:Q", y2="high:Q", color=marks["color"])
        + played.mark_line(strokeWidth=1).encode(x=x, y=y, color=marks["color"])
        + played.mark_point(filled=True, size=25, opacity=1).encode(x=x, y=y, **marks)
        + alt.Chart(exact).mark_line(strokeDash=DOTS).encode(x=x, y=y, color=marks["color"])
        + rule([], y=1)
    )
    return drawn.properties(title=title, width=190, height=140)
