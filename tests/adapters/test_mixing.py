"""Per-body numbers under an engine's mixing rule: every pair comes out as asked, or is named."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.material_combine import (
    MIX_TOLERANCE,
    check_range,
    crossed_factors,
    maximum_factors,
    mean_factors,
    minimum_factors,
    product_factors,
    restitutions,
)
from touchstone.adapters.registry import ENGINES
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, PairCoefficients, Piece, Scenario, Sphere
from touchstone.scenarios.solids import sphere_inertia

RULES = {"product": (product_factors, lambda f, g: f * g), "minimum": (minimum_factors, min)}
ROUNDING = 1e-12
"""Logarithms of three numbers and back, relative."""


def crowd(materials, **coefficients):
    """Balls p, q, r ... of the given materials; a pair's coefficient is given as ab=0.3, 0 otherwise."""
    balls = tuple(
        Body(name, "simulated", material, (Piece("b", Sphere(0.1)),), 1.0, inertia=sphere_inertia(1.0, 0.1))
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


def meeting(*materials):
    """A fixed ball of the first material and free ones of the others, under table 1 of the method."""
    ball = crowd("a").bodies[0]
    kinds = ("fixed", *["simulated"] * (len(materials) - 1))
    bodies = tuple(
        replace(ball, name=name, kind=kind, material=material)
        for name, kind, material in zip("pqrstuvw", kinds, materials)
    )
    return Scenario("table 1", "materials of table 1", (), bodies, 1.0, TABLE_1)


TABLE_SCENES = {
    # materials, the first one fixed: what of table 1 has no numbers per body, per rule
    ("wood", "wood"): set(),
    ("wood", "wood", "human"): set(),
    ("wood", "wood", "metal"): set(),
    ("human", "wood", "metal"): set(),
    ("wood", "metal", "metal"): set(),
    # f_wood^2 = e_ww twice over, so e_wh^2 = e_ww e_hh would have to hold
    ("wood", "wood", "wood", "human", "human"): {"product e", "product mu", "minimum mu"},
    # two hands: min(f_h, f_h) = .1, but each needs .2 against wood
    ("wood", "human", "human"): {"minimum mu"},
    # four bodies, six pairs: e_pq e_rs = e_pr e_qs does not hold
    ("wood", "wood", "human", "metal"): {"product e", "product mu"},
    # one more wooden body beside a hand and metal is one too many, in any order
    ("metal", "human", "wood", "wood"): {"product e", "product mu"},
}


MIXES = {"reference": set(), "mujoco": set(), "bullet": {"product e", "product mu"}}
MIXES["dart"] = {"product e", "minimum mu"}


@pytest.mark.parametrize("materials", TABLE_SCENES, ids="-".join)
@pytest.mark.parametrize("name", ENGINES)
def test_engines_take_table_1_exactly_or_name_the_pairs(registry, name, materials):
    """Every pair is read back as asked, or the scene is Unsupported, with the engine and a pair named."""
    scenario, engine = meeting(*materials), registry.engine(name)
    if MIXES[name] & TABLE_SCENES[materials]:
        with pytest.raises(Unsupported, match=rf"^{name}: no \w+ per body gives the pairs [p-t]-[p-t]"):
            engine.build(scenario, registry.settings(name))
        return
    world = engine.build(scenario, registry.settings(name))
    reported = {(p.body_a, p.body_b): (p.restitution, p.friction) for p in world.describe().pairs}
    world.close()
    names = [body.name for body in scenario.bodies]
    for a, b in scenario.touching_pairs():
        asked = scenario.pair_coefficients(a, b)
        assert reported[names[a], names[b]] == pytest.approx(asked, abs=MIX_TOLERANCE)


def test_coefficients_an_engine_would_alter_are_named():
    """Too small and too large ones are refused with the bound, the value and the pairs; zero never is."""
    scenario = crowd("abc", ab=0.0, ac=0.002, bc=0.4)
    wanted = restitutions(scenario)
    check_range("test", "friction", scenario, wanted)
    check_range("test", "friction", scenario, wanted, least=0.001, greatest=0.4)
    with pytest.raises(Unsupported, match=r"^test: friction must be 0 or above 0.002, found 0.002 .* p-r$"):
        check_range("test", "friction", scenario, wanted, least=0.002)
    with pytest.raises(Unsupported, match=r"^test: friction must be 0 or up to 0.3, found 0.4 .* q-r$"):
        check_range("test", "friction", scenario, wanted, greatest=0.3)


def test_lengths_of_rolling_friction_are_crossed_with_friction():
    """Factors that are not negative give r_a f_b + r_b f_a; lengths that no factors give are named."""
    scenario = crowd("abc", ab=0.1, ac=0.2, bc=0.3)
    frictions = [1.0, 0.5, 0.25]
    wanted = dict(zip(scenario.touching_pairs(), (0.01, 0.004, 0.003)))
    factors = crossed_factors("test", "rolling friction", scenario, wanted, frictions)
    assert min(factors) >= 0
    for (a, b), length in wanted.items():
        assert factors[a] * frictions[b] + factors[b] * frictions[a] == pytest.approx(length)
    assert crossed_factors("test", "", scenario, dict.fromkeys(wanted, 0.0), [0.0] * 3) == [0.0] * 3
    with pytest.raises(Unsupported, match=r"^test: no rolling friction per body gives the pairs .*q-r"):
        crossed_factors("test", "rolling friction", scenario, wanted, [1.0, 0.0, 0.0])


def test_a_crowd_of_hundreds_is_solved_at_once():
    """Two hundred balls, twenty thousand pairs, have their factors recovered."""
    factors = np.random.default_rng(0).uniform(0.1, 1.0, 200)
    scenario = crowd("aa", aa=0.25)
    many = replace(
        scenario, bodies=tuple(replace(scenario.bodies[0], name=f"{k}") for k in range(len(factors)))
    )
    wanted = {(a, b): factors[a] * factors[b] for b in range(len(factors)) for a in range(b)}
    found = product_factors("test", "restitution", many, wanted)
    assert found == pytest.approx(factors.tolist(), rel=1e-10)


def test_a_factor_is_within_what_an_engine_accepts():
    """Rounding takes none of a scene of six restitutions beyond 1; one that has to be is refused."""
    scene, steep = catalogue()["normal_impacts"], crowd("abc", ab=0.9, ac=0.9, bc=0.5)
    assert max(product_factors("test", "restitution", scene, restitutions(scene), greatest=1.0)) == 1.0
    with pytest.raises(Unsupported, match=r"^test: restitution of 'p' would be 1.27\d+, beyond 1$"):
        product_factors("test", "restitution", steep, restitutions(steep), greatest=1.0)


def test_means_and_maxima_have_factors_or_are_refused():
    """Three materials: every pair gets its own mean; a maximum below both bodies' others does not exist."""
    three = crowd("abc", ab=0.4, ac=0.5, bc=0.6)
    factors = mean_factors("engine", "restitution", three, restitutions(three))
    assert factors == pytest.approx([0.3, 0.5, 0.7])
    two = crowd("abb", ab=0.5, bb=0.2)
    assert maximum_factors("engine", "restitution", two, restitutions(two)) == [0.5, 0.2, 0.2]
    steep, bouncy = crowd("abc", ab=0.1, ac=0.9, bc=0.1), crowd("abb", ab=0.2, bb=0.5)
    for solve, scenario, pair in ((mean_factors, steep, "p-q"), (maximum_factors, bouncy, "q-r")):
        with pytest.raises(Unsupported, match=f"engine: no restitution per body gives the pairs {pair}"):
            solve("engine", "restitution", scenario, restitutions(scenario))
