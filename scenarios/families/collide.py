"""Two free balls collide, and `cradle`: five in a row, of which only the last flies off.

The normal force exerts no torque on a ball, and the tangential impulse acts on the mass 2/7 m_eff, so
Newton's and Coulomb's laws decouple: j_n = (1 + e) m_eff v_n, j_t = min(mu j_n, 2/7 m_eff v_t).
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Arc, Body, PairCoefficients, Scenario, Truth, vector
from touchstone.scenarios.solids import ball
from touchstone.scenarios.truths.published import Published

RADIUS = 0.05
GAP = 0.47
"""Distance of the balls along the velocity before they collide [m]."""
SPEED = 2.0
"""Speed of the moving ball [m/s]: they collide after 0.235 s, within a step of every engine, not at its
end."""


@dataclass(frozen=True, slots=True)
class Case:
    """A ball of mass `mover` [kg] hits a ball of 1 kg at rest, `offset` diameters off its centre."""

    summary: str
    mover: float = 1.0
    offset: float = 0.0
    restitution: float = 1.0
    friction: float = 0.0


CASES: dict[str, Case] = {
    "central": Case("head on, e = 0.5", mover=2.0, restitution=0.5),
    "oblique": Case("off centre, without friction", offset=0.5),
    "slips": Case(
        "off centre, friction too small to stop the slip", offset=0.5, restitution=0.8, friction=0.05
    ),
    "sticks": Case("off centre, friction stops the slip", offset=0.5, restitution=0.8, friction=0.8),
    "ratio_1e3": Case("head on, a thousand times the mass", mover=1e3),
    "ratio_1e6": Case("head on, a million times the mass", mover=1e6),
}


@scene
def collisions() -> tuple[Scenario, ...]:
    """No gravity: momentum is conserved, and velocities are constant before and after."""
    return tuple(_collision(name, case) for name, case in CASES.items())


def _collision(name: str, case: Case) -> Scenario:
    bodies = _balls(case)
    lossless = case.restitution == 1 and case.friction == 0
    return Scenario(
        name=f"collide_{name}",
        summary=f"two free balls collide {case.summary}",
        tags=("probe", "impact", "isolated", *(("conservative",) if lossless else ())),
        bodies=bodies,
        coefficients=(PairCoefficients("wood", "wood", case.restitution, case.friction),),
        duration=0.75,
        effects=("restitution", "friction"),
        truths=_outcome(bodies, case),
    )


def _balls(case: Case) -> tuple[Body, Body]:
    across = 2 * RADIUS * case.offset
    along = sqrt((2 * RADIUS) ** 2 - across**2)
    return (
        ball("mover", "wood", RADIUS, case.mover, (-GAP - along, across, 0.0), (SPEED, 0.0, 0.0)),
        ball("target", "wood", RADIUS, 1.0),
    )


def _outcome(bodies: tuple[Body, Body], case: Case) -> tuple[Truth, Truth]:
    """Motion of both balls before and after they collide at GAP / SPEED."""
    across = 2 * RADIUS * case.offset
    met = np.array([-sqrt((2 * RADIUS) ** 2 - across**2), across, 0.0])
    n = -met / np.linalg.norm(met)  # from the mover to the target
    v = -np.array(bodies[0].linear_velocity)  # of the target relative to the mover
    v_n = float(n @ v)
    v_t = v - v_n * n
    slip = float(np.linalg.norm(v_t))
    mass = 1 / sum(1 / body.mass for body in bodies)
    j_n = -(1 + case.restitution) * mass * v_n
    j_t = min(case.friction * j_n, 2 / 7 * mass * slip)
    impulse = j_n * n - (j_t * v_t / slip if slip > 0 else 0.0)
    truths = []
    for body, place, arm, sign in zip(bodies, (met, np.zeros(3)), (n, -n), (-1, 1)):
        before = np.array(body.linear_velocity)
        after = before + sign * impulse / body.mass
        spin = np.cross(RADIUS * arm, sign * impulse) / body.inertia[0][0]
        first = Arc(0.0, body.position, body.linear_velocity)
        second = Arc(GAP / SPEED, vector(place), vector(after), angular_velocity=vector(spin))
        truths.append(Truth(body.name, "arcs", (first, second)))
    return truths[0], truths[1]


def struck_row(
    count: int, radius: float, mass: float, gap: float
) -> tuple[tuple[Body, ...], tuple[Truth, ...]]:
    """Balls of which the first moves at 1 m/s over a gap [m] towards a row of touching ones, and their
    motion if the last one takes all its speed."""
    velocity, stops = (1.0, 0.0, 0.0), (-2 * radius, 0.0, 0.0)
    first = ball("ball_1", "wood", radius, mass, (-2 * radius - gap, 0.0, 0.0), velocity)
    row = [ball(f"ball_{k + 2}", "wood", radius, mass, (2 * radius * k, 0.0, 0.0)) for k in range(count - 1)]
    last = row[-1]
    paths = {
        "ball_1": (Arc(0.0, first.position, velocity), Arc(gap, stops)),
        **{body.name: (Arc(0.0, body.position),) for body in row[:-1]},
        last.name: (Arc(0.0, last.position), Arc(gap, last.position, velocity)),
    }
    return (first, *row), tuple(Truth(name, "arcs", arcs) for name, arcs in paths.items())


CRADLE_GAP = 0.187
"""Distance of the first ball from the row [m]: it also arrives within a step."""

MARIOTTE = (
    "Mariotte (1673), Traité de la percussion: the last ball takes all the speed; Herrmann & Schmälzle "
    "(1981), Am. J. Phys. 49, 761, disagree: elastic balls that touch disperse some of it"
)


@scene
def cradle() -> Scenario:
    """Five touching balls, e = 1: impacts propagate one at a time, and the last ball takes all the
    momentum."""
    bodies, truths = struck_row(5, RADIUS, 1.0, CRADLE_GAP)
    return Scenario(
        name="cradle",
        summary="Newton's cradle: a ball hits a row of four",
        tags=("probe", "impact", "isolated", "conservative", "literature"),
        bodies=bodies,
        coefficients=(PairCoefficients("wood", "wood", 1.0, 0.0),),
        duration=0.5,
        effects=("restitution", "friction"),
        truths=truths,
        published=(Published("last ball", "ball_5", "velocity", 1.0, 0.01, MARIOTTE, 0.5, 0.5),),
    )
