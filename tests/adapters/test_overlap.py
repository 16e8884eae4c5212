"""The judge of overlap: closed forms, the explicit Minkowski difference, and no pair missed."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip("fcl", reason="python-fcl is not installed")
pytest.importorskip("coal", reason="coal (pin) is not installed")
from touchstone.adapters.engines.reference.reference_world import matrix
from touchstone.adapters.oracles import minkowski
from touchstone.adapters.oracles.closed_distance import Placed, closed_distance
from touchstone.adapters.oracles.overlap import (
    MARGIN,
    coal_shape,
    gaps_along,
    measure,
    signed_distance,
)
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.random_scenes.bodies import random_shape
from touchstone.scenarios.scenario import Body, Box, Capsule, Cone, Cylinder, Ellipsoid, Hull, Piece, Sphere
from touchstone.scenarios.solids import elliptic_hull, sphere_inertia

ASKED = 1e-6
"""What is asked of a depth [m]."""
TIGHT = 1e-7
"""Ten times the oracle's own tolerance [m]."""
AXES = np.vstack([np.eye(3), -np.eye(3)])


def apart(shape_a, pose_a, shape_b, pose_b):
    """Signed distance, normal and midpoint of two shapes at (position, Rotation)."""
    poses = [(turn.as_matrix(), np.array(position, dtype=float)) for position, turn in (pose_a, pose_b)]
    return signed_distance(coal_shape(shape_a), poses[0], coal_shape(shape_b), poses[1])


def random_rotation(rng):
    return Rotation.random(rng=rng)


