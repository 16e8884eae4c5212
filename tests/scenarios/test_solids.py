"""Uniform solids: mass properties of hulls, bodies of one piece, bodies that are cut in two."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.relations.decomposition import decomposed, is_divisible
from touchstone.scenarios.rounded_solid import rounded_mass_properties
from touchstone.scenarios.scenario import Box, PairCoefficients, Piece, Scenario, Vector, vector
from touchstone.scenarios.solids import (
    block,
    box_corners,
    box_inertia,
    capsule,
    capsule_inertia,
    cone_inertia,
    cylinder_inertia,
    ellipsoid,
    ellipsoid_inertia,
    hull,
    hull_mass_properties,
    slab,
)

ROUNDING = 1e-13
"""Relative error of a few hundred sums of products of one size."""
CUBE = tuple(product((-0.1, 0.1), (-0.2, 0.2), (-0.3, 0.3)))


def test_a_box_by_its_corners():
    """Give a box the closed form's volume, centre and inertia, wherever its corners lie."""
    mass, centre, inertia = hull_mass_properties(np.array(CUBE) + [3.0, -2.0, 1.0], density=500.0)
    assert mass == pytest.approx(500.0 * 0.2 * 0.4 * 0.6, rel=ROUNDING)
    np.testing.assert_allclose(centre, (3.0, -2.0, 1.0), rtol=ROUNDING)
    # the offset of 3 m loses four digits of the corners themselves
    np.testing.assert_allclose(inertia, box_inertia(mass, (0.1, 0.2, 0.3)), atol=1e-12)


def test_a_tetrahedron():
    """Give a cube's corner I_xx = 3 m a^2 / 40 and I_xy = m a^2 / 80 about its centre."""
    vertices = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    mass, centre, inertia = hull_mass_properties(vertices, density=6.0)
    assert mass == pytest.approx(1.0, rel=ROUNDING)
    np.testing.assert_allclose(centre, (0.25, 0.25, 0.25), rtol=ROUNDING)
    np.testing.assert_allclose(inertia, (5 * np.eye(3) + 1) / 80, rtol=ROUNDING)


def test_turned_hulls_have_turned_inertia():
    """Turn the corners of a box and find its inertia turned, I' = R I R^T."""
    turn = Rotation.from_rotvec((0.3, -1.1, 0.7))
    _, _, inertia = hull_mass_properties(turn.apply(CUBE), mass=2.0)
    matrix = turn.as_matrix()
    expected = matrix @ np.array(box_inertia(2.0, (0.1, 0.2, 0.3))) @ matrix.T
    np.testing.assert_allclose(inertia, expected, atol=1e-15)


def test_a_fine_prism_tends_to_its_cylinder():
    """Approach the cylinder's inertia as 1 / n^2 with n sides."""
    angles = 2 * np.pi * np.arange(400) / 400
    rim = 0.2 * np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.vstack([np.column_stack([rim, np.full(400, z)]) for z in (-0.3, 0.3)])
    mass, _, inertia = hull_mass_properties(points, mass=2.0)
    np.testing.assert_allclose(inertia, cylinder_inertia(mass, 0.2, 0.3), rtol=2e-4, atol=1e-15)


def test_what_has_no_volume_is_refused():
    """Refuse flat hulls, too few vertices, and both or neither of mass and density."""
    with pytest.raises(ValueError, match="8 vertices span no volume"):
        hull_mass_properties([(x, y, 0.0) for x, y, _ in CUBE], mass=1.0)
    with pytest.raises(ValueError, match="2 vertices span no volume"):
        hull_mass_properties(CUBE[:2], mass=1.0)
    for given in ({}, {"mass": 1.0, "density": 1.0}):
        with pytest.raises(ValueError, match="exactly one"):
            hull_mass_properties(CUBE, **given)


def test_bodies_of_one_piece_are_valid_and_centred():
    """Build a capsule, an ellipsoid and a hull whose origin is their centre of mass, and a fixed wedge."""
    wedge = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    bodies = (
        capsule("capsule", "wood", 0.1, 0.2, 1.0, position=(0.0, 0.0, 1.0)),
        ellipsoid("ellipsoid", "wood", (0.1, 0.2, 0.3), 2.0, position=(1.0, 0.0, 1.0), spin=(1.0, 0.0, 0.0)),
        hull("hull", "wood", np.array(wedge) + 5.0, 3.0, position=(2.0, 0.0, 1.0)),
        replace(hull("wedge", "wood", wedge, position=(5.0, 0.0, 1.0)), kind="fixed"),
        block("block", "wood", (0.1, 0.1, 0.1), 1.0, position=(8.0, 0.0, 1.0)),
        slab("floor", "wood"),
    )
    Scenario("solids", "", (), bodies, 1.0, (PairCoefficients("wood", "wood", 0.0, 0.5),))
    assert bodies[0].inertia == capsule_inertia(1.0, 0.1, 0.2)
    assert bodies[1].inertia == ellipsoid_inertia(2.0, (0.1, 0.2, 0.3))
    shape = bodies[2].pieces[0].shape
    _, centre, inertia = hull_mass_properties(shape.vertices, mass=3.0)
    np.testing.assert_allclose(centre, 0.0, atol=1e-15)
    np.testing.assert_allclose(bodies[2].inertia, inertia, rtol=1e-12)
    assert bodies[3].mass == 0


def test_bodies_are_the_same_on_every_processor() -> None:
    """Give all bodies of the catalogue the same bits with the linear algebra of two processors."""
    code = (
        "from dataclasses import asdict\n"
        "from touchstone.scenarios.catalogue import catalogue\n"
        "print([asdict(body) for scenario in catalogue().values() for body in scenario.bodies])"
    )
    printed = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=os.environ | {"OPENBLAS_CORETYPE": processor},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for processor in ("Prescott", "Sandybridge")
    ]
    assert "vertices" in printed[0]
    assert printed[0] == printed[1]


