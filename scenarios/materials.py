"""Restitution and friction per pair of materials (Schmidl & Lin 2004, table 1)."""

from touchstone.scenarios.scenario import PairCoefficients

TABLE_1: tuple[PairCoefficients, ...] = (
    PairCoefficients("wood", "wood", restitution=0.3, friction=0.3),
    PairCoefficients("wood", "human", restitution=0.2, friction=0.2),
    PairCoefficients("wood", "metal", restitution=0.2, friction=0.1),
    PairCoefficients("human", "human", restitution=0.1, friction=0.1),
    PairCoefficients("human", "metal", restitution=0.2, friction=0.1),
    PairCoefficients("metal", "metal", restitution=0.3, friction=0.1),
)
