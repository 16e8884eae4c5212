"""Eq. 1 by hand."""

from __future__ import annotations

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


def test_one_pair_moves_by_its_depth() -> None:
    """Move B along the normal and A against it, by the depth."""
    deepest, size, shift = shift_of([(0, 1, -0.02, (0, 0, 1))])
    assert (deepest, size) == (0.02, pytest.approx(0.02, rel=1e-15))
    np.testing.assert_allclose(shift, (0, 0, 0.02), rtol=1e-15)
    np.testing.assert_allclose(shift_of([(1, 2, -0.02, (0, 0, 1))])[2], (0, 0, -0.02), rtol=1e-15)


def test_depth_weighted_mean() -> None:
    """Weigh depths 2 and 1 cm along x and y: (4 x + y) / 3 cm."""
    deepest, size, shift = shift_of([(0, 1, -0.02, (1, 0, 0)), (1, 2, -0.01, (0, -1, 0))])
    assert deepest == 0.02
    np.testing.assert_allclose(shift, (0.04 / 3, 0.01 / 3, 0), rtol=1e-14)
    assert size == pytest.approx(np.hypot(0.04, 0.01) / 3, rel=1e-14)


def test_opposing_normals_swap_their_depths() -> None:
    """Turn opposing depths of 2 and 1 cm into 1 and 2 cm: the cycle that Eq. 1 never leaves."""
    _, _, shift = shift_of([(0, 1, -0.02, (1, 0, 0)), (0, 1, -0.01, (-1, 0, 0))])
    np.testing.assert_allclose(shift, (0.01, 0, 0), rtol=1e-14)


def test_other_bodies_and_gaps_do_not_count() -> None:
    """Leave out pairs that are apart, touch, or belong to others."""
    contacts = [(0, 1, 0.01, (1, 0, 0)), (0, 1, 0.0, (1, 0, 0)), (0, 2, -0.5, (1, 0, 0))]
    deepest, size, shift = shift_of(contacts)
    assert (deepest, size) == (0.0, 0.0)
    assert not shift.any()


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