def test_a_rounded_box_is_its_parts():
    """Give the volume of Steiner's formula, and the second moments of slabs, quarter cylinders, octants."""
    sides, r = np.array((0.3, 0.2, 0.1)), 0.07

    def square(a, b, c):
        faces = 8 * b * c * ((a + r) ** 3 - a**3) / 3 + 8 * a * r * (b + c) * a * a / 3
        edges = 2 * np.pi * r * r * a**3 / 3
        edges += sum(
            8 * half * (a * a * np.pi * r * r / 4 + 2 * a * r**3 / 3 + np.pi * r**4 / 16) for half in (b, c)
        )
        corners = 8 * (a * a * np.pi * r**3 / 6 + a * np.pi * r**4 / 8 + np.pi * r**5 / 30)
        return 8 * b * c * a**3 / 3 + faces + edges + corners

    a, b, c = sides
    volume = (
        8 * a * b * c
        + 8 * r * (a * b + b * c + a * c)
        + 2 * np.pi * r * r * (a + b + c)
        + 4 / 3 * np.pi * r**3
    )
    squares = np.array([square(*np.roll(sides, -k)) for k in range(3)])
    mass, centre, inertia = rounded_mass_properties(np.add(box_corners(tuple(sides)), (1.0, 2.0, 3.0)), r)
    assert mass == pytest.approx(volume, rel=ROUNDING)
    np.testing.assert_allclose(centre, (1.0, 2.0, 3.0), rtol=ROUNDING)
    np.testing.assert_allclose(inertia, np.diag(squares.sum() - squares), atol=1e-14)


def test_a_rounded_hull_tends_to_a_fine_one():
    """Be a little heavier than the hull of points on its surface, and have its centre and its inertia."""
    corners, r = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.2, 0.8, 0.0), (0.1, 0.2, 0.9)), 0.3
    ball = Rotation.random(1500, random_state=1).apply((0.0, 0.0, r))
    points = (np.array(corners)[:, None] + ball).reshape(-1, 3)
    fine, own = hull_mass_properties(points, density=1.0), rounded_mass_properties(corners, r)
    assert 0 < own[0] - fine[0] < 1e-2 * own[0]
    np.testing.assert_allclose(own[1], fine[1], atol=1e-3)
    np.testing.assert_allclose(own[2], fine[2], rtol=2e-2, atol=1e-3)


def test_a_cone_is_a_pyramid_of_many_sides():
    """Have the centre of mass and the inertia of its pyramid, to the depth of the sides."""
    turns = np.linspace(0.0, 2 * np.pi, 2000, endpoint=False)
    rim = np.column_stack((0.3 * np.cos(turns), 0.3 * np.sin(turns), np.full(2000, -0.2)))
    _, centre, inertia = hull_mass_properties([*rim, (0.0, 0.0, 0.2)], mass=2.0)
    np.testing.assert_allclose(centre, (0.0, 0.0, -0.1), atol=1e-6)
    np.testing.assert_allclose(inertia, cone_inertia(2.0, 0.3, 0.2), atol=1e-6)


SCENES = ("slide", "stack", "coin_falls", "arch_stands", "tip_falls")


def corners(piece: Piece) -> tuple[Vector, ...]:
    """Corners of a box or a hull in the body's frame."""
    shape = piece.shape
    if isinstance(shape, Box):
        local = np.array(list(product(*((-half, half) for half in shape.half_extents))))
    else:
        local = np.array(shape.vertices)
    return tuple(
        map(vector, Rotation.from_quat(piece.orientation, scalar_first=True).apply(local) + piece.position)
    )


def moments(pieces: tuple[Piece, ...]) -> np.ndarray:
    """Volume, first and second moments about the body's origin of pieces that do not overlap."""
    found = np.zeros(13)
    for piece in pieces:
        mass, centre, inertia = hull_mass_properties(corners(piece), density=1.0)
        c = np.array(centre)
        about = np.array(inertia) + mass * (c @ c * np.eye(3) - np.outer(c, c))
        found += [mass, *(mass * c), *about.ravel()]
    return found


@pytest.mark.parametrize("name", SCENES)
def test_the_parts_are_the_whole(name: str) -> None:
    """Two parts a piece, with the volume and the moments of the whole, and masses as before."""
    scene, cut = catalogue()[name], decomposed(catalogue()[name])
    for whole, parts in zip(scene.bodies, cut.bodies):
        if not is_divisible(whole):
            assert parts == whole
            continue
        assert len(parts.pieces) == 2 * len(whole.pieces)
        assert (parts.mass, parts.inertia) == (whole.mass, whole.inertia)
        one, two = moments(whole.pieces), moments(parts.pieces)
        np.testing.assert_allclose(two, one, atol=1e-13 * np.abs(one).max())
        # no part reaches beyond the whole
        for axis in np.random.default_rng(3).normal(size=(50, 3)):
            reach = [max((np.array(corners(p)) @ axis).max() for p in body.pieces) for body in (whole, parts)]
            assert reach[1] == pytest.approx(reach[0], abs=1e-14)


def test_cuts_are_random_and_repeat() -> None:
    """Equal bodies are cut at different places, and a scene always at the same."""
    cut = decomposed(catalogue()["slide"])
    assert cut == decomposed(catalogue()["slide"])
    first = [body.pieces[0] for body in cut.bodies[1:]]
    assert len({piece.shape for piece in first}) == len(first)
