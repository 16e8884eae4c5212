"""Restitution and friction of every pair that can meet, and per-body numbers that mix to them.

Engines that keep coefficients per body mix them by a rule of their own. Table 1 of the method has no such
numbers for all its materials at once, but few materials meet in one scene: solved per scene and body, most
scenes have them. Where one has not, its name and its pairs are told: `Unsupported`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import numpy as np

from touchstone.adapters.contract import Unsupported
from touchstone.scenarios.scenario import Scenario

MIX_TOLERANCE = 1e-9
"""Accepted deviation of a mixed coefficient from the one asked for [1]: rounding."""

Pairs = dict[tuple[int, int], float]


def restitutions(scenario: Scenario) -> Pairs:
    """Restitution per pair of bodies that can meet (a < b)."""
    return {pair: scenario.pair_coefficients(*pair)[0] for pair in scenario.touching_pairs()}


def frictions(scenario: Scenario) -> Pairs:
    """Friction per pair of bodies that can meet (a < b)."""
    return {pair: scenario.pair_coefficients(*pair)[1] for pair in scenario.touching_pairs()}


def check_range(
    engine: str, kind: str, scenario: Scenario, wanted: Pairs, least: float = 0.0, greatest: float = inf
) -> None:
    """Raise Unsupported for the pairs whose coefficient an engine would alter: up to `least` but not zero (it
    ignores or raises it), or above `greatest` (it cuts it)."""
    out = [pair for pair, value in wanted.items() if 0 < value <= least or value > greatest]
    if out:
        value = wanted[out[0]]
        bound = f"above {least:g}" if value <= least else f"up to {greatest:g}"
        names = _named(scenario, out)
        raise Unsupported(f"{engine}: {kind} must be 0 or {bound}, found {value:g} for the pairs {names}")


def product_factors(engine: str, kind: str, scenario: Scenario, wanted: Pairs) -> list[float]:
    """Factors per body with f_a f_b = the pair's coefficient, for engines that multiply.

    A linear system in the logarithms, by its normal equations: scenes of hundreds of bodies have tens of
    thousands of pairs. Pairs of coefficient zero need one factor of zero, taken from the body that has no
    other pair than such. Raises Unsupported with the pairs named where none exists.
    """
    count = len(scenario.bodies)
    system, logs = np.zeros((count, count)), np.zeros(count)
    for (a, b), value in wanted.items():
        if value > 0:
            system[np.ix_((a, b), (a, b))] += 1.0
            logs[[a, b]] += np.log(value)
    solved = np.exp(np.linalg.lstsq(system, logs, rcond=None)[0])
    factors = np.where(system.diagonal() > 0, solved, 0.0).tolist()
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
        (a, b) for (a, b), value in wanted.items() if abs(mix(factors[a], factors[b]) - value) > MIX_TOLERANCE
    ]
    if missed:
        raise Unsupported(f"{engine}: no {kind} per body gives the pairs {_named(scenario, missed)}")


def _named(scenario: Scenario, pairs: list[tuple[int, int]]) -> str:
    """The first four pairs by name, and how many more there are."""
    names = [f"{scenario.bodies[a].name}-{scenario.bodies[b].name}" for a, b in pairs]
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return ", ".join(names[:4]) + more
