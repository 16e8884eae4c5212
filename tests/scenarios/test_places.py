"""Bodies that start in the same place."""

from dataclasses import replace

import pytest

from touchstone.scenarios.places import coinciding
from touchstone.scenarios.scenario import Hull, Piece
from touchstone.scenarios.solids import ball, block, hull

HERE = (0.3, -0.2, 1.0)
CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ONE = ball("one", "wood", 0.05, 1.0, HERE)


@pytest.mark.parametrize(
    "other",
    [
        ball("two", "wood", 0.03, 2.0, HERE),
        block("two", "wood", (0.1, 0.1, 0.1), 1.0, HERE),
        block("two", "wood", (0.1, 0.1, 0.1), kind="fixed", position=HERE),
        # the mean of the corners of a tetrahedron is its centre of mass
        hull("two", "wood", CORNERS, 1.0, HERE),
    ],
    ids=("ball", "block", "fixed", "hull"),
)
def test_bodies_in_one_place_are_told(lab, other):
    """Name two bodies with one centre, whatever their shapes, and their place, in one line."""
    expected = (
        "bodies[2].position: 'two' starts where 'one' does: pieces of both have their centre at "
        "(0.3, -0.2, 1) m; move one of them"
    )
    assert coinciding(lab.scene(ONE, lab.ground(), other)) == expected


def test_overlap_is_no_fault(lab):
    """Say nothing of bodies that overlap, of fixed bodies in one place, and of one body's pieces in one."""
    near = (HERE[0] + 1e-6, *HERE[1:])
    twice = (Piece("one", Hull(CORNERS)), Piece("two", Hull(CORNERS)))
    scene = lab.scene(
        ONE,
        ball("two", "wood", 0.05, 1.0, near),
        replace(lab.ball("three", (5.0, 0.0, 1.0)), pieces=twice),
        lab.ground(),
        replace(lab.ground(), name="again"),
    )
    assert coinciding(scene) is None
    assert coinciding(lab.scene(ONE)) is None
