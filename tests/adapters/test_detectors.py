"""Detectors: signs, normals and accuracy by closed forms; failures that stay a row; the cloud of boxes."""

import itertools
import os
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from touchstone.adapters.contract import AdapterError, Unsupported
from touchstone.adapters.detectors import (
    DETECTORS,
    REFERENCE,
    THREW,
    UNSUPPORTED,
    Entry,
    Pair,
    PythonBatch,
    Query,
    load,
    missing_reason,
)
from touchstone.adapters.detectors.children import Child
from touchstone.adapters.engines.reference.box_cloud import Cloud
from touchstone.scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Piece, Sphere
from touchstone.scenarios.solids import elliptic_hull

DEPTH, GAP = 0.15, 0.25
LOWER = Piece("a", Box((0.5, 0.5, 0.5)))
SUNK = Piece("b", Box((0.4, 0.3, 0.6)), (0.1, 0.05, 1.1 - DEPTH))
ABOVE = Piece("b", Box((0.4, 0.3, 0.6)), (0.1, 0.05, 1.1 + GAP))
UP = (0.0, 0.0, 1.0)
ACCURACY = {
    REFERENCE: 1e-14,
    "reference.walk": 1e-14,
    "bullet.tight": 1e-5,  # its GJK's default tolerances, once boxes have no margin
}
"""Error of the depth of two boxes of 1 m [m]."""
DEFAULT_ACCURACY = 1e-6
"""The tolerance that FCL, coal and MuJoCo state; the others' boxes are closed forms."""
CONTACTS_ONLY = ("python-fcl", "dart.fcl", "dart.bullet", "dart.dart")
"""Detectors that report nothing for pieces apart."""


@pytest.fixture(params=DETECTORS)
def name(request: pytest.FixtureRequest) -> str:
    """Each detector in turn; skips where it is not installed."""
    if reason := missing_reason(request.param):
        pytest.skip(f"{request.param}: {reason}")
    return request.param


def answers(name: str, *pairs: Pair):
    """What a detector says of pairs."""
    batch = load(name).prepare(pairs)
    seconds = batch.ask()
    found = batch.answers()
    batch.close()
    assert seconds.shape == found.distance.shape
    return found


def test_boxes_by_the_closed_form(name: str) -> None:
    """Give two overlapping boxes the right negative distance, and the normal from A to B in either order."""
    found = answers(name, (LOWER, SUNK), (SUNK, LOWER))
    assert not found.failures
    np.testing.assert_allclose(found.distance, -DEPTH, atol=ACCURACY.get(name, DEFAULT_ACCURACY), rtol=0)
    np.testing.assert_allclose(found.normal, [UP, np.negative(UP)], atol=DEFAULT_ACCURACY)


def test_boxes_apart(name: str) -> None:
    """Give boxes apart their positive distance, or no contact."""
    found = answers(name, (LOWER, ABOVE), (ABOVE, LOWER))
    assert not found.failures
    if name in CONTACTS_ONLY:
        assert np.isnan(found.distance).all()
        assert np.isnan(found.normal).all()
    else:
        np.testing.assert_allclose(found.distance, GAP, atol=ACCURACY.get(name, DEFAULT_ACCURACY), rtol=0)
        np.testing.assert_allclose(found.normal, [UP, np.negative(UP)], atol=DEFAULT_ACCURACY)


def test_hulls_are_posed_like_boxes(name: str) -> None:
    """Place a hull where its pose says: a ball-like hull's pole sinks into the box by the depth."""
    ball = Piece(
        "b", Hull(elliptic_hull((0.3, 0.3, 0.3))), (0.05, 0.02, 0.8 - DEPTH), (0.5**0.5, 0, 0.5**0.5, 0)
    )
    found = answers(name, (LOWER, ball))
    if name in ("dart.fcl", "dart.dart"):
        # they see triangles, not a solid: only the side is right
        assert found.distance[0] < 0
    else:
        # Bullet's margin is 1 mm
        assert found.distance[0] == pytest.approx(-DEPTH, abs=2e-3)
        assert found.normal[0] @ UP > 0.999


def test_a_capsule_lies_along_its_z(name: str) -> None:
    """Sink a capsule's end, 0.7 m from its middle, into the box by the depth."""
    found = answers(name, (LOWER, Piece("b", Capsule(0.2, 0.5), (0.1, 0.05, 1.2 - DEPTH))))
    if name == "dart.fcl":
        # DART hands FCL a ball of 10 cm in its place, and only prints an error
        assert np.isnan(found.distance[0])
    else:
        assert found.distance[0] == pytest.approx(-DEPTH, abs=DEFAULT_ACCURACY)
        np.testing.assert_allclose(found.normal[0], UP, atol=1e-5)


