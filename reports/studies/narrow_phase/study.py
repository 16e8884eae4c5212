"""The study `narrow-phase`: errors and times of all detectors on the same poses.

The truth is the explicit Minkowski difference. Depth errors are relative to max(depth, a thousandth of the
pair's size); a missed contact counts as distance 0. Times are of single queries, interleaved over all
detectors, after warm-up, without the transfer of shapes and poses. `time.query` is the wall time of a call
from Python; `time.net` and ratios subtract the cheapest call, that of two spheres.

Poses are random and adversarial, by family; sizes are about 1 m. Moving B along the normal of the deepest
face changes the depth by the same amount, so one evaluation of the difference gives any requested depth or
gap.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Unsupported
from touchstone.adapters.detectors import DETECTORS, FAILURES, REFERENCE, THREW, UNCONVERGED, Failure, Pair
from touchstone.adapters.oracles.minkowski import axes_of, core, piece_distance, reach, signed_distance
from touchstone.reports.bootstrap import median_interval, time_ratio
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.narrow_phase.interleaved_timing import Answered, Stretch, measure
from touchstone.reports.studies.study import MICRO, RefusedError, failure_lines, kept, with_interval
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.pictures import DASHES, PALE, detector_looks, ends, log_axis, save
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.scenarios.extents import extents
from touchstone.scenarios.files.pair_file import GivenPair
from touchstone.scenarios.scenario import Box, HalfSpace, Hull, Piece, Shape, vector
from touchstone.scenarios.solids import elliptic_hull

ELLIPTIC, FINE_HULLS, RANDOM = 12, 4, 16
"""Numbers of hulls to draw from: of 80 triangles, of 320 triangles, and of 6 to 40 random points. They are
few because an engine loads a mesh in the time of a thousand queries or more."""
TOUCH = 1e-6
"""Depth or gap of a shallow touch, over the size [1]."""
NEEDLE = 0.01
"""Thickness of a needle over its length [1]."""
RATIO_POWERS = (3.0, 6.0)
"""Range of the powers of ten of the size of the large piece over the small one's [1]."""


def corners(piece: Piece) -> Array:
    """World vertices (n, 3) of a box or a hull [m]."""
    return core(piece)[0]


def size_of(pair: Pair) -> float:
    """Longest side of the two pieces' bounding boxes in the world [m]."""
    return max(float(np.ptp(corners(piece), axis=0).max()) for piece in pair)


class Shapes:
    """Shapes to draw from, created once."""

    def __init__(self, rng: np.random.Generator) -> None:
        fine = _subdivided(np.array(elliptic_hull((1.0, 1.0, 1.0))))
        self._hulls = [elliptic_hull(_axes(rng)) for _ in range(ELLIPTIC)]
        self._hulls += [_vertices(fine * _axes(rng)) for _ in range(FINE_HULLS)]
        for _ in range(RANDOM):
            points = rng.normal(size=(rng.integers(6, 41), 3)) * 0.5
            self._hulls.append(_vertices(points[ConvexHull(points).vertices]))

    def draw(self, rng: np.random.Generator) -> Shape:
        """A box with probability 1/3, else one of the hulls."""
        if rng.random() < 1 / 3:
            return Box(_axes(rng))
        return Hull(self._hulls[rng.integers(len(self._hulls))])


def _axes(rng: np.random.Generator) -> tuple[float, float, float]:
    return vector(np.exp(rng.normal(size=3) * 0.4) * 0.5)


