"""The study `gradients`: derivatives of the end state, by central differences on engines as black boxes.

A learner or an optimiser that moves a start or a parameter by h sees these. Each derivative is taken at
several h and at several starts, between which an event moves through a step: where an engine's end state
jumps as an event passes from one step into the next, small h see another derivative than large ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, installed
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.tasks import played
from touchstone.reports.studies.study import Column, extremes, failures, kept, missing_rows, with_interval
from touchstone.reports.views.pictures import save
from touchstone.reports.views.render import Part
from touchstone.scenarios.scenario import GRAVITY, Body, PairCoefficients, Scenario
from touchstone.scenarios.solids import ball, block, slab

STUDY = "gradients"
ERROR = f"{STUDY}.error"
SIZES = (1e-2, 1e-4, 1e-6)
"""Steps h of the differences, over the parameter's own size [1]."""
JUDGED = ("reference", "accurate", SIZES[1])
"""Column and step that are judged: truncation leaves 1e-7, rounding 1e-12; `balanced` lets bodies touch at a
distance of 1e-6 m, which changes the derivatives of bounces by 1e-5."""
LIMIT = 1e-5
"""Largest error of a derivative of the reference [1]."""
STARTS = 5
"""Starts, between which the event moves through a step of 1/60 s [1]."""
RADIUS, FRAME = 0.05, 1 / 60
Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Derivative:
    """Derivative of an output by a parameter: its closed form, over `size` (0: its own magnitude)."""

    output: str
    parameter: str
    value: float
    size: float = 0.0

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"d {self.output} / d {self.parameter}"


@dataclass(frozen=True, slots=True)
class Case:
    """A scene as a function of parameters. `shift`: a parameter, and its change from one start to the next;
    `outputs`: fields of recordings and indices of bodies, measured along `axis`."""

    start: Values
    shift: tuple[str, float]
    scene: Callable[[Values], Scenario]
    outputs: Mapping[str, tuple[str, int]]
    axis: int
    truth: Callable[[Values], tuple[Derivative, ...]]

    def starts(self) -> list[dict[str, float]]:
        """Parameters of all starts."""
        name, step = self.shift
        return [{**self.start, name: self.start[name] + k * step} for k in range(STARTS)]

    def end(self, recording: Recording) -> dict[str, float]:
        """Outputs of a run."""
        return {
            name: float(getattr(recording, field)[-1, body, self.axis])
            for name, (field, body) in self.outputs.items()
        }


def _scene(
    bodies: Sequence[Body], e: float, mu: float, frames: int, effects: tuple[str, ...] = ()
) -> Scenario:
    return Scenario(
        name="gradient",
        summary="a scene of which a derivative is taken",
        tags=("measured",),
        bodies=tuple(bodies),
        coefficients=(PairCoefficients("wood", "wood", e, mu),),
        duration=frames * FRAME,
        effects=effects or ("gravity", "restitution", "friction"),
    )


MEET, FLY = 0.25, 30
"""Distance that the first ball flies before it hits the second [m], and frames of the scene."""


def _balls(p: Values) -> Scenario:
    bodies = (
        ball("a", "wood", RADIUS, p["m1"], (p["x1"], 0.0, 0.0), (p["v1"], 0.0, 0.0)),
        ball("b", "wood", RADIUS, 1.0, (p["x2"], 0.0, 0.0)),
    )
    return _scene(bodies, p["e"], 0.0, FLY, ("restitution", "friction"))


def _elastic(p: Values) -> tuple[Derivative, ...]:
    """Equal balls exchange their velocities: x1' = x2 - 2 r, x2' = x1 + 2 r + v1 T."""
    return (
        Derivative("x2'", "x1", 1.0),
        Derivative("x1'", "x1", 0.0, 1.0),
        Derivative("x1'", "x2", 1.0),
        Derivative("x2'", "x2", 0.0, 1.0),
        Derivative("v2'", "v1", 1.0),
        Derivative("v1'", "v1", 0.0, 1.0),
        Derivative("x2'", "v1", FLY * FRAME),
    )


def _unequal(p: Values) -> tuple[Derivative, ...]:
    """v2' = (1 + e) v1 m1 / (m1 + m2), v1' = v1 - m2 / m1 v2'."""
    m, v, e = p["m1"], p["v1"], p["e"]
    return (
        Derivative("v2'", "m1", (1 + e) * v / (m + 1) ** 2),
        Derivative("v2'", "e", v * m / (m + 1)),
        Derivative("v1'", "m1", (1 + e) * v / (m + 1) ** 2),
        Derivative("v1'", "e", -v / (m + 1)),
    )


def _slides(p: Values) -> Scenario:
    half = (RADIUS, RADIUS, RADIUS)
    cube = block("a", "wood", half, p["m"], (0.0, 0.0, RADIUS), velocity=(p["v"], 0.0, 0.0))
    return _scene((slab("table", "wood"), cube), 0.0, p["mu"], 36)


