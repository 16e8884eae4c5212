"""`bench scaling`: growth of time with size, as the exponent of a power law.

- Broad phase: 100 to 10,000 boxes that move in a cloud of constant density. Frames of all sizes alternate, so
  that none keeps the processor's caches to itself, as in a step.
- Balls at rest: whole frames of every engine at its own step; all balls touch one floor and no other ball.
- Hull vertices: depth of touching hulls of 50 to 5,000 vertices, one sliding past the other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import ceil, sqrt
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import MISSING, Array, Engine, Settings, World
from touchstone.adapters.detectors import DETECTORS, UNCONVERGED, Pair
from touchstone.adapters.detectors import load as load_detector
from touchstone.adapters.detectors.children import Loader as DetectorLoader
from touchstone.adapters.engines.reference.box_cloud import Cloud
from touchstone.adapters.recorder import frame_seconds, undisturbed
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.adapters.workers.pool import Ended, EngineProcess, Loader
from touchstone.reports.bench.geometry import hull_slide
from touchstone.reports.bootstrap import exponent, median_interval
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.narrow_phase.interleaved_timing import Stretch, measure
from touchstone.reports.studies.study import (
    MICRO,
    interval_text,
    kept,
    limit_text,
    remarks,
    value_text,
    with_interval,
)
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.pictures import detector_looks, ends, log_axis, save
from touchstone.reports.views.render import Part
from touchstone.scenarios.scenario import Body, Box, PairCoefficients, Piece, Scenario
from touchstone.scenarios.solids import ball

BROAD_PHASE, BALLS, VERTICES = "broad phase", "balls at rest", "hull vertices"
WARM_UP = 5
"""Frames of each size that are discarded."""
SPACING, RADIUS, MASS = 0.2, 0.05, 0.3
"""Balls at rest: distance from centre to centre, radius [m] and mass [kg]."""


SUBJECTS = ("reference.exact", "reference.walk", "coal", "coal.tight", "python-fcl.distance")
"""Detectors whose time over the number of vertices is measured."""


@dataclass(frozen=True, slots=True)
class Amount:
    """Sizes, and the number of repetitions."""

    pieces: tuple[int, ...] = (100, 320, 1000, 3200, 10_000)
    cloud_frames: int = 60
    balls: tuple[int, ...] = (10, 30, 100)
    more_balls: tuple[int, ...] = (300, 500)
    """Sizes for the reference only: other engines take a minute to build them."""
    ball_turns: int = 4
    ball_frames: int = 5
    vertices: tuple[int, ...] = (50, 160, 500, 1600, 5000)
    hull_pairs: int = 4
    hull_frames: int = 30
    hull_turns: int = 3


AMOUNT = Amount()


@dataclass(slots=True)
class Curve:
    """Times [s] per repetition (r,) of one engine over sizes. `ended`: verdict and reason of an engine that
    stopped; `remark`: on the times."""

    scenario: str
    unit: str
    engine: str
    profile: str
    dt: float = float("nan")
    sizes: list[int] = field(default_factory=list)
    times: list[Array] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    ended: tuple[str, str] | None = None


def broad_phase(amount: Amount, progress: Progress) -> list[Curve]:
    """The reference's broad phase in clouds of moving boxes of constant density."""
    sizes, frames = amount.pieces, amount.cloud_frames
    clouds = [Cloud(size, np.random.default_rng(size)) for size in sizes]
    times = np.zeros((len(sizes), WARM_UP + frames))
    for frame in range(WARM_UP + frames):
        # One frame of each size in turn: other work evicts the processor's caches in between, as in a step.
        for k, cloud in enumerate(clouds):
            times[k, frame] = undisturbed(cloud.frame)
        progress(BROAD_PHASE, 1)
    remarks = [f"{2 * cloud.found / len(cloud.pieces):.1f} neighbours each" for cloud in clouds]
    found, what = list(times[:, WARM_UP:]), (BROAD_PHASE, "pieces", "reference", "balanced")
    return [Curve(*what, sizes=list(sizes), times=found, remarks=remarks)]


