"""MuJoCo's contacts by masks and priorities: the same as by explicit pairs, to the bit."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.motion_bounds import planned
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Body, PairCoefficients, Piece, Scenario, Sphere
from touchstone.scenarios.solids import sphere_inertia

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
from touchstone.adapters.engines.mujoco import contacts as mujoco_contacts  # noqa: E402
from touchstone.adapters.engines.mujoco import engine as mujoco_engine  # noqa: E402
from touchstone.adapters.engines.mujoco.masks import contact_filter  # noqa: E402

DT = 1 / 540
SETTINGS = Settings("recommended", DT)
SCENES = (
    *(("ball_snip", 400), ("table_slide", 400), ("collide_slips", 150), ("break_15", 150)),
    pytest.param("arms_cross", 1300, marks=pytest.mark.slow),
)
"""Hands, a collision, many balls, a person whose arms meet, each with the steps to play."""


def explicit_pairs(spec, bodies, scenario: Scenario, settings: Settings) -> None:
    """Every touching pair as explicit pairs, the slow way."""
    mujoco_contacts.add_pairs(spec, scenario, settings, scenario.touching_pairs())


def build(scenario: Scenario):
    """A world in which only what the plan has is simulated."""
    left = planned(scenario).applied(scenario, fixed_pieces=True)
    return mujoco_engine.MujocoEngine().build(left, SETTINGS)


def steps(scenario: Scenario, count: int) -> Iterator[tuple]:
    """The state after each step, and every field of its contacts that the solver reads."""
    world = build(scenario)
    model, data = world._model, world._data
    for step in range(count):
        world.drive(step)
        world.step()
        contact = data.contact
        yield (
            np.concatenate((data.qpos, data.qvel)),
            # of bodies at a distance of 0 the broad phase lists some and the solver none
            *(np.array(getattr(contact, name))[contact.exclude == 0] for name in CONTACT),
        )
    yield (np.array([model.npair]),)


CONTACT = ("geom", "dist", "pos", "frame", "dim", "friction", "solref", "solreffriction", "solimp")


def played(scenario: Scenario, count: int) -> tuple[list[tuple], int]:
    """All steps, and the number of explicit pairs."""
    *rows, (pairs,) = steps(scenario, count)
    return rows, int(pairs[0])


@pytest.mark.parametrize(("name", "count"), SCENES)
def test_masks_give_the_contacts_of_explicit_pairs(
    name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Play the same states and contacts to the bit, in the same order, with the same coefficients."""
    scenario = catalogue()[name]
    masked, listed = played(scenario, count)
    assert listed == 0
    monkeypatch.setattr(mujoco_engine, "add_contacts", explicit_pairs)
    paired, listed = played(scenario, count)
    assert listed > 0
    assert sum(len(row[1]) for row in paired) > 0
    for one, two in zip(masked, paired, strict=True):
        for first, second in zip(one, two, strict=True):
            np.testing.assert_array_equal(first, second)


def ball(name: str, kind: str = "simulated") -> Body:
    """A ball of a material of its own."""
    piece = (Piece("ball", Sphere(0.1)),)
    if kind == "fixed":
        return Body(name, "fixed", name, piece)
    return Body(name, "simulated", name, piece, 1.0, inertia=sphere_inertia(1.0, 0.1))


def balls(bodies: Iterable[Body], coefficients: dict[str, tuple[float, float]]) -> Scenario:
    """Balls a metre apart, with the (e, mu) of each pair of materials by their two letters."""
    bodies = tuple(replace(body, position=(float(k), 0.0, 0.0)) for k, body in enumerate(bodies))
    pairs = tuple(PairCoefficients(*names, e, mu) for names, (e, mu) in coefficients.items())
    return Scenario("test", "a test", (), bodies, 1.0, pairs)


def facts(scenario: Scenario) -> tuple[dict[str, tuple[float, float]], int]:
    """(e, mu) of each pair as read back from the model, and the number of explicit pairs."""
    world = mujoco_engine.MujocoEngine().build(scenario, SETTINGS)
    reported = {
        pair.body_a + pair.body_b: (pair.restitution, pair.friction) for pair in world.describe().pairs
    }
    return reported, world._model.npair


def test_priorities_give_different_coefficients_to_different_pairs() -> None:
    """Give three materials two sets of coefficients without an explicit pair."""
    asked = {"aa": (0.1, 0.0), "ab": (0.5, 0.3), "ac": (0.5, 0.3), "bb": (0.1, 0.0), "bc": (0.2, 0.8)}
    reported, listed = facts(balls((ball("a"), ball("b"), ball("c")), asked | {"cc": (0.2, 0.8)}))
    assert listed == 0
    for pair in ("ab", "ac", "bc"):
        assert reported[pair] == pytest.approx(asked[pair], abs=1e-12)


def test_explicit_pairs_are_the_exception() -> None:
    """List the fewest pairs where no priorities give all coefficients, and give every pair its own."""
    asked = {"ab": (0.1, 0.1), "ac": (0.2, 0.2), "bc": (0.3, 0.3), "ad": (0.4, 0.4), "bd": (0.5, 0.5)}
    asked |= {"cd": (0.6, 0.6)} | {x + x: (0.0, 0.0) for x in "abcd"}
    scenario = balls((ball("a"), ball("b"), ball("c"), ball("d")), asked)
    reported, listed = facts(scenario)
    assert 0 < listed < len(reported)
    for pair, found in reported.items():
        assert found == pytest.approx(asked[pair], abs=1e-12)


@pytest.mark.parametrize("name", sorted(name for name, one in catalogue().items() if "large" not in one.tags))
def test_masks_allow_touching_pairs_and_no_others(name: str) -> None:
    """Let exactly the touching pairs of every scene collide, after masks, exclusions and explicit pairs."""
    scenario = planned(catalogue()[name]).applied(catalogue()[name], fixed_pieces=True)
    found = contact_filter(scenario)
    allowed = set(found.explicit)
    for a, b in combinations(sorted(found.geoms), 2):
        one, two = found.geoms[a], found.geoms[b]
        if one.contype & two.conaffinity or two.contype & one.conaffinity:
            allowed.add((a, b))
    assert allowed - set(found.excluded) == set(scenario.touching_pairs())
    # no priority chooses the product of two coefficients
    assert not found.explicit or name == "normal_impacts"
    for a, b in allowed - set(found.excluded) - set(found.explicit):
        one, two = found.geoms[a], found.geoms[b]
        chosen = one if one.priority >= two.priority else two
        assert chosen.coefficients == scenario.pair_coefficients(a, b)
        assert one.priority != two.priority or one.coefficients == two.coefficients
