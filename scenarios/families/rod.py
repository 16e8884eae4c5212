"""`rod_*`: one end of a slanting rod hits the floor with friction; the rod must not gain energy."""

from dataclasses import dataclass, replace
from math import cos, sin

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import about_y
from touchstone.scenarios.scenario import PairCoefficients, Scenario, Vector
from touchstone.scenarios.solids import block, slab
from touchstone.scenarios.truths.impact_laws import outcomes
from touchstone.scenarios.truths.published import Published

HALF: Vector = (0.25, 0.02, 0.02)
"""Half extents of the rod [m]."""
CLEARANCE = 0.11
"""Initial height of its lower end [m]: it arrives within a step of every engine."""


@dataclass(frozen=True, slots=True)
class Case:
    """Slope of the rod against the floor [rad], velocity [m/s], coefficients; Newton's law as printed gains
    much energy for these."""

    slope: float
    velocity: Vector
    restitution: float
    friction: float


CASES: dict[str, Case] = {
    # Friction mu j regardless of slip (Eq. 10) gains 10 % of the energy.
    "rod_e03": Case(1.2, (-0.25, 0.0, -2.0), 0.3, 0.3),
    # With friction that stops the slip, restitution alone gains 18 %.
    "rod_e1": Case(0.85, (-1.0, 0.0, -2.0), 1.0, 0.9),
    # The end slips on, and the laws of restitution agree.
    "rod_slips": Case(0.85, (3.0, 0.0, -2.0), 0.5, 0.3),
}
KANE = (
    "Stronge (1990), Proc. R. Soc. A 431, 169: work is restored; Newton (reversed speed) and Poisson "
    "(impulse) disagree where the slip ends; Newton's law may gain energy where it reverses, Kane's paradox "
    "(Stronge 1991, J. Appl. Mech. 58, 1049). Integrated"
)
END = 0.1
"""Time at which rates are measured [s]: soft contacts have ended, and the other end is still in the air."""


@scene
def rods() -> tuple[Scenario, ...]:
    """A rod flies at the floor without gravity and without spin, its end at +x first."""
    return tuple(_rod(name, case) for name, case in CASES.items())


def _rod(name: str, case: Case) -> Scenario:
    height = CLEARANCE + HALF[0] * sin(case.slope) + HALF[2] * cos(case.slope)
    turn = about_y(case.slope)
    plain = Scenario(
        name=name,
        summary=f"the end of a rod hits the floor, e = {case.restitution:g}, mu = {case.friction:g}",
        tags=("impact",) if name == "rod_slips" else ("probe", "impact"),
        bodies=(
            slab("floor", "wood"),
            block("rod", "wood", HALF, 1.0, (0.0, 0.0, height), turn, velocity=case.velocity),
        ),
        coefficients=(PairCoefficients("wood", "wood", case.restitution, case.friction),),
        duration=0.5,
        effects=("restitution", "friction"),
    )
    if name == "rod_e03":
        return plain  # the laws differ by 0.5 %
    rates = tuple((law, float(after[1][1]) / HALF[0]) for law, after in outcomes(plain)[1].items())
    value = dict(rates)["Stronge"]
    named = rates if name == "rod_e1" else ()
    published = Published(
        "rate", "rod", "spin", value, 0.01 * abs(value), KANE, END, END, (0.0, 1.0, 0.0), outcomes=named
    )
    return replace(plain, tags=(*plain.tags, "literature"), published=(published,))
