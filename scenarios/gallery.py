"""Art gallery of the scenes: two rooms joined by a doorway, with twenty objects.

The west room contains `table`, whose top is centred above the world's origin; the floor's upper face is
z = 0. Bodies that are not convex (tables, frames, the ring, the partition with its doorway) are unions of
convex pieces; sculptures have hundreds of triangles each. All bodies are fixed and of one material.
"""

from itertools import pairwise
from math import cos, pi, sin
from typing import Any

import numpy as np

from touchstone.scenarios.avatar.avatar import Parts
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Hull,
    Joint,
    Piece,
    Scenario,
    Tracker,
    Vector,
    vector,
)

WEST, DOOR, EAST = -2.5, 2.5, 6.65
"""Inner faces of the west wall, of the partition in the west room, and of the east wall: x [m]."""
NORTH, SOUTH = 2.2, -2.2
"""Inner faces of the long walls: y [m]."""
HEIGHT = 2.8
WALL = 0.15
"""Height and thickness of the walls [m]."""
DOORWAY: tuple[float, float] = (0.6, 2.1)
"""Half its width and its height [m]."""
TABLE_TOP = 0.75
"""Height of the tables' surfaces [m]."""
TABLE_HALF: Vector = (0.6, 0.4, 0.02)
"""Half extents of a table's top [m]."""
LEG_HALF: Vector = (0.03, 0.03, 0.355)
PEDESTAL_HEIGHT = 1.0
GOLDEN_TURN = pi * (3 - 5**0.5)
"""Angle between successive points of a spiral that covers a sphere evenly [rad]."""

Pieces = tuple[Piece, ...]


def gallery_scene(
    name: str,
    summary: str,
    parts: Parts | tuple[tuple[Body, ...], tuple[Joint, ...]],
    tracker: Tracker,
    *others: Body,
    material: str = "wood",
    **fields: Any,
) -> Scenario:
    """A scene in the gallery as long as its tracker: a person or a hand (bodies, joints, and chains if it has
    any) and other bodies."""
    bodies, joints, *chains = parts
    given: dict[str, Any] = {"frame_rate": 60, "seed": 5, "chains": chains[0] if chains else ()}
    return Scenario(
        name=name,
        summary=summary,
        tags=("gallery",),
        bodies=(*gallery(material), *bodies, *others),
        joints=joints,
        trackers=(tracker,),
        coefficients=TABLE_1,
        duration=tracker.times[-1],
        **given | fields,
    )


def gallery(material: str = "wood") -> tuple[Body, ...]:
    """Floor, walls, partition and the twenty objects."""
    pedestals = {"pedestal_1": (-1.9, 1.6), "pedestal_2": (-1.9, -1.6), "pedestal_3": (3.3, 1.6)}
    parts: dict[str, Pieces] = {
        **_building(),
        "table": _table((0.0, 0.0)),
        "side_table": _table((3.6, -1.7)),
        "bench": _bench((0.0, 1.6)),
        "long_bench": _bench((4.6, 0.0)),
        **{name: _pedestal(place) for name, place in pedestals.items()},
        "plinth": (_box("plinth", (0.3, 0.3, 0.15), (1.7, -1.6, 0.15)),),
        "gem": _stone("gem", 160, (0.16, 0.16, 0.22), (-1.9, 1.6, PEDESTAL_HEIGHT + 0.22)),
        "pebbles": (
            *_stone("lower_pebble", 120, (0.17, 0.14, 0.07), (-1.9, -1.6, PEDESTAL_HEIGHT + 0.07)),
            *_stone("upper_pebble", 120, (0.11, 0.12, 0.06), (-1.9, -1.6, PEDESTAL_HEIGHT + 0.2)),
        ),
        "ring": _ring((1.7, -1.6, 0.75), 0.36, 0.09, 14),
        "egg": _stone("egg", 160, (0.13, 0.13, 0.19), (3.3, 1.6, PEDESTAL_HEIGHT + 0.19)),
        "twist": _twist((5.9, -1.7), 0.16, 10),
        "frame_1": _frame((-1.1, NORTH - 0.02, 1.5), 0.35, 0.25, "y"),
        "frame_2": _frame((1.3, NORTH - 0.02, 1.5), 0.3, 0.4, "y"),
        "frame_3": _frame((0.0, SOUTH + 0.02, 1.5), 0.5, 0.35, "y"),
        "frame_4": _frame((WEST + 0.02, 0.0, 1.5), 0.6, 0.4, "x"),
        "frame_5": _frame((3.6, SOUTH + 0.02, 1.6), 0.4, 0.3, "y"),
        "frame_6": _frame((4.3, NORTH - 0.02, 1.6), 0.4, 0.3, "y"),
        "frame_7": _frame((EAST - 0.02, -1.7, 1.6), 0.25, 0.35, "x"),
    }
    return tuple(Body(name, "fixed", material, pieces) for name, pieces in parts.items())


def _box(name: str, half_extents: Vector, position: Vector) -> Piece:
    return Piece(name, Box(half_extents), position)


