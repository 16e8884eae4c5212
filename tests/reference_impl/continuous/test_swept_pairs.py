"""Broad phase of moving pieces."""

from types import SimpleNamespace

from touchstone.reference_impl.continuous.swept_pairs import find_swept_pairs
from touchstone.reference_impl.core.conventions import DRIVEN, SIMULATED


def test_a_driver_in_the_loop_is_swept_where_fat_bounds_are_dropped(lab: SimpleNamespace) -> None:
    """Find what a driven block meets a metre ahead, in the search in which a piece leaves its fat bounds."""
    hand = lab.block("hand", (0.05, 0.05, 0.05), (0.0, 0.0, 0.0), kind="driven")
    tracker = lab.still("hand", (0.0, 0.0, 0.0))
    world = lab.build(lab.scene(hand, lab.ball("ball", (1.0, 0.0, 0.0)), trackers=(tracker,)))
    state = world.state
    for body in world.bodies:
        body["old_center"], body["old_orientation"] = body["center"], body["orientation"]
    moving = int((world.bodies["kind"] == DRIVEN).argmax())
    world.bodies[moving]["moves"], world.bodies[moving]["travel"] = 1, (1.0, 0.0, 0.0)
    # no piece is inside fat bounds of no extent
    state["has_fat_bounds"], state["driven_loop"] = 1, 1
    world.pieces["fat_low"] = world.pieces["fat_high"] = 0.0
    assert find_swept_pairs(world.of_stages(), SIMULATED, 0) == 1
    assert state["has_fat_bounds"] == 0
