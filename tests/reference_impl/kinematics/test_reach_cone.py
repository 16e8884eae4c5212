"""Reach cones: axioms of the projection, nearest points by dense sampling, recovered rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.reference_impl.kinematics.reach_cone import (
    carry,
    is_inside,
    keep_in_cone,
    nearest_direction,
    nearest_twist,
    recover_angles,
    twist_of,
)
from touchstone.reference_impl.kinematics.skeleton import measure_angle

ROUNDING = 1e-13
"""Some hundred roundings of angles of about 1 rad."""
STARRED = ((45, 0), (12, 60), (50, 120), (14, 200), (48, 250), (15, 310))
"""A polygon that is star-shaped and not convex: distances from the centre and headings [degrees]."""


@pytest.fixture(scope="module")
def person(lab):
    """The avatar standing alone."""
    return lab.person()


@pytest.fixture(params=["neck", "left_shoulder", "right_shoulder", "left_hip", "star"])
def ball(request, person):
    """Rows of a ball joint's three hinges, at angles 0 and inside."""
    names = [joint.name for joint in person.joints]
    name = "neck" if request.param == "star" else request.param
    first = names.index(f"{name}_1")
    rows = translate(person).joints[first : first + 3].copy()
    if request.param == "star":
        far, heading = np.radians(STARRED).T
        rows[0]["cone_count"], rows[0]["cone_cap"] = len(STARRED), 1.0
        corners = (np.sin(far) * np.cos(heading), np.sin(far) * np.sin(heading), np.cos(far))
        rows[0]["cone"][: len(STARRED)] = np.transpose(corners)
        rows[0]["cone_center"], rows[0]["cone_mark"] = (0, 0, 1), (1, 0, 0)
    set_angles(rows, np.zeros(3))
    rows["last_angle"] = 0
    return rows


def set_angles(rows, angles) -> None:
    """Give hinges angles with their cosines and sines."""
    rows["angle"] = angles
    for row in rows:
        measure_angle(row)


def rotation(rows) -> np.ndarray:
    """Rotation matrix of the ball joint in its hinges' axes, by scipy."""
    return Rotation.from_euler("XYZ", rows["angle"]).as_matrix()


def directions(count: int, seed: int) -> np.ndarray:
    """Random unit vectors (count, 3)."""
    found = np.random.default_rng(seed).normal(size=(count, 3))
    return found / np.linalg.norm(found, axis=1)[:, None]


def boundary(row, count: int = 400) -> np.ndarray:
    """Points on all edges of the polygon, evenly spaced on chords, the corners among them."""
    corners = row["cone"][: row["cone_count"]]
    share = np.linspace(0, 1, count)[:, None]
    pairs = zip(corners, np.roll(corners, -1, axis=0))
    points = np.concatenate([(1 - share) * a + share * b for a, b in pairs])
    return points / np.linalg.norm(points, axis=1)[:, None]


def test_inside_is_told_by_edges_crossed(ball) -> None:
    """Tell directions inside as those that the way from the centre crosses an even number of edges to."""
    row = ball[0]
    center = row["cone_center"]
    edge = row["cone"][: row["cone_count"]]
    after = np.roll(edge, -1, axis=0)
    normals = np.cross(edge, after)
    for bone in directions(500, 1):
        crossings = 0
        plane = np.cross(center, bone)
        between = np.cross(plane, normals)
        for points in (between, -between):
            on_edge = (np.cross(edge, points) * normals).sum(axis=1) > 0
            on_edge &= (np.cross(points, after) * normals).sum(axis=1) > 0
            on_way = (np.cross(center, points) @ plane > 0) & (np.cross(points, bone) @ plane > 0)
            crossings += int((on_edge & on_way).sum())
        assert is_inside(row, bone) == (crossings % 2 == 0)


