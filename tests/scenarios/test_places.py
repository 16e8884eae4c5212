"""Bodies that start where others do."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scenarios.scenario import Hull, Piece, ScenarioError
from scenarios.solids import ball, block, hull

HERE = (0.3, -0.2, 1.0)
CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


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
def test_bodies_in_one_place_are_refused(lab, other):
    """Refuse two bodies with one centre, whatever their shapes, with the bodies and the place in one line."""
    with pytest.raises(ScenarioError) as caught:
        lab.scene(ball("one", "wood", 0.05, 1.0, HERE), lab.ground(), other)
    told = "'two' starts where 'one' does: pieces of both have their centre at (0.3, -0.2, 1) m; move one of them"
    assert caught.value.faults == [("bodies[2].position", told)]


def test_every_body_of_a_pile_in_one_place_is_named_once(lab):
    """Name each pair once, though several of their pieces coincide."""
    pieces = (Piece("left", Hull(CORNERS)), Piece("right", Hull(CORNERS), (3.0, 0.0, 0.0)))
    twins = [replace(lab.ball(f"twin_{k}"), pieces=pieces) for k in range(3)]
    with pytest.raises(ScenarioError) as caught:
        lab.scene(*twins)
    assert [path for path, _ in caught.value.faults] == [f"bodies[{k}].position" for k in (1, 2, 2)]


def test_overlap_is_no_fault(lab):
    """Accept bodies that overlap, fixed bodies in one place, and one body's pieces in one place."""
    near = (HERE[0] + 1e-6, *HERE[1:])
    twice = (Piece("one", Hull(CORNERS)), Piece("two", Hull(CORNERS)))
    lab.scene(
        ball("one", "wood", 0.05, 1.0, HERE),
        ball("two", "wood", 0.05, 1.0, near),
        replace(lab.ball("three", (5.0, 0.0, 1.0)), pieces=twice),
        lab.ground(),
        replace(lab.ground(), name="again"),
    )
