"""Bodies that are cut in two are the same solids."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.relations.decomposition import decomposed, is_divisible
from touchstone.scenarios.scenario import Box, Piece, Vector, vector
from touchstone.scenarios.solids import hull_mass_properties

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