def resting_balls(count: int) -> Scenario:
    """Balls on one floor that do not touch each other."""
    across = ceil(sqrt(count))
    half = across * SPACING
    floor = Body("floor", "fixed", "wood", (Piece("floor", Box((half, half, 0.1)), (0.0, 0.0, -0.1)),))
    places = ((k % across - across / 2, k // across - across / 2) for k in range(count))
    balls = tuple(
        ball(f"ball_{k}", "wood", RADIUS, MASS, (SPACING * x, SPACING * y, RADIUS))
        for k, (x, y) in enumerate(places)
    )
    wood = (PairCoefficients("wood", "wood", 0.3, 0.3),)
    return Scenario(f"{count} balls", "balls at rest", (), (floor, *balls), 60.0, wood)


@dataclass(frozen=True, slots=True)
class Frames:
    """The next frames of a scene on an engine."""

    engine: str
    settings: Settings
    scenario: Scenario
    count: int


_worlds: dict[str, tuple[World, Iterator[int]]] = {}
"""Worlds of this process and the numbers of their next frames, by the scene's name."""


def frame_times(engine: Engine, task: Frames) -> Array:
    """Times of the next frames, each without preemption, state not read [s]."""
    name, settings = task.scenario.name, task.settings
    world, numbers = _worlds.get(name) or (engine.build(task.scenario, settings), itertools.count())
    _worlds[name] = world, numbers
    return np.array(
        [
            undisturbed(lambda: frame_seconds(world, task.scenario, settings, next(numbers)))
            for _ in range(task.count)
        ]
    )


def balls_at_rest(amount: Amount, output: Path, progress: Progress, loader: Loader = load) -> list[Curve]:
    """Times of whole frames of every engine in its first profile, interleaved; the reference also at more
    sizes."""
    sizes, further = amount.balls, amount.more_balls
    curves, children = [], []
    for engine, entry in ENGINES.items():
        profile, dt = next(iter(entry.profiles.items()))
        curve = Curve(BALLS, "balls", engine, profile, dt, list(sizes))
        if engine == "reference":
            curve.sizes += further
        if installed(engine):
            children.append((curve, EngineProcess(frame_times, output / f"{engine}.txt", loader)))
        else:
            curve.ended = (MISSING, missing_reason(engine))
        curve.times = [np.zeros(0) for _ in curve.sizes]
        curves.append(curve)
    scenes = {size: resting_balls(size) for size in (*sizes, *further)}

    def ask(curve: Curve, child: EngineProcess, size: int, count: int) -> None:
        if curve.ended is None:
            child.send("play", Frames(curve.engine, Settings(curve.profile, curve.dt), scenes[size], count))

    def answer(curve: Curve, child: EngineProcess) -> Array:
        found = child.receive() if curve.ended is None else np.zeros(0)
        if isinstance(found, Ended):
            curve.ended, found = (found.status, found.reason), np.zeros(0)
        return found

    try:
        for size in scenes:
            asked = [(curve, child) for curve, child in children if size in curve.sizes]
            for curve, child in asked:
                ask(curve, child, size, WARM_UP)
            for curve, child in asked:
                progress(f"{curve.engine}: build", 1)
                answer(curve, child)
        for _ in range(amount.ball_turns):
            for k, size in enumerate(scenes):
                for curve, child in children:
                    if size in curve.sizes:
                        progress(curve.engine, 1)
                        ask(curve, child, size, amount.ball_frames)
                        curve.times[k] = np.append(curve.times[k], answer(curve, child))
    finally:
        for _, child in children:
            child.stop()
    return curves


def hull_vertices(
    amount: Amount, output: Path, progress: Progress, loader: DetectorLoader = load_detector
) -> list[Curve]:
    """Times of depth queries of touching hulls, over the frames of a motion, net of the crossing."""
    rng = np.random.default_rng(0)
    queries: list[Pair] = []
    stretches = []
    for size in amount.vertices:
        frames = hull_slide(size, amount.hull_pairs, amount.hull_frames, rng)
        motion = [pair for frame in frames for pair in frame]
        stretches.append(Stretch(len(queries), len(queries) + len(motion), amount.hull_pairs))
        queries += motion
    measured = measure(SUBJECTS, queries, stretches, amount.hull_turns, 1, output, progress, loader)
    curves = []
    for name, mine in measured.items():
        curve = Curve(VERTICES, "vertices", name, DETECTORS[name].profile, sizes=list(amount.vertices))
        curve.ended = mine.ended
        net = mine.net(np.full(len(queries), -1.0)) if mine.ended is None else mine.seconds
        for stretch in stretches:
            part = range(stretch.first, stretch.end)
            curve.times.append(net[stretch.first : stretch.end])
            open_ones = sum(k in mine.failures and mine.failures[k].kind == UNCONVERGED for k in part)
            curve.remarks.append(f"{open_ones} of {len(part)} not converged" if open_ones else "")
        curves.append(curve)
    return curves


NOTES = ("exponent: of the power law that fits the medians by least squares, with its 95 % interval",)


def report(frame: pd.DataFrame) -> list[Part]:
    """One table per curve: times by size, and the exponent."""
    parts = []
    for scenario in dict.fromkeys(frame[frame.metric == "scaling.time"].scenario):
        part = frame[frame.scenario == scenario]
        sizes = list(dict.fromkeys(part[part.metric == "scaling.time"].subject))
        numbers, units = zip(*(size.split() for size in sizes))
        rows = []
        for engine in dict.fromkeys(part[part.metric == "scaling.time"].engine):
            mine = {(row.metric, row.subject): row for row in rows_of(part[part.engine == engine])}
            power = mine.get(("scaling.exponent", ""))
            cells = [value_text(mine.get(("scaling.time", size)), MICRO) for size in sizes]
            rows.append([engine, *cells, value_text(power), interval_text(power), limit_text(power)])
        heads = (units[0], *numbers, "exponent", "95 % interval", "limit")
        parts.append(Part(f"bench scaling: {scenario}, median time [µs]", heads, rows))
    unusual, lines = frame[(frame.metric == "scaling.time") & (frame.reason != "")], []
    for (scenario, engine), part in unusual.groupby(["scenario", "engine"], sort=False):
        reasons = ", ".join(f"{row.subject} {row.reason}" for row in rows_of(part))
        lines.append(f"{scenario}: {engine}: {reasons}")
    return [*parts, Part(lines=lines), remarks(frame, NOTES)]


TITLES = {
    BROAD_PHASE: ("Broad phase", "moving boxes in a cloud of constant density"),
    BALLS: ("Whole frame", "balls at rest on a floor, each engine at its own step"),
    VERTICES: ("Convex depth", "vertices per hull, one hull sliding past the other"),
}
"""Curve -> title and label of sizes."""


def draw(frame: pd.DataFrame, path: Path) -> None:
    """Draw one panel per curve. A marker is the median, a bar its 95 % interval."""
    shown = [name for name in TITLES if (frame.scenario == name).any()]
    panels = [_panel(frame[frame.scenario == name], *TITLES[name]) for name in shown]
    note = "marker: median; line: the power law that fits best, with its exponent in the legend"
    drawn = alt.hconcat(*panels, spacing=24).resolve_scale(color="independent", shape="independent")
    save(drawn, path, "Growth of times with size", note)


def _panel(part: pd.DataFrame, title: str, sizes_label: str) -> Any:
    powers = part[part.metric == "scaling.exponent"].set_index("engine").value
    heads = {engine: f"{engine}, n^{power:.2f}" for engine, power in powers.items()}
    points = part[(part.metric == "scaling.time") & part.engine.isin(powers.index)]
    sizes = points.subject.str.split().str[0].astype(float)  # "100 pieces" is 100
    points = points.assign(size=sizes, engine=points.engine.map(heads))
    points[["value", "low", "high"]] *= MICRO
    fits = []
    for engine, power in powers.items():
        mine = points[points.engine == heads[engine]]
        middle = np.exp(np.mean(np.log(mine.value) - power * np.log(mine["size"])))
        fit = mine.iloc[[0, -1]]
        fits.append(fit.assign(value=middle * fit["size"] ** power))
    text = "median time [µs], 95 % interval"
    x = log_axis(alt.X, "size", sizes_label, ends(sizes), values=sorted(set(sizes)), grid=False)
    y = log_axis(alt.Y, "value", text, ends(pd.concat(fits).value, points.low, points.high))
    marks = {name: mark.legend(columns=2) for name, mark in detector_looks(heads.values()).items()}
    base = alt.Chart(points).encode(x=x, color=marks["color"])
    lines = alt.Chart(pd.concat(fits)).mark_line(opacity=0.65, strokeWidth=1.3)
    drawn = (
        lines.encode(x=x, y=y, color=marks["color"])
        + base.mark_rule(strokeWidth=1.2).encode(y="low:Q", y2="high:Q")
        + base.mark_point(filled=True, size=40, opacity=1).encode(y=y, shape=marks["shape"])
    )
    return drawn.properties(title=title, width=300, height=230)


STUDY = "bench scaling"


def steps(amount: Amount = AMOUNT) -> int:
    """Number of frames of the cloud, builds and turns of the balls, and queries of the detectors."""
    worlds = len(ENGINES) * len(amount.balls) + len(amount.more_balls)
    queries = len(SUBJECTS) * len(amount.vertices) * amount.hull_pairs * amount.hull_frames
    return 5 + amount.cloud_frames + worlds * (1 + amount.ball_turns) + queries


def run(
    out: Path,
    progress: Progress,
    amount: Amount = AMOUNT,
    loader: Loader = load,
    detector_loader: DetectorLoader = load_detector,
) -> pd.DataFrame:
    """Measure all three; store rows, picture and manifest."""
    with output_folder(out) as folder:
        output = folder / "output"
        output.mkdir()
        curves = broad_phase(amount, progress)
        curves += balls_at_rest(amount, output, progress, loader)
        curves += hull_vertices(amount, output, progress, detector_loader)
        rows = [judged(row, ()) for row in rows_of_curves(curves)]
        return kept(rows, folder, {"study": STUDY, **asdict(amount)}, {"scaling.png": draw})


def rows_of_curves(curves: Sequence[Curve]) -> list[Row]:
    """The time of every size, and the exponent over all of them."""
    rows = []
    for curve in curves:
        base = Row(STUDY, curve.scenario, curve.engine, curve.profile, curve.dt, "run")
        if curve.ended is not None:
            rows.append(replace(base, verdict=curve.ended[0], reason=curve.ended[1]))
            continue
        for size, times, remark in zip(curve.sizes, curve.times, curve.remarks or [""] * len(curve.sizes)):
            row = replace(base, metric="scaling.time", subject=f"{size} {curve.unit}", reason=remark)
            rows.append(with_interval(row, median_interval(times), unit="s"))
        power = replace(base, metric="scaling.exponent", unit="1")
        rows.append(with_interval(power, exponent(curve.sizes, curve.times)))
    return rows
