"""Per-body numbers whose mix under an engine's rule gives the coefficients of every pair that can meet."""

from __future__ import annotations

from collections.abc import Callable

from adapters.engine import Unsupported
from scenarios.scenario import Scenario

MIX_TOLERANCE = 1e-9
"""Accepted deviation of a mixed coefficient from the one asked for [1]: rounding."""


def pair_table(scenario: Scenario) -> dict[tuple[int, int], tuple[float, float]]:
    """Restitution and friction per pair of bodies that can meet (a < b)."""
    return {pair: scenario.pair_coefficients(*pair) for pair in scenario.touching_pairs()}


def check_mix(
    engine: str,
    scenario: Scenario,
    kind: str,
    wanted: dict[tuple[int, int], float],
    factors: list[float],
    mix: Callable[[float, float], float],
) -> None:
    """Raise Unsupported, with the pairs named, where `mix` of the factors misses a coefficient."""
    missed = [
        f"{scenario.bodies[a].name}-{scenario.bodies[b].name}"
        for (a, b), value in wanted.items()
        if abs(mix(factors[a], factors[b]) - value) > MIX_TOLERANCE
    ]
    if missed:
        raise Unsupported(f"{engine}: no per-body {kind} gives the pairs {', '.join(missed[:4])}")
