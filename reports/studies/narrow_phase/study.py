"""The study `narrow-phase`: errors and times of all detectors on the same poses.

The truth is the explicit Minkowski difference. Depth errors are relative to max(depth, a thousandth of the
pair's size); a missed contact counts as distance 0. Times are of single queries, interleaved over all
detectors, after warm-up, without the transfer of shapes and poses. `time.query` is the wall time of a call
from Python; `time.net` and ratios subtract the cheapest call, that of two spheres.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.detectors import DETECTORS
from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import illustrate, save, save_manifest, table
from touchstone.reports.studies.interleaved_timing import Stretch, measure
from touchstone.reports.studies.narrow_phase.rows import STUDY, Truth, rows_of_study
from touchstone.reports.studies.poses import FAMILIES, corners, draw, size_of
from touchstone.reports.verdict.judge import judged

SLICE = 5 * len(FAMILIES)
"""Pairs per turn: every family five times, so that variations of the machine's speed affect all detectors
equally."""
TURNS, PASSES = 2, 3
"""Turns per slice and timed passes per turn."""


class PairsError(Exception):
    """The number of pairs cannot be used; the message says why."""


def steps(pairs: int) -> int:
    """Number of progress steps of a run: pairs times detectors."""
    return pairs * len(DETECTORS)


def run(pairs: int, seed: int, out: Path, progress: Progress) -> pd.DataFrame:
    """Measure all detectors; store rows, picture and manifest. The folder appears complete or not at all."""
    if pairs < len(FAMILIES):
        raise PairsError(f"--pairs {pairs}: expected at least {len(FAMILIES)}, one per family of poses")
    with output_folder(out) as folder:
        (folder / "output").mkdir()
        progress("draw pairs", 0)
        truth = truth_of(pairs, seed)
        slices = [Stretch(first, min(first + SLICE, pairs)) for first in range(0, pairs, SLICE)]
        measured = measure(DETECTORS, truth.pairs, slices, TURNS, PASSES, folder / "output", progress)
        progress("judge", 0)
        frame = table(judged(replace(row, seed=seed), ()) for row in rows_of_study(truth, measured))
        save(frame, folder)
        facts = {name: dict(mine.facts) for name, mine in measured.items()}
        save_manifest(folder, {"study": STUDY, "pairs": pairs, "seed": seed, "detectors": facts})
        from touchstone.reports.views.pictures import work_precision

        illustrate(folder / "narrow_phase.png", lambda part: work_precision(frame, part))
    return frame


def truth_of(count: int, seed: int) -> Truth:
    """Random pairs of a seed, with the truth by the explicit Minkowski difference of each."""
    drawn = draw(count, np.random.default_rng(seed))
    vertices = [(corners(a), corners(b)) for _, (a, b) in drawn]
    found = [signed_distance(a, b) for a, b in vertices]
    return Truth(
        [pair for _, pair in drawn],
        vertices,
        np.array([family for family, _ in drawn]),
        np.array([size_of(pair) for _, pair in drawn]),
        np.array([distance for distance, _ in found]),
        np.array([normal for _, normal in found]),
    )
