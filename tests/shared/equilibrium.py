"""Static equilibrium of bodies in contact: a linear program over contact forces within friction cones.

Limit analysis of masonry (Livesley 1978): if no forces within the cones balance the weights, the bodies move;
if some do, rigid bodies may stand. Pyramids replace the cones: inscribed ones prove that bodies can stand,
circumscribed ones that they cannot.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from touchstone.scenarios.scenario import Scenario, Vector

Array = NDArray[np.float64]

SIDES = 16
"""Number of a pyramid's edges: it deviates from the cone by 2 %."""
FEASIBLE, INFEASIBLE = 0, 2
"""Status codes of scipy's linear program solver."""


class EquilibriumError(RuntimeError):
    """The solver failed; the message says why."""


@dataclass(frozen=True, slots=True)
class Support:
    """Contact point of two bodies, by name: position [m, world] and unit normal from A to B."""

    body_a: str
    body_b: str
    position: Vector
    normal: Vector


def can_stand(scenario: Scenario, supports: Sequence[Support], *, outer: bool = False) -> bool:
    """Whether forces at contact points within their friction pyramids balance gravity on each simulated body.

    Args:
        scenario: provides the bodies' initial poses, masses and friction.
        supports: all points at which bodies may push on each other.
        outer: use pyramids around the friction cones instead of inside them.
    Raises:
        EquilibriumError: the solver neither finds a solution nor proves that there is none.
    """
    bodies = [body for body in scenario.bodies if body.kind == "simulated"]
    row = {body.name: 6 * k for k, body in enumerate(bodies)}
    centre = {body.name: np.array(body.position) for body in bodies}
    weight = np.concatenate([[*(b.mass * np.array(scenario.acting_gravity)), 0.0, 0.0, 0.0] for b in bodies])
    # Unknowns of a point: its normal force, then one force per edge of the pyramid.
    balance = np.zeros((6 * len(bodies), (1 + SIDES) * len(supports)))
    cones = np.zeros((len(supports), balance.shape[1]))
    for k, point in enumerate(supports):
        first = (1 + SIDES) * k
        forces = np.column_stack([point.normal, *_tangents(np.array(point.normal))])
        for name, sign in ((point.body_a, -1.0), (point.body_b, 1.0)):
            if name in row:
                arm = np.array(point.position) - centre[name]
                part = balance[row[name] : row[name] + 6, first : first + 1 + SIDES]
                part[:3] = sign * forces
                part[3:] = sign * np.cross(arm, forces.T).T
        pair = sorted(map(scenario.body_index, (point.body_a, point.body_b)))
        mu = scenario.pair_coefficients(pair[0], pair[1])[1] / (cos(pi / SIDES) if outer else 1.0)
        cones[k, first] = -mu
        cones[k, first + 1 : first + 1 + SIDES] = 1.0
    # Scale by the heaviest body: the solver's tolerance is absolute.
    scale = float(np.abs(weight).max()) or 1.0
    answer = linprog(
        np.zeros(balance.shape[1]),
        A_ub=cones,
        b_ub=np.zeros(len(supports)),
        A_eq=balance,
        b_eq=-weight / scale,
        bounds=(0, None),
        method="highs",
    )
    if answer.status not in (FEASIBLE, INFEASIBLE):
        raise EquilibriumError(f"scenario {scenario.name!r}: {answer.message}")
    return bool(answer.status == FEASIBLE)


def _tangents(n: Array) -> list[Array]:
    """SIDES unit vectors perpendicular to a normal, evenly spaced around it."""
    first = np.cross(n, np.eye(3)[int(np.abs(n).argmin())])
    first /= np.linalg.norm(first)
    second = np.cross(n, first)
    return [cos(2 * pi * k / SIDES) * first + sin(2 * pi * k / SIDES) * second for k in range(SIDES)]
