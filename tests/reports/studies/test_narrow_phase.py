"""The study narrow-phase: complete, repeatable rows and an exact reference; pairs of a file, their truths."""

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.detectors import DETECTORS, REFERENCE, Entry, Failure, load, missing_reason
from touchstone.adapters.oracles.minkowski import piece_distance
from touchstone.reports.progress import quietly
from touchstone.reports.results import COLUMNS
from touchstone.reports.studies.narrow_phase import study as narrow_phase
from touchstone.reports.studies.narrow_phase.interleaved_timing import Answered
from touchstone.reports.studies.narrow_phase.study import (
    FAMILIES,
    TOUCH,
    depth_errors,
    draw,
    normal_errors,
    report,
    run,
    truth_of,
)
from touchstone.scenarios.files.pair_file import GivenPair, Placed, read_pairs
from touchstone.scenarios.files.read import SceneFileError
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Piece,
    RoundedBox,
    Sphere,
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
    assert text.count("missing: absent default: not installed (pip install no_such_package)") == 1
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


REPORTS = Path(__file__).with_name("detector_reports.json")
"""Pairs of public reports about detectors; `source` is the report. Numbers are those of the reports, or of
regression tests that cite them."""
HALF = 0.5**0.5
TURNED = (HALF, 0.0, HALF, 0.0)  # a capsule along x
CUBE = Box((1.0, 1.0, 1.0))


def piece(shape, position=(0.0, 0.0, 0.0), orientation=(1.0, 0.0, 0.0, 0.0)) -> Piece:
    return Piece("piece", shape, position, orientation)


@pytest.mark.parametrize(
    ("a", "b", "distance", "normal"),
    [
        (piece(Sphere(2.0)), piece(Sphere(1.0), (0, 5, 0)), 2.0, (0, 1, 0)),
        (piece(Sphere(2.0)), piece(Sphere(1.0), (0, 0, -2.5)), -0.5, (0, 0, -1)),
        (piece(CUBE), piece(Sphere(0.1), (0, 0, 0.7)), -0.4, (0, 0, 1)),
        (piece(Sphere(0.1), (3, 0, 0)), piece(CUBE), 1.9, (-1, 0, 0)),
        (piece(CUBE), piece(Capsule(0.3, 1.0), (0, 0, 2.5), TURNED), 1.2, (0, 0, 1)),
        (piece(CUBE), piece(Capsule(0.3, 1.0), (0, 0, 0.9), TURNED), -0.4, (0, 0, 1)),
        (piece(Capsule(0.3, 1.0)), piece(Capsule(0.2, 1.0), (0, 1, 0), TURNED), 0.5, (0, 1, 0)),
        (piece(Capsule(0.3, 1.0)), piece(Sphere(0.2), (0, 0, 2)), 0.5, (0, 0, 1)),
        (piece(HalfSpace(), (0, 0, 1)), piece(Sphere(0.5), (3, 4, 2)), 0.5, (0, 0, 1)),
        (piece(Ellipsoid((1, 2, 3)), (0, 0, 2)), piece(HalfSpace()), -1.0, (0, 0, -1)),
        (piece(HalfSpace()), piece(Cone(0.3, 0.2), (0, 0, 0.5)), 0.3, (0, 0, 1)),
        (piece(Ellipsoid((1, 1, 1))), piece(Ellipsoid((0.5, 0.5, 0.5)), (0, 2, 0)), 0.5, (0, 1, 0)),
        (piece(Cone(0.3, 0.2)), piece(Sphere(0.1), (0.55, 0, 0.3)), 0.4, (0.8, 0, 0.6)),
        (piece(Cylinder(0.5, 0.5)), piece(Sphere(0.2), (0.8, 0, 0.9)), 0.3, (0.6, 0, 0.8)),
        (piece(Cylinder(0.5, 0.5)), piece(Cylinder(0.3, 0.4), (0.0, 0.7, 0.1)), -0.1, (0, 1, 0)),
        (piece(RoundedBox((0.3, 0.3, 0.3), 0.1)), piece(CUBE, (0, 0, -1.5)), 0.1, (0, 0, -1)),
    ],
)
def test_the_truth_of_curved_pieces_is_their_closed_form(a, b, distance, normal):
    """Apart and overlapping: balls and capsules, which are points and segments less their radii, to rounding;
    planes, cones, cylinders, ellipsoids and rounded boxes."""
    found, along = piece_distance(a, b)
    exact = {type(a.shape), type(b.shape)} <= {Sphere, Capsule, Box}
    assert found == pytest.approx(distance, abs=1e-14 if exact else 1e-11)
    assert np.allclose(along, normal, atol=1e-12 if exact else 1e-5)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (piece(Sphere(0.3)), piece(Sphere(0.2))),
        (piece(Capsule(0.3, 1.0)), piece(Sphere(0.2), (0, 0, 0.5))),
        (piece(Capsule(0.3, 1.0)), piece(Capsule(0.2, 1.0), (0.5, 0, 0), TURNED)),
    ],
)
def test_segments_that_meet_overlap_by_both_radii(a, b):
    """The normal is across the segments, where there is one."""
    distance, normal = piece_distance(a, b)
    assert distance == pytest.approx(-0.5, abs=1e-14)
    assert np.linalg.norm(normal) == pytest.approx(1)
    if isinstance(a.shape, Capsule):
        assert normal[2] == pytest.approx(0, abs=1e-12)


