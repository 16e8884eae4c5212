"""`bench scaling`: growth of time with size, as the exponent of a power law.

- Broad phase: 100 to 10,000 boxes that move in a cloud of constant density. Frames of all sizes alternate, so
  that none keeps the processor's caches to itself, as in a step.
- Balls at rest: whole frames of every engine at its own step; all balls touch one floor and no other ball.
- Hull vertices: depth of touching hulls of 50 to 5,000 vertices, one sliding past the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import pandas as pd

from touchstone.adapters.detectors import load as load_detector
from touchstone.adapters.detectors.children import Loader as DetectorLoader
from touchstone.adapters.registry import ENGINES, load
from touchstone.adapters.workers.stepping import Loader
from touchstone.reports.bench.curves import Curve, balls_at_rest, broad_phase, hull_vertices
from touchstone.reports.bench.scaling_table import show
from touchstone.reports.bootstrap import exponent, median_interval
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, illustrate, save, save_manifest, table
from touchstone.reports.verdict.judge import judged

__all__ = ["Plan", "run", "show", "steps"]

STUDY = "bench scaling"
SUBJECTS = ("reference.exact", "reference.walk", "coal", "coal.tight", "python-fcl.distance")
"""Detectors whose time over the number of vertices is measured."""


@dataclass(frozen=True, slots=True)
class Plan:
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


PLAN = Plan()


def steps(plan: Plan = PLAN) -> int:
    """Number of frames of the cloud, builds and turns of the balls, and queries of the detectors."""
    worlds = len(ENGINES) * len(plan.balls) + len(plan.more_balls)
    queries = len(SUBJECTS) * len(plan.vertices) * plan.hull_pairs * plan.hull_frames
    return 5 + plan.cloud_frames + worlds * (1 + plan.ball_turns) + queries


def run(
    out: Path,
    progress: Progress,
    plan: Plan = PLAN,
    loader: Loader = load,
    detector_loader: DetectorLoader = load_detector,
) -> pd.DataFrame:
    """Measure all three; store rows, picture and manifest."""
    from touchstone.reports.bench.scaling_picture import draw

    with output_folder(out) as folder:
        output = folder / "output"
        output.mkdir()
        curves = broad_phase(plan.pieces, plan.cloud_frames, progress)
        curves += balls_at_rest(
            plan.balls, plan.more_balls, plan.ball_turns, plan.ball_frames, output, progress, loader
        )
        curves += hull_vertices(
            SUBJECTS,
            plan.vertices,
            plan.hull_pairs,
            plan.hull_frames,
            plan.hull_turns,
            output,
            progress,
            detector_loader,
        )
        frame = table(judged(row, ()) for row in rows_of_curves(curves))
        save(frame, folder)
        save_manifest(folder, {"study": STUDY, **asdict(plan)})
        illustrate(folder / "scaling.png", lambda part: draw(frame, part))
    return frame


def rows_of_curves(curves: Sequence[Curve]) -> list[Row]:
    """The time of every size, and the exponent over all of them."""
    rows = []
    for curve in curves:
        base = Row(STUDY, curve.scenario, curve.engine, curve.profile, curve.dt, "run")
        if curve.ended is not None:
            rows.append(replace(base, verdict=curve.ended[0], reason=curve.ended[1]))
            continue
        for size, times, remark in zip(curve.sizes, curve.times, curve.remarks or [""] * len(curve.sizes)):
            value, low, high = median_interval(times)
            row = replace(
                base, metric="scaling.time", unit="s", subject=f"{size} {curve.unit}", reason=remark
            )
            rows.append(replace(row, value=value, low=low, high=high))
        value, low, high = exponent(curve.sizes, curve.times)
        rows.append(replace(base, metric="scaling.exponent", unit="1", value=value, low=low, high=high))
    return rows