def direction(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


@pytest.mark.parametrize("gap", [-0.15, -1e-3, -1e-7, 1e-7, 1e-3, 0.5])
def test_two_spheres(gap):
    """Spheres: the gap along the line of centres, normal from the first to the second, point in between."""
    rng = np.random.default_rng(1)
    for _ in range(20):
        n, start = direction(rng), rng.normal(size=3)
        small, large = (start, random_rotation(rng)), (start + (0.3 + gap) * n, random_rotation(rng))
        distance, normal, point = apart(Sphere(0.1), small, Sphere(0.2), large)
        assert distance == pytest.approx(gap, abs=TIGHT)
        # two spheres a hair apart: the witnesses tell the direction no better than the tolerance
        assert normal == pytest.approx(n, abs=1e-6)
        assert point == pytest.approx(start + (0.1 + gap / 2) * n, abs=1e-6)


@pytest.mark.parametrize("gap", [-0.05, -1e-4, 1e-4, 0.3])
@pytest.mark.parametrize("axis", range(6))
def test_sphere_and_the_face_of_a_box(gap, axis):
    """A sphere over a face, the box turned anyhow, in both orders: the gap along the face's normal."""
    rng = np.random.default_rng(axis)
    half, turn, center = np.array([0.3, 0.2, 0.25]), random_rotation(rng), rng.normal(size=3)
    n = turn.apply(AXES[axis])
    beside = turn.apply(0.05 * (1 - np.abs(AXES[axis])))  # off the middle of the face
    ball = center + beside + (half @ np.abs(AXES[axis]) + 0.1 + gap) * n
    box = (Box(tuple(half)), (center, turn))
    sphere = (Sphere(0.1), (ball, random_rotation(rng)))
    for one, two, sign in ((box, sphere, 1), (sphere, box, -1)):
        distance, normal, _ = apart(*one, *two)
        assert distance == pytest.approx(gap, abs=TIGHT)
        assert normal == pytest.approx(sign * n, abs=1e-5)  # tolerance over depth


@pytest.mark.parametrize("gap", [-0.02, -1e-6, 1e-6, 0.1])
def test_two_boxes_face_to_face_and_edge_to_edge(gap):
    """Boxes: face on face the gap of the faces; crossed edges the gap between the edges."""
    still, box = Rotation.identity(), Box((0.1, 0.2, 0.3))
    distance, normal, _ = apart(box, (np.zeros(3), still), box, ([0.05, 0.1, 0.6 + gap], still))
    assert distance == pytest.approx(gap, abs=TIGHT)
    assert normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    # two cubes on edge, the edges crossed at a right angle
    cube, root = Box((0.1, 0.1, 0.1)), 0.1 * 2**0.5
    lower, upper = (Rotation.from_euler(axis, 45, degrees=True) for axis in "xy")
    distance, normal, point = apart(cube, (np.zeros(3), lower), cube, ([0, 0, 2 * root + gap], upper))
    assert distance == pytest.approx(gap, abs=TIGHT)
    assert normal == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert point == pytest.approx([0.0, 0.0, root + gap / 2], abs=1e-6)


def test_cylinders_that_nearly_touch(lab):
    """Agree with the reference on cylinders next to shapes of all kinds, where coal alone may be wrong."""
    rng = np.random.default_rng(4)
    for k in range(400):
        shapes = [Cylinder(*(0.05 * np.exp(0.5 * rng.normal(size=2))).tolist()) for _ in range(2)]
        shapes[1] = random_shape(rng, 0.06) if k % 2 else shapes[1]
        turns, way = [random_rotation(rng) for _ in shapes], 0.2 * direction(rng)
        one, two = lab.piece(shapes[0], (0, 0, 0), turns[0]), lab.piece(shapes[1], way, turns[1])
        found = lab.measure(one, two)
        gap = float(rng.choice([-1e-2, -1e-4, -1e-6, 1e-9, 1e-6, 1e-2]))
        place = way - (found.distance - gap) * found.normal
        found = lab.measure(one, lab.piece(shapes[1], place, turns[1]))
        distance, _, _ = apart(shapes[0], (np.zeros(3), turns[0]), shapes[1], (place, turns[1]))
        assert distance == pytest.approx(found.distance, abs=ASKED)


def test_cylinders_that_coal_has_no_normal_for():
    """Of two cylinders that touch, every query of coal has a normal along which they overlap by 8 cm."""
    turns = (
        Rotation.from_quat(turn, scalar_first=True)
        for turn in (
            (0.5251719927632265, -0.5144367030651386, 0.48322077129974494, -0.4754439427956273),
            (0.7690925916425706, 0.06588443186682218, 0.6324324143124519, -0.06469210496670673),
        )
    )
    one = (-0.19902261904403742, 0.011943990170979052, 0.05419375681701201), next(turns)
    two = (-0.09790527245565267, 0.08183073563219312, 0.07568101096966151), next(turns)
    distance, _, _ = apart(
        Cylinder(0.0539899373801372, 0.05510982207834194), one,
        Cylinder(0.070981266973162, 0.0302269013744767), two,
    )  # fmt: skip
    assert distance == pytest.approx(0.0, abs=1e-7)


def test_hulls_against_the_explicit_minkowski_difference():
    """Distance and depth of random elliptic hulls, near and deep, agree with the slow and obvious answer."""
    rng = np.random.default_rng(5)
    seen = []
    for _ in range(60):
        hulls = [np.array(elliptic_hull(tuple(np.sort(rng.uniform(0.007, 0.03, 3))[::-1]))) for _ in range(2)]
        turns = [random_rotation(rng) for _ in range(2)]
        way = rng.uniform(0.2, 2.2) * 0.02 * direction(rng)
        places = [np.zeros(3), way]
        world = [turn.apply(hull) + place for hull, turn, place in zip(hulls, turns, places)]
        truth, along = minkowski.signed_distance(*world)
        shapes = [Hull(tuple(map(tuple, hull.tolist()))) for hull in hulls]
        distance, normal, _ = apart(shapes[0], (places[0], turns[0]), shapes[1], (places[1], turns[1]))
        seen.append(truth)
        assert distance == pytest.approx(truth, abs=ASKED)
        # the normal separates: moving the second by the distance along it ends touching, whichever face it is
        gap = (world[1] @ normal).min() - (world[0] @ normal).max()
        assert gap == pytest.approx(truth, abs=ASKED)
        if abs(truth) > 1e-4:
            assert (world[1] @ along).min() - (world[0] @ along).max() == pytest.approx(truth, abs=ASKED)
    assert min(seen) < -0.005 < 0.005 < max(seen)


def crowd(lab, rng):
    """A crowd of all shapes in a small room, some bodies of several turned and shifted pieces."""
    shapes = (
        lambda: Sphere(rng.uniform(0.02, 0.06)),
        lambda: Box(tuple(rng.uniform(0.02, 0.08, 3))),
        lambda: Hull(elliptic_hull(tuple(rng.uniform(0.02, 0.07, 3)))),
        lambda: Ellipsoid(tuple(rng.uniform(0.02, 0.06, 3))),
        lambda: Capsule(*rng.uniform(0.02, 0.05, 2)),
        lambda: Cylinder(*rng.uniform(0.02, 0.05, 2)),
    )
    bodies = []
    for k in range(24):
        pieces = tuple(
            Piece(
                f"{k} {j}",
                shapes[rng.integers(len(shapes))](),
                tuple(rng.uniform(-0.1, 0.1, 3) * (j > 0)),
                tuple(random_rotation(rng).as_quat(scalar_first=True)),
            )
            for j in range(rng.integers(1, 4))
        )
        kind = "fixed" if k % 5 == 0 else "simulated"
        bodies.append(Body(f"b{k}", kind, "wood", pieces, 1.0, inertia=sphere_inertia(1.0, 0.1)))
    return lab.scene(*bodies, duration=4 / 60)


def pieces_at(body, position, quaternion):
    """Shapes and poses of a body's pieces."""
    turned = matrix(quaternion)
    return [
        (coal_shape(piece.shape), (turned @ matrix(piece.orientation), position + turned @ piece.position))
        for piece in body.pieces
    ]


@pytest.mark.parametrize("seed", [1, 2])
def test_the_broad_phase_misses_no_pair(lab, recordings, seed):
    """Frame by frame every body pair within the margin has the distance that trying all pairs finds."""
    rng = np.random.default_rng(seed)
    scenario = crowd(lab, rng)
    shape = (scenario.frame_count + 1, len(scenario.bodies))
    positions = rng.uniform(-0.35, 0.35, (*shape, 3))
    positions[:, 1] = positions[:, 0]  # two pieces at one place
    turns = Rotation.random(shape[0] * shape[1], rng=rng).as_quat(scalar_first=True).reshape(*shape, 4)
    found = measure(recordings.recording(scenario, position=positions, orientation=turns), scenario)
    assert set(found.distance) == set(scenario.touching_pairs())
    close = 0
    for (a, b), f in product(scenario.touching_pairs(), range(shape[0])):
        placed = [pieces_at(scenario.bodies[k], positions[f, k], tuple(turns[f, k])) for k in (a, b)]
        answers = [signed_distance(*one, *two) for one in placed[0] for two in placed[1]]
        least = min(answers, key=lambda answer: answer[0])
        if least[0] <= MARGIN:
            close += 1
            assert found.distance[a, b][f] == pytest.approx(least[0], abs=TIGHT)
            assert found.normal[a, b][f] == pytest.approx(least[1], abs=1e-3)
            assert found.point[a, b][f] == pytest.approx(least[2], abs=1e-3)
        else:
            assert found.distance[a, b][f] == np.inf
    assert close > 40


def test_pairs_that_are_asked_for_are_followed_anywhere(lab, recordings):
    """A pair asked for has its distance in every frame, however far; others are infinitely far there."""
    scenario = lab.scene(lab.ball("a"), lab.ball("b", (9.0, 0.0, 1.0)), lab.ground(), duration=2 / 60)
    found = measure(recordings.recording(scenario), scenario, [(0, 1)])
    assert found.distance[0, 1] == pytest.approx([8.9] * 3, abs=TIGHT)
    assert found.normal[0, 1] == pytest.approx(np.tile([1.0, 0.0, 0.0], (3, 1)), abs=1e-6)
    assert np.isinf(found.distance[0, 2]).all()
    assert np.isnan(found.normal[0, 2]).all()


def test_what_may_not_touch_is_not_measured(lab, recordings):
    """Fixed bodies among themselves and the links of one hand are no pairs, however deep they overlap."""
    slabs = [lab.block(name, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), kind="fixed") for name in "ab"]
    ball = lab.ball(position=(0.0, 0.0, 5.0))
    scenario = lab.scene(*slabs, ball, duration=1 / 60)
    found = measure(recordings.recording(scenario), scenario)
    assert set(found.distance) == {(0, 2), (1, 2)}
    assert found.overlap().tolist() == [0.0, 0.0]
    scene = catalogue()["ball_snip"]
    group = scene.groups()
    assert all(group[a] != group[b] or group[a] < 0 for a, b in scene.touching_pairs())