def test_half_spaces_have_no_distance():
    """Two of them are refused."""
    with pytest.raises(Unsupported, match="no distance of two half-spaces"):
        piece_distance(piece(HalfSpace()), piece(HalfSpace(), (0, 0, 1)))


@pytest.fixture
def only_reference(monkeypatch):
    """No other detector is asked."""
    for name in DETECTORS.keys() - {"reference.exact"}:
        monkeypatch.delitem(DETECTORS, name)


def test_the_reference_is_exact_on_all_shapes(only_reference, tmp_path):
    """Pairs of every two shapes, apart and overlapping, at random; qhull's planes are exact to 1e-10."""
    rng = np.random.default_rng(3)
    shapes = [
        *(Sphere(0.4), Box((0.5, 0.3, 0.2)), Capsule(0.2, 0.4), Cylinder(0.3, 0.4), Cone(0.4, 0.4)),
        *(Ellipsoid((0.5, 0.3, 0.2)), RoundedBox((0.4, 0.3, 0.1), 0.1), HalfSpace()),
    ]
    pairs = []
    for k, (one, two) in enumerate(combinations(shapes, 2)):
        way = Rotation.random(random_state=k).apply((0.0, 0.0, float(rng.choice([0.3, 1.5]))))
        turned = Rotation.random(2, random_state=99 + k).as_quat(scalar_first=True)
        a, b = Placed(one, (0.0, 0.0, 0.0), tuple(turned[0])), Placed(two, tuple(way), tuple(turned[1]))
        pairs.append(GivenPair(f"pair_{k}", a, b))
    frame = narrow_phase.run_given(pairs, tmp_path / "out", lambda *_: None)
    errors = frame[(frame.engine == "reference.exact") & (frame.metric == "depth.error")]
    assert len(errors) == len(pairs)
    assert errors.value.max() < 1e-8


def test_the_reference_is_exact_on_public_reports(only_reference, tmp_path):
    """Every pair has a source and a name of its own; the reference is exact to rounding. In `drake_21234`
    bodies touch to 3e-11 m: the direction from the nearest point of a hull is rounding there."""
    pairs = read_pairs(REPORTS)
    assert len(pairs) == 48
    assert all(pair.source.startswith("https://github.com/") for pair in pairs)
    frame = narrow_phase.run_given(pairs, tmp_path / "out", lambda *_: None)
    mine = frame[frame.engine == "reference.exact"]
    assert sorted(mine.scenario[mine.metric == "distance"]) == sorted(pair.name for pair in pairs)
    errors = mine[mine.metric == "depth.error"].set_index("scenario").value
    smooth = [pair.name for pair in pairs if {type(pair.a.shape), type(pair.b.shape)} & {Cylinder}]
    assert errors.drop(smooth).max() < 1e-10
    assert errors[smooth].max() < 1e-8  # that of the explicit difference of curved pieces
    assert set(mine.reason) == {""}
    stated = {
        "fcl_508": 3.0,
        "fcl_275": 10.0,
        "fcl_127": 3.0,
        "fcl_568": -6.0,
        "fcl_628": -0.2,
        "fcl_375": 0.0,
        "mujoco_2206": -0.01,
        "mujoco_1473": 0.6,
        "mujoco_1857": 0.035,
        "mujoco_2710": 0.1,
        "libccd_25": -0.1,
        "opengjk_52": -300.0,
        "parry_315": 0.0,
        "python_fcl_68": 0.1,
    }
    truth = frame[frame.engine == "minkowski"].set_index("scenario").value
    for name, distance in stated.items():
        assert truth[name] == pytest.approx(distance, abs=1e-9)


