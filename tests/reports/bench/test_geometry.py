"""`bench geometry` on tiny sizes and on times known in advance: complete rows, exact ratios, honest poses."""

from math import nan
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial import ConvexHull

from touchstone.adapters.detectors import (
    DETECTORS,
    REFERENCE,
    UNCONVERGED,
    Entry,
    Failure,
    load,
    missing_reason,
)
from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reports.bench import geometry
from touchstone.reports.bench.geometry import (
    FAMILIES,
    MOTION,
    STEP,
    TOUCH_DEPTH,
    Amount,
    hand_slide,
    hull_slide,
    queries,
    rows_of_bench,
    spread_vertices,
)
from touchstone.reports.results import COLUMNS
from touchstone.reports.studies.narrow_phase.interleaved_timing import Answered
from touchstone.reports.studies.narrow_phase.study import corners
from touchstone.reports.verdict.judge import judged

OTHER, ABSENT = "coal", "absent"
TINY = Amount(pairs=2, frames=3, turns=1, passes=1)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, Path, int]:
    """A tiny run with the reference, coal and a detector that is not installed; its folder and progress."""
    if reason := missing_reason(OTHER):
        pytest.skip(f"{OTHER}: {reason}")
    folder, reported = tmp_path_factory.mktemp("bench") / "out", []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(geometry, "SUBJECTS", (REFERENCE, OTHER, ABSENT))
        patch.setitem(DETECTORS, ABSENT, Entry("no.such:Thing", "no_such_package"))
        rows = geometry.run(folder, lambda label, count: reported.append(count), TINY)
        assert sum(reported) == geometry.steps(TINY)
    return rows, folder, sum(reported)


def test_geometry_has_all_rows(measured) -> None:
    """Hold times, error and failures per family and detector, ratios in one direction, and certificates."""
    rows = measured[0]
    assert tuple(rows.columns) == COLUMNS
    assert set(rows.study) == {"bench geometry"}
    per_family = {"time.query", "time.net", "depth.error.max", "exception"}
    certificates = {"certificate.open", "certificate.false"}
    for family in (*FAMILIES, MOTION):
        ours, theirs = (rows[(rows.engine == n) & (rows.scenario == family)] for n in (REFERENCE, OTHER))
        extra = certificates if family == MOTION else set()
        assert sorted(ours.metric) == sorted({*per_family, *extra, "ratio.time"})
        assert sorted(theirs.metric) == sorted(per_family)
        assert set(ours[ours.metric == "ratio.time"].subject) == {OTHER}
        assert ours[ours.metric == "depth.error.max"].value.item() <= geometry.FALSE
    times = rows[rows.metric.str.startswith(("time.", "ratio."))]
    known = times[times.verdict != "skipped"]
    assert ((known.low <= known.value) & (known.value <= known.high)).all()
    # two queries on a busy machine may take less than the cheapest call
    assert set(times[times.verdict == "skipped"].reason) <= {"queries cost no more than their crossing"}
    assert (rows[rows.metric == "certificate.false"].value == 0).all()


def test_geometry_shows_every_ratio(measured, shown) -> None:
    """Show a line per family and detector, none cut off, and why one is missing, once."""
    text = shown(geometry.report(measured[0]))
    assert text.count(f"missing: {ABSENT}: not installed (pip install no_such_package)") == 1
    assert "…" not in text
    for family in (*FAMILIES, MOTION):
        assert family in text
    assert sum(line.split()[:1] == [OTHER] for line in text.splitlines()) == len(FAMILIES) + 1


def known_answers(truth, seconds: float, crossing: float) -> Answered:
    """A detector that is right, takes as long as told, and pays for its crossing."""
    n = len(truth.pairs)
    cross = np.full((4, 2), crossing)
    return Answered(truth.distance.copy(), truth.normal.copy(), np.full(n, seconds), [cross], {}, {})


@pytest.fixture(scope="module")
def truth():
    """The queries of a tiny plan."""
    return queries(TINY)[0]


