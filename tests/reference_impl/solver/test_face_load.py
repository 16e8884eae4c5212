"""Load on the corners of a face: the most even one, in any order of rows."""

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.solver.face_load import even_out, find_faces

HALF = 0.05


def corner_loads(lab: SimpleNamespace, heading: float, spin: float) -> tuple[np.ndarray, np.ndarray]:
    """Corners and normal impulses of a box that slides and turns on the ground, after one frame."""
    box = lab.block(
        "box",
        (HALF, 0.6 * HALF, 0.4 * HALF),
        (0.0, 0.0, 0.4 * HALF),
        linear_velocity=(float(np.cos(heading)), float(np.sin(heading)), 0.0),
        angular_velocity=(0.0, 0.0, spin),
    )
    world = lab.build(lab.scene(box, lab.ground(), mu=0.4))
    lab.play(world, 1)
    rows = world.contacts[: int(world.state[0]["contact_count"])]
    return rows["position"], np.abs((rows["impulse"] * rows["normal"]).sum(1))


@pytest.mark.parametrize("heading", [0.0, 0.7, 2.3, 4.0])
@pytest.mark.parametrize("spin", [0.0, 2.0, -5.0])
def test_corners_bear_the_most_even_load(lab: SimpleNamespace, heading: float, spin: float) -> None:
    """Of the loads with one sum and one moment, that of least squares: a linear function of the place."""
    places, loads = corner_loads(lab, heading, spin)
    assert len(loads) == 4
    assert loads.min() > 0
    assert np.ptp(loads) > 0.01 * loads.mean()
    plane = np.column_stack((np.ones(4), places[:, :2]))
    linear = plane @ np.linalg.lstsq(plane, loads, rcond=None)[0]
    np.testing.assert_allclose(loads, linear, rtol=1e-10)


def loaded(loads: list[float], speeds: list[float]) -> tuple[np.void, np.ndarray]:
    """A solver with one square face under given loads, whose corners separate at given speeds."""
    from touchstone.reference_impl.core.solver_dtypes import SOLVER
    from touchstone.reference_impl.core.world import PAIR

    solver, pairs = np.zeros(1, SOLVER)[0], np.zeros(4, PAIR)
    solver["row_count"] = 4
    pairs["next_point"], pairs["solver_row"] = (1, 2, 3, -1), range(4)
    rows = solver["rows"][:4]
    rows["pair"] = range(4)
    rows["a"] = rows["link_a"] = rows["link_b"] = -1
    rows["normal"][:, 2] = rows["across_1"][:, 0] = rows["across_2"][:, 1] = 1.0
    rows["r_b"][:, :2] = (-1, -1), (1, -1), (1, 1), (-1, 1)
    rows["impulse"][:, 2] = loads
    rows["free"][:, 2] = speeds
    find_faces(solver, pairs)
    return solver, rows["impulse"][:, 2]


@pytest.mark.parametrize(
    ("loads", "speeds", "most_even"),
    [
        ([2.0, 0.0, 2.0, 0.0], [0.0] * 4, [1.0, 1.0, 1.0, 1.0]),
        ([4.0, 0.0, 1.0, 0.0], [0.0] * 4, [3.0, 1.0, 0.0, 1.0]),
        ([3.0, 2.0, 1.0, 2.0], [0.0] * 4, [3.0, 2.0, 1.0, 2.0]),
        # a corner that parts bears nothing
        ([2.0, 1.0, 2.0, 0.0], [0.0, 0.0, 0.0, 1.0], [2.0, 1.0, 2.0, 0.0]),
    ],
)
def test_no_corner_pulls_and_none_that_parts_is_loaded(loads, speeds, most_even) -> None:
    """The sum and the moment stay; a load falls at most to nothing."""
    solver, found = loaded(loads, speeds)
    assert solver["face_count"] == 1
    even_out(solver)
    np.testing.assert_allclose(found, most_even, atol=1e-15)