def _vertices(points: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple(map(vector, points))


def _subdivided(points: Array) -> Array:
    """The vertices of a convex polyhedron on the unit sphere, and its edge midpoints projected onto it."""
    simplices = ConvexHull(points).simplices
    edges = {tuple(sorted((int(s[i]), int(s[j])))) for s in simplices for i, j in ((0, 1), (1, 2), (2, 0))}
    finer = np.vstack([points, [points[i] + points[j] for i, j in sorted(edges)]])
    return np.asarray(finer / np.linalg.norm(finer, axis=1, keepdims=True))


def _posed(shape: Shape, position: Sequence[float] | Array, turn: Rotation) -> Piece:
    qw, qx, qy, qz = turn.as_quat(scalar_first=True).tolist()
    return Piece("piece", shape, vector(position), (qw, qx, qy, qz))


def _turn(rng: np.random.Generator) -> Rotation:
    return Rotation.from_quat(rng.normal(size=4))


def _parted(pair: Pair, gap: Callable[[float], float]) -> Pair:
    """The pair with B moved along the deepest face's normal, so that an overlapping pair of depth d gets
    distance gap(d) [m]."""
    a, b = pair
    distance, normal = signed_distance(corners(a), corners(b))
    place = np.array(b.position) + (gap(-distance) - distance) * normal
    return (a, replace(b, position=vector(place))) if distance < 0 else pair


def _overlapping(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Overlapping pieces whose centres are near each other."""
    a = _posed(shapes.draw(rng), rng.normal(size=3), _turn(rng))
    b = _posed(shapes.draw(rng), np.array(a.position) + 0.05 * rng.normal(size=3), _turn(rng))
    return a, b


def parted_pair(rng: np.random.Generator, one: Shape, two: Shape, gap: Callable[[float], float]) -> Pair:
    """Two shapes with random orientations and overlapping centres, separated along the deepest face's normal
    so that depth d becomes distance gap(d) [m]."""
    a, b = (_posed(shape, rng.normal(size=3), _turn(rng)) for shape in (one, two))
    return _parted((a, replace(b, position=a.position)), gap)


def elliptic(rng: np.random.Generator, scale: float = 1.0) -> Hull:
    """An elliptic hull of 80 triangles, about 1 m in size times `scale`."""
    return Hull(elliptic_hull(vector(scale * np.array(_axes(rng)))))


def random_box(rng: np.random.Generator) -> Box:
    """A box about 1 m in size."""
    return Box(_axes(rng))


def overlap(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Pieces that overlap by 2 to 50 % of their depth with nearby centres."""
    share = rng.uniform(0.02, 0.5)
    return _parted(_overlapping(rng, shapes), lambda depth: -share * depth)


def apart(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Pieces 1 mm to 1 m apart."""
    gap = 10 ** rng.uniform(-3, 0)
    return _parted(_overlapping(rng, shapes), lambda depth: gap)


def touch(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Touching pieces: a millionth of the size deep, or apart."""
    pair = _overlapping(rng, shapes)
    gap = rng.choice((-TOUCH, TOUCH)) * size_of(pair)
    return _parted(pair, lambda depth: gap)


def face_face(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Boxes with common axes, in half of all cases also with flush sides, 0.1 mm to 0.1 m deep."""
    half_a, half_b = np.array(_axes(rng)), np.array(_axes(rng))
    if rng.random() < 0.5:
        half_b[:2] = half_a[:2]
    depth = 10 ** rng.uniform(-4, -1)
    slide = rng.uniform(-0.3, 0.3, size=2) * (half_a + half_b)[:2] * (rng.random() < 0.5)
    return _boxes(rng, half_a, half_b, np.append(slide, half_a[2] + half_b[2] - depth))


def edge_edge(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Square bars with parallel edges in contact, 0.1 mm to 0.1 m deep or apart; two faces are equally
    deep."""
    half_a, half_b = np.array(_axes(rng)), np.array(_axes(rng))
    half_a[1], half_b[1] = half_a[0], half_b[0]
    depth = rng.choice((-1.0, 1.0)) * 10 ** rng.uniform(-4, -1)
    reach = half_a[0] + half_b[0] - depth
    return _boxes(rng, half_a, half_b, np.array([reach, reach, 0.3 * rng.normal()]))


def _boxes(rng: np.random.Generator, half_a: Array, half_b: Array, shift: Array) -> Pair:
    """Boxes with common axes, rotated together with probability 3/4."""
    turn = _turn(rng) if rng.random() < 0.75 else Rotation.identity()
    one, two = Box(vector(half_a)), Box(vector(half_b))
    return _posed(one, (0.0, 0.0, 0.0), turn), _posed(two, turn.apply(shift), turn)


def needle(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """A bar or a hull a hundred times as long as thick, overlapping another or any piece."""
    axes = (1.0, NEEDLE, NEEDLE)
    needles: tuple[Shape, Shape] = (Box(axes), Hull(elliptic_hull(axes)))
    one = needles[rng.integers(2)]
    two = needles[rng.integers(2)] if rng.random() < 0.5 else shapes.draw(rng)
    position = 0.01 * rng.normal(size=3) + rng.uniform(-0.5, 0.5) * np.eye(3)[0]
    share = rng.uniform(0.02, 0.9)
    pair = _posed(one, (0.0, 0.0, 0.0), Rotation.identity()), _posed(two, position, _turn(rng))
    return _parted(pair, lambda depth: -share * depth)


def size_ratio(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """A box a thousandth to a millionth of the other's size, at a face, an edge or a vertex of it."""
    large = _posed(shapes.draw(rng), (0.0, 0.0, 0.0), _turn(rng))
    half = np.array(_axes(rng)) * 10 ** -rng.uniform(*RATIO_POWERS)
    points = corners(large)
    simplices = ConvexHull(points).simplices
    weights = rng.random(3) * (rng.permutation(3) < rng.integers(1, 4))
    place = weights / weights.sum() @ points[simplices[rng.integers(len(simplices))]]
    return large, _posed(Box(vector(half)), place + rng.uniform(-0.7, 0.7, size=3) * half, _turn(rng))


def coincident(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """A piece and its copy in the same place."""
    piece = _posed(shapes.draw(rng), rng.normal(size=3), _turn(rng))
    return piece, piece


FAMILIES: dict[str, Callable[[np.random.Generator, Shapes], Pair]] = {
    "overlap": overlap,
    "apart": apart,
    "deep": _overlapping,
    "touch": touch,
    "face-face": face_face,
    "edge-edge": edge_edge,
    "needle": needle,
    "size-ratio": size_ratio,
    "coincident": coincident,
}


def draw(count: int, rng: np.random.Generator) -> list[tuple[str, Pair]]:
    """`count` pairs with the names of their families; families alternate, so that any stretch contains all of
    them."""
    shapes = Shapes(rng)
    names = list(FAMILIES)
    return [(name, FAMILIES[name](rng, shapes)) for name in (names[k % len(names)] for k in range(count))]


STUDY = "narrow-phase"
ALL = "all"
"""Scenario name of the aggregate over all families."""
DEPTH_FLOOR = 1e-3
"""Depth over size below which errors are relative to the size [1], to avoid division of rounding by almost
zero."""
SIGN_FLOOR = 1e-9
"""Distance over size below which either sign is accepted [1]: three decades below the shallowest touch."""
EQUALLY_DEEP = 1e-6
"""Excess over the depth of the translation along a normal, over the size, below which the face counts as
equally deep [1]."""

STATISTICS: dict[str, Callable[[Array], Any]] = {
    "median": np.median,
    "p95": lambda sample: np.percentile(sample, 95),
    "max": np.max,
}

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class PairTruth:
    """Pairs with families, sizes [m] and signed distances [m] (n,), and normals from A to B (n, 3)."""

    pairs: Sequence[Pair]
    family: Array
    size: Array
    distance: Array
    normal: Array

    @classmethod
    def of(cls, pairs: Sequence[Pair], families: Sequence[str]) -> PairTruth:
        """The truth of pairs of boxes and hulls by the explicit Minkowski difference of each."""
        distance, normal = zip(*(signed_distance(corners(a), corners(b)) for a, b in pairs))
        sizes = np.array([size_of(pair) for pair in pairs])
        return cls(pairs, np.array(families), sizes, np.array(distance), np.array(normal))


def rows_of_study(truth: PairTruth, measured: Mapping[str, Answered]) -> list[Row]:
    rows: list[Row] = []
    errors: dict[str, Array] = {}
    for name, mine in measured.items():
        base = Row(STUDY, ALL, name, DETECTORS[name].profile, float("nan"), "run")
        if mine.ended is not None:
            rows.append(replace(base, verdict=mine.ended[0], reason=mine.ended[1]))
            continue
        errors[name] = depth_errors(truth, mine)
        angles = normal_errors(truth, mine)
        for family in (ALL, *FAMILIES):
            chosen = np.full(len(truth.family), True) if family == ALL else truth.family == family
            rows += _family(replace(base, scenario=family), chosen, truth, mine, errors[name], angles)
        remark = "" if np.any(mine.crossing) else "one crossing for a whole batch"
        cross = replace(base, metric="time.crossing", unit="s", reason=remark)
        for subject, sample in zip(("apart", "touching"), np.concatenate(mine.crossing).T):
            rows.append(with_interval(cross, median_interval(sample), subject=subject))
    return rows + _ratios(truth, measured, errors)


def _family(
    base: Row, chosen: Mask, truth: PairTruth, mine: Answered, errors: Array, angles: Array
) -> list[Row]:
    """All rows of one detector on one family, except ratios."""
    rows = []
    error = errors[chosen][np.isfinite(errors[chosen])]
    angle = angles[chosen][np.isfinite(angles[chosen])]
    failures = [mine.failures[int(k)] for k in np.flatnonzero(chosen) if int(k) in mine.failures]
    reason = next((f.reason for f in failures if f.kind != UNCONVERGED), "reports no contact, rightly")
    values = [(f"depth.error.{kind}", "", "1", error, kind) for kind in STATISTICS]
    values += [("normal.error", kind, "rad", angle, kind) for kind in ("median", "max")]
    for metric, subject, unit, sample, kind in values:
        row = replace(base, metric=metric, subject=subject, unit=unit)
        if len(sample):
            rows.append(replace(row, value=float(STATISTICS[kind](sample))))
        else:
            rows.append(replace(row, verdict="skipped", reason=reason))
    reported = np.isfinite(mine.distance)
    clear = np.abs(truth.distance) > SIGN_FLOOR * truth.size
    wrong = chosen & clear & reported & (mine.distance * truth.distance < 0)
    unseen = chosen & clear & (truth.distance < 0) & ~reported & ~_failed(mine)
    rows.append(replace(base, metric="sign.wrong", unit="pairs", value=float(wrong.sum())))
    rows.append(replace(base, metric="contact.missed", unit="pairs", value=float(unseen.sum())))
    for kind in FAILURES:
        reasons = [failure.reason for failure in failures if failure.kind == kind]
        row = replace(base, metric="exception", subject=kind, unit="pairs", value=float(len(reasons)))
        rows.append(replace(row, reason=reasons[0] if reasons else ""))
    for metric, sample in (("time.query", mine.seconds), ("time.net", mine.net(truth.distance))):
        rows.append(with_median(replace(base, metric=metric), sample[chosen], reason))
    return rows


def _failed(mine: Answered) -> Mask:
    failed = np.zeros(len(mine.distance), dtype=bool)
    failed[[k for k, failure in mine.failures.items() if failure.kind != UNCONVERGED]] = True
    return failed


def depth_errors(truth: PairTruth, mine: Answered) -> Array:
    """|distance - truth| / max(depth, DEPTH_FLOOR size) per pair; NaN where the detector failed, or correctly
    reports no contact."""
    unseen = np.isnan(mine.distance) & (truth.distance < 0) & ~_failed(mine)
    distance = np.where(unseen, 0.0, mine.distance)
    return np.abs(distance - truth.distance) / np.maximum(-truth.distance, DEPTH_FLOOR * truth.size)


def normal_errors(truth: PairTruth, mine: Answered) -> Array:
    """Angles between normals and truth [rad]; NaN where none is reported.

    Where the translation along the normal exceeds the depth by less than EQUALLY_DEEP of the size, the
    detector found an equally deep face. The error is then that excess over the size, if it is smaller.
    """
    errors = np.full(len(truth.pairs), np.nan)
    for k in np.flatnonzero(np.isfinite(mine.normal).all(axis=1)).tolist():
        n, true, (a, b) = mine.normal[k], truth.normal[k], truth.pairs[k]
        errors[k] = 2 * np.arctan2(np.linalg.norm(n - true), np.linalg.norm(n + true))
        longer = reach(a, n) + reach(b, -n) + truth.distance[k]
        if longer < EQUALLY_DEEP * truth.size[k]:
            errors[k] = min(errors[k], max(0.0, longer / truth.size[k]))
    return errors


def _ratios(truth: PairTruth, measured: Mapping[str, Answered], errors: Mapping[str, Array]) -> list[Row]:
    """The reference's time per query over each other detector's, net of its crossing, on common pairs."""
    if REFERENCE not in errors:
        return []
    rows = []
    ours, profile = measured[REFERENCE].net(truth.distance), DETECTORS[REFERENCE].profile
    for name in (one for one in errors if one != REFERENCE):
        net = measured[name].net(truth.distance)
        for family in (ALL, *FAMILIES):
            chosen = (truth.family == family) | (family == ALL)
            row = Row(STUDY, family, REFERENCE, profile, nan, "ratio.time", subject=name)
            rows.append(with_ratio(row, ours[chosen], net[chosen]))
    return rows


def with_ratio(row: Row, ours: Array, theirs: Array) -> Row:
    """The row with the ratio of two detectors' times on the queries that both answered; skipped if there are
    none, or if they cost no more than their crossing."""
    both = np.isfinite(ours) & np.isfinite(theirs)
    row = replace(row, unit="1")
    if not both.any() or np.median(theirs[both]) <= 0:
        reason = "no query" if not both.any() else "queries cost no more than their crossing"
        return replace(row, verdict="skipped", reason=reason)
    return with_interval(row, time_ratio(ours[both], theirs[both]))


def with_median(row: Row, seconds: Array, reason: str) -> Row:
    """The row with the median of the finite times; skipped for `reason` if there is none."""
    seconds, row = seconds[np.isfinite(seconds)], replace(row, unit="s")
    if not len(seconds):
        return replace(row, verdict="skipped", reason=reason)
    return with_interval(row, median_interval(seconds))


SLICE = 5 * len(FAMILIES)
"""Pairs per turn: every family five times, so that variations of the machine's speed affect all detectors
equally."""
TURNS, PASSES = 2, 3


def run(pairs: int, seed: int, out: Path, progress: Progress) -> pd.DataFrame:
    """Measure all detectors; store rows, picture and manifest. The folder appears complete or not at all."""
    if pairs < len(FAMILIES):
        raise RefusedError(f"--pairs {pairs}: expected at least {len(FAMILIES)}, one per family of poses")
    with output_folder(out) as folder:
        progress("draw pairs", 0)
        truth = truth_of(pairs, seed)
        slices = [Stretch(first, min(first + SLICE, pairs)) for first in range(0, pairs, SLICE)]
        measured = ask_all(truth, slices, folder, progress)
        progress("judge", 0)
        rows = [judged(replace(row, seed=seed), ()) for row in rows_of_study(truth, measured)]
        facts = {"study": STUDY, "pairs": pairs, "seed": seed, "detectors": facts_of(measured)}
        return kept(rows, folder, facts, {"narrow_phase.png": work_precision})


def ask_all(
    truth: PairTruth, slices: Sequence[Stretch], folder: Path, progress: Progress
) -> dict[str, Answered]:
    """Answers of all detectors, whose output goes to `folder`."""
    (folder / "output").mkdir()
    return measure(DETECTORS, truth.pairs, slices, TURNS, PASSES, folder / "output", progress)


def facts_of(measured: Mapping[str, Answered]) -> dict[str, dict[str, object]]:
    """Version and settings of each detector."""
    return {name: dict(mine.facts) for name, mine in measured.items()}


def truth_of(count: int, seed: int) -> PairTruth:
    """Random pairs of a seed, with the truth by the explicit Minkowski difference of each."""
    drawn = draw(count, np.random.default_rng(seed))
    return PairTruth.of([pair for _, pair in drawn], [family for family, _ in drawn])


ROUNDING, FINE = 1e-12, 1e-4
"""Depth errors that separate detectors [1]: a few thousand roundings over size / 1000, and an error too small
to matter in a simulation."""
HEADS = (
    *("detector", "median", "depth error\np95", "max", "normal\nmax [rad]", "wrong\nsign", "missed"),
    "failed",
    *("query\n[µs]", "net\n[µs]", "reference over it\n(95 % interval)"),
)
NOTES = (
    "depth error: over max(depth, size / 1000); a missed contact counts as depth 0",
    "failed: unsupported, threw, or says itself that it did not converge (then the answer counts)",
    "query: from Python, shapes and poses prepared; net: less the cheapest call, of two spheres",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """One row per detector over all families, the best of each family, and every remark."""
    if (frame.engine == TRUTH).any():
        return report_given(frame)
    whole = frame[frame.scenario == "all"]
    title = "narrow-phase: all families against the explicit Minkowski difference"
    rows = [[name, *_cells(whole, name)] for name in dict.fromkeys(whole.engine)]
    return [Part(title, HEADS, rows, NOTES, tight=True), _families(frame), Part(lines=remarks(frame))]


def _cells(whole: pd.DataFrame, name: str) -> list[str]:
    mine = {(row.metric, row.subject): row for row in rows_of(whole[whole.engine == name])}
    if ("run", "") in mine:
        return [mine["run", ""].verdict]
    ratios = rows_of(whole[(whole.metric == "ratio.time") & (whole.subject == name) & whole.value.notna()])
    failed = sum(row.value for (metric, _), row in mine.items() if metric == "exception")
    return [
        *(exact_number(mine["depth.error." + kind, ""].value) for kind in ("median", "p95", "max")),
        exact_number(mine["normal.error", "max"].value),
        *(f"{mine[metric, ''].value:.0f}" for metric in ("sign.wrong", "contact.missed")),
        f"{failed:.0f}",
        *(exact_number(mine[metric, ""].value * MICRO) for metric in ("time.query", "time.net")),
        *([f"{row.value:.2f} ({row.low:.2f} to {row.high:.2f})" for row in ratios[:1]] or [""]),
    ]


def _families(frame: pd.DataFrame) -> Part:
    """Per family the detectors that are exact to rounding, and the fastest among those exact to FINE."""
    heads = ["family", f"p95 of the depth error below {ROUNDING:.0e}"]
    heads += [f"fastest net, p95 below {FINE:.0e} [µs]"]
    rows = []
    for family in FAMILIES:
        part = frame[(frame.scenario == family) & frame.value.notna()]
        error = {row.engine: row.value for row in rows_of(part[part.metric == "depth.error.p95"])}
        right = [name for name in error if error[name] < ROUNDING]
        times = [row for row in rows_of(part[part.metric == "time.net"]) if error.get(row.engine, 1.0) < FINE]
        best = min(times, key=lambda row: row.value, default=None)
        fastest = "-" if best is None else f"{best.engine} {exact_number(best.value * MICRO)}"
        rows.append([family, ", ".join(right) or "-", fastest])
    return Part("", heads, rows, last=2, tight=True)


def remarks(frame: pd.DataFrame) -> list[str]:
    """Broken limits, runs that are skipped as a whole and failures, with reasons."""
    failed = frame[(frame.metric == "exception") & (frame.scenario == ALL) & (frame.value > 0)]
    counts = [f"{row.subject}: {row.engine}, {row.value:.0f} pairs: {row.reason}" for row in rows_of(failed)]
    return failure_lines(frame) + counts


ERROR_FLOOR = 1e-16
"""Smaller errors are drawn at this value: half a rounding of double precision [1]."""
LEVELS = (
    (2.2e-16, "rounding, double precision"),
    (6.0e-8, "rounding, single precision"),
    (1.0, "no contact seen"),
)
"""Errors that get a reference line [1]."""
ERRORS = tuple(f"depth.error.{kind}" for kind in STATISTICS)


def work_precision(frame: pd.DataFrame, path: Path) -> None:
    """Depth error over time per query of every detector, from the rows of the study `narrow-phase`.

    A marker is the median, the thick bar reaches to the 95th percentile, the thin one to the largest error.
    """
    whole = frame[(frame.scenario == ALL) & frame.value.notna()].drop_duplicates(["engine", "metric"])
    table = whole.pivot(index="engine", columns="metric", values="value").reindex(whole.engine.unique())
    table = table.reindex(columns=["time.net", *ERRORS])
    table.columns = ["time", "median", "p95", "largest"]
    table = table[table.time > 0].clip(lower=ERROR_FLOOR).assign(time=MICRO * table.time).reset_index()
    text = "median time per query [µs], one thread, crossing from Python taken off"
    ticks = np.outer(10.0 ** np.arange(-3, 6), (1, 2, 5)).ravel().tolist()
    x = log_axis(alt.X, "time", text, ends(table.time, factor=1.5), values=ticks, grid=False)
    errors = (ERROR_FLOOR / 3, max(10.0, table.largest.max()))
    y = log_axis(alt.Y, "median", "depth error over max(depth, size / 1000)", errors)
    marks = detector_looks(table.engine)
    base = alt.Chart(table).encode(x=x, color=marks["color"])
    levels = alt.Chart(pd.DataFrame(LEVELS, columns=["level", "name"])).encode(y="level:Q")
    drawn = (
        levels.mark_rule(color=PALE, strokeDash=DASHES)
        + levels.mark_text(color=PALE, align="left", dy=-6).encode(x=alt.value(4), text="name:N")
        + base.mark_rule(strokeWidth=4, strokeOpacity=0.4).encode(y="median:Q", y2="p95:Q")
        + base.mark_rule().encode(y="median:Q", y2="largest:Q")
        + base.mark_point(filled=True, size=80, opacity=1).encode(y=y, shape=marks["shape"])
    ).properties(width=640, height=360)
    note = "marker: median; thick bar: to the 95th percentile; thin bar: to the largest"
    save(drawn, path, "Narrow phase: random and adversarial pairs of convex pieces", note)


TRUTH = "minkowski"
"""Engine of the rows that hold the truth."""
DISTANCE, ERROR, NORMAL, TIME = "distance", "depth.error", "normal.error", "time.query"
WRONG_SIGN, MISSED = "wrong sign", "missed"
"""Reasons of answers that are wrong in kind: overlap for a gap or the reverse, and no contact for overlap."""


def run_given(pairs: Sequence[GivenPair], out: Path, progress: Progress) -> pd.DataFrame:
    """Measure all detectors on the pairs; the folder appears complete or not at all."""
    truth = truth_of_given(pairs)
    with output_folder(out) as folder:
        measured = ask_all(truth, [Stretch(0, len(pairs))], folder, progress)
        for name, mine in measured.items():
            if mine.ended is not None and mine.ended[0] == "error":
                _ask_one_by_one(name, mine, truth, folder / "output")
        sources = {pair.name: pair.source for pair in pairs}
        facts = {"study": STUDY, "pairs": sources, "detectors": facts_of(measured)}
        return kept(_rows(pairs, truth, measured), folder, facts)


def _ask_one_by_one(name: str, mine: Answered, truth: PairTruth, output: Path) -> None:
    """Ask a detector that died each pair in a process of its own, so that only those have no answer of which
    it dies."""
    mine.ended = None
    for k, pair in enumerate(truth.pairs):
        one = measure([name], [pair], [Stretch(0, 1)], 1, 1, output, lambda *_: None)[name]
        mine.distance[k], mine.normal[k], mine.seconds[k] = one.distance[0], one.normal[0], one.seconds[0]
        found = Failure(THREW, one.ended[1]) if one.ended is not None else one.failures.get(0)
        if found is not None:
            mine.failures[k] = found


def truth_of_given(pairs: Sequence[GivenPair]) -> PairTruth:
    """Signed distance and normal of each pair; raises RefusedError."""
    try:
        found = [piece_distance(*pair.pieces) for pair in pairs]
    except Unsupported as error:
        raise RefusedError(str(error)) from error
    sizes = [max(_size(piece) for piece in pair.pieces) for pair in pairs]
    return PairTruth(
        [pair.pieces for pair in pairs],
        np.array([pair.name for pair in pairs]),
        np.array(sizes),
        np.array([distance for distance, _ in found]),
        np.array([normal for _, normal in found]),
    )


def _size(piece: Piece) -> float:
    """Largest side of the bounding box of a piece [m]; 0 of a half-space."""
    if isinstance(piece.shape, HalfSpace):
        return 0.0
    low, high = extents(piece.shape, axes_of(piece.orientation)[None])
    return float((high - low).max())


def _rows(pairs: Sequence[GivenPair], truth: PairTruth, measured: Mapping[str, Answered]) -> list[Row]:
    rows = [
        Row(STUDY, pair.name, TRUTH, "exact", nan, DISTANCE, float(distance), "m", reason=pair.source)
        for pair, distance in zip(pairs, truth.distance)
    ]
    for name, mine in measured.items():
        base = Row(STUDY, "all", name, DETECTORS[name].profile, nan, "run_given")
        if mine.ended is not None:
            rows.append(replace(base, verdict=mine.ended[0], reason=mine.ended[1]))
            continue
        figures = [(DISTANCE, mine.distance, "m"), (ERROR, depth_errors(truth, mine), "1")]
        figures += [(NORMAL, normal_errors(truth, mine), "rad"), (TIME, mine.seconds, "s")]
        for k, pair in enumerate(pairs):
            row = replace(base, scenario=pair.name, reason=_remark(truth, mine, k))
            rows += [replace(row, metric=name, value=float(x[k]), unit=unit) for name, x, unit in figures]
    return rows


def _remark(truth: PairTruth, mine: Answered, k: int) -> str:
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


OFF = 1e-6
"""Depth error above which a detector is named beside a pair [1]: single precision over size / 1000."""
GIVEN_HEADS = (
    *("detector", "depth error\nmedian", "max", "normal\nmax [rad]", "wrong\nsign", "missed", "failed"),
    *("unsupported", "query\n[µs]"),
)
GIVEN_NOTES = (
    "depth error: over max(depth, size / 1000); a missed contact counts as depth 0",
    f"beside a pair: detectors whose depth error exceeds {OFF:g}, the largest first, or that gave no answer",
)


def report_given(frame: pd.DataFrame) -> list[Part]:
    """One row per detector, one line per pair, and why detectors did not take part."""
    rows = rows_of(frame)
    truths = {row.scenario: row for row in rows if row.engine == TRUTH}
    mine: dict[str, list[Row]] = {}
    for row in rows:
        if row.engine != TRUTH and row.metric != "run_given":
            mine.setdefault(row.engine, []).append(row)
    title = "narrow-phase: given pairs against the explicit Minkowski difference"
    table = Part(title, GIVEN_HEADS, [[name, *_given_cells(found)] for name, found in mine.items()])
    lines = []
    for name, truth in truths.items():
        off = _off([row for row in rows if row.scenario == name and row.metric == ERROR])
        source = f" ({truth.reason})" if truth.reason else ""
        lines.append(f"{name}{source}: {truth.value:.6g} m: {off}")
    ended = [f"{row.verdict}: {row.engine}: {row.reason}" for row in rows if row.metric == "run_given"]
    return [table, Part(lines=lines), Part(notes=GIVEN_NOTES, lines=ended)]


def _given_cells(found: list[Row]) -> list[str]:
    def values(metric: str) -> pd.Series:
        return pd.Series([row.value for row in found if row.metric == metric]).dropna()

    def counted(*starts: str) -> str:
        return str(sum(row.reason.startswith(starts) for row in found if row.metric == DISTANCE))

    errors, (unsupported, *failures) = values(ERROR), FAILURES
    return [
        exact_number(errors.median()),
        exact_number(errors.max()),
        exact_number(values(NORMAL).max()),
        counted(WRONG_SIGN),
        counted(MISSED),
        counted(*failures),
        counted(unsupported),
        exact_number(1e6 * values(TIME).median()),
    ]


def _off(errors: list[Row]) -> str:
    """Detectors that are off in one pair, with their errors or what they said."""
    wrong = [row for row in errors if row.value > OFF or (row.reason and row.value != row.value)]
    wrong.sort(key=lambda row: -row.value if row.value == row.value else float("inf"))
    texts = []
    for row in wrong:
        kind = row.reason.partition(":")[0]
        figure = exact_number(row.value) if row.value == row.value else ""
        texts.append(" ".join(filter(None, (row.engine, figure, kind))))
    return ", ".join(texts) or "all agree"
