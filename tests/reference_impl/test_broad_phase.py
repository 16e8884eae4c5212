"""Sweep and prune against all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from reference_impl.broad_phase import find_pairs
from reference_impl.conventions import DRIVEN, FIXED, SIMULATED
from reference_impl.world import BODY, PAIR, PIECE


def random_scene(rng: np.random.Generator):
    """Sixty pieces on twenty bodies of all kinds; two driven bodies of three links each."""
    bodies, pieces = np.zeros(20, BODY), np.zeros(60, PIECE)
    bodies["kind"] = [FIXED] * 6 + [SIMULATED] * 8 + [DRIVEN] * 6
    bodies["driver"] = [-1] * 14 + [0, 0, 0, 1, 1, 1]
    pieces["body"] = np.sort(rng.integers(0, 20, 60))
    pieces["order"] = np.arange(60)
    place(rng, pieces, rng.uniform(0, 1, (60, 3)))
    return bodies, pieces


def place(rng: np.random.Generator, pieces: np.ndarray, center: np.ndarray) -> None:
    """Boxes of random size round `center`, on a grid, so that some touch exactly."""
    half = rng.integers(1, 5, (len(pieces), 3)) / 32
    center = np.round(center * 32) / 32
    pieces["low"], pieces["high"] = center - half, center + half


def all_pairs(bodies, pieces, kind) -> set[tuple[int, int]]:
    """Every wanted pair, by definition."""
    found = set()
    for p in range(len(pieces)):
        for q in range(p + 1, len(pieces)):
            one, two = bodies[pieces[p]["body"]], bodies[pieces[q]["body"]]
            same = pieces[p]["body"] == pieces[q]["body"] or one["driver"] == two["driver"] >= 0
            meet = (pieces[p]["low"] <= pieces[q]["high"]).all() and (
                pieces[q]["low"] <= pieces[p]["high"]
            ).all()
            if kind in (one["kind"], two["kind"]) and not same and meet:
                found.add((p, q))
    return found


@pytest.mark.parametrize("kind", [SIMULATED, DRIVEN])
@pytest.mark.parametrize("seed", range(5))
def test_pairs_are_all_pairs_frame_after_frame(kind: int, seed: int) -> None:
    """Find what brute force finds over ten frames of motion; the order stays a permutation."""
    rng = np.random.default_rng(seed)
    bodies, pieces = random_scene(rng)
    pairs = np.zeros(2000, PAIR)
    for _ in range(10):
        end, lost = find_pairs(bodies, pieces, kind, 5, pairs)
        rows = pairs[5:end]
        found = list(zip(rows["piece_a"].tolist(), rows["piece_b"].tolist()))
        assert lost == 0
        assert len(found) == len(set(found))
        assert set(found) == all_pairs(bodies, pieces, kind)
        np.testing.assert_array_equal(rows["body_a"], pieces["body"][rows["piece_a"]])
        np.testing.assert_array_equal(rows["body_b"], pieces["body"][rows["piece_b"]])
        assert sorted(pieces["order"]) == list(range(len(pieces)))
        assert (np.diff(pieces["low"][pieces["order"], 0]) >= 0).all()
        place(rng, pieces, (pieces["low"] + pieces["high"]) / 2 + rng.normal(size=(60, 3)) * 0.05)


def test_pairs_without_room_are_counted() -> None:
    """Tell how many pairs found no room."""
    bodies, pieces = random_scene(np.random.default_rng(1))
    wanted = len(all_pairs(bodies, pieces, SIMULATED))
    end, lost = find_pairs(bodies, pieces, SIMULATED, 0, np.zeros(7, PAIR))
    assert (end, lost) == (7, wanted - 7)


def test_pieces_of_one_body_never_pair() -> None:
    """Leave the pieces of a compound simulated body alone."""
    bodies, pieces = np.zeros(1, BODY), np.zeros(3, PIECE)
    bodies["kind"], bodies["driver"] = SIMULATED, -1
    pieces["order"], pieces["high"] = np.arange(3), 1.0
    assert find_pairs(bodies, pieces, SIMULATED, 0, np.zeros(7, PAIR)) == (0, 0)
