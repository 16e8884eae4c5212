"""Terrain of triangles: height fields and meshes that are planes move nothing otherwise than planes do."""

from collections.abc import Callable
from dataclasses import replace
from math import atan, cos, sin, tan

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.roll import rolling
from touchstone.scenarios.families.slide import HEADINGS, sliding
from touchstone.scenarios.height_field import HeightField
from touchstone.scenarios.orientations import slope
from touchstone.scenarios.scenario import (
    GRAVITY,
    IDENTITY,
    ORIGIN,
    Arc,
    Body,
    PairCoefficients,
    Quaternion,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball
from touchstone.scenarios.triangle_mesh import solid_below

SPACING = (0.37, 0.29)
"""Distances between the points of a field [m]: bodies cross seams at any place."""
CENTER = (1.2, 1.4, 0.0)
"""Middle of a field that three lanes cross [m]."""
POINTS = (14, 20)
"""Points of a field along x and y."""
SLOPE = 0.2
"""Inclination of a field [1]."""
RADIUS = 0.1
"""Radius of a ball that rolls down a field or a groove [m]."""
GROOVE = 0.4
"""Inclination of both sides of a groove [rad]."""
LATTICE, APART = (8, 11), (0.74, 0.58)
"""Points of a mesh along x and y, and their distances before they are moved [m]."""
UNEVEN = 0.3
"""Largest displacement of a mesh's inner points, relative to their distances [1]."""
SEED = 1
"""Seed of the displacements of a mesh's points."""


@scene
def tiles() -> tuple[Scenario, ...]:
    """Balls that roll, balls that slip and cubes that slide over a level field, as over a plane."""
    tags = ("terrain", "headings")
    return (
        _over(rolling("tiles_roll", (*tags, "conservative"), HEADINGS, 0.3, 1.0, 1.0, 1.5), _level),
        _over(rolling("tiles_slip", tags, HEADINGS, 0.3, 2.0, 0.0, 1.0), _level),
        _over(sliding("tiles_slide", tags, HEADINGS, 0.5, 4.0, 1.2), _level),
    )


@scene
def mesh() -> tuple[Scenario, ...]:
    """Balls that roll and cubes that slide over a closed mesh of uneven triangles, as over a plane."""
    tags = ("terrain", "headings")
    return (
        _over(rolling("mesh_roll", (*tags, "conservative"), HEADINGS, 0.3, 1.0, 1.0, 1.5), _uneven),
        _over(sliding("mesh_slide", tags, HEADINGS, 0.5, 4.0, 1.2), _uneven),
    )


def _over(scenario: Scenario, ground_of: Callable[[str], Body]) -> Scenario:
    """A scene with level triangles in place of its first body."""
    ground, *others = scenario.bodies
    summary = f"{scenario.summary}, over triangles"
    return replace(scenario, summary=summary, bodies=(ground_of(ground.name), *others))


def _level(name: str) -> Body:
    return _field(name, np.zeros(POINTS), CENTER)


def _uneven(name: str) -> Body:
    return _meshed(name, _grid(0.0, np.random.default_rng(SEED)), CENTER, IDENTITY)


def _grid(slope: float, rng: np.random.Generator) -> np.ndarray:
    """Points of a surface that rises by `slope` on both sides of x = 0; inner ones are moved in it [m]."""
    x, y = ((np.arange(n) - n // 2) * step for n, step in zip(LATTICE, APART))
    xy = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1)
    moved = rng.uniform(-UNEVEN, UNEVEN, xy.shape) * APART
    moved[LATTICE[0] // 2, :, 0] = 0.0
    xy[1:-1, 1:-1] += moved[1:-1, 1:-1]
    return np.concatenate([xy, slope * np.abs(xy[..., :1])], axis=-1)


def _meshed(name: str, surface: np.ndarray, position: Vector, orientation: Quaternion) -> Body:
    pieces = solid_below(surface, -0.5).pieces()
    return Body(name, "fixed", "wood", pieces, position=position, orientation=orientation)


@scene
def mesh_groove() -> Scenario:
    """A ball rolls down a groove between two planes at an angle b: a = g sin / (1 + 2/5 / cos(b)^2)."""
    angle, lever = atan(SLOPE), RADIUS * cos(GROOVE)
    along, up = np.array([0.0, -cos(angle), -sin(angle)]), np.array([0.0, -sin(angle), cos(angle)])
    surface = _grid(tan(GROOVE), np.random.default_rng(SEED))
    groove = _meshed("groove", surface, ORIGIN, (cos(angle / 2), sin(angle / 2), 0.0, 0.0))
    start = vector(-1.8 * along + RADIUS / cos(GROOVE) * up)
    pull = GRAVITY * sin(angle) / (1 + 0.4 * (RADIUS / lever) ** 2)
    down = Arc(0.0, start, ORIGIN, vector(pull * along), angular_acceleration=(pull / lever, 0.0, 0.0))
    return Scenario(
        name="mesh_groove",
        summary=f"a ball rolls down a groove of triangles with a slope of {SLOPE}",
        tags=("terrain", "conservative"),
        bodies=(groove, ball("ball", "wood", RADIUS, 1.0, start)),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.4,
        truths=(Truth("ball", "arcs", (down,)),),
    )


def _field(name: str, heights: np.ndarray, center: Vector) -> Body:
    rows = tuple(tuple(map(float, row)) for row in heights)
    return Body(name, "fixed", "wood", HeightField(rows, SPACING, -0.5).pieces(), position=center)


@scene
def field_slope() -> Scenario:
    """A ball rolls straight down a field that is an inclined plane: a = 5/7 g sin."""
    angle = atan(SLOPE)
    _, along, up = slope(angle)
    x = (np.arange(POINTS[0]) - (POINTS[0] - 1) / 2) * SPACING[0]
    heights = np.repeat(-SLOPE * x[:, None], POINTS[1], axis=1) + 0.6
    start = vector(-1.5 * along + RADIUS * up + (0.0, 0.04, 0.6))
    pull = 5 / 7 * GRAVITY * sin(angle)
    down = Arc(
        0.0, start, (0.0, 0.0, 0.0), vector(pull * along), angular_acceleration=(0.0, pull / RADIUS, 0.0)
    )
    return Scenario(
        name="field_slope",
        summary=f"a ball rolls down a field of triangles that is a plane with a slope of {SLOPE}",
        tags=("terrain",),
        bodies=(_field("field", heights, (0.0, 0.0, 0.0)), ball("ball", "wood", RADIUS, 1.0, start)),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.4,
        truths=(Truth("ball", "arcs", (down,)),),
    )
