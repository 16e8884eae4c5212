"""Convex depth on adversarial poses, under motions that change nothing, and next to round surfaces."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reports.studies.narrow_phase.study import FAMILIES, Shapes, size_of
from touchstone.scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Piece, Sphere

EXACT = 1e-11
"""Allowed error over max(depth, a thousandth of the size), as in the study."""
QUICK_PAIRS, SLOW_PAIRS = 40, 1100
"""Pairs of a family in a usual and in a slow run; nine families make 10,000."""


@pytest.mark.parametrize("pairs", [QUICK_PAIRS, pytest.param(SLOW_PAIRS, marks=pytest.mark.slow)])
@pytest.mark.parametrize("family", FAMILIES)
def test_adversarial_families(lab: SimpleNamespace, family: str, pairs: int) -> None:
    """Agree with the oracle, converged, on touching, coincident, coplanar, needle-thin and tiny pieces."""
    rng = np.random.default_rng(2004)
    shapes = Shapes(rng)
    for _ in range(pairs):
        pair = FAMILIES[family](rng, shapes)
        truth, _ = signed_distance(*map(lab.corners, pair))
        found, size = lab.measure(*pair), size_of(pair)
        assert found.converged
        assert abs(found.distance - truth) <= EXACT * max(-truth, 1e-3 * size)
        gap = found.point_b - found.point_a - found.distance * found.normal
        # the direction to a pair of points is known to rounding over APART = 1e-3 of the size, and GJK stops
        # at 1e-15 of the distance: across a tiny piece that is 1e-9 of the size
        assert np.linalg.norm(gap) <= (1e-9 if family == "size-ratio" else EXACT) * size


def box(half, position, quaternion) -> Piece:
    """A box in the world."""
    return Piece("box", Box(half), position, quaternion)


COUNTEREXAMPLES = {
    # study, seed 0, pair 457: a face's normal from two long edges of a sliver overestimated by 4e-12 m
    "sliver": (
        box(
            (0.772981702027165, 0.7489928096849173, 0.3915311446280262),
            (0.0, 0.0, 0.0),
            (0.32516418651860607, -0.9091821668769103, 0.1937108894665666, -0.17358608970989237),
        ),
        box(
            (3.099514712838505e-07, 1.0362851539992157e-06, 1.347908715455474e-06),
            (-0.6620248199410977, 0.6887630774350431, 0.6317569772279221),
            (0.39101738599450847, 0.24983714036834795, -0.25834497101326154, -0.8473161647783812),
        ),
    ),
    # study, seed 2, pair 3238: EPA ended 8e-14 m early
    "early": (
        box(
            (0.4748117006900608, 0.5791347939539453, 0.2942929814385554),
            (0.0, 0.0, 0.0),
            (0.2065676257096949, -0.8603403750991573, -0.3786043824345245, -0.27166703256794544),
        ),
        box(
            (2.4033106360177135e-06, 2.843710265482942e-06, 3.9703753624581605e-06),
            (-0.2970715636273232, -0.4730322710517102, -0.08284868498865308),
            (0.6188915108703436, 0.19693776107450123, -0.7079291198939048, -0.27753410104314624),
        ),
    ),
    # study, seed 1, pair 4318: GJK was right and stuck with a normal 1e-5 rad off
    "stuck": (
        box(
            (0.36562725366240806, 0.6881699938092057, 0.500369385637546),
            (0.0, 0.0, 0.0),
            (0.6108734067419668, -0.5955117308199843, -0.5216926309462827, -0.006021478854547351),
        ),
        box(
            (1.8103843068662258e-06, 1.0506132345188757e-06, 2.266275827549442e-06),
            (-0.20971360848613504, -0.041162134995412415, 0.7547104817491711),
            (-0.5680939540487637, 0.8211896355098867, 0.053404452742685384, -0.008050237986228797),
        ),
    ),
    # hard_tiles_64, `accurate`, 1/30 s: GJK's second search from a simplex of 2e-15 m ended 1.3e-6 m away
    "corner": (
        box((0.03125, 0.5, 0.1), (1.28125, 0.0, -0.1), (1.0, 0.0, 0.0, 0.0)),
        box(
            (0.05, 0.05, 0.05),
            (1.2000000000000008, -2.9173966222745976e-18, 0.05000000000000382),
            (1.0, 6.598367191586591e-16, 2.569174920529001e-14, -4.376094933501205e-17),
        ),
    ),
    # study, seed 0, pair 3369: right to 2e-16 m at a gap of 1.6e-6 m, and called unconverged
    "touching": (
        box(
            (0.2862103665989819, 0.59461352961649, 0.55359395436632),
            (-1.2707403178970333, -0.44966929245229376, 0.15978395604614798),
            (0.15556014481920413, -0.9057868475800271, 0.3500028281229419, 0.18124361616566595),
        ),
        box(
            (0.3197803957665613, 0.32880114613476796, 0.5130850110469071),
            (-1.8516676041064617, 0.09788116820288284, 0.22625899174974012),
            (-0.920424101760199, -0.013557546013381898, -0.10067217570657616, -0.37749275341856614),
        ),
    ),
}


@pytest.mark.parametrize("name", COUNTEREXAMPLES)
def test_counterexamples(lab: SimpleNamespace, name: str) -> None:
    """Keep right, and told so, what was once wrong."""
    pair = COUNTEREXAMPLES[name]
    truth, _ = signed_distance(*map(lab.corners, pair))
    found = lab.measure(*pair)
    assert found.converged
    assert abs(found.distance - truth) <= EXACT * max(-truth, 1e-3 * size_of(pair))


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_flush_boxes_touch(lab: SimpleNamespace, axes: int) -> None:
    """Boxes whose faces, edges or corners coincide up to rounding have distance 0, whatever the rounding."""
    rng = np.random.default_rng(axes)
    for _ in range(300):
        one, two = rng.uniform(0.02, 0.5, (2, 3))
        offset = rng.uniform(-1.0, 1.0, 3) * np.abs(one - two)
        offset[:axes] = (one + two)[:axes] * rng.choice([-1.0, 1.0], axes)
        offset += rng.normal(size=3) * 10 ** rng.uniform(-17.0, -12.0)
        tilt = Rotation.from_rotvec(rng.normal(size=3) * 10 ** rng.uniform(-17.0, -12.0))
        turn = Rotation.random(rng=rng) if rng.random() < 0.5 else Rotation.identity()
        boxes = [
            box(tuple(half.tolist()), tuple(place.tolist()), tuple(own.as_quat(scalar_first=True).tolist()))
            for half, place, own in ((one, np.zeros(3), turn), (two, turn.apply(offset), turn * tilt))
        ]
        found, size = lab.measure(*boxes), size_of((boxes[0], boxes[1]))
        assert found.converged
        assert abs(found.distance) <= EXACT * size
        gap = found.point_b - found.point_a - found.distance * found.normal
        assert np.linalg.norm(gap) <= EXACT * size


def moved(piece: Piece, turn: Rotation, shift: np.ndarray) -> Piece:
    """A piece turned about the world's origin, then shifted."""
    own = Rotation.from_quat(np.array(piece.orientation), scalar_first=True)
    position = tuple((turn.apply(piece.position) + shift).tolist())
    return replace(piece, position=position, orientation=tuple((turn * own).as_quat(scalar_first=True)))


