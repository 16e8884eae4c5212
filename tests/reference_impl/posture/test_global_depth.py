"""Eq. 1 by hand."""

import numpy as np
import pytest

from touchstone.reference_impl.core.conventions import MOVER_BODY, MOVER_DRIVER, MOVER_TRUNK
from touchstone.reference_impl.core.world import BODY, PAIR
from touchstone.reference_impl.posture.global_depth import Mover, global_depth, side_of

BODY_1 = Mover(MOVER_BODY, 1)


def shift_of(contacts, mover=BODY_1, driver=-1):
    """Global depth of body 1 against bodies 0 (as A) and 2 (as B): (deepest, |PD|, PD)."""
    bodies, pairs = np.zeros(3, BODY), np.zeros(len(contacts), PAIR)
    bodies["driver"] = -1
    bodies[1]["driver"] = driver
    for pair, (a, b, distance, normal) in zip(pairs, contacts):
        pair["body_a"], pair["body_b"], pair["depth"], pair["normal"] = a, b, -distance, normal
    shift = np.zeros(3)
    return *global_depth(bodies, pairs, 0, len(pairs), mover, shift), shift


@pytest.mark.parametrize(
    ("contacts", "wanted"),
    [
        # B along the normal, A against it
        ([(0, 1, -0.02, (0, 0, 1))], (0, 0, 0.02)),
        ([(1, 2, -0.02, (0, 0, 1))], (0, 0, -0.02)),
        # depths of 2 and 1 cm: (4 x + y) / 3 cm
        ([(0, 1, -0.02, (1, 0, 0)), (1, 2, -0.01, (0, -1, 0))], (0.04 / 3, 0.01 / 3, 0)),
        # opposing depths are swapped: the cycle that Eq. 1 never leaves
        ([(0, 1, -0.02, (1, 0, 0)), (0, 1, -0.01, (-1, 0, 0))], (0.01, 0, 0)),
        # apart, touching, and of others
        ([(0, 1, 0.01, (1, 0, 0)), (0, 1, 0.0, (1, 0, 0)), (0, 2, -0.5, (1, 0, 0))], (0, 0, 0)),
    ],
)
def test_depths_are_weighed_by_themselves(contacts, wanted) -> None:
    """The mean of depth times normal, each with its depth as weight, of what overlaps the body."""
    deepest, size, shift = shift_of(contacts)
    assert deepest == max(0.02 * (1 in pair[:2] and pair[2] < 0) for pair in contacts)
    assert size == pytest.approx(np.linalg.norm(wanted), rel=1e-14)
    np.testing.assert_allclose(shift, wanted, rtol=1e-14)


def test_a_driver_moves_with_all_its_links() -> None:
    """Count the pairs of every link when the mover is a driver."""
    deepest, _, shift = shift_of([(0, 1, -0.02, (0, 1, 0))], mover=Mover(MOVER_DRIVER, 3), driver=3)
    assert deepest == 0.02
    np.testing.assert_allclose(shift, (0, 0.02, 0), rtol=1e-15)


def test_sides() -> None:
    """Distinguish B, A and neither, for a body, for a driver and for its trunk."""
    bodies, pairs = np.zeros(3, BODY), np.zeros(1, PAIR)
    bodies["driver"], bodies["chain"] = (-1, -1, 2), (-1, -1, 0)
    pairs[0]["body_a"], pairs[0]["body_b"] = 0, 2
    movers = [Mover(MOVER_BODY, k) for k in range(3)] + [Mover(MOVER_DRIVER, k) for k in (2, 1)]
    assert [side_of(bodies, pairs[0], mover) for mover in movers] == [-1, 0, 1, 1, 0]
    assert side_of(bodies, pairs[0], Mover(MOVER_TRUNK, 2)) == 0
    bodies["chain"] = -1
    assert side_of(bodies, pairs[0], Mover(MOVER_TRUNK, 2)) == 1
