"""The hand, its solids and the catalogue."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from touchstone.scenarios.avatar.hand import HAND_MASS, hand_parts
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.solids import (
    box_inertia,
    capsule_inertia,
    ellipsoid_inertia,
    elliptic_hull,
    sphere_inertia,
)


def test_the_hand_has_its_mass_and_parts() -> None:
    """Weigh 0.4 kg in a palm without shape and fifteen parts on fifteen hinges."""
    bodies, joints = hand_parts()
    assert sum(body.mass for body in bodies) == pytest.approx(HAND_MASS, rel=1e-15)
    assert HAND_MASS == 0.4
    assert [len(body.pieces) for body in bodies] == [0] + [1] * 15
    assert len(joints) == 15
    assert all(body.mass > 0 for body in bodies)


@pytest.mark.parametrize("half_axes", [(1.0, 1.0, 1.0), (0.024, 0.008, 0.008), (0.5, 2.0, 3.0)])
def test_an_elliptic_hull_lies_on_its_ellipsoid(half_axes) -> None:
    """Have 42 vertices and 80 triangles, all corners, all on the ellipsoid."""
    vertices = np.array(elliptic_hull(half_axes))
    hull = ConvexHull(vertices)
    assert (len(vertices), len(hull.vertices), len(hull.simplices)) == (42, 42, 80)
    np.testing.assert_allclose(((vertices / half_axes) ** 2).sum(axis=1), 1, atol=1e-14)
    # closed surface about its centre
    np.testing.assert_allclose(vertices.mean(axis=0), 0, atol=1e-15)


def test_inertia_of_solids_by_quadrature() -> None:
    """Match sums over a fine grid of points."""
    half = np.array([0.3, 0.2, 0.1])
    ticks = (np.arange(60) + 0.5) / 30 - 1
    grid = np.stack(np.meshgrid(ticks, ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    # a capsule of radius 0.2 and half length 0.3 in a box of half extents (0.2, 0.2, 0.5)
    pill, reach = (0.2, 0.2, 0.5), np.maximum(0, np.abs(grid[:, 2]) * 0.5 - 0.3)
    in_pill = (grid[:, :2] ** 2).sum(axis=1) * 0.04 + reach**2 < 0.04
    for size, inside, reported in (
        (half, np.ones(len(grid), bool), box_inertia(2.0, tuple(half))),
        (half, (grid**2).sum(axis=1) < 1, ellipsoid_inertia(2.0, tuple(half))),
        (pill, in_pill, capsule_inertia(2.0, 0.2, 0.3)),
    ):
        points = (grid * size)[inside]
        square = (points**2).sum(axis=1)
        inertia = 2.0 * (square.mean() * np.eye(3) - points.T @ points / len(points))
        # 60 cells an edge: a few 1e-3 on a curved surface
        np.testing.assert_allclose(reported, inertia, atol=3e-3 * np.max(inertia))
    assert sphere_inertia(2.0, 0.5) == ellipsoid_inertia(2.0, (0.5, 0.5, 0.5))
    np.testing.assert_allclose(capsule_inertia(2.0, 0.5, 1e-15), sphere_inertia(2.0, 0.5), atol=1e-14)


def test_probes_and_seeded_scenes_are_told_apart() -> None:
    """Play no seeded scene with the probes; keep what is isolated free of gravity and of fixed bodies."""
    assert not {s.name for s in tagged("probe")} & {s.name for s in tagged("seeded")}
    assert all(scenario.seed == int(scenario.name[-1]) for scenario in tagged("seeded"))
    for scenario in tagged("isolated"):
        assert {body.kind for body in scenario.bodies} == {"simulated"}
        assert scenario.acting_gravity == (0.0, 0.0, 0.0)
    for scenario in tagged("conservative"):
        # a break of many balls has no closed form
        if "symmetric" in scenario.tags:
            continue
        assert {t.body for t in scenario.truths} == {b.name for b in scenario.bodies if b.kind != "fixed"}


def test_who_may_touch(lab: SimpleNamespace) -> None:
    """Pair all bodies with pieces but fixed with fixed and links of one hand, unless self-collision is on."""
    scenario = catalogue()["ball_snip"]
    names = [body.name for body in scenario.bodies]
    pairs = {frozenset((names[a], names[b])) for a, b in scenario.touching_pairs()}
    assert frozenset(("ball", "table")) in pairs
    assert frozenset(("ball", "index_distal")) in pairs
    assert not any(frozenset(pair) in pairs for pair in (("floor", "table"), ("palm", "ball")))
    assert frozenset(("index_distal", "thumb_distal")) not in pairs
    itself = dataclasses.replace(scenario, effects=(*scenario.effects, "self_collision"))
    more = {frozenset((names[a], names[b])) for a, b in itself.touching_pairs()} - pairs
    assert frozenset(("index_distal", "thumb_distal")) in more
    # 15 parts: 105 pairs, 10 of them adjacent (those at the palm have no partner with a shape)
    assert len(more) == 95