def scaled(piece: Piece, factors: np.ndarray) -> Piece:
    """A piece in a world scaled along its axes: by one factor, or by -1 along x."""
    turn = Rotation.from_quat(np.array(piece.orientation), scalar_first=True).as_matrix()
    signs = np.sign(factors)
    quaternion = Rotation.from_matrix(signs[:, None] * turn * signs).as_quat(scalar_first=True)
    match piece.shape:
        case Box(half):
            shape: Box | Hull = Box(tuple((half * np.abs(factors)).tolist()))
        case Hull(vertices):
            shape = Hull(tuple(map(tuple, (np.array(vertices) * factors).tolist())))
    position = tuple((np.array(piece.position) * factors).tolist())
    return replace(piece, shape=shape, position=position, orientation=tuple(quaternion.tolist()))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(family=st.sampled_from(list(FAMILIES)), seed=st.integers(0, 10**6))
def test_depth_does_not_depend_on_the_frame(lab: SimpleNamespace, family: str, seed: int) -> None:
    """Give the same distance swapped, turned, shifted and mirrored, and 1000 times it at that scale."""
    rng = np.random.default_rng(seed)
    a, b = FAMILIES[family](rng, Shapes(np.random.default_rng(0)))
    distance, size = lab.measure(a, b).distance, size_of((a, b))
    turn, shift = Rotation.from_quat(rng.normal(size=4)), rng.normal(size=3) * size
    mirror = np.array([-1.0, 1.0, 1.0])
    others = {
        "swapped": (1.0, b, a),
        "moved": (1.0, moved(a, turn, shift), moved(b, turn, shift)),
        "mirrored": (1.0, scaled(a, mirror), scaled(b, mirror)),
        "larger": (1e3, scaled(a, np.full(3, 1e3)), scaled(b, np.full(3, 1e3))),
        "smaller": (1e-3, scaled(a, np.full(3, 1e-3)), scaled(b, np.full(3, 1e-3))),
    }
    for name, (factor, one, two) in others.items():
        found = lab.measure(one, two)
        assert found.converged, name
        # poses are rounded again: a few roundings of positions and turns, over the same floor as above
        assert abs(found.distance / factor - distance) <= EXACT * max(-distance, 1e-3 * size), name


