"""`bench geometry`: time per query of convex depth, and its error.

Single pairs by family, and a hand that slides over a table, queried in every frame. Cold detectors are
compared with cold ones, and detectors that start from the previous frame's answer with each other.
`time.query` is the wall time of a call from Python; `time.net` and ratios subtract the cheapest call. The
reference is queried in a batch inside one compiled call. Errors are relative to the explicit Minkowski
difference. Hulls of a motion are also those of `bench scaling`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from rich.text import Text
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.detectors import DETECTORS, REFERENCE, UNCONVERGED, Pair, load
from touchstone.adapters.detectors import load as load_detector
from touchstone.adapters.detectors.children import Loader
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.narrow_phase.interleaved_timing import Answered, Stretch, measure
from touchstone.reports.studies.narrow_phase.study import (
    Mask,
    PairTruth,
    corners,
    depth_errors,
    elliptic,
    facts_of,
    parted_pair,
    random_box,
    with_median,
    with_ratio,
)
from touchstone.reports.studies.study import MICRO, interval_text, kept, limit_text, remarks, value_text
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.render import Part
from touchstone.scenarios.avatar.driven_poses import driven_pieces, moved
from touchstone.scenarios.avatar.hand import FINGERS, hand_parts
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, Box, Hull, Piece, Scenario, Tracker, Vector, vector

SMALL = 0.01
"""Ratio of the small hull's size to the large one's [1]: a ball beside a table."""
DEPTHS = (0.02, 0.5)
"""Range of the overlap over the depth of the pieces before they are moved apart [1]."""
GAPS = (-3.0, 0.0)
"""Range of the powers of ten of gaps between separated pieces [m]."""


def _overlap(rng: np.random.Generator) -> Callable[[float], float]:
    share = rng.uniform(*DEPTHS)
    return lambda depth: -share * depth


def _gap(rng: np.random.Generator) -> Callable[[float], float]:
    gap = float(10 ** rng.uniform(*GAPS))
    return lambda depth: gap


FAMILIES: dict[str, Callable[[np.random.Generator], Pair]] = {
    "hulls overlapping": lambda rng: parted_pair(rng, elliptic(rng), elliptic(rng), _overlap(rng)),
    "hulls apart": lambda rng: parted_pair(rng, elliptic(rng), elliptic(rng), _gap(rng)),
    "boxes overlapping": lambda rng: parted_pair(rng, random_box(rng), random_box(rng), _overlap(rng)),
    "small and large": lambda rng: parted_pair(rng, elliptic(rng), elliptic(rng, SMALL), _overlap(rng)),
}
"""Elliptic hulls of 80 triangles, or boxes, that overlap by DEPTHS or are GAPS apart; one of them SMALL."""

STEP = 1e-3
"""The hand's displacement per frame [m]: 6 cm/s."""
SINK = 5e-3
"""Depth of the lowest point in the table when the hand neither rocks nor bobs [m]."""
ROCK, BOB, PERIOD = 0.02, 1.5e-3, 60
"""Amplitudes of pitch and roll [rad] and of height [m], and frames per cycle: a real hand does not slide
rigidly level."""
THUMB, FINGER = (-0.25, 0.2, 0.1), (0.01, 0.01, 0.01)
"""Angles of the hinges [rad]: the hand lies flat, each part within a few millimetres of the surface, like all
pairs that a broad phase reports."""
TABLE = Piece("table", Box((0.6, 0.4, 0.02)), (0.0, 0.0, -0.02))
"""The table, with its surface at z = 0."""
START = -0.1
"""Initial x of the palm [m]."""


def hand_slide(frames: int) -> list[list[Pair]]:
    """Pairs of the fifteen parts of the hand with the table over which it slides, frame by frame."""
    parts = _resting_hand()
    motion = []
    for k in range(frames):
        phase = 2 * np.pi * k / PERIOD
        rock = Rotation.from_euler("xy", (ROCK * np.sin(phase), ROCK * np.cos(1.7 * phase)))
        shift = np.array([START + STEP * k, 0.0, BOB * np.sin(1.3 * phase)])
        motion.append([(moved(part, rock, shift), TABLE) for part in parts])
    return motion