def test_the_nearest_direction_is_found_by_dense_sampling(ball) -> None:
    """Lie on the edge, and no farther than any of many samples of it."""
    row, found = ball[0], np.zeros(3)
    samples = boundary(row)
    for bone in directions(200, 2):
        nearest_direction(row, bone, found)
        assert np.linalg.norm(found) == pytest.approx(1, abs=ROUNDING)
        angle = np.arccos(np.clip(samples @ bone, -1, 1)).min()
        mine = np.arccos(np.clip(found @ bone, -1, 1))
        # samples are up to 2 mrad apart: the nearest of them is farther by the square of half that
        assert angle - 2e-3 <= mine <= angle + 1e-7
        assert np.arccos(np.clip((samples @ found).max(), -1, 1)) < 2e-3


def test_projection_is_idempotent_and_keeps_what_is_inside(ball) -> None:
    """Change nothing inside, and nothing the second time."""
    rng = np.random.default_rng(3)
    kept = moved = 0
    for _ in range(500):
        set_angles(ball, rng.uniform(ball["lower"], ball["upper"]))
        before = ball["angle"].copy()
        bone = rotation(ball)[:, 2]
        inside = is_inside(ball[0], bone)
        changed = keep_in_cone(ball, 0)
        once = ball["angle"].copy()
        if not changed:
            assert inside
            np.testing.assert_array_equal(once, before)
            kept += 1
        else:
            moved += 1
        assert not keep_in_cone(ball, 0)
        np.testing.assert_array_equal(ball["angle"], once)
        assert ((ball["lower"] <= once) & (once <= ball["upper"])).all()
        ball["last_angle"] = once
    assert min(kept, moved) > 25


def test_a_projected_bone_was_turned_by_the_shortest_rotation(ball) -> None:
    """Turn from the old orientation to the new one about the axis square to both bones, but for the twist."""
    rng = np.random.default_rng(4)
    checked = 0
    ball[0]["twist_lower"], ball[0]["twist_upper"] = -np.pi, np.pi
    ball["lower"], ball["upper"] = -10, 10
    for _ in range(200):
        set_angles(ball, rng.uniform(-1.5, 1.5, 3))
        before = rotation(ball)
        if not keep_in_cone(ball, 0):
            continue
        turn = Rotation.from_matrix(rotation(ball) @ before.T).as_rotvec()
        bone, found = before[:, 2], np.zeros(3)
        nearest_direction(ball[0], bone, found)
        np.testing.assert_allclose(rotation(ball)[:, 2], found, atol=ROUNDING)
        assert abs(turn @ bone) < 1e-12
        assert np.linalg.norm(turn) == pytest.approx(np.arccos(bone @ found), abs=1e-7)
        checked += 1
    assert checked > 50


def test_projection_is_continuous_on_the_boundary(ball) -> None:
    """Move a bone just outside, or just inside, by no more than it is away from the edge."""
    ball[0]["twist_lower"], ball[0]["twist_upper"] = -np.pi, np.pi
    ball["lower"], ball["upper"] = -10, 10
    center = ball[0]["cone_center"]
    for point in boundary(ball[0], 23):
        for step in (-1e-7, 1e-7):
            bone = point + step * (center - (center @ point) * point)
            bone /= np.linalg.norm(bone)
            mark = ball[0]["cone_mark"].copy()
            carry(center, bone, mark)
            ball[0]["bone"], ball[0]["mark"] = bone, mark
            assert recover_angles(ball, 0)
            for row in ball:
                measure_angle(row)
            before = ball["angle"].copy()
            keep_in_cone(ball, 0)
            np.testing.assert_allclose(rotation(ball)[:, 2], bone, atol=1.1e-7)
            if np.abs(bone[0]) < 0.98:  # near a gimbal pose angles change faster than the bone
                np.testing.assert_allclose(ball["angle"], before, atol=1e-6)