def _stops(p: Values) -> tuple[Derivative, ...]:
    """x = v^2 / (2 mu g)."""
    v, mu = p["v"], p["mu"]
    stop = v**2 / (2 * mu * GRAVITY)
    return (
        Derivative("stop", "v", v / (mu * GRAVITY)),
        Derivative("stop", "mu", -stop / mu),
        Derivative("stop", "m", 0.0, stop / p["m"]),
    )


def _drops(frames: int) -> Callable[[Values], Scenario]:
    def scene(p: Values) -> Scenario:
        body = ball("a", "wood", RADIUS, p["m"], (0.0, 0.0, RADIUS + p["h"]))
        return _scene((slab("floor", "wood"), body), p["e"], 0.0, frames)

    return scene


def _bounced(bounces: int, frames: int) -> Callable[[Values], tuple[Derivative, ...]]:
    """z = e^n v s - g s^2 / 2, s after bounce n at t = v / g (1 + 2 (e + ... + e^(n-1))), v^2 = 2 g h."""

    def truth(p: Values) -> tuple[Derivative, ...]:
        h, e, n = p["h"], p["e"], bounces
        v = sqrt(2 * GRAVITY * h)
        t = v / GRAVITY * (1 + 2 * sum(e**k for k in range(1, n)))
        t_by_e = 2 * v / GRAVITY * sum(k * e ** (k - 1) for k in range(1, n))
        s = frames * FRAME - t
        late = GRAVITY * s - e**n * v
        return (
            Derivative("height", "h", e**n * GRAVITY / v * s + late * t / (2 * h)),
            Derivative("height", "e", n * e ** (n - 1) * v * s + late * t_by_e),
            Derivative("height", "m", 0.0, h / p["m"]),
        )

    return truth


ROLL = 45


def _rolls(p: Values) -> Scenario:
    body = ball("a", "wood", RADIUS, p["m"], (0.0, 0.0, RADIUS), (p["v"], 0.0, 0.0))
    return _scene((slab("table", "wood"), body), 0.0, p["mu"], ROLL)


def _rolled(p: Values) -> tuple[Derivative, ...]:
    """From 2 v / (7 mu g) on it rolls at 5/7 v: x = 2 v^2 / (49 mu g) + 5/7 v T."""
    v, mu = p["v"], p["mu"]
    slid = 2 * v**2 / (49 * mu * GRAVITY)
    return (
        Derivative("x'", "v", 2 * slid / v + 5 / 7 * ROLL * FRAME),
        Derivative("x'", "mu", -slid / mu),
        Derivative("v'", "v", 5 / 7),
        Derivative("v'", "mu", 0.0, v / mu),
        Derivative("x'", "m", 0.0, v * ROLL * FRAME / p["m"]),
    )