def test_overlap_is_of_the_deepest_pair(lab, recordings):
    """Per frame the overlap is the deepest pair's depth, and never negative."""
    scenario = lab.scene(lab.ball("a"), lab.ball("b"), lab.ground(), duration=3 / 60)
    positions = np.array(
        [
            [[0, 0, 1.0], [1, 0, 1.0], [0, 0, -0.5]],  # nothing touches
            [[0, 0, 0.03], [1, 0, 0.04], [0, 0, -0.5]],  # 20 mm and 10 mm in the ground
            [[0, 0, 1.0], [0.07, 0, 1.0], [0, 0, -0.5]],  # 30 mm in each other
            [[0, 0, 0.05], [0.1, 0, 0.05], [0, 0, -0.5]],  # touching
        ]
    )
    found = measure(recordings.recording(scenario, position=positions), scenario)
    assert found.overlap() == pytest.approx([0.0, 0.02, 0.03, 0.0], abs=TIGHT)


def any_shape(rng):
    """A shape of a few centimetres."""
    round_, long_ = rng.uniform(0.01, 0.04, 2)
    corners = rng.normal(size=(20, 3))
    corners *= rng.uniform(0.02, 0.05, 3) / np.linalg.norm(corners, axis=1, keepdims=True)
    kinds = (Ellipsoid, Box, Hull, Capsule, Cylinder, Cone)
    kind = kinds[rng.integers(len(kinds))]
    if kind in (Ellipsoid, Box):
        return kind(tuple(rng.uniform(0.015, 0.05, 3)))
    return Hull(tuple(map(tuple, corners))) if kind is Hull else kind(round_, long_)


