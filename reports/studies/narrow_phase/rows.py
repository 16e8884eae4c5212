"""Rows of the study `narrow-phase`: errors, wrong answers and times of detectors, per family of poses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.adapters.detectors import DETECTORS, FAILURES, REFERENCE, UNCONVERGED, Pair
from touchstone.reports.bootstrap import median_interval, time_ratio
from touchstone.reports.results import Row
from touchstone.reports.studies.interleaved_timing import Measured
from touchstone.reports.studies.poses import FAMILIES

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
class Truth:
    """Pairs with the world vertices of each [m], families, sizes [m] and signed distances [m] (n,), and
    normals from A to B (n, 3). `radii` (n,) [m]: by how much the pieces exceed the hulls of their vertices,
    both together; 0 for boxes and hulls."""

    pairs: Sequence[Pair]
    corners: Sequence[tuple[Array, Array]]
    family: Array
    size: Array
    distance: Array
    normal: Array
    radii: Array = field(default_factory=lambda: np.zeros(1))


def rows_of_study(truth: Truth, measured: Mapping[str, Measured]) -> list[Row]:
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
            middle, low, high = median_interval(sample)
            rows.append(replace(cross, subject=subject, value=middle, low=low, high=high))
    return rows + _ratios(truth, measured, errors)


def _family(base: Row, chosen: Mask, truth: Truth, mine: Measured, errors: Array, angles: Array) -> list[Row]:
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


def _failed(mine: Measured) -> Mask:
    """Mask of pairs without an answer; no contact is an answer."""
    failed = np.zeros(len(mine.distance), dtype=bool)
    failed[[k for k, failure in mine.failures.items() if failure.kind != UNCONVERGED]] = True
    return failed


def depth_errors(truth: Truth, mine: Measured) -> Array:
    """|distance - truth| / max(depth, DEPTH_FLOOR size) per pair; NaN where the detector failed, or correctly
    reports no contact."""
    unseen = np.isnan(mine.distance) & (truth.distance < 0) & ~_failed(mine)
    distance = np.where(unseen, 0.0, mine.distance)
    return np.abs(distance - truth.distance) / np.maximum(-truth.distance, DEPTH_FLOOR * truth.size)


def normal_errors(truth: Truth, mine: Measured) -> Array:
    """Angles between normals and truth [rad]; NaN where none is reported.

    Where the translation along the normal exceeds the depth by less than EQUALLY_DEEP of the size, the
    detector found an equally deep face. The error is then that excess over the size, if it is smaller.
    """
    errors, radii = np.full(len(truth.pairs), np.nan), np.broadcast_to(truth.radii, len(truth.pairs))
    for k in np.flatnonzero(np.isfinite(mine.normal).all(axis=1)).tolist():
        n, true, (a, b) = mine.normal[k], truth.normal[k], truth.corners[k]
        errors[k] = 2 * np.arctan2(np.linalg.norm(n - true), np.linalg.norm(n + true))
        longer = (a @ n).max() - (b @ n).min() + radii[k] + truth.distance[k]
        if longer < EQUALLY_DEEP * truth.size[k]:
            errors[k] = min(errors[k], max(0.0, longer / truth.size[k]))
    return errors


def _ratios(truth: Truth, measured: Mapping[str, Measured], errors: Mapping[str, Array]) -> list[Row]:
    """The reference's time per query over each other detector's, net of its crossing, on common pairs."""
    if REFERENCE not in errors:
        return []
    rows = []
    ours = measured[REFERENCE]
    for name in errors:
        if name == REFERENCE:
            continue
        net = measured[name].net(truth.distance)
        for family in (ALL, *FAMILIES):
            chosen = (truth.family == family) | (family == ALL)
            profile = DETECTORS[REFERENCE].profile
            row = Row(STUDY, family, REFERENCE, profile, float("nan"), "ratio.time", subject=name)
            rows.append(with_ratio(row, ours.net(truth.distance)[chosen], net[chosen]))
    return rows


def with_ratio(row: Row, ours: Array, theirs: Array) -> Row:
    """The row with the ratio of two detectors' times on the queries that both answered; skipped if there are
    none, or if they cost no more than their crossing."""
    both = np.isfinite(ours) & np.isfinite(theirs)
    row = replace(row, unit="1")
    if not both.any() or np.median(theirs[both]) <= 0:
        reason = "no query" if not both.any() else "queries cost no more than their crossing"
        return replace(row, verdict="skipped", reason=reason)
    ratio = time_ratio(ours[both], theirs[both])
    return replace(row, value=ratio.value, low=ratio.low, high=ratio.high)


def with_median(row: Row, seconds: Array, reason: str) -> Row:
    """The row with the median of the finite times; skipped for `reason` if there is none."""
    seconds, row = seconds[np.isfinite(seconds)], replace(row, unit="s")
    if not len(seconds):
        return replace(row, verdict="skipped", reason=reason)
    value, low, high = median_interval(seconds)
    return replace(row, value=value, low=low, high=high)
