"""Pairs of convex pieces for the narrow-phase study: random and adversarial poses, by family.

Sizes are about 1 m. Moving B along the normal of the deepest face changes the depth by the same amount, so
one evaluation of the explicit Minkowski difference gives any requested depth or gap.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.detectors import Pair
from touchstone.adapters.oracles.minkowski import core, signed_distance
from touchstone.scenarios.scenario import Box, Hull, Piece, Shape
from touchstone.scenarios.solids import elliptic_hull

ELLIPTIC, FINE, RANDOM = 12, 4, 16
"""Numbers of hulls to draw from: of 80 triangles, of 320 triangles, and of 6 to 40 random points. They are
few because an engine loads a mesh in the time of a thousand queries or more."""
TOUCH = 1e-6
"""Depth or gap of a shallow touch, over the size [1]."""
NEEDLE = 0.01
"""Thickness of a needle over its length [1]."""
RATIO_POWERS = (3.0, 6.0)
"""Range of the powers of ten of the size of the large piece over the small one's [1]."""


def corners(piece: Piece) -> Array:
    """World vertices (n, 3) of a box or a hull [m]."""
    return core(piece)[0]


def size_of(pair: Pair) -> float:
    """Longest side of the two pieces' bounding boxes in the world [m]."""
    return max(float(np.ptp(corners(piece), axis=0).max()) for piece in pair)


class Shapes:
    """Shapes to draw from, created once."""

    def __init__(self, rng: np.random.Generator) -> None:
        fine = _subdivided(np.array(elliptic_hull((1.0, 1.0, 1.0))))
        self._hulls = [elliptic_hull(_axes(rng)) for _ in range(ELLIPTIC)]
        self._hulls += [_vertices(fine * _axes(rng)) for _ in range(FINE)]
        for _ in range(RANDOM):
            points = rng.normal(size=(rng.integers(6, 41), 3)) * 0.5
            self._hulls.append(_vertices(points[ConvexHull(points).vertices]))

    def draw(self, rng: np.random.Generator) -> Shape:
        """A box with probability 1/3, else one of the hulls."""
        if rng.random() < 1 / 3:
            return Box(_axes(rng))
        return Hull(self._hulls[rng.integers(len(self._hulls))])


def _axes(rng: np.random.Generator) -> tuple[float, float, float]:
    x, y, z = np.exp(rng.normal(size=3) * 0.4) * 0.5
    return float(x), float(y), float(z)


def _vertices(points: Array) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points)


def _subdivided(points: Array) -> Array:
    """The vertices of a convex polyhedron on the unit sphere, and its edge midpoints projected onto it."""
    simplices = ConvexHull(points).simplices
    edges = {tuple(sorted((int(s[i]), int(s[j])))) for s in simplices for i, j in ((0, 1), (1, 2), (2, 0))}
    finer = np.vstack([points, [points[i] + points[j] for i, j in sorted(edges)]])
    return np.asarray(finer / np.linalg.norm(finer, axis=1, keepdims=True))


def _posed(shape: Shape, position: Sequence[float] | Array, turn: Rotation) -> Piece:
    x, y, z = map(float, position)
    qw, qx, qy, qz = turn.as_quat(scalar_first=True).tolist()
    return Piece("piece", shape, (x, y, z), (qw, qx, qy, qz))


def _turn(rng: np.random.Generator) -> Rotation:
    return Rotation.from_quat(rng.normal(size=4))


def _moved(piece: Piece, shift: Array) -> Piece:
    x, y, z = (np.array(piece.position) + shift).tolist()
    return replace(piece, position=(x, y, z))


def _parted(pair: Pair, gap: Callable[[float], float]) -> Pair:
    """The pair with B moved along the deepest face's normal, so that an overlapping pair of depth d gets
    distance gap(d) [m]."""
    a, b = pair
    distance, normal = signed_distance(corners(a), corners(b))
    return (a, _moved(b, (gap(-distance) - distance) * normal)) if distance < 0 else pair


