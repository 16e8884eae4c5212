"""`fall`: a ball falls from rest; p = p_0 + g t^2 / 2."""

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import ball

PULL = (0.0, 0.0, -GRAVITY)
SPIN = (0.0, 5.0, 0.0)
"""Spin of the ball, with the same inertia about any axis [rad/s]."""


@scene
def fall() -> Scenario:
    """One spinning ball without contacts: a first-order integrator is off by g h T / 2 after the time T."""
    return Scenario(
        name="fall",
        summary="a spinning ball falls from rest for a second",
        tags=("probe", "conservative"),
        bodies=(ball("ball", "wood", 0.05, 1.0, spin=SPIN),),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.0),),
        duration=1.0,
        truths=(
            Truth("ball", "arcs", (Arc(0.0, (0.0, 0.0, 0.0), acceleration=PULL, angular_velocity=SPIN),)),
        ),
    )