def test_twist_goes_to_the_nearest_end_round_the_circle() -> None:
    """Keep what is inside; else take the nearer end, also across half a turn."""
    assert nearest_twist(0.3, -1.0, 0.5) == 0.3
    assert nearest_twist(0.7, -1.0, 0.5) == 0.5
    assert nearest_twist(-1.2, -1.0, 0.5) == -1.0
    # 3.0 is 2.5 over the upper end, and 2.28 below the lower one, round the back
    assert nearest_twist(3.0, -1.0, 0.5) == -1.0
    assert nearest_twist(-3.1, -1.0, 2.5) == 2.5


def test_twist_is_bounded(ball) -> None:
    """Bring the twist to its interval and leave the bone where it is."""
    rng = np.random.default_rng(5)
    low, high = ball[0]["twist_lower"], ball[0]["twist_upper"]
    for _ in range(200):
        set_angles(ball, rng.uniform(ball["lower"], ball["upper"]))
        keep_in_cone(ball, 0)
        ball[0]["bone"], ball[0]["mark"] = rotation(ball)[:, 2], rotation(ball)[:, 0]
        assert low - 1e-12 <= twist_of(ball[0]) <= high + 1e-12
        ball["last_angle"] = ball["angle"]


def test_recovered_angles_reproduce_the_rotation(ball) -> None:
    """Give back the rotation, on the branch nearest the present angles."""
    rng = np.random.default_rng(6)
    ball["lower"], ball["upper"] = -7, 7
    for _ in range(500):
        wanted = Rotation.random(random_state=rng).as_matrix()
        ball["angle"] = rng.uniform(-3, 3, 3)
        near = ball["angle"].copy()
        ball[0]["bone"], ball[0]["mark"] = wanted[:, 2], wanted[:, 0]
        assert recover_angles(ball, 0)
        np.testing.assert_allclose(rotation(ball), wanted, atol=1e-12)
        q1, q2, q3 = Rotation.from_matrix(wanted).as_euler("XYZ")
        branches = [(q1, q2, q3), (q1 + np.pi, np.pi - q2, q3 + np.pi)]
        wound = [near + (np.array(b) - near + np.pi) % (2 * np.pi) - np.pi for b in branches]
        distance = [np.sum((w - near) ** 2) for w in wound]
        assert np.sum((ball["angle"] - near) ** 2) == pytest.approx(min(distance), abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_gimbal_pose_is_finite_and_moves_the_least(ball, side: float) -> None:
    """Share what is missing between the first and the third hinge where only their sum is determined."""
    ball["lower"], ball["upper"] = -7, 7
    ball["angle"] = (0.5, side * 1.4, -0.2)
    wanted = Rotation.from_euler("XYZ", (0.8, side * np.pi / 2, 0.3)).as_matrix()
    ball[0]["bone"], ball[0]["mark"] = wanted[:, 2], wanted[:, 0]
    assert recover_angles(ball, 0)
    np.testing.assert_allclose(rotation(ball), wanted, atol=1e-9)
    moved = ball["angle"] - (0.5, side * 1.4, -0.2)
    assert moved[0] == pytest.approx(side * moved[2], abs=1e-12)


def test_where_limits_cut_off_the_projection_nothing_changes(ball) -> None:
    """Return to the last angles inside when no branch lies within the hinges' limits."""
    far = -2.5
    ball["lower"][0], ball["upper"][0] = far - 1e-3, far + 1e-3
    set_angles(ball, (far, 0, 0))
    assert keep_in_cone(ball, 0)
    np.testing.assert_array_equal(ball["angle"], 0)
    np.testing.assert_array_equal(ball["cosine"], 1)


def test_opposite_directions_are_carried_by_half_a_turn() -> None:
    """Stay finite where the shortest rotation has no axis."""
    vector = np.array((1.0, 0.0, 0.0))
    carry(np.array((0.0, 0.0, 1.0)), np.array((0.0, 0.0, -1.0)), vector)
    np.testing.assert_array_equal(vector, (1, 0, 0))