def tip(shape, turn: Rotation, n: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A point of the shape whose outward normal is n; of a box' face, which n is of, any inner point."""
    d = turn.inv().apply(n)
    match shape:
        case Sphere(radius):
            point = radius * d
        case Capsule(radius, half_length):
            point = radius * d + np.array([0.0, 0.0, np.copysign(half_length, d[2])])
        case Ellipsoid(half_axes):
            axes = np.array(half_axes)
            point = axes**2 * d / np.linalg.norm(axes * d)
        case Box(half_extents):
            inner = np.abs(d) < 0.5
            point = np.where(inner, rng.uniform(-0.9, 0.9, size=3), np.sign(d)) * half_extents
    return turn.apply(point)


def round_shape(kind: str, rng: np.random.Generator):
    """A shape of about 1 m."""
    x, y, z = np.exp(rng.normal(size=3) * 0.4).tolist()
    shapes = {
        "sphere": Sphere(x),
        "capsule": Capsule(x, y),
        "ellipsoid": Ellipsoid((x, y, z)),
        "box": Box((x, y, z)),
    }
    return shapes[kind]


ROUND_PAIRS = [
    ("sphere", "sphere"),
    ("sphere", "capsule"),
    ("sphere", "box"),
    ("capsule", "capsule"),
    ("capsule", "box"),
    ("ellipsoid", "sphere"),
    ("ellipsoid", "capsule"),
    ("ellipsoid", "ellipsoid"),
    ("ellipsoid", "box"),
]
GAPS = (0.1, 1e-3, 1e-6, 1e-8, 1e-10, 1e-12, 0.0, -1e-12, -1e-9, -1e-6, -1e-3, -1e-2)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("kinds", ROUND_PAIRS)
def test_round_pieces_near_contact(lab: SimpleNamespace, kinds: tuple[str, str], gap: float) -> None:
    """Measure a known gap or depth between points with opposite normals, where pieces are strictly convex."""
    rng = np.random.default_rng(7)
    for _ in range(10):
        shapes = [round_shape(kind, rng) for kind in kinds]
        turns = [Rotation.from_quat(rng.normal(size=4)) for _ in kinds]
        n = rng.normal(size=3)
        if kinds[1] == "box":
            n = turns[1].apply(np.eye(3)[rng.integers(3)])
        n /= np.linalg.norm(n)
        shift = tip(shapes[0], turns[0], n, rng) - tip(shapes[1], turns[1], -n, rng) + gap * n
        found = lab.measure(lab.piece(shapes[0], (0, 0, 0), turns[0]), lab.piece(shapes[1], shift, turns[1]))
        assert found.converged
        # STAGNATION of the pair's size, at most some 10 m
        assert abs(found.distance - gap) <= 1e-11
        # a depth known to 1e-12 of the size leaves its root to the normal
        assert np.linalg.norm(found.normal - n) <= 1e-5
        parted = found.point_b - found.point_a - found.distance * found.normal
        assert np.linalg.norm(parted) <= 1e-5


@pytest.mark.parametrize(
    ("half_axes", "converged", "error"),
    [
        ((1.0, 0.8, 0.6), True, 1e-12),
        # nearly a ball: 256 vertices prove little, and find a direction that is nearly as good
        ((1.0, 0.999, 0.998), False, 1e-4),
        ((1.0, 1.0, 1.0), False, 1e-12),
    ],
)
def test_an_ellipsoid_in_its_twin(lab: SimpleNamespace, half_axes, converged: bool, error: float) -> None:
    """Part concentric ellipsoids by twice the least half axis, never by less, and say what is not proven."""
    twin = lab.piece(Ellipsoid(half_axes))
    found = lab.measure(twin, twin)
    assert found.converged == converged
    # a reach is never less than the depth but for rounding
    assert -1e-15 <= -found.distance - 2 * min(half_axes) <= error
