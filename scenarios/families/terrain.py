"""Terrain of triangles: a height field that is a plane moves nothing otherwise than a plane does."""

from __future__ import annotations

from dataclasses import replace
from math import atan, cos, sin

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.roll import rolling
from touchstone.scenarios.families.slide import HEADINGS, sliding
from touchstone.scenarios.height_field import HeightField
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    PairCoefficients,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball

SPACING = (0.37, 0.29)
"""Distances between the points of a field [m]: bodies cross seams at any place."""
CENTER = (1.2, 1.4, 0.0)
"""Middle of a field that three lanes cross [m]."""
POINTS = (14, 20)
"""Points of a field along x and y."""
SLOPE = 0.2
"""Inclination of a field [1]."""
RADIUS = 0.1
"""Radius of a ball that rolls down a field [m]."""


@scene
def tiles() -> tuple[Scenario, ...]:
    """Balls that roll, balls that slip and cubes that slide over a level field, as over a plane."""
    tags = ("terrain", "headings")
    return (
        _over_field(rolling("tiles_roll", (*tags, "conservative"), HEADINGS, 0.3, 1.0, 1.0, 1.5)),
        _over_field(rolling("tiles_slip", tags, HEADINGS, 0.3, 2.0, 0.0, 1.0)),
        _over_field(sliding("tiles_slide", tags, HEADINGS, 0.5, 4.0, 1.2)),
    )


def _over_field(scenario: Scenario) -> Scenario:
    """A scene with a level field in place of its first body."""
    ground, *others = scenario.bodies
    field = _field(ground.name, np.zeros(POINTS), CENTER)
    return replace(scenario, summary=f"{scenario.summary}, over triangles", bodies=(field, *others))


def _field(name: str, heights: np.ndarray, center: Vector) -> Body:
    rows = tuple(tuple(map(float, row)) for row in heights)
    return Body(name, "fixed", "wood", HeightField(rows, SPACING, -0.5).pieces(), position=center)


@scene
def field_slope() -> Scenario:
    """A ball rolls straight down a field that is an inclined plane: a = 5/7 g sin."""
    angle = atan(SLOPE)
    along, up = np.array([cos(angle), 0.0, -sin(angle)]), np.array([sin(angle), 0.0, cos(angle)])
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
