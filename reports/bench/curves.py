"""Measurements of `bench scaling`: times over sizes, of the broad phase, of balls at rest, of hulls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, sqrt
from pathlib import Path

import numpy as np

from touchstone.adapters.contract import MISSING, Array, Settings
from touchstone.adapters.detectors import DETECTORS, UNCONVERGED, Pair
from touchstone.adapters.detectors import load as load_detector
from touchstone.adapters.detectors.children import Loader as DetectorLoader
from touchstone.adapters.engines.reference.box_cloud import Cloud
from touchstone.adapters.recorder import undisturbed
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.adapters.workers.stepping import Loader, Stepper
from touchstone.reports.bench.poses import hull_slide
from touchstone.reports.cli.progress import Progress
from touchstone.reports.studies.narrow_phase.interleaved_timing import Stretch, measure
from touchstone.scenarios.scenario import Body, Box, PairCoefficients, Piece, Scenario, Sphere
from touchstone.scenarios.solids import sphere_inertia

BROAD_PHASE, BALLS, VERTICES = "broad phase", "balls at rest", "hull vertices"
"""Names of the curves."""
WARM_UP = 5
"""Frames of each size that are discarded."""
SPACING, RADIUS, MASS = 0.2, 0.05, 0.3
"""Balls at rest: distance from centre to centre, radius [m] and mass [kg]."""


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


def broad_phase(sizes: Sequence[int], frames: int, progress: Progress) -> list[Curve]:
    """The reference's broad phase in clouds of moving boxes of constant density."""
    clouds = [Cloud(size, np.random.default_rng(size)) for size in sizes]
    times = np.zeros((len(sizes), WARM_UP + frames))
    for frame in range(WARM_UP + frames):
        # One frame of each size in turn: other work evicts the processor's caches in between, as in a step.
        for k, cloud in enumerate(clouds):
            times[k, frame] = undisturbed(cloud.frame)
        progress(BROAD_PHASE, 1)
    remarks = [f"{2 * cloud.found / len(cloud.pieces):.1f} neighbours each" for cloud in clouds]
    found = list(times[:, WARM_UP:])
    return [
        Curve(BROAD_PHASE, "pieces", "reference", "balanced", sizes=list(sizes), times=found, remarks=remarks)
    ]


def resting_balls(count: int) -> Scenario:
    """Balls on one floor that do not touch each other."""
    across = ceil(sqrt(count))
    half = across * SPACING
    floor = Body("floor", "fixed", "wood", (Piece("floor", Box((half, half, 0.1)), (0.0, 0.0, -0.1)),))
    places = ((k % across - across / 2, k // across - across / 2) for k in range(count))
    balls = tuple(
        Body(
            f"ball_{k}",
            "simulated",
            "wood",
            (Piece("ball", Sphere(RADIUS)),),
            mass=MASS,
            inertia=sphere_inertia(MASS, RADIUS),
            position=(SPACING * x, SPACING * y, RADIUS),
        )
        for k, (x, y) in enumerate(places)
    )
    wood = (PairCoefficients("wood", "wood", 0.3, 0.3),)
    return Scenario(f"{count} balls", "balls at rest", (), (floor, *balls), 60.0, wood)


def balls_at_rest(
    sizes: Sequence[int],
    further: Sequence[int],
    turns: int,
    frames: int,
    output: Path,
    progress: Progress,
    loader: Loader = load,
) -> list[Curve]:
    """Times of whole frames of every engine in its first profile, interleaved; the reference also at
    `further` sizes."""
    curves, children = [], []
    for engine, entry in ENGINES.items():
        profile, dt = next(iter(entry.profiles.items()))
        curve = Curve(BALLS, "balls", engine, profile, dt, list(sizes))
        if engine == "reference":
            curve.sizes += further
        if installed(engine):
            children.append((curve, Stepper(engine, output / f"{engine}.txt", loader)))
        else:
            curve.ended = (MISSING, missing_reason(engine))
        curves.append(curve)
    scenes = {size: resting_balls(size) for size in (*sizes, *further)}
    try:
        for _, child in children:
            child.send("load")
        for _, child in children:
            child.receive()
        for size, scene in scenes.items():
            asked = [(curve, child) for curve, child in children if size in curve.sizes]
            for curve, child in asked:
                child.send("build", (scene, Settings(curve.profile, curve.dt), WARM_UP))
            for curve, child in asked:
                progress(f"{curve.engine}: build", 1)
                child.receive()
        for curve, _ in children:
            curve.times = [np.zeros(0)] * len(curve.sizes)
        for _ in range(turns):
            for k, size in enumerate((*sizes, *further)):
                for curve, child in children:
                    if size in curve.sizes:
                        progress(curve.engine, 1)
                        seconds = child.ask("frames", (scenes[size].name, frames))
                        curve.times[k] = np.append(curve.times[k], [] if seconds is None else seconds)
        for curve, child in children:
            curve.ended = child.failure
    finally:
        for _, child in children:
            child.stop()
    return curves


def hull_vertices(
    names: Sequence[str],
    sizes: Sequence[int],
    pairs: int,
    frames: int,
    turns: int,
    output: Path,
    progress: Progress,
    loader: DetectorLoader = load_detector,
) -> list[Curve]:
    """Times of depth queries of touching hulls, over the frames of a motion, net of the crossing."""
    rng = np.random.default_rng(0)
    queries: list[Pair] = []
    stretches = []
    for size in sizes:
        motion = [pair for frame in hull_slide(size, pairs, frames, rng) for pair in frame]
        stretches.append(Stretch(len(queries), len(queries) + len(motion), pairs))
        queries += motion
    measured = measure(names, queries, stretches, turns, 1, output, progress, loader)
    curves = []
    for name, mine in measured.items():
        curve = Curve(VERTICES, "vertices", name, DETECTORS[name].profile, sizes=list(sizes))
        curve.ended = mine.ended
        net = mine.net(np.full(len(queries), -1.0)) if mine.ended is None else mine.seconds
        for stretch in stretches:
            part = range(stretch.first, stretch.end)
            curve.times.append(net[stretch.first : stretch.end])
            open_ones = sum(k in mine.failures and mine.failures[k].kind == UNCONVERGED for k in part)
            curve.remarks.append(f"{open_ones} of {len(part)} not converged" if open_ones else "")
        curves.append(curve)
    return curves
