"""Per-body numbers under an engine's mixing rule: every pair comes out as asked, or is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adapters.engine import Unsupported
from adapters.mixing import MIX_TOLERANCE, frictions, minimum_factors, product_factors, restitutions
from scenarios.catalogue import catalogue
from scenarios.scenario import Body, PairCoefficients, Piece, Scenario, Sphere
from scenarios.solids import sphere_inertia

RULES = {
    "product": (product_factors, lambda f, g: f * g),
    "minimum": (minimum_factors, min),
}
ROUNDING = 1e-12
"""Logarithms of three numbers and back, relative."""


def crowd(materials, **coefficients):
    """Balls p, q, r ... of the given materials; a pair's coefficient is given as ab=0.3, 0 otherwise."""
    balls = tuple(
        Body(
            name, "simulated", material, (Piece("ball", Sphere(0.1)),), 1.0, inertia=sphere_inertia(1.0, 0.1)
        )
        for name, material in zip("pqrstuvw", materials)
    )
    kinds = sorted(set(materials))
    pairs = [a + b for k, a in enumerate(kinds) for b in kinds[k:]]
    table = tuple(PairCoefficients(*pair, coefficients.get(pair, 0.0), 0.5) for pair in pairs)
    return Scenario("crowd", "a crowd", (), balls, 1.0, table)


def mixed(rule, scenario):
    """Every pair's coefficient as the engine would mix it, beside the one asked for."""
    solve, mix = RULES[rule]
    wanted = restitutions(scenario)
    factors = solve("test", "restitution", scenario, wanted)
    assert len(factors) == len(scenario.bodies)
    assert min(factors) >= 0
    return [mix(factors[a], factors[b]) for a, b in wanted], list(wanted.values())


def test_factors_of_a_product_in_closed_form():
    """One pair splits evenly; three pairs have the one solution f_p = sqrt(pq pr / qr)."""
    scenario = crowd("ab", ab=0.36)
    assert product_factors("x", "e", scenario, restitutions(scenario)) == pytest.approx(
        [0.6, 0.6], rel=ROUNDING
    )
    scenario = crowd("abc", ab=0.1, ac=0.2, bc=0.4)
    expected = [(0.1 * 0.2 / 0.4) ** 0.5, (0.1 * 0.4 / 0.2) ** 0.5, (0.2 * 0.4 / 0.1) ** 0.5]
    factors = product_factors("x", "e", scenario, restitutions(scenario))
    assert factors == pytest.approx(expected, rel=ROUNDING)


def test_factors_of_a_minimum_in_closed_form():
    """A body's factor is the largest coefficient among its pairs."""
    scenario = crowd("abc", ab=0.1, ac=0.1, bc=0.4)
    factors = minimum_factors("x", "e", scenario, restitutions(scenario))
    assert factors == [0.1, 0.4, 0.4]


SOLVABLE = {
    "all zero": crowd("abc"),
    "one body bounces off nothing": crowd("abc", bc=0.3),
    "one material": crowd("aaaa", aa=0.25),
    "perfectly elastic": crowd("aa", aa=1.0),
    "a lone body": crowd("a", aa=0.3),
}


@pytest.mark.parametrize("name", SOLVABLE)
@pytest.mark.parametrize("rule", RULES)
def test_solvable_tables_are_solved(rule, name):
    """Tables with a solution under either rule are solved; zero coefficients are exactly zero."""
    got, wanted = mixed(rule, SOLVABLE[name])
    assert got == pytest.approx(wanted, rel=ROUNDING)
    assert [g == 0 for g in got] == [w == 0 for w in wanted]


@pytest.mark.parametrize("effects", [("gravity",), ("gravity", "friction", "restitution")])
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("wanted", [restitutions, frictions])
def test_the_gallery_is_solved(rule, wanted, effects):
    """The coefficients of every scene of the catalogue have factors under both rules."""
    solve, mix = RULES[rule]
    for scenario in catalogue().values():
        pairs = wanted(replace(scenario, effects=effects))
        factors = solve("test", "coefficient", scenario, pairs)
        for (a, b), value in pairs.items():
            assert mix(factors[a], factors[b]) == pytest.approx(value, abs=MIX_TOLERANCE)


@pytest.mark.parametrize(
    ("rule", "scenario", "named"),
    [
        # four bodies, two materials: e_ab^2 = e_aa e_bb does not hold
        ("product", crowd("aabb", aa=0.9, ab=0.1, bb=0.9), "p-q"),
        # b bounces off c, c off a, yet a not off b: one factor would have to be zero
        ("product", crowd("abc", bc=0.3, ac=0.2), "p-q"),
        # the smaller of two, each at least 0.9, is not 0.1
        ("minimum", crowd("aabb", aa=0.9, ab=0.1, bb=0.9), "p-r, p-s, q-r, q-s"),
        ("minimum", crowd("abc", bc=0.3, ac=0.2), "p-q"),
    ],
)
def test_unsolvable_tables_name_engine_kind_and_pairs(rule, scenario, named):
    """A table without a solution is Unsupported, with the engine, what is missed and the pairs."""
    with pytest.raises(Unsupported, match=rf"^test: no restitution per body gives the pairs .*{named}"):
        mixed(rule, scenario)


def test_many_missed_pairs_are_counted():
    """The first four missed pairs are named, the others counted."""
    scenario = crowd("aaabbb", aa=0.9, ab=0.1, bb=0.9)
    with pytest.raises(Unsupported, match=r"p-s, p-t, p-u, q-s and 5 more$"):
        mixed("minimum", scenario)


def test_random_products_are_recovered():
    """Tables made from random factors are solved, whatever the sizes."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        f = dict(zip("abcdef", rng.uniform(0.05, 1.0, 6)))
        table = {a + b: f[a] * f[b] for a in f for b in f if a <= b}
        got, wanted = mixed("product", crowd("abcdef", **table))
        assert got == pytest.approx(wanted, rel=1e-10)  # six logarithms, of condition below 10
