"""Values of a scene that are valid and yet no body has: grams, millimetres and percent show here."""

from collections.abc import Iterator

from touchstone.scenarios.files.mass_properties import volume
from touchstone.scenarios.scenario import UNMOVED, Scenario

DENSITIES = (10.0, 25_000.0)
"""Densities that a body may have [kg/m^3]: light foam has 15, osmium 22,600."""
FRICTION = 2.0
"""Largest coefficient of friction that a pair may have [1]: rubber on a dry road has 1, a racing tyre 1.7."""
UNITS = "check the mass (kg, not g) and the scale of the shapes (m, not mm)"


def implausible(scenario: Scenario) -> Iterator[str]:
    """A line for each density and coefficient of friction out of bounds; bodies that no force moves, and
    those without a mass or a volume, have no density."""
    for body in scenario.bodies:
        size = sum(volume(piece.shape) for piece in body.pieces)
        if body.kind in UNMOVED or not (size > 0 and body.mass > 0):
            continue
        if not DENSITIES[0] <= body.mass / size <= DENSITIES[1]:
            yield f"{body.name}: {body.mass:.3g} kg in its shapes are {body.mass / size:.3g} kg/m^3; {UNITS}"
    for pair in scenario.coefficients:
        if (found := max(pair.friction, pair.static_friction)) > FRICTION:
            a, b = pair.material_a, pair.material_b
            yield f"friction of {a} and {b} is {found:g}; rubber on a dry road has 1"