def test_crossings_are_answered(name: str) -> None:
    """Answer the pairs that measure the crossing."""
    detector = load(name)
    if detector.crossings is not None:
        assert not answers(name, *detector.crossings).failures


def test_an_unsupported_shape_is_a_failure_of_its_query() -> None:
    """Keep the other queries of a batch."""
    if reason := missing_reason("python-fcl"):
        pytest.skip(reason)
    found = answers("python-fcl", (LOWER, Piece("b", Ellipsoid((1.0, 1.0, 1.0)))), (LOWER, SUNK))
    assert found.failures[0].kind == UNSUPPORTED
    assert "Ellipsoid" in found.failures[0].reason
    assert np.isnan(found.distance[0])
    assert found.distance[1] == pytest.approx(-DEPTH)


def test_an_exception_is_a_failure_of_its_query() -> None:
    """Report the exception, whether a query is built or asked."""

    def build(pair: Pair) -> Query:
        match pair[1].shape:
            case Sphere():
                raise Unsupported("test: no spheres")
            case Box():
                return Query(lambda: 1 / 0, lambda found: None)
        raise ValueError("one\ntwo")

    ball, hull = Piece("b", Sphere(1.0)), Piece("b", Ellipsoid((1.0, 1.0, 1.0)))
    batch = PythonBatch(build, [(LOWER, ball), (LOWER, SUNK), (LOWER, hull)], lambda: None)
    assert np.isnan(batch.ask()).all()
    kinds = {k: tuple(failure) for k, failure in batch.answers().failures.items()}
    assert kinds == {
        0: (UNSUPPORTED, "test: no spheres"),
        1: (THREW, "ZeroDivisionError: division by zero"),
        2: (THREW, "ValueError: one"),
    }


def test_a_missing_package_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Name the package that brings it, without importing anything."""
    monkeypatch.setitem(DETECTORS, "absent", Entry("no.such:Thing", "no_such_package"))
    assert missing_reason("absent") == "not installed (pip install no_such_package)"
    with pytest.raises(AdapterError, match="absent: not installed"):
        load("absent")


@pytest.mark.parametrize("name", DETECTORS)
def test_the_hint_of_a_detector_is_a_requirement_of_the_project(name: str) -> None:
    """Tell pip a package that the project requires, itself or by an extra."""
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *itertools.chain(*project["optional-dependencies"].values())]
    asked = DETECTORS[name].requirement or DETECTORS[name].package
    assert asked in {*wanted, *(re.split("[>;]", one)[0] for one in wanted)}


def test_a_child_that_dies_is_one_failure(tmp_path: Path) -> None:
    """Report how it ended, and answer nothing from then on."""
    child = Child(7, tmp_path / "output.txt", loader=os._exit)  # type: ignore[arg-type]
    assert child.ask("load") is None
    assert child.failure == ("error", "died during 'load': exit code 7")
    assert child.ask("time", 1) is None
    child.stop()


def test_a_followed_motion_is_exact_and_held() -> None:
    """Walk two pairs frame by frame: the exact depths, and proved from the frame before but for the first."""
    hull, frames = Hull(elliptic_hull((0.3, 0.2, 0.2))), 40
    pairs = []
    for k in range(frames):
        sway = 0.02 * np.sin(0.2 * k)
        pairs.append((LOWER, Piece("b", hull, (0.001 * k, 0.1, 0.69 + sway))))
        pairs.append((LOWER, Piece("b", hull, (0.69 + sway, 0.001 * k, 0.0))))
    walked, exact = load("reference.walk").follow(pairs, 2), load(REFERENCE).prepare(pairs)
    assert (walked.ask() > 0).any()
    exact.ask()
    found, truth = walked.answers(), exact.answers()
    np.testing.assert_allclose(found.distance, truth.distance, atol=1e-14)
    assert not found.failures
    assert found.held is not None
    assert not found.held[:2].any()
    assert found.held[2:].all()
    assert truth.held is None


@pytest.mark.parametrize("count", [20, 150])
def test_pairs_are_all_pairs(count: int) -> None:
    """Find in every frame what brute force finds."""
    cloud = Cloud(count, np.random.default_rng(count))
    for _ in range(5):
        assert cloud.frame() > 0
        low, high = cloud.pieces["low"], cloud.pieces["high"]
        meet = (low[:, None] <= high).all(axis=2) & (low <= high[:, None]).all(axis=2)
        rows = cloud.pairs[: cloud.found]
        found = set(zip(rows["piece_a"].tolist(), rows["piece_b"].tolist()))
        assert len(found) == cloud.found > 0
        assert found == set(zip(*(k.tolist() for k in np.nonzero(np.triu(meet, 1)))))