def _resting_hand() -> list[Piece]:
    """The parts about the palm's x and y, at the height at which the lowest sinks by SINK."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    origin, upright = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    angles = tuple(a for finger in FINGERS for a in (THUMB if finger == "thumb" else FINGER))
    tracker = Tracker("palm", names, (0.0, 1.0), (origin,) * 2, (upright,) * 2, (angles,) * 2)
    table = Body("table", "fixed", "wood", (TABLE,))
    hand = Scenario("hand_slide", "", (), (table, *links), 1.0, TABLE_1, joints=joints, trackers=(tracker,))
    parts = driven_pieces(hand)
    height = -SINK - min(float(corners(part)[:, 2].min()) for part in parts)
    return [moved(part, Rotation.identity(), np.array([0.0, 0.0, height])) for part in parts]


HALF_AXES: Vector = (0.6, 0.5, 0.4)
"""Half axes of the hulls of many vertices [m]."""
NEAR = 0.75
"""Distance of their centres before they are moved into touch [m]: they overlap in any orientation."""
TOUCH_DEPTH, TURN = 5e-3, 5e-4
"""Overlap in the first frame [m], and rotation of one hull per frame [rad] while it slides by STEP."""


def hull_slide(vertices: int, pairs: int, frames: int, rng: np.random.Generator) -> list[list[Pair]]:
    """Pairs of touching hulls of `vertices` vertices, one sliding past the other and turning a little."""
    hull = Piece("hull", Hull(spread_vertices(vertices)))
    turns = Rotation.from_quat(rng.normal(size=(pairs, 2, 4)).reshape(-1, 4))
    sides, axes = (_directions(rng, pairs) for _ in range(2))
    near = [
        (moved(hull, turns[2 * k], np.zeros(3)), moved(hull, turns[2 * k + 1], NEAR * sides[k]))
        for k in range(pairs)
    ]
    # Along the deepest face's normal the depth changes as far as B moves.
    batch = load(REFERENCE).prepare(near)
    batch.ask()
    distance, normal = batch.answers().distance, batch.answers().normal
    start = NEAR * sides - (TOUCH_DEPTH + distance)[:, None] * normal
    ways = np.cross(normal, _directions(rng, pairs))
    ways *= STEP / np.linalg.norm(ways, axis=1, keepdims=True)
    return [
        [
            (near[k][0], moved(hull, Rotation.from_rotvec(f * TURN * axes[k]) * turns[2 * k + 1], place))
            for k, place in enumerate(start + f * ways)
        ]
        for f in range(frames)
    ]


def _directions(rng: np.random.Generator, count: int) -> Array:
    ways = rng.normal(size=(count, 3))
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def spread_vertices(count: int) -> tuple[Vector, ...]:
    """Points spread evenly over an ellipsoid by the golden angle, all vertices of their convex hull."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    points = np.column_stack([across * np.cos(turn), across * np.sin(turn), z]) * HALF_AXES
    return tuple(map(vector, points))


