"""How MuJoCo is told e and mu: an explicit pair for every two pieces that may touch.

Restitution: MuJoCo has springs instead of e. With zeta = -ln e / sqrt(pi^2 + ln^2 e) a pair gets the direct
form solref = (-w^2, -2 zeta w), w = 1 / max(0.02 zeta, 2 dt): the default time constant of 20 ms at damping
ratio zeta (e = 0 is MuJoCo's default contact), but never stiffer than the floor MuJoCo itself keeps for a
critically damped contact (timeconst >= 2 dt; the positive form has no such floor for zeta < 1 and gains
energy). Friction is given per pair; mu = 0 is a frictionless contact (condim 1). The edges of the pyramidal
cone share the pair's damping: friction is Coulomb's for e up to about .8, fades above, and is none at e = 1.
"""

from __future__ import annotations

from math import exp, hypot, log, pi, sqrt
from typing import Any

from adapters.engine import Array
from adapters.mixing import check_range, frictions
from scenarios.scenario import Scenario

TIME_CONSTANT = 0.02
"""MuJoCo's default time constant of a contact, 1 / (zeta w) [s]."""
FLOOR_STEPS = 2.0
"""MuJoCo's floor of a contact's time constant [steps] (its flag refsafe)."""
FRICTION_MIN = 1e-5
"""Least friction of a contact with condim > 1 (mjMINMU) [1]: smaller values are raised to it."""


def solref_of(restitution: float, dt: float) -> tuple[float, float]:
    """(-stiffness, -damping) per unit mass of a contact with restitution e."""
    zeta = 1.0 if restitution == 0 else -log(restitution) / hypot(pi, log(restitution))
    w = 1 / max(TIME_CONSTANT * zeta, FLOOR_STEPS * dt)
    return -w * w, -2 * zeta * w


def restitution_of(solref: Array) -> float:
    """Restitution e of a contact with (-stiffness, -damping), the inverse of `solref_of`."""
    zeta = -solref[1] / (2 * sqrt(-solref[0]))
    return exp(-pi * zeta / sqrt(1 - zeta * zeta)) if zeta < 1 else 0.0


def add_pairs(spec: Any, scenario: Scenario, dt: float) -> None:
    """An explicit pair for every two pieces that may touch."""
    check_range("mujoco", "friction", scenario, frictions(scenario), least=FRICTION_MIN)
    for a, b in scenario.touching_pairs():
        e, mu = scenario.pair_coefficients(a, b)
        for first in range(len(scenario.bodies[a].pieces)):
            for second in range(len(scenario.bodies[b].pieces)):
                spec.add_pair(
                    geomname1=f"{a}.{first}",
                    geomname2=f"{b}.{second}",
                    condim=3 if mu > 0 else 1,
                    friction=(mu, mu, 0.0, 0.0, 0.0),
                    solref=solref_of(e, dt),
                )