def test_ratios_are_net_of_the_crossing(truth) -> None:
    """Divide times without the crossing: 1 us over 3 us less 1 us of crossing is a half."""
    asked = {REFERENCE: known_answers(truth, 1e-6, 0.0), OTHER: known_answers(truth, 3e-6, 1e-6)}
    rows = {(r.scenario, r.metric, r.engine): r for r in rows_of_bench(truth, asked)}
    for family in (*FAMILIES, MOTION):
        ratio = rows[family, "ratio.time", REFERENCE]
        assert (ratio.subject, ratio.value) == (OTHER, pytest.approx(0.5, rel=1e-12))
        assert rows[family, "time.query", OTHER].value == pytest.approx(3e-6)
        assert rows[family, "time.net", OTHER].value == pytest.approx(2e-6)


@pytest.mark.parametrize(("seconds", "verdict"), [(0.5e-6, "pass"), (1e-6, "fail")])
def test_geometry_judges_where_a_figure_is_asked(truth, seconds: float, verdict: str) -> None:
    """Judge one ratio and the certificates by their limits, and nothing else."""
    asked = {REFERENCE: known_answers(truth, seconds, 0.0), OTHER: known_answers(truth, 2e-6, 0.0)}
    rows = [judged(row, ()) for row in rows_of_bench(truth, asked)]
    limits = {(r.metric, r.scenario): (r.limit, r.verdict) for r in rows if not np.isnan(r.limit)}
    assert limits == {
        ("ratio.time", "hulls overlapping"): (0.3, verdict),
        ("certificate.open", MOTION): (0.01, "pass"),
        ("certificate.false", MOTION): (0.0, "pass"),
    }


def test_crossings_that_cost_all_are_skipped(truth) -> None:
    """Skip the ratio where a query costs no more than its crossing."""
    asked = {REFERENCE: known_answers(truth, 1e-6, 0.0), OTHER: known_answers(truth, 1e-6, 1e-6)}
    ratios = [row for row in rows_of_bench(truth, asked) if row.metric == "ratio.time"]
    assert {(row.verdict, row.reason) for row in ratios} == {
        ("skipped", "queries cost no more than their crossing")
    }


def test_certificates_tell_open_from_false(truth) -> None:
    """Count what is not vouched for as open, right or wrong, and what is vouched for and wrong as false."""
    mine = known_answers(truth, 1e-6, 0.0)
    moving = np.flatnonzero(truth.family == MOTION)
    mine.failures = {int(k): Failure(UNCONVERGED, "test") for k in moving[:9]}
    mine.distance[moving[[0, 20, 21, 22]]] += 1e-6
    rows = {r.metric: r.value for r in rows_of_bench(truth, {REFERENCE: mine}) if r.scenario == MOTION}
    assert rows["certificate.open"] == pytest.approx(9 / 45)
    assert rows["certificate.false"] == 3


def test_certificates_that_did_not_hold_are_open(truth) -> None:
    """Count proved answers that the frame before did not give as open; they are not false."""
    mine = known_answers(truth, 1e-6, 0.0)
    moving = np.flatnonzero(truth.family == MOTION)
    mine.held = np.full(len(truth.pairs), nan)
    mine.held[moving] = 1.0
    mine.held[moving[:15]] = 0.0
    rows = {r.metric: r.value for r in rows_of_bench(truth, {REFERENCE: mine}) if r.scenario == MOTION}
    assert rows["certificate.open"] == pytest.approx(15 / 45)
    assert rows["certificate.false"] == 0


def test_a_detector_that_fails_at_all_is_skipped(truth) -> None:
    """Skip times and errors with the first failure's reason, and count the failures."""
    n = len(truth.pairs)
    failures = {k: Failure("threw", "boom") for k in range(n)}
    nothing = np.full(n, nan)
    broken = Answered(nothing, np.full((n, 3), nan), nothing, [np.zeros((4, 2))], failures, {})
    rows = rows_of_bench(truth, {REFERENCE: known_answers(truth, 1e-6, 0.0), OTHER: broken})
    for row in rows:
        if row.engine == OTHER and row.metric != "exception":
            assert (row.verdict, row.reason) == ("skipped", "boom")
        if row.metric == "exception":
            per_family = 45 if row.scenario == MOTION else 2
            assert row.value == (per_family if row.engine == OTHER else 0)
        if row.metric == "ratio.time":
            assert (row.verdict, row.reason) == ("skipped", "no query")


