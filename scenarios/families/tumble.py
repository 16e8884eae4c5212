"""`tumble_*`: a free box rotates about its stable and about its unstable axis (Euler's top)."""

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import PairCoefficients, Scenario, Truth, Vector
from touchstone.scenarios.solids import block

HALF: Vector = (0.15, 0.10, 0.05)
"""Half extents [m]: the smallest moment is about x, the intermediate one about y."""
MASS = 6.0
PUSH: Vector = (0.3, -0.2, 0.1)
"""Velocity of the centre of mass [m/s]."""
SPINS: dict[str, tuple[str, Vector]] = {
    # Rates about the box' axes [rad/s].
    "stable": ("the axis of its largest moment", (0.5, 0.3, 6.0)),
    "unstable": ("the axis of its middle moment, and turns over twice", (0.1, 6.0, 0.1)),
}


@scene
def tumbles() -> tuple[Scenario, ...]:
    """Ten seconds without gravity; orientation and times of the flips by elliptic functions."""
    return tuple(
        Scenario(
            name=f"tumble_{name}",
            summary=f"a free box spins about {axis}",
            tags=("probe", "isolated", "conservative"),
            bodies=(block("box", "wood", HALF, MASS, velocity=PUSH, spin=spin),),
            coefficients=(PairCoefficients("wood", "wood", 0.0, 0.0),),
            duration=10.0,
            effects=("restitution", "friction"),
            truths=(Truth("box", "torque_free"),),
        )
        for name, (axis, spin) in SPINS.items()
    )
