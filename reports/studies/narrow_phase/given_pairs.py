"""Pairs of a file, sent through every detector: what each says of each pair, beside the explicit Minkowski
difference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.detectors import DETECTORS, THREW, UNCONVERGED, Failure
from touchstone.adapters.oracles.minkowski import core, piece_distance
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, save, save_manifest, table
from touchstone.reports.studies.interleaved_timing import Measured, Stretch, measure
from touchstone.reports.studies.narrow_phase.rows import (
    SIGN_FLOOR,
    STUDY,
    Truth,
    depth_errors,
    normal_errors,
)
from touchstone.scenarios.files.pair_file import GivenPair

TRUTH = "minkowski"
"""Engine of the rows that hold the truth."""
DISTANCE, ERROR, NORMAL, TIME = "distance", "depth.error", "normal.error", "time.query"
WRONG_SIGN, MISSED = "wrong sign", "missed"
"""Reasons of answers that are wrong in kind: overlap for a gap or the reverse, and no contact for overlap."""
TURNS, PASSES = 2, 3


class UnknownTruth(Exception):
    """A pair has a shape without an explicit Minkowski difference; the message names it."""


def run(pairs: Sequence[GivenPair], out: Path, progress: Progress) -> pd.DataFrame:
    """Measure all detectors on the pairs; the folder appears complete or not at all."""
    truth = truth_of(pairs)
    with output_folder(out) as folder:
        (folder / "output").mkdir()
        stretches = [Stretch(0, len(pairs))]
        measured = measure(DETECTORS, truth.pairs, stretches, TURNS, PASSES, folder / "output", progress)
        for name, mine in measured.items():
            if mine.ended is not None and mine.ended[0] == "error":
                _ask_one_by_one(name, mine, truth, folder / "output")
        frame = table(_rows(pairs, truth, measured))
        save(frame, folder)
        facts = {name: dict(mine.facts) for name, mine in measured.items()}
        sources = {pair.name: pair.source for pair in pairs}
        save_manifest(folder, {"study": STUDY, "pairs": sources, "detectors": facts})
    return frame


def _ask_one_by_one(name: str, mine: Measured, truth: Truth, output: Path) -> None:
    """Ask a detector that died each pair in a process of its own, so that only those have no answer of which
    it dies."""
    mine.ended = None
    for k, pair in enumerate(truth.pairs):
        one = measure([name], [pair], [Stretch(0, 1)], 1, 1, output, lambda *_: None)[name]
        mine.distance[k], mine.normal[k], mine.seconds[k] = one.distance[0], one.normal[0], one.seconds[0]
        found = Failure(THREW, one.ended[1]) if one.ended is not None else one.failures.get(0)
        if found is not None:
            mine.failures[k] = found


def truth_of(pairs: Sequence[GivenPair]) -> Truth:
    """Signed distance and normal of each pair; raises UnknownTruth."""
    try:
        found = [piece_distance(*pair.pieces) for pair in pairs]
    except Unsupported as error:
        raise UnknownTruth(str(error)) from error
    cores = [tuple(core(piece) for piece in pair.pieces) for pair in pairs]
    radii = np.array([a[1] + b[1] for a, b in cores])
    sizes = [max(float(np.ptp(points, axis=0).max()) + 2 * r for points, r in each) for each in cores]
    return Truth(
        [pair.pieces for pair in pairs],
        [(a[0], b[0]) for a, b in cores],
        np.array([pair.name for pair in pairs]),
        np.array(sizes),
        np.array([distance for distance, _ in found]),
        np.array([normal for _, normal in found]),
        radii,
    )


def _rows(pairs: Sequence[GivenPair], truth: Truth, measured: Mapping[str, Measured]) -> list[Row]:
    rows = [
        Row(STUDY, pair.name, TRUTH, "exact", nan, DISTANCE, float(distance), "m", reason=pair.source)
        for pair, distance in zip(pairs, truth.distance)
    ]
    for name, mine in measured.items():
        base = Row(STUDY, "all", name, DETECTORS[name].profile, nan, "run")
        if mine.ended is not None:
            rows.append(replace(base, verdict=mine.ended[0], reason=mine.ended[1]))
            continue
        errors, angles = depth_errors(truth, mine), normal_errors(truth, mine)
        for k, pair in enumerate(pairs):
            row = replace(base, scenario=pair.name, reason=_remark(truth, mine, k))
            figures = (
                (DISTANCE, mine.distance[k], "m"),
                (ERROR, errors[k], "1"),
                (NORMAL, angles[k], "rad"),
                (TIME, mine.seconds[k], "s"),
            )
            rows += [replace(row, metric=metric, value=float(x), unit=unit) for metric, x, unit in figures]
    return rows


def _remark(truth: Truth, mine: Measured, k: int) -> str:
    """What is wrong in kind with an answer, or why there is none; "" for an answer or a gap that is not
    reported."""
    failure, true, found = mine.failures.get(k), truth.distance[k], mine.distance[k]
    if failure is not None and failure.kind != UNCONVERGED:
        return f"{failure.kind}: {failure.reason}"
    if abs(true) > SIGN_FLOOR * truth.size[k]:
        if np.isnan(found) and true < 0:
            return MISSED
        if found * true < 0:
            return WRONG_SIGN
    return f"{failure.kind}: {failure.reason}" if failure is not None else ""
