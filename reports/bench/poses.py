"""Poses for `bench`: single pairs by family, and motions frame by frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.detectors import REFERENCE, Pair, load
from touchstone.reports.studies.narrow_phase.study import corners, elliptic, parted_pair, random_box
from touchstone.scenarios.avatar.driven_poses import driven_pieces, moved
from touchstone.scenarios.avatar.hand import FINGERS, hand_parts
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, Box, Hull, Piece, Scenario, Tracker, Vector

SMALL = 0.01
"""Ratio of the small hull's size to the large one's [1]: a ball beside a table."""
DEPTHS = (0.02, 0.5)
"""Range of the overlap over the depth of the pieces before they are moved apart [1]."""
GAPS = (-3.0, 0.0)
"""Range of the powers of ten of gaps between separated pieces [m]."""


def _overlap(rng: np.random.Generator) -> Callable[[float], float]:
    share = rng.uniform(*DEPTHS)
    return lambda depth: -share * depth


def _gap(rng: np.random.Generator) -> Callable[[float], float]:
    gap = float(10 ** rng.uniform(*GAPS))
    return lambda depth: gap


def hulls_overlapping(rng: np.random.Generator) -> Pair:
    """Two elliptic hulls of 80 triangles, overlapping by 2 to 50 % of their depth."""
    return parted_pair(rng, elliptic(rng), elliptic(rng), _overlap(rng))


def hulls_apart(rng: np.random.Generator) -> Pair:
    """Two elliptic hulls, 1 mm to 1 m apart."""
    return parted_pair(rng, elliptic(rng), elliptic(rng), _gap(rng))


def boxes_overlapping(rng: np.random.Generator) -> Pair:
    """Two boxes, overlapping as the hulls do."""
    return parted_pair(rng, random_box(rng), random_box(rng), _overlap(rng))


def small_and_large(rng: np.random.Generator) -> Pair:
    """A hull and one a hundredth of its size, with the same relative overlaps."""
    return parted_pair(rng, elliptic(rng), elliptic(rng, SMALL), _overlap(rng))


FAMILIES: dict[str, Callable[[np.random.Generator], Pair]] = {
    "hulls overlapping": hulls_overlapping,
    "hulls apart": hulls_apart,
    "boxes overlapping": boxes_overlapping,
    "small and large": small_and_large,
}

STEP = 1e-3
"""The hand's displacement per frame [m]: 6 cm/s."""
SINK = 5e-3
"""Depth of the lowest point in the table when the hand neither rocks nor bobs [m]."""
ROCK, BOB, PERIOD = 0.02, 1.5e-3, 60
"""Amplitudes of pitch and roll [rad] and of height [m], and frames per cycle: a real hand does not slide
rigidly level."""
THUMB, FINGER = (-0.25, 0.2, 0.1), (0.01, 0.01, 0.01)
"""Angles of the hinges [rad]: the hand lies flat, each part within a few millimetres of the surface, like all
pairs that a broad phase reports."""
TABLE = Piece("table", Box((0.6, 0.4, 0.02)), (0.0, 0.0, -0.02))
"""The table, with its surface at z = 0."""
START = -0.1
"""Initial x of the palm [m]."""


def hand_slide(frames: int) -> list[list[Pair]]:
    """Pairs of the fifteen parts of the hand with the table over which it slides, frame by frame."""
    parts = _resting_hand()
    motion = []
    for k in range(frames):
        phase = 2 * np.pi * k / PERIOD
        rock = Rotation.from_euler("xy", (ROCK * np.sin(phase), ROCK * np.cos(1.7 * phase)))
        shift = np.array([START + STEP * k, 0.0, BOB * np.sin(1.3 * phase)])
        motion.append([(moved(part, rock, shift), TABLE) for part in parts])
    return motion


def _resting_hand() -> list[Piece]:
    """The parts about the palm's x and y, at the height at which the lowest sinks by SINK."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    origin, upright = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    angles = tuple(a for finger in FINGERS for a in (THUMB if finger == "thumb" else FINGER))
    tracker = Tracker("palm", names, (0.0, 1.0), (origin,) * 2, (upright,) * 2, (angles,) * 2)
    table = Body("table", "fixed", "wood", (TABLE,))
    scenario = Scenario(
        "hand_slide", "", (), (table, *links), 1.0, TABLE_1, joints=joints, trackers=(tracker,)
    )
    parts = driven_pieces(scenario)
    height = -SINK - min(float(corners(part)[:, 2].min()) for part in parts)
    return [moved(part, Rotation.identity(), np.array([0.0, 0.0, height])) for part in parts]


HALF_AXES: Vector = (0.6, 0.5, 0.4)
"""Half axes of the hulls of many vertices [m]."""
NEAR = 0.75
"""Distance of their centres before they are moved into touch [m]: they overlap in any orientation."""
TOUCH_DEPTH, TURN = 5e-3, 5e-4
"""Overlap in the first frame [m], and rotation of one hull per frame [rad] while it slides by STEP."""


def hull_slide(vertices: int, pairs: int, frames: int, rng: np.random.Generator) -> list[list[Pair]]:
    """Pairs of touching hulls of `vertices` vertices, one sliding past the other and turning a little."""
    hull = Piece("hull", Hull(spread_vertices(vertices)))
    turns = Rotation.from_quat(rng.normal(size=(pairs, 2, 4)).reshape(-1, 4))
    sides, axes = (_directions(rng, pairs) for _ in range(2))
    near = [
        (moved(hull, turns[2 * k], np.zeros(3)), moved(hull, turns[2 * k + 1], NEAR * sides[k]))
        for k in range(pairs)
    ]
    # Along the deepest face's normal the depth changes as far as B moves.
    batch = load(REFERENCE).prepare(near)
    batch.ask()
    distance, normal = batch.answers().distance, batch.answers().normal
    start = NEAR * sides - (TOUCH_DEPTH + distance)[:, None] * normal
    ways = np.cross(normal, _directions(rng, pairs))
    ways *= STEP / np.linalg.norm(ways, axis=1, keepdims=True)
    return [
        [
            (near[k][0], moved(hull, Rotation.from_rotvec(f * TURN * axes[k]) * turns[2 * k + 1], place))
            for k, place in enumerate(start + f * ways)
        ]
        for f in range(frames)
    ]


def _directions(rng: np.random.Generator, count: int) -> Array:
    ways = rng.normal(size=(count, 3))
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def spread_vertices(count: int) -> tuple[Vector, ...]:
    """Points spread evenly over an ellipsoid by the golden angle, all vertices of their convex hull."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    across = np.sqrt(1 - z * z)
    points = np.column_stack([across * np.cos(turn), across * np.sin(turn), z]) * HALF_AXES
    return tuple((float(x), float(y), float(z)) for x, y, z in points)
