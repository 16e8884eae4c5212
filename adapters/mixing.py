"""Per-body numbers whose mix under an engine's rule gives the coefficients of every pair that can meet."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from adapters.engine import Unsupported
from scenarios.scenario import Scenario

MIX_TOLERANCE = 1e-9
"""Accepted deviation of a mixed coefficient from the one asked for [1]: rounding."""

Pairs = dict[tuple[int, int], float]


def restitutions(scenario: Scenario) -> Pairs:
    """Restitution per pair of bodies that can meet (a < b)."""
    return {pair: scenario.pair_coefficients(*pair)[0] for pair in scenario.touching_pairs()}


def frictions(scenario: Scenario) -> Pairs:
    """Friction per pair of bodies that can meet (a < b)."""
    return {pair: scenario.pair_coefficients(*pair)[1] for pair in scenario.touching_pairs()}


def product_factors(engine: str, kind: str, scenario: Scenario, wanted: Pairs) -> list[float]:
    """Factors per body with f_a f_b = the pair's coefficient, for engines that multiply.

    A linear system in the logarithms; pairs of coefficient zero need one factor of zero, taken from the body
    that has no other pair than such. Raises Unsupported with the pairs named where none exists.
    """
    positive = {pair: value for pair, value in wanted.items() if value > 0}
    rows = np.zeros((len(positive), len(scenario.bodies)))
    for row, (a, b) in zip(rows, positive):
        row[a], row[b] = 1.0, 1.0
    logs = np.linalg.lstsq(rows, np.log(list(positive.values())), rcond=None)[0]
    met = {body for pair in positive for body in pair}
    factors = [float(np.exp(logs[k])) if k in met else 0.0 for k in range(len(scenario.bodies))]
    _check(engine, kind, scenario, wanted, factors, lambda f, g: f * g)
    return factors


def minimum_factors(engine: str, kind: str, scenario: Scenario, wanted: Pairs) -> list[float]:
    """Factors per body with min(f_a, f_b) = the pair's coefficient, for engines that take the smaller.

    The largest coefficient among a body's pairs is the only candidate. Raises Unsupported likewise.
    """
    factors = [
        max((value for pair, value in wanted.items() if k in pair), default=0.0)
        for k in range(len(scenario.bodies))
    ]
    _check(engine, kind, scenario, wanted, factors, min)
    return factors


def _check(
    engine: str,
    kind: str,
    scenario: Scenario,
    wanted: Pairs,
    factors: list[float],
    mix: Callable[[float, float], float],
) -> None:
    missed = [
        f"{scenario.bodies[a].name}-{scenario.bodies[b].name}"
        for (a, b), value in wanted.items()
        if abs(mix(factors[a], factors[b]) - value) > MIX_TOLERANCE
    ]
    if missed:
        more = f" and {len(missed) - 4} more" if len(missed) > 4 else ""
        raise Unsupported(f"{engine}: no {kind} per body gives the pairs {', '.join(missed[:4])}{more}")