def test_families_are_what_they_say(truth) -> None:
    """Overlap, part and differ in size as the names promise."""
    distance = {name: truth.distance[truth.family == name] for name in FAMILIES}
    for name in ("hulls overlapping", "boxes overlapping", "small and large"):
        assert (distance[name] < 0).all()
    assert (distance["hulls apart"] > 0).all()
    one, two = (
        np.ptp(corners(p), axis=0).max() for p in truth.pairs[list(truth.family).index("small and large")]
    )
    assert 20 < one / two < 500


def test_the_hand_slides_near_the_table() -> None:
    """Move the fifteen parts by about a millimetre a frame, each within a centimetre of the surface; some
    parts overlap it, some do not, and none by more than its thickness."""
    motion = hand_slide(60)
    assert {len(frame_pairs) for frame_pairs in motion} == {15}
    places = np.array([[a.position for a, _ in pairs] for pairs in motion])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2)
    # rocking by 0.02 rad and bobbing by 1.5 mm a second adds and takes away
    assert steps.mean() == pytest.approx(STEP, rel=0.2)
    assert steps.max() < 2 * STEP
    distance = [signed_distance(corners(a), corners(b))[0] for pairs in motion[::15] for a, b in pairs]
    assert -0.01 < min(distance) < 0 < max(distance) < 0.01
    assert 0.2 < np.mean(np.array(distance) < 0) < 0.8


def test_hulls_have_the_vertices_asked_for() -> None:
    """Give hulls whose vertices are all corners, that touch by 5 mm at first and stay in touch."""
    for count in (50, 700):
        assert len(ConvexHull(np.array(spread_vertices(count))).vertices) == count
    motion = hull_slide(50, 3, 30, np.random.default_rng(0))
    assert (len(motion), {len(pairs) for pairs in motion}) == (30, {3})
    first, last = (
        [signed_distance(corners(a), corners(b))[0] for a, b in pairs] for pairs in (motion[0], motion[-1])
    )
    np.testing.assert_allclose(first, -TOUCH_DEPTH, rtol=1e-9)
    # 3 cm along a surface that is 16 cm round or flatter: 3 mm, from either side
    assert -2 * TOUCH_DEPTH < min(last) <= max(last) < TOUCH_DEPTH


def test_warm_is_compared_with_warm_alone(truth) -> None:
    """Compare the warm-started depth with coal from its cached guess, the exact one with cold ones."""
    names = ("reference.exact", "reference.walk", "coal", "coal.warm", "mujoco")
    rows = rows_of_bench(truth, {name: known_answers(truth, 1e-6, 0.0) for name in names})
    assert {(row.engine, row.subject) for row in rows if row.metric == "ratio.time"} == {
        *(("reference.exact", "coal"), ("reference.exact", "mujoco"), ("reference.walk", "coal.warm"))
    }


@pytest.mark.parametrize("moving", [False, True])
def test_warm_coal_answers_as_cold_coal(truth, moving: bool) -> None:
    """Give the same distances from the guess of a frame before as from none."""
    chosen = truth.family == MOTION if moving else truth.family != MOTION
    pairs = [truth.pairs[k] for k in np.flatnonzero(chosen)]
    warm = load("coal.warm").follow(pairs, 15) if moving else load("coal.warm").prepare(pairs)
    cold = load("coal").prepare(pairs)
    for batch in (warm, warm, cold):
        assert (batch.ask() > 0).all()
    np.testing.assert_allclose(warm.answers().distance, cold.answers().distance, rtol=0, atol=1e-6)
