"""Valid values that no body has are named."""

from dataclasses import replace

import pytest

from touchstone.scenarios.plausibility import UNITS, implausible
from touchstone.scenarios.scenario import PairCoefficients, Scenario
from touchstone.scenarios.solids import ball, block

WOODEN = PairCoefficients("wood", "wood", 0.5, 0.4)
FLOOR = block("floor", "wood", (1.0, 1.0, 1.0), 0.0, (0.0, 0.0, -1.0), kind="fixed")


@pytest.mark.parametrize(
    ("radius", "mass", "pair", "lines"),
    [
        (0.1, 5.0, WOODEN, []),
        # 4/3 pi 0.1^3 m^3
        (0.1, 5000.0, WOODEN, [f"ball: 5e+03 kg in its shapes are 1.19e+06 kg/m^3; {UNITS}"]),
        (100.0, 5.0, WOODEN, [f"ball: 5 kg in its shapes are 1.19e-06 kg/m^3; {UNITS}"]),
        (
            0.1,
            5.0,
            replace(WOODEN, friction=40),
            ["friction of wood and wood is 40; rubber on a dry road has 1"],
        ),
        (
            *(0.1, 5.0, replace(WOODEN, static_friction=3.0)),
            ["friction of wood and wood is 3; rubber on a dry road has 1"],
        ),
    ],
)
def test_implausible_values_are_named(radius, mass, pair, lines):
    """Densities of moving bodies, and coefficients of friction."""
    body = ball("ball", "wood", radius, mass, (0.0, 0.0, radius))
    assert list(implausible(Scenario("own", "", (), (FLOOR, body), 1.0, (pair,)))) == lines