POSITION, VELOCITY = "position", "linear_velocity"
TWO = {"x1'": (POSITION, 0), "x2'": (POSITION, 1), "v1'": (VELOCITY, 0), "v2'": (VELOCITY, 1)}
DROP, HEIGHT = {"h": 0.3, "e": 0.7, "m": 1.0}, {"height": (POSITION, 1)}
MEETING = {"x1": -2 * RADIUS - MEET, "x2": 0.0, "v1": 1.0}
CASES = {
    "elastic balls": Case({**MEETING, "m1": 1.0, "e": 1.0}, ("x1", 0.0037), _balls, TWO, 0, _elastic),
    "unequal balls": Case({**MEETING, "m1": 2.0, "e": 0.5}, ("x1", 0.0037), _balls, TWO, 0, _unequal),
    "slide": Case(
        {"v": 2.0, "mu": 0.5, "m": 1.0}, ("v", 0.0181), _slides, {"stop": (POSITION, 1)}, 0, _stops
    ),
    "bounce": Case(DROP, ("h", 0.0089), _drops(24), HEIGHT, 2, _bounced(1, 24)),
    "bounce three times": Case(DROP, ("h", 0.0031), _drops(60), HEIGHT, 2, _bounced(3, 60)),
    "roll": Case(
        {"v": 2.0, "mu": 0.3, "m": 1.0}, ("v", 0.0379), _rolls,
        {"x'": (POSITION, 1), "v'": (VELOCITY, 1)}, 0, _rolled,
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Task:
    """All differences of a case on an engine."""

    case: str
    engine: str
    settings: Settings


def errors(engine: Engine, task: Task) -> Array:
    """Error of each derivative at each size and start (d, SIZES, STARTS), over its size [1]."""
    case = CASES[task.case]
    found = []
    for start in case.starts():
        truths = case.truth(start)
        by_size = []
        for size in SIZES:
            slopes: dict[tuple[str, str], float] = {}
            for name in dict.fromkeys(one.parameter for one in truths):
                step = size * (abs(start[name]) or 1.0)
                scenes = [case.scene({**start, name: start[name] + way}) for way in (step, -step)]
                high, low = (case.end(record(engine, scene, task.settings)) for scene in scenes)
                slopes |= {(name, output): (high[output] - low[output]) / (2 * step) for output in high}
            apart = [abs(slopes[one.parameter, one.output] - one.value) for one in truths]
            by_size.append([e / (one.size or abs(one.value)) for e, one in zip(apart, truths)])
        found.append(by_size)
    return np.transpose(found, (2, 1, 0))


def tasks(columns: Sequence[Column]) -> list[Task]:
    """All cases on all installed engines."""
    return [
        Task(name, engine, Settings(profile, ENGINES[engine].profiles[profile]))
        for name in CASES
        for engine, profile in columns
        if installed(engine)
    ]


def run(columns: Sequence[Column], out: Path, progress: Progress) -> pd.DataFrame:
    """Take all derivatives; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        asked = tasks(columns)
        rows = missing_rows(STUDY, columns)
        for task, one in zip(asked, played(errors, asked, folder / "output", progress)):
            rows += rows_of_task(task, one)
        facts = {"study": STUDY, "sizes": SIZES, "starts": STARTS}
        return kept(rows, folder, facts, {"gradients.png": errors_picture} if asked else {})


def rows_of_task(task: Task, found: Array | Ended) -> list[Row]:
    """Per derivative and size the median error over the starts, with the range; JUDGED by its largest."""
    base = Row(STUDY, task.case, task.engine, task.settings.label, task.settings.dt, ERROR, unit="1")
    if isinstance(found, Ended):
        return [replace(base, metric="run", verdict=found.status, reason=found.reason)]
    case, rows = CASES[task.case], []
    for one, by_size in zip(case.truth(case.start), found):
        for size, several in zip(SIZES, by_size):
            row = with_interval(base, extremes(several), subject=f"{one.name}, h {size:g}")
            if (task.engine, task.settings.profile, size) == JUDGED:
                row = replace(row, limit=LIMIT, verdict="pass" if row.high <= LIMIT else "fail")
            rows.append(row)
    return rows


NOTES = (
    "median error over the starts at h of 1e-2, 1e-4 and 1e-6 of the parameter, over the derivative (where",
    "that is 0: over output by parameter); limit 1e-5 for the largest at 1e-4 of the reference's `accurate`",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per derivative with the errors of every column, by case."""
    rows = rows_of(frame[frame.metric == ERROR])
    columns = list(dict.fromkeys((row.engine, row.profile) for row in rows))
    cells: dict[tuple[str, str], dict[Column, list[str]]] = {}
    for row in rows:
        line = cells.setdefault((row.scenario, row.subject.partition(",")[0]), {})
        line.setdefault((row.engine, row.profile), []).append(f"{row.value:.0e}")
    lines: list[list[str]] = []
    last = ""
    for (case, name), found in cells.items():
        lines += [[case]] if case != last else []
        last = case
        lines.append([name, *(" ".join(found.get(column, ())) for column in columns)])
    heads = ["derivative", *map(" ".join, columns)]
    judged = [row.high for row in rows if row.limit == row.limit]
    worst = [f"largest of the {len(judged)} judged: {max(judged):.0e}"] if judged else []
    notes = (*NOTES, *worst)
    return [Part("gradients: errors of derivatives of the end state", heads, lines, notes), failures(frame)]


LEAST, MOST = 1e-10, 10.0
"""Errors between which the picture's colours change [1]."""


def errors_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw a map of the errors: derivatives by case, over columns and h."""
    rows = frame[frame.metric == ERROR].copy()
    rows[["name", "size"]] = rows.subject.str.split(", h ", expand=True)
    rows["name"], rows["column"] = rows.scenario + ":  " + rows["name"], rows.engine + " " + rows.profile
    rows["value"] = rows.value.clip(LEAST, MOST)
    colors = alt.Scale(type="log", domain=[LEAST, MOST], scheme="redyellowblue", reverse=True)
    powers = alt.Axis(labelExpr="format(datum.value, '.0e')", ticks=False, domain=False, labelAngle=0)
    heads = alt.Header(labelExpr="split(datum.label, ' ')", labelFontSize=8)
    legend = alt.Legend(title="error of the derivative [1]", orient="right", format=".0e", gradientLength=120)
    names = list(dict.fromkeys(rows.column))
    drawn = (
        alt.Chart(rows)
        .mark_rect(stroke="white")
        .encode(
            x=alt.X("size:O", sort=None, title=None, axis=powers),
            y=alt.Y("name:N", sort=None, title=None, axis=alt.Axis(ticks=False, domain=False, labelLimit=0)),
            color=alt.Color("value:Q", scale=colors, legend=legend),
            column=alt.Column("column:N", sort=names, title=None, spacing=4, header=heads),
        )
        .properties(width=alt.Step(22), height=alt.Step(16))
    )
    note = f"central differences with steps h over the parameter; median over {STARTS} starts"
    save(drawn, path, "Derivatives of the end state: where they are wrong", note)
