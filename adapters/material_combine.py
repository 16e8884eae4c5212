"""Restitution and friction of all pairs that can touch, and per-body factors that combine to them.

Some engines store coefficients per body and combine them by their own rule. Table 1 of the method has no such
factors for all its materials at once. Few materials occur in one scene, so most scenes have factors when they
are solved per scene and body. Otherwise `Unsupported` names the coefficient and the pairs.
"""

from collections.abc import Callable
from math import inf

import numpy as np
from scipy.optimize import nnls

from touchstone.adapters.contract import Unsupported
from touchstone.scenarios.scenario import Scenario

MIX_TOLERANCE = 1e-9
"""Tolerance of a combined coefficient [1]: rounding."""

Pairs = dict[tuple[int, int], float]
Rule = Callable[[float, float], float]


def restitutions(scenario: Scenario) -> Pairs:
    """Restitution per pair of bodies that can touch (a < b)."""
    return {pair: scenario.pair_coefficients(*pair)[0] for pair in scenario.touching_pairs()}


def frictions(scenario: Scenario) -> Pairs:
    """Friction per pair of bodies that can touch (a < b)."""
    return {pair: scenario.pair_coefficients(*pair)[1] for pair in scenario.touching_pairs()}


def friction_lengths(scenario: Scenario, law: str) -> Pairs:
    """Length of `rolling` or `torsional` friction per pair of bodies that can touch (a < b) [m]."""
    return {pair: getattr(scenario.friction_law(*pair), law) for pair in scenario.touching_pairs()}


def check_range(
    engine: str, kind: str, scenario: Scenario, wanted: Pairs, least: float = 0.0, greatest: float = inf
) -> None:
    """Raise Unsupported for pairs whose coefficient an engine would alter: nonzero ones up to `least`, which
    it ignores or raises, and those above `greatest`, which it clamps."""
    out = [pair for pair, value in wanted.items() if 0 < value <= least or value > greatest]
    if out:
        value = wanted[out[0]]
        bound = f"above {least:g}" if value <= least else f"up to {greatest:g}"
        names = _named(scenario, out)
        raise Unsupported(f"{engine}: {kind} must be 0 or {bound}, found {value:g} for the pairs {names}")


def product_factors(
    engine: str, kind: str, scenario: Scenario, wanted: Pairs, greatest: float = inf
) -> list[float]:
    """Factors per body with f_a f_b = the pair's coefficient, for engines that multiply.

    Solves a linear system in the logarithms by its normal equations: scenes of hundreds of bodies have tens
    of thousands of pairs. A pair with coefficient zero needs one zero factor, taken from the body all of
    whose pairs are zero. Raises Unsupported with the pairs if no factors exist, or with the body whose factor
    is over `greatest`.
    """
    count = len(scenario.bodies)
    system, logs = np.zeros((count, count)), np.zeros(count)
    for (a, b), value in wanted.items():
        if value > 0:
            system[np.ix_((a, b), (a, b))] += 1.0
            logs[[a, b]] += np.log(value)
    solved = np.exp(np.linalg.lstsq(system, logs, rcond=None)[0])
    solved[np.abs(solved - 1) < MIX_TOLERANCE] = 1.0  # by rounding it would exceed what engines accept
    factors: list[float] = np.where(system.diagonal() > 0, solved, 0.0).tolist()
    _check(engine, kind, scenario, wanted, factors, lambda f, g: f * g)
    for body, factor in zip(scenario.bodies, factors):
        if factor > greatest:
            raise Unsupported(f"{engine}: {kind} of {body.name!r} would be {factor:g}, beyond {greatest:g}")
    return factors


def crossed_factors(
    engine: str, kind: str, scenario: Scenario, wanted: Pairs, frictions: list[float]
) -> list[float]:
    """Factors r per body with r_a f_b + r_b f_a = the pair's length, for the factors f of friction.

    Raises Unsupported with the pairs if no factors exist that are not negative.
    """
    factors = [0.0] * len(scenario.bodies)
    if any(wanted.values()):
        system = np.zeros((len(wanted), len(scenario.bodies)))
        for row, (a, b) in zip(system, wanted):
            row[a], row[b] = frictions[b], frictions[a]
        factors = nnls(system, np.array(list(wanted.values())))[0].tolist()
        pairs = [
            (a, b)
            for (a, b), value in wanted.items()
            if abs(factors[a] * frictions[b] + factors[b] * frictions[a] - value) > MIX_TOLERANCE
        ]
        if pairs:
            raise Unsupported(f"{engine}: no {kind} per body gives the pairs {_named(scenario, pairs)}")
    return factors


def minimum_factors(engine: str, kind: str, scenario: Scenario, wanted: Pairs) -> list[float]:
    """Factors per body with min(f_a, f_b) = the pair's coefficient, for engines that take the minimum.

    The largest coefficient among a body's pairs is the only candidate. Raises Unsupported with the pairs if
    no factors exist.
    """
    return _extremes(engine, kind, scenario, wanted, max, min)


def maximum_factors(engine: str, kind: str, scenario: Scenario, wanted: Pairs) -> list[float]:
    """As `minimum_factors`, for engines that take the maximum: the smallest coefficient is the candidate."""
    return _extremes(engine, kind, scenario, wanted, min, max)


def _extremes(
    engine: str, kind: str, scenario: Scenario, wanted: Pairs, pick: Callable[..., float], rule: Rule
) -> list[float]:
    bodies = range(len(scenario.bodies))
    factors = [pick((value for pair, value in wanted.items() if k in pair), default=0.0) for k in bodies]
    _check(engine, kind, scenario, wanted, factors, rule)
    return factors


def mean_factors(
    engine: str, kind: str, scenario: Scenario, wanted: Pairs, signed: bool = False
) -> list[float]:
    """Factors per body with (f_a + f_b) / 2 = the pair's coefficient, for engines that take the mean.

    Solves a linear system by its normal equations, as `product_factors`. Raises Unsupported with the pairs if
    no factors exist that are not negative; an engine that takes the mean of any numbers has `signed` ones.
    """
    count = len(scenario.bodies)
    system, sums = np.zeros((count, count)), np.zeros(count)
    for (a, b), value in wanted.items():
        system[np.ix_((a, b), (a, b))] += 1.0
        sums[[a, b]] += 2 * value
    solved = np.linalg.lstsq(system, sums, rcond=None)[0]
    factors: list[float] = (solved if signed else np.maximum(solved, 0.0)).tolist()
    _check(engine, kind, scenario, wanted, factors, lambda f, g: (f + g) / 2)
    return factors


def _check(
    engine: str,
    kind: str,
    scenario: Scenario,
    wanted: Pairs,
    factors: list[float],
    mix: Rule,
) -> None:
    missed = [
        (a, b) for (a, b), value in wanted.items() if abs(mix(factors[a], factors[b]) - value) > MIX_TOLERANCE
    ]
    if missed:
        raise Unsupported(f"{engine}: no {kind} per body gives the pairs {_named(scenario, missed)}")


def _named(scenario: Scenario, pairs: list[tuple[int, int]]) -> str:
    """Names of the first four pairs, and the number of the others."""
    names = [f"{scenario.bodies[a].name}-{scenario.bodies[b].name}" for a, b in pairs]
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return ", ".join(names[:4]) + more
