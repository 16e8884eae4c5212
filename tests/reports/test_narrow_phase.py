"""The study narrow-phase: complete and repeatable rows, an exact reference, pairs that are what they say."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from touchstone.adapters.detectors import DETECTORS, REFERENCE, Entry, load, missing_reason
from touchstone.reports.progress import quietly
from touchstone.reports.results import COLUMNS
from touchstone.reports.studies.narrow_phase.poses import FAMILIES, TOUCH, draw
from touchstone.reports.studies.narrow_phase.study import (
    Answered,
    depth_errors,
    normal_errors,
    report,
    run,
    truth_of,
)

PAIRS = 3 * len(FAMILIES)
OTHER, ABSENT = "coal", "absent"
PER_FAMILY = [
    *(("depth.error.median", ""), ("depth.error.p95", ""), ("depth.error.max", "")),
    *(("normal.error", "median"), ("normal.error", "max"), ("sign.wrong", ""), ("contact.missed", "")),
    *(("exception", "unsupported"), ("exception", "threw"), ("exception", "unconverged")),
    *(("time.query", ""), ("time.net", "")),
]
EXACT = 1e-11
"""The reference's error over max(depth, size / 1000): the oracle's own rounding is about 1e-13 [1]."""
SMALL = 1e-7
"""The same where one piece is a millionth: rounding of its corners, times 1e6 for its edges' directions,
over size / 1000 [1]."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[pd.DataFrame, Path]:
    """A run with the reference, coal and a detector that is not installed, and its folder."""
    if reason := missing_reason(OTHER):
        pytest.skip(f"{OTHER}: {reason}")
    folder = tmp_path_factory.mktemp("narrow-phase")
    with pytest.MonkeyPatch.context() as patch:
        for name in set(DETECTORS) - {REFERENCE, OTHER}:
            patch.delitem(DETECTORS, name)
        patch.setitem(DETECTORS, ABSENT, Entry("no.such:Thing", "no_such_package"))
        return run(PAIRS, 5, folder / "one", quietly), folder / "one"


@pytest.mark.slow
def test_rows_are_complete(results) -> None:
    """Hold one row per detector, family, metric and subject, and intervals round every time."""
    frame = results[0]
    assert tuple(frame.columns) == COLUMNS
    assert set(frame.study) == {"narrow-phase"}
    assert set(frame.seed) == {5}
    for name in (REFERENCE, OTHER):
        for family in ("all", *FAMILIES):
            part = frame[(frame.engine == name) & (frame.scenario == family)]
            part = part[~part.metric.isin(["ratio.time", "time.crossing"])]
            assert sorted(zip(part.metric, part.subject)) == sorted(PER_FAMILY)
    times = frame[frame.metric.str.startswith(("time.", "ratio."))]
    assert ((times.low <= times.value) & (times.value <= times.high)).all()
    ratios = frame[frame.metric == "ratio.time"]
    assert set(zip(ratios.engine, ratios.subject, ratios.scenario)) == {
        (REFERENCE, OTHER, family) for family in ("all", *FAMILIES)
    }


def test_a_missing_engine_is_a_skipped_row(results) -> None:
    """Skip with the reason, once."""
    rows = results[0][results[0].engine == ABSENT]
    assert rows[["metric", "verdict", "reason"]].to_numpy().tolist() == [
        ["run", "missing", "not installed (pip install no_such_package)"]
    ]


def test_files_are_written(results) -> None:
    """Leave table, picture, manifest and the children's output, and no other folder."""
    frame, folder = results
    pd.testing.assert_frame_equal(pd.read_parquet(folder / "results.parquet"), frame)
    assert (folder / "narrow_phase.png").read_bytes().startswith(b"\x89PNG")
    assert {path.name for path in folder.iterdir()} == {
        *("results.parquet", "results.csv", "narrow_phase.png", "manifest.json", "output")
    }
    assert [path.name for path in folder.parent.iterdir()] == ["one"]


def test_the_terminal_shows_every_detector(results, shown) -> None:
    """Print a row per detector and the reason of a skipped one."""
    text = shown(report(results[0]))
    for name in (REFERENCE, OTHER, *FAMILIES):
        assert f"{name} " in text
    assert "missing: absent default: not installed" in text
    assert "…" not in text


@pytest.fixture(scope="module")
def truth():
    """Two hundred pairs and their truth."""
    return truth_of(200, 7)


def test_the_reference_is_exact(truth) -> None:
    """Equal the explicit Minkowski difference on every family, by depth and by way out along the normal."""
    batch = load(REFERENCE).prepare(truth.pairs)
    seconds = batch.ask()
    found = batch.answers()
    mine = Answered(found.distance, found.normal, seconds, [], dict(found.failures), {})
    errors = depth_errors(truth, mine)
    small = truth.family == "size-ratio"
    assert errors[~small].max() <= EXACT
    assert errors[small].max() <= SMALL
    # a normal across a gap of 1e-6 of the size is good to rounding over it
    assert normal_errors(truth, mine).max() <= 1e-8


def test_families_are_what_they_say(truth) -> None:
    """Overlap, part and touch as the names promise."""
    relative = {family: (truth.distance / truth.size)[truth.family == family] for family in FAMILIES}
    for family in ("overlap", "deep", "face-face", "needle", "coincident"):
        assert (relative[family] < 0).all()
    assert (relative["apart"] > 0).all()
    np.testing.assert_allclose(np.abs(relative["touch"]), TOUCH, rtol=0.7)
    for family in ("touch", "edge-edge", "size-ratio"):
        assert (relative[family] < 0).any()
    assert (relative["touch"] > 0).any()
    assert [family for family, _ in draw(9, np.random.default_rng(0))] == list(FAMILIES)


def test_missed_and_failed_count_apart(truth) -> None:
    """Count a contact that is not seen as distance 0, and a query that failed not at all."""
    n = len(truth.pairs)
    nothing = Answered(np.full(n, np.nan), np.full((n, 3), np.nan), np.zeros(n), [], {}, {})
    errors = depth_errors(truth, nothing)
    assert np.isnan(errors[truth.distance > 0]).all()
    deep = -truth.distance > 1e-3 * truth.size
    np.testing.assert_array_equal(errors[deep], 1.0)
    from touchstone.adapters.detectors import Failure

    nothing.failures = {k: Failure("threw", "test") for k in range(n)}
    assert np.isnan(depth_errors(truth, nothing)).all()


def test_an_equally_deep_face_is_no_error(truth) -> None:
    """Accept the other of two faces that are equally deep."""
    k = int(np.flatnonzero(truth.family == "coincident")[0])
    n = len(truth.pairs)
    normal = np.full((n, 3), np.nan)
    normal[k] = -truth.normal[k]
    mine = Answered(truth.distance.copy(), normal, np.zeros(n), [], {}, {})
    # a piece in its twin is as wide to one side as to the other
    assert np.nanmax(normal_errors(truth, mine)) <= 1e-12
