"""`coin_*`: a coin of 32 edges on its rim: it spins, rolls or falls over, and never gains energy."""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import ORIGIN, PairCoefficients, Scenario, Vector
from touchstone.scenarios.solids import hull, slab

RADIUS, HALF_THICKNESS = 0.05, 0.004
CORNERS = 32
MASS = 0.1


@dataclass(frozen=True, slots=True)
class Case:
    """Tilt of the coin's plane from the vertical [rad], velocity of its centre [m/s] and spin [rad/s]."""

    summary: str
    tilt: float
    velocity: Vector = ORIGIN
    spin: Vector = ORIGIN


CASES: dict[str, Case] = {
    "coin_spins": Case("a coin on its rim spins about the vertical", 0.05, spin=(0.0, 0.0, 20.0)),
    "coin_rolls": Case("a coin rolls on its rim", 0.1, velocity=(0.0, 0.75, 0.0), spin=(-15.0, 0.0, 0.0)),
    "coin_falls": Case("a coin on its rim falls over", 0.15),
}


@scene
def coins() -> tuple[Scenario, ...]:
    """A coin that touches the floor at its lowest corner, e = 0."""
    return tuple(_coin(name, case) for name, case in CASES.items())


def _coin(name: str, case: Case) -> Scenario:
    angles = 2 * pi * (np.arange(CORNERS) + 0.5) / CORNERS
    rim = [(RADIUS * cos(t), RADIUS * sin(t)) for t in angles]
    corners: list[Vector] = [(x, y, z) for z in (-HALF_THICKNESS, HALF_THICKNESS) for x, y in rim]
    # Its axis is along x, except for the tilt.
    turn = Rotation.from_rotvec([0.0, pi / 2 + case.tilt, 0.0])
    height = float(-turn.apply(corners)[:, 2].min())
    place = (0.0, 0.0, height)
    body = hull(
        "coin", "metal", corners, MASS, place, quaternion(turn), velocity=case.velocity, spin=case.spin
    )
    return Scenario(
        name=name,
        summary=case.summary,
        tags=("probe", "impact", "collective"),
        bodies=(slab("floor", "metal"), body),
        coefficients=(PairCoefficients("metal", "metal", 0.0, 0.5),),
        duration=1.0,
    )