def test_no_direction_contradicts_a_deep_overlap():
    """No gap along any of 300 directions is larger than the distance of 3,000 pairs: coal tells 91 mm for
    6 mm between an ellipsoid and a hull of 32 corners, in both orders and with any tolerance."""
    rng, deep = np.random.default_rng(3), 0
    ways = np.array([direction(rng) for _ in range(300)])
    for _ in range(3000):
        shapes = coal_shape(any_shape(rng)), coal_shape(any_shape(rng))
        first = (random_rotation(rng).as_matrix(), np.zeros(3))
        second = (random_rotation(rng).as_matrix(), 0.02 * rng.normal(size=3))
        found, _, _ = signed_distance(shapes[0], first, shapes[1], second)
        gaps, _ = gaps_along(shapes[0], first, shapes[1], second, ways)
        assert found > -1e-4 or gaps.max() <= found + ASKED
        deep += found < -1e-4
    assert deep > 2000


def test_a_face_that_is_not_the_nearest_is_not_taken():
    """Two cubes of a pyramid, nearly flat on each other: one way round coal tells 45 mm for 0.0127 mm."""
    half = Box((0.05, 0.05, 0.05))
    first = np.array(
        [
            [0.9999999957939156, -7.998186804897579e-05, -4.488952756769937e-05],
            [7.997883451562644e-05, 0.9999999945184704, -6.757547892512672e-05],
            [4.489493213467483e-05, 6.757188842880174e-05, 0.9999999967092426],
        ]
    )
    second = np.array(
        [
            [0.9999999980840111, -4.333168340412091e-05, -4.4207952227124346e-05],
            [4.332988089403316e-05, 0.9999999982300184, -4.0773578513120943e-05],
            [4.4209718936672466e-05, 4.077166290969465e-05, 0.9999999981915861],
        ]
    )
    below = (first, np.array([1.772690992097354e-05, -2.6052715478117825e-06, 0.5499169827392052]))
    above = (second, np.array([0.05501541041303344, -4.505619300687475e-06, 0.6499081217511099]))
    signs = np.array(list(product((-1, 1), repeat=3))) * 0.05
    true, _ = minkowski.signed_distance(*(signs @ turn.T + place for turn, place in (below, above)))
    found, normal, middle = signed_distance(coal_shape(half), below, coal_shape(half), above)
    assert found == pytest.approx(true, abs=ASKED)
    # from the lower to the upper cube, between both
    assert normal[2] == pytest.approx(1.0, abs=1e-6)
    assert middle[2] == pytest.approx(0.6, abs=1e-4)
    back, reverse, _ = signed_distance(coal_shape(half), above, coal_shape(half), below)
    assert (back, -reverse[2]) == (pytest.approx(true, abs=ASKED), pytest.approx(1.0, abs=1e-6))