def _overlapping(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Overlapping pieces whose centres are near each other."""
    a = _posed(shapes.draw(rng), rng.normal(size=3), _turn(rng))
    b = _posed(shapes.draw(rng), np.array(a.position) + 0.05 * rng.normal(size=3), _turn(rng))
    return a, b


def parted_pair(rng: np.random.Generator, one: Shape, two: Shape, gap: Callable[[float], float]) -> Pair:
    """Two shapes with random orientations and overlapping centres, separated along the deepest face's normal
    so that depth d becomes distance gap(d) [m]."""
    a, b = (_posed(shape, rng.normal(size=3), _turn(rng)) for shape in (one, two))
    return _parted((a, replace(b, position=a.position)), gap)


def elliptic(rng: np.random.Generator, scale: float = 1.0) -> Hull:
    """An elliptic hull of 80 triangles, about 1 m in size times `scale`."""
    x, y, z = (scale * axis for axis in _axes(rng))
    return Hull(elliptic_hull((x, y, z)))


def random_box(rng: np.random.Generator) -> Box:
    """A box about 1 m in size."""
    return Box(_axes(rng))


def overlap(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Pieces that overlap by 2 to 50 % of their depth with nearby centres."""
    share = rng.uniform(0.02, 0.5)
    return _parted(_overlapping(rng, shapes), lambda depth: -share * depth)


def apart(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Pieces 1 mm to 1 m apart."""
    gap = 10 ** rng.uniform(-3, 0)
    return _parted(_overlapping(rng, shapes), lambda depth: gap)


def deep(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Deeply overlapping pieces, with nearby centres."""
    return _overlapping(rng, shapes)


def touch(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Touching pieces: a millionth of the size deep, or apart."""
    pair = _overlapping(rng, shapes)
    gap = rng.choice((-TOUCH, TOUCH)) * size_of(pair)
    return _parted(pair, lambda depth: gap)


def face_face(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Boxes with common axes, in half of all cases also with flush sides, 0.1 mm to 0.1 m deep."""
    half_a, half_b = np.array(_axes(rng)), np.array(_axes(rng))
    if rng.random() < 0.5:
        half_b[:2] = half_a[:2]
    depth = 10 ** rng.uniform(-4, -1)
    slide = rng.uniform(-0.3, 0.3, size=2) * (half_a + half_b)[:2] * (rng.random() < 0.5)
    return _boxes(rng, half_a, half_b, np.append(slide, half_a[2] + half_b[2] - depth))


def edge_edge(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """Square bars with parallel edges in contact, 0.1 mm to 0.1 m deep or apart; two faces are equally
    deep."""
    half_a, half_b = np.array(_axes(rng)), np.array(_axes(rng))
    half_a[1], half_b[1] = half_a[0], half_b[0]
    depth = rng.choice((-1.0, 1.0)) * 10 ** rng.uniform(-4, -1)
    reach = half_a[0] + half_b[0] - depth
    return _boxes(rng, half_a, half_b, np.array([reach, reach, 0.3 * rng.normal()]))


def _boxes(rng: np.random.Generator, half_a: Array, half_b: Array, shift: Array) -> Pair:
    """Boxes with common axes, rotated together with probability 3/4."""
    turn = _turn(rng) if rng.random() < 0.75 else Rotation.identity()
    one, two = (Box((float(x), float(y), float(z))) for x, y, z in (half_a, half_b))
    return _posed(one, (0.0, 0.0, 0.0), turn), _posed(two, turn.apply(shift), turn)


def needle(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """A bar or a hull a hundred times as long as thick, overlapping another or any piece."""
    axes = (1.0, NEEDLE, NEEDLE)
    needles: tuple[Shape, Shape] = (Box(axes), Hull(elliptic_hull(axes)))
    one = needles[rng.integers(2)]
    two = needles[rng.integers(2)] if rng.random() < 0.5 else shapes.draw(rng)
    position = 0.01 * rng.normal(size=3) + rng.uniform(-0.5, 0.5) * np.eye(3)[0]
    share = rng.uniform(0.02, 0.9)
    pair = _posed(one, (0.0, 0.0, 0.0), Rotation.identity()), _posed(two, position, _turn(rng))
    return _parted(pair, lambda depth: -share * depth)


def size_ratio(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """A box a thousandth to a millionth of the other's size, at a face, an edge or a vertex of it."""
    large = _posed(shapes.draw(rng), (0.0, 0.0, 0.0), _turn(rng))
    half = np.array(_axes(rng)) * 10 ** -rng.uniform(*RATIO_POWERS)
    points = corners(large)
    simplices = ConvexHull(points).simplices
    weights = rng.random(3) * (rng.permutation(3) < rng.integers(1, 4))
    place = weights / weights.sum() @ points[simplices[rng.integers(len(simplices))]]
    small = Box((float(half[0]), float(half[1]), float(half[2])))
    return large, _posed(small, place + rng.uniform(-0.7, 0.7, size=3) * half, _turn(rng))


def coincident(rng: np.random.Generator, shapes: Shapes) -> Pair:
    """A piece and its copy in the same place."""
    piece = _posed(shapes.draw(rng), rng.normal(size=3), _turn(rng))
    return piece, piece


FAMILIES: dict[str, Callable[[np.random.Generator, Shapes], Pair]] = {
    "overlap": overlap,
    "apart": apart,
    "deep": deep,
    "touch": touch,
    "face-face": face_face,
    "edge-edge": edge_edge,
    "needle": needle,
    "size-ratio": size_ratio,
    "coincident": coincident,
}


def draw(count: int, rng: np.random.Generator) -> list[tuple[str, Pair]]:
    """`count` pairs with the names of their families; families alternate, so that any stretch contains all of
    them."""
    shapes = Shapes(rng)
    names = list(FAMILIES)
    return [(name, FAMILIES[name](rng, shapes)) for name in (names[k % len(names)] for k in range(count))]