HEADS = ("family", "detector", "query", "net", "error", "over it", "95 % interval", "limit")
NOTES = (
    "query: median from Python [µs], shapes and poses prepared; net: less the cheapest call, of two spheres",
    "error: the largest of the depth over max(depth, size / 1000), against the explicit Minkowski difference",
    "over it: net time of the reference over the detector's, query by query",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """One row per family and detector for each of the reference's, and the reference's certificates."""
    rows = {(row.scenario, row.engine, row.metric, row.subject): row for row in rows_of(frame)}
    timed = frame[frame.metric == "time.net"]
    every = dict.fromkeys(timed.engine)
    ratios = frame[frame.metric == "ratio.time"]
    parts, certificates = [], []
    for name in dict.fromkeys(ratios.engine):
        lines: list[list[str | Text]] = []
        for family in dict.fromkeys(timed.scenario):
            lines.append([])
            detectors = [e for e in every if e == name or (family, name, "ratio.time", e) in rows]
            for k, detector in enumerate(detectors):
                ratio = rows.get((family, name, "ratio.time", detector))
                cells = (*_times(rows, family, detector), value_text(ratio), interval_text(ratio))
                lines.append(["" if k else family, detector, *cells, limit_text(ratio)])
        parts.append(Part(f"bench geometry: {name} over other detectors", HEADS, lines, words=2))
    for family, name in dict.fromkeys((row[0], row[1]) for row in rows if row[2] == "certificate.open"):
        unsure, wrong = (rows[family, name, f"certificate.{kind}", ""] for kind in ("open", "false"))
        share = f"{100 * unsure.value:.3g} % ({unsure.verdict})"
        source = " from the frame before" if name != REFERENCE else ""
        line = f"{family}: {name}: {share} of the answers not proved{source}; "
        certificates.append(line + f"{wrong.value:.0f} ({wrong.verdict}) proved and wrong")
    return [*parts, Part(lines=certificates), remarks(frame, NOTES)]


def _times(rows: dict[tuple[str, str, str, str], Row], family: str, detector: str) -> list[str]:
    shown = (("time.query", MICRO), ("time.net", MICRO), ("depth.error.max", 1.0))
    return [value_text(rows.get((family, detector, metric, "")), factor) for metric, factor in shown]


STUDY = "bench geometry"
WARM = ("reference.walk", "coal.warm")
COLD = ("reference.exact", "coal", "coal.tight", "python-fcl.distance", "mujoco")
SUBJECTS = (*COLD, *WARM)
"""Timed detectors; those of the reference are compared with the others, cold with cold and warm with warm."""
MOTION = "hand sliding"
"""The family whose pairs form the frames of a motion."""
FALSE = 1e-11
"""Error over max(depth, size / 1000) from which an answer is wrong [1]: a hundred roundings."""


@dataclass(frozen=True, slots=True)
class Amount:
    """Size of the benchmark: pairs per family, frames of the motion, turns of all detectors, passes per
    turn."""

    pairs: int = 100
    frames: int = 90
    turns: int = 4
    passes: int = 4


AMOUNT = Amount()


def steps(amount: Amount = AMOUNT) -> int:
    """Number of queries of all detectors."""
    return len(SUBJECTS) * (len(FAMILIES) * amount.pairs + amount.frames * len(hand_slide(1)[0]))


def run(
    out: Path, progress: Progress, amount: Amount = AMOUNT, loader: Loader = load_detector
) -> pd.DataFrame:
    """Measure all detectors; store rows and manifest."""
    with output_folder(out) as folder:
        (folder / "output").mkdir()
        progress("draw pairs", 0)
        truth, stretches = queries(amount)
        how = amount.turns, amount.passes, folder / "output", progress, loader
        measured = measure(SUBJECTS, truth.pairs, stretches, *how)
        rows = [judged(row, ()) for row in rows_of_bench(truth, measured)]
        return kept(rows, folder, {"study": STUDY, **asdict(amount), "detectors": facts_of(measured)})


def queries(amount: Amount) -> tuple[PairTruth, list[Stretch]]:
    """All queries with their truths, one stretch per family: an application asks one kind of query at a
    time."""
    rng = np.random.default_rng(0)
    pairs: list[Pair] = []
    stretches = []
    for draw in FAMILIES.values():
        stretches.append(Stretch(len(pairs), len(pairs) + amount.pairs))
        pairs += [draw(rng) for _ in range(amount.pairs)]
    motion = hand_slide(amount.frames)
    stretches.append(Stretch(len(pairs), len(pairs) + amount.frames * len(motion[0]), len(motion[0])))
    pairs += [pair for frame in motion for pair in frame]
    family = [name for name, s in zip((*FAMILIES, MOTION), stretches) for _ in range(s.first, s.end)]
    return PairTruth.of(pairs, family), stretches


def rows_of_bench(truth: PairTruth, measured: Mapping[str, Answered]) -> list[Row]:
    """Rows of every detector and family; for the sliding hand also the detectors' certificates."""
    rows = []
    asked = {}
    for name, mine in measured.items():
        base = Row(STUDY, "all", name, DETECTORS[name].profile, float("nan"), "run")
        if mine.ended is not None:
            rows.append(replace(base, verdict=mine.ended[0], reason=mine.ended[1]))
            continue
        asked[name] = mine
        for family in (*FAMILIES, MOTION):
            chosen = truth.family == family
            rows += _rows(replace(base, scenario=family), truth, mine, chosen)
            if family == MOTION and _ours(name):
                rows += _certificates(replace(base, scenario=family), truth, mine, chosen)
    return rows + _ratios(truth, asked)


def _ours(name: str) -> bool:
    return name.startswith("reference.")


def _rows(base: Row, truth: PairTruth, mine: Answered, chosen: Mask) -> list[Row]:
    """Times and the largest error of one detector on one family."""
    rows = []
    failures = [mine.failures[k] for k in np.flatnonzero(chosen).tolist() if k in mine.failures]
    failed = [failure.reason for failure in failures if failure.kind != UNCONVERGED]
    reason = failed[0] if failed else "no query"
    for metric, sample in (("time.query", mine.seconds), ("time.net", mine.net(truth.distance))):
        rows.append(with_median(replace(base, metric=metric), sample[chosen], reason))
    errors = depth_errors(truth, mine)[chosen]
    error = replace(base, metric="depth.error.max", unit="1")
    if np.isfinite(errors).any():
        rows.append(replace(error, value=float(np.nanmax(errors))))
    else:
        rows.append(replace(error, verdict="skipped", reason=reason))
    exception = replace(base, metric="exception", unit="pairs", value=float(len(failed)))
    return [*rows, replace(exception, reason=reason if failed else "")]


def _certificates(base: Row, truth: PairTruth, mine: Answered, chosen: Mask) -> list[Row]:
    """Share of answers without a certificate, or without one from the previous frame, and the number of wrong
    answers among certified ones."""
    proved = chosen.copy()
    proved[[k for k, failure in mine.failures.items() if failure.kind == UNCONVERGED]] = False
    wrong = proved & (depth_errors(truth, mine) > FALSE)
    held = proved & (mine.held != 0) if len(mine.held) else proved
    return [
        replace(base, metric="certificate.open", unit="1", value=1 - float(held.sum() / chosen.sum())),
        replace(base, metric="certificate.false", unit="queries", value=float(wrong.sum())),
    ]


def _ratios(truth: PairTruth, asked: Mapping[str, Answered]) -> list[Row]:
    """Ratios of the time of each of the reference's detectors to each other detector's, query by query."""
    rows = []
    for name in filter(_ours, asked):
        for other in asked:
            if _ours(other) or (name in WARM) != (other in WARM):
                continue
            ours, theirs = asked[name].net(truth.distance), asked[other].net(truth.distance)
            for family in (*FAMILIES, MOTION):
                chosen = truth.family == family
                row = Row(STUDY, family, name, DETECTORS[name].profile, float("nan"), "ratio.time")
                rows.append(with_ratio(replace(row, subject=other), ours[chosen], theirs[chosen]))
    return rows