def over_a_box(rng, k):
    """A box anywhere, and a shape of another kind whose lowest point is near one of its faces."""
    half, shape = tuple(rng.uniform(0.1, 0.3, 3)), ROUND_AND_FLAT[k % len(ROUND_AND_FLAT)]
    gap, lift = rng.choice([-5e-3, -1e-5, -1e-8, 0.0, 1e-8, 1e-5, 5e-3]), rng.uniform(-0.25, 0.25, 2)
    tilt = Rotation.from_rotvec(rng.choice([0.0, 1e-9, 1e-4, 1.0]) * direction(rng))
    down = tilt.as_matrix()[2]
    lowest = np.array(farthest(shape, -down)) @ down
    place = (*(lift * np.array(half[:2]) / 0.2), half[2] + gap - lowest)
    about, center = random_rotation(rng), rng.normal(size=3)
    poses = [(about.as_matrix(), center), ((about * tilt).as_matrix(), center + about.apply(place))]
    return (Box(half), shape), poses


def farthest(shape, way):
    """The farthest point of a shape along a direction in its own axes, by its corners or closed form."""
    match shape:
        case Sphere(radius):
            return radius * way
        case Box(half):
            return np.array(half) * np.sign(way)
        case Hull(vertices):
            return max(vertices, key=lambda vertex: np.dot(vertex, way))
        case Capsule(radius, half_length):
            return radius * way + np.array((0.0, 0.0, half_length * np.sign(way[2])))
        case Cylinder(radius, half_length):
            across = np.hypot(way[0], way[1])
            rim = radius * way[:2] / across if across > 0 else np.zeros(2)
            return np.array((*rim, half_length * np.sign(way[2])))
        case Ellipsoid(axes):
            return np.square(axes) * way / np.linalg.norm(np.array(axes) * way)


ROUND_AND_FLAT = (
    Box((0.03, 0.02, 0.04)),
    Sphere(0.03),
    Capsule(0.02, 0.03),
    Cylinder(0.03, 0.02),
    Ellipsoid((0.04, 0.03, 0.02)),
    Hull(elliptic_hull((0.04, 0.03, 0.03))),
)


def test_closed_forms_are_exact():
    """Shapes near faces of boxes: coal agrees, the normal separates by the distance, the point is between."""
    rng = np.random.default_rng(3)
    closed = 0
    for k in range(1500):
        shapes, poses = over_a_box(rng, k)
        order = slice(None, None, -1) if k % 3 == 0 else slice(None)
        shapes, poses = shapes[order], poses[order]
        sides = [Placed(shape, turn[None], place[None]) for shape, (turn, place) in zip(shapes, poses)]
        found = closed_distance(*sides)
        if np.isnan(found.distance[0]):
            continue
        closed += 1
        distance, _, _ = signed_distance(coal_shape(shapes[0]), poses[0], coal_shape(shapes[1]), poses[1])
        # coal is off by up to 4e-7 m where boxes or ellipsoids just touch; the shapes' own ends are exact.
        assert found.distance[0] == pytest.approx(distance, abs=ASKED), (shapes, poses)
        n = found.normal[0]
        ends = [
            sign * (turn @ farthest(shape, sign * turn.T @ n) + place) @ n
            for shape, (turn, place), sign in zip(shapes, poses, (1, -1))
        ]
        assert -ends[1] - ends[0] == pytest.approx(found.distance[0], abs=1e-12)
        middle = found.point[0] @ n
        assert middle == pytest.approx((ends[0] - ends[1]) / 2, abs=TIGHT)
    assert closed > 1000


@pytest.mark.parametrize(
    ("height", "tilt"),
    [
        # at some places coal's EPA ends at the lower side of the slab
        (0.5500000060629131, 7.570835163441521e-09),
        # at some, it fails
        (0.5500000201737203, -9.910084064836355e-08),
    ],
)
def test_a_box_that_touches_a_slab_has_no_deep_overlap(height, tilt):
    """Move a box over a slab within rounding, tilted by some nanoradians, where coal alone finds metres."""
    slab, box = Box((10.0, 10.0, 0.5)), Box((0.4, 0.35, 0.55))
    turn = Rotation.from_quat((1.0, 1e-14, tilt, 0.0), scalar_first=True)
    below = ((0.0, 0.0, -0.5), Rotation.identity())
    for x in np.linspace(1.0, 1.5, 300):
        distance, normal, _ = apart(slab, below, box, ((x, 0.0, height), turn))
        assert distance == pytest.approx(0.0, abs=TIGHT)
        assert normal[2] > 0.99