def answers(*distances: float) -> Answered:
    """What a detector says of pairs along x."""
    n = len(distances)
    normal = np.tile([1.0, 0.0, 0.0], (n, 1))
    return Answered(np.array(distances), normal, np.full(n, 1e-6), [np.ones((1, 2)) * 1e-7], {}, {})


@pytest.fixture
def spheres(tmp_path):
    """A file with a pair of balls that overlap, one that touches, and one that is apart by 1 m."""
    ball = {"shape": {"radius": 0.5}}
    pairs = [
        {"name": name, "a": ball, "b": {**ball, "position": [x, 0, 0]}}
        for name, x in (("over", 0.5), ("touch", 1.0), ("apart", 2.0))
    ]
    path = tmp_path / "pairs.json"
    path.write_text(json.dumps({"pairs": pairs}))
    return path


def test_answers_wrong_in_kind_are_named(monkeypatch, spheres, touchstone):
    """A gap for an overlap, a contact that is missed, and an answer that is right; each beside its pair."""
    said = {"reference.exact": (0.1, 0.0, 1.0), "coal": (np.nan, 0.0, np.nan), "bullet": (-0.5, 0.0, 1.0)}
    monkeypatch.setattr(narrow_phase, "measure", lambda *_: {n: answers(*each) for n, each in said.items()})
    code, out, err = touchstone("study narrow-phase --pairs", spheres, "--out", "out")
    assert code == 0, err
    lines = [line for line in out.splitlines() if line.startswith(("over", "touch", "apart"))]
    assert lines == [
        "over: -0.5 m: reference.exact 1.20 wrong sign, coal 1.00 missed",
        "touch: 0 m: all agree",
        "apart: 1 m: all agree",
    ]


def test_a_detector_that_dies_is_asked_one_by_one(monkeypatch, spheres, tmp_path):
    """It loses the pair of which it dies, and no other."""

    def measure(names, pairs, *_):
        found = answers(*(float(b.position[0]) - 1 for _, b in pairs))
        if any(b.position[0] == 0.5 for _, b in pairs):
            found.distance[:], found.ended = np.nan, ("error", "died: signal SIGABRT")
        return {"coal": found}

    monkeypatch.setattr(narrow_phase, "measure", measure)
    frame = narrow_phase.run_given(read_pairs(spheres), tmp_path / "out", lambda *_: None)
    rows = frame[(frame.engine == "coal") & (frame.metric == "distance")].set_index("scenario")
    assert rows.value[["touch", "apart"]].tolist() == [0.0, 1.0]
    assert rows.reason["over"] == "threw: died: signal SIGABRT"
    assert "run" not in set(frame.metric)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('{"pairs": []}', "p.json:1: pairs: found none, expected at least one"),
        ('{"pairs": [{"name": "x", "a": {"shape": {"radius": 1}}}]}', "p.json:1: pairs[0].b: missing"),
        (
            '{"pairs": [{"name": "x",\n "a": {"shape": {"radius": -1}},\n "b": {"shape": {"radius": 1}}}]}',
            "p.json:2: pairs[0].a.shape.radius: found -1",
        ),
        (
            '{"pairs": [{"name": "x",\n "a": {"shape": {"radius": 1}, "orientation": [1, 1, 0, 0]},\n'
            ' "b": {"shape": {"half_extent": [1, 1, 1]}}}]}',
            "p.json:3: pairs[0].b.shape: found no shape: unknown field 'half_extent'; did you mean 'half_",
        ),
        ('{"pairs": [', "p.json:1: not JSON"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(text, line, tmp_path):
    """File, line, field, what was found and what is valid."""
    (tmp_path / "p.json").write_text(text)
    with pytest.raises(SceneFileError) as error:
        read_pairs(tmp_path / "p.json")
    assert line in str(error.value)


def test_names_are_unique(spheres):
    """Rows of two pairs with one name could not be told apart."""
    spheres.write_text(spheres.read_text().replace("touch", "over"))
    with pytest.raises(SceneFileError, match=r"pairs\[1\]\.name: found 'over', expected a name of its own"):
        read_pairs(spheres)