def _building() -> dict[str, Pieces]:
    """Floor and walls; the partition is a wall on each side of the doorway and a lintel above it."""
    far = EAST + WALL
    middle, half_length, half_width = (WEST - WALL + far) / 2, (far - WEST + WALL) / 2, NORTH + WALL
    up, thick = HEIGHT / 2, WALL / 2
    door, top = DOORWAY
    beside = (NORTH - door) / 2
    sides = {"north": 1, "south": -1}
    across = DOOR + thick
    return {
        "floor": (_box("floor", (half_length, half_width, 0.1), (middle, 0.0, -0.1)),),
        **{
            f"{side}_wall": (_box("wall", (half_length, thick, up), (middle, sign * (NORTH + thick), up)),)
            for side, sign in sides.items()
        },
        "west_wall": (_box("wall", (thick, NORTH, up), (WEST - thick, 0.0, up)),),
        "east_wall": (_box("wall", (thick, NORTH, up), (EAST + thick, 0.0, up)),),
        "partition": (
            *(
                _box(side, (thick, beside, up), (across, sign * (door + beside), up))
                for side, sign in sides.items()
            ),
            _box("lintel", (thick, door, (HEIGHT - top) / 2), (across, 0.0, (HEIGHT + top) / 2)),
        ),
    }


def _table(place: tuple[float, float]) -> Pieces:
    x, y = place
    corners = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    legs = (
        _box(f"leg_{k}", LEG_HALF, (x + 0.5 * i, y + 0.3 * j, LEG_HALF[2]))
        for k, (i, j) in enumerate(corners)
    )
    return (_box("top", TABLE_HALF, (x, y, TABLE_TOP - TABLE_HALF[2])), *legs)


def _bench(place: tuple[float, float]) -> Pieces:
    x, y = place
    feet = (_box(f"foot_{k}", (0.04, 0.18, 0.2), (x + 0.45 * i, y, 0.2)) for k, i in enumerate((1, -1)))
    return (_box("seat", (0.6, 0.2, 0.025), (x, y, 0.425)), *feet)


def _pedestal(place: tuple[float, float]) -> Pieces:
    x, y = place
    rows = (("base", 0.22, 0.0, 0.08), ("shaft", 0.15, 0.08, 0.94), ("cap", 0.2, 0.94, PEDESTAL_HEIGHT))
    return tuple(
        _box(name, (wide, wide, (top - low) / 2), (x, y, (top + low) / 2)) for name, wide, low, top in rows
    )


def _frame(middle: Vector, half_width: float, half_height: float, through: str) -> Pieces:
    """Picture frame of four bars on a wall with normal axis `through`; the bars protrude from the picture."""
    bar, depth = 0.03, 0.02

    def piece(name: str, aside: float, up: float, wide: float, high: float, deep: float) -> Piece:
        x, y, z = middle
        if through == "x":
            return _box(name, (deep, wide, high), (x, y + aside, z + up))
        return _box(name, (wide, deep, high), (x + aside, y, z + up))

    return (
        piece("picture", 0.0, 0.0, half_width, half_height, depth / 4),
        *(
            piece(f"bar_{k}", 0.0, sign * (half_height + bar), half_width + 2 * bar, bar, depth)
            for k, sign in enumerate((1, -1))
        ),
        *(
            piece(f"bar_{k}", sign * (half_width + bar), 0.0, bar, half_height, depth)
            for k, sign in enumerate((1, -1), start=2)
        ),
    )


def _stone(name: str, count: int, half_axes: Vector, middle: Vector) -> Pieces:
    """An ellipsoid of `count` vertices on a spiral from pole to pole: 2 count - 4 triangles."""
    heights = 1 - (2 * np.arange(count) + 1) / count
    turns = GOLDEN_TURN * np.arange(count)
    wide = np.sqrt(1 - heights**2)
    points = np.column_stack((wide * np.cos(turns), wide * np.sin(turns), heights)) * half_axes
    return (Piece(name, Hull(tuple(map(vector, points))), middle),)


def _ring(middle: Vector, radius: float, thickness: float, count: int) -> Pieces:
    """A standing ring perpendicular to x of `count` wedges with octagonal cross-section: 28 triangles
    each."""
    section = [(thickness * cos(t), thickness * sin(t)) for t in (np.arange(8) + 0.5) * pi / 4]

    def ring_point(turn: float, out: float, aside: float) -> Vector:
        return ((radius + out) * sin(turn), aside, -(radius + out) * cos(turn))

    ends = [2 * pi * k / count for k in range(count + 1)]
    return tuple(
        Piece(
            f"wedge_{k}",
            Hull(tuple(ring_point(turn, *point) for turn in (start, end) for point in section)),
            middle,
        )
        for k, (start, end) in enumerate(pairwise(ends))
    )


def _twist(place: tuple[float, float], radius: float, count: int) -> Pieces:
    """A column of `count` hexagonal drums, each rotated against the one below: 20 triangles each."""
    drum, step = 0.18, pi / 18

    def drum_points(k: int) -> tuple[Vector, ...]:
        corners = [step * k + 2 * pi * i / 6 for i in range(6)]
        return tuple((radius * cos(t), radius * sin(t), z) for z in (0.0, drum) for t in corners)

    return tuple(Piece(f"drum_{k}", Hull(drum_points(k)), (*place, drum * k)) for k in range(count))
