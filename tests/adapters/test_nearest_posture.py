"""The best known posture: a plane in closed form, several starts, and what cannot be free."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import LinearConstraint, minimize
from scipy.spatial.transform import Rotation

pytest.importorskip("pinocchio", reason="not installed (pip install pin)")
pytest.importorskip("fcl", reason="not installed (pip install python-fcl)")

from touchstone.adapters.oracles.nearest_posture import FREE, NearestPosture, _least_distance

BENT = {"left_shoulder_1": 0.3, "left_elbow": 0.9}


@pytest.fixture
def posed(lab: SimpleNamespace):
    """A person with the left arm bent, a wall before it, and the search for free postures."""

    def build(face: float):
        wall = lab.block("wall", (0.5, 2.0, 2.0), (face + 0.5, 0.0, 0.0), kind="fixed")
        person = lab.person()
        scenario = lab.person(bodies=(*person.bodies, wall))
        tracker = scenario.trackers[0]
        tracked = np.array([BENT.get(name, 0.0) for name in tracker.joints])
        poses = [
            (Rotation.from_quat(body.orientation, scalar_first=True).as_matrix(), np.array(body.position))
            for body in scenario.bodies
        ]
        root = (np.eye(3), np.zeros(3))
        search = NearestPosture(scenario, tracker)

        def best(*starts: np.ndarray):
            return search.best(root, poses, tracked, [tracked, *starts], np.random.default_rng(3))

        return search, tracked, best

    return build


def test_a_free_posture_stays(posed) -> None:
    """Return the tracker's own posture where it touches nothing."""
    _, tracked, best = posed(3.0)
    np.testing.assert_array_equal(best(), tracked)


def test_a_hand_in_a_wall_comes_free_along_the_slope(posed) -> None:
    """Turn by what is least: free to 1e-6 m, along the gradients of what touches, no other start nearer."""
    search, tracked, best = posed(0.30)
    found = best()
    depth, planes = search._near(found, [])
    assert depth <= FREE
    turned = found - tracked
    assert 1e-2 < np.abs(turned).max() < 1.0
    slopes = search._slopes([plane for plane in planes if plane.distance < 1e-3], len(turned))
    pulls = np.linalg.lstsq(slopes.T, turned, rcond=None)[0]
    # first-order condition of the minimum, to a settled turn of 1e-3 rad; hinges at a limit are excused
    inside = (found > search._lower + 1e-6) & (found < search._upper - 1e-6)
    np.testing.assert_allclose((slopes.T @ pulls)[inside], turned[inside], atol=5e-3)


def test_the_best_of_many_starts_is_no_worse_than_one(posed) -> None:
    """Never return a posture farther away than the one that a single start leads to."""
    search, tracked, best = posed(0.25)
    found, alone = best(), search._descend(tracked, tracked, np.inf)
    assert alone is not None
    assert np.sum((found - tracked) ** 2) <= np.sum((alone - tracked) ** 2)


def test_a_root_in_a_wall_is_told(posed) -> None:
    """Return nothing where no posture can be free: thighs hang in a wall that the hips are in."""
    _, _, best = posed(-0.3)
    assert best() is None


def test_slopes_are_differences_of_distances(posed) -> None:
    """Agree with central differences of the oracle's distances."""
    search, tracked, best = posed(0.30)
    best()  # poses the rest of the scene
    _, planes = search._near(tracked, [])
    slopes = search._slopes(planes, len(tracked))
    deepest = int(np.argmin([plane.distance for plane in planes]))
    step, pair = 1e-6, planes[deepest].pair
    for k in np.flatnonzero(np.abs(slopes[deepest]) > 1e-3):
        change = np.zeros(len(tracked))
        change[k] = step
        ends = [
            next(
                plane.distance for plane in search._near(tracked + way * change, [])[1] if plane.pair == pair
            )
            for way in (1, -1)
        ]
        # coal's distances are good to 1e-8 m
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(slopes[deepest, k], abs=2e-2)


def test_the_least_distance_program_against_slsqp() -> None:
    """Agree with a general solver on random half-spaces and limits; say so where there is no solution."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        start, slopes = rng.normal(size=5), rng.normal(size=(4, 5))
        inside = start + rng.normal(scale=0.5, size=5)
        heights = slopes @ inside - rng.uniform(0, 0.2, 4)
        low, high = inside - rng.uniform(0, 0.5, 5), inside + rng.uniform(0, 0.5, 5)
        truth = minimize(
            lambda q, to: np.sum((q - to) ** 2),
            inside,
            args=(start,),
            bounds=list(zip(low, high)),
            constraints=LinearConstraint(slopes, heights),
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        ).x
        # SLSQP ends at 1e-14 of the objective, 1e-7 of the point
        np.testing.assert_allclose(_least_distance(start, slopes, heights, low, high), truth, atol=1e-6)
    one = np.ones((1, 5))
    assert _least_distance(start, one, np.array([6.0]), np.zeros(5), np.ones(5)) is None
