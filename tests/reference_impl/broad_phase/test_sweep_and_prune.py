"""The broad phase against all pairs, by definition."""

import numpy as np
import pytest

from touchstone.reference_impl.broad_phase.spatial_hash import (
    COLUMN_FAR,
    SPATIAL_HASH_PIECE_COUNT,
    list_pieces,
)
from touchstone.reference_impl.broad_phase.sweep_and_prune import find_pairs
from touchstone.reference_impl.core.conventions import DRIVEN, FIXED, SIMULATED
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import BODY, PAIR, PIECE

KINDS = [SIMULATED, DRIVEN]


class Scene:
    """Pieces with boxes on a grid, so that some touch exactly: on bodies of all kinds, or each on its own."""

    def __init__(self, rng: np.random.Generator, counts: tuple[int, int, int], pieces_per_body: int = 3):
        """`counts` of fixed, simulated and driven bodies; of the last, every three are links of a driver."""
        self.bodies = np.zeros(sum(counts), BODY)
        self.bodies["kind"] = np.repeat([FIXED, SIMULATED, DRIVEN], counts)
        self.bodies["driver"] = -1
        self.bodies["driver"][sum(counts[:2]) :] = np.arange(counts[2]) // 3
        self.pieces = np.zeros(pieces_per_body * len(self.bodies), PIECE)
        self.pieces["body"] = rng.permutation(np.repeat(np.arange(len(self.bodies)), pieces_per_body))
        room = len(self.pieces) * (len(self.pieces) - 1) // 2
        self.state, self.pairs = np.zeros(1, STATE), np.zeros(5 + room, PAIR)
        self.moving = self.kind != FIXED
        side = np.cbrt(len(self.pieces)) / 4
        half = rng.integers(1, 8, (len(self.pieces), 3)) / 32
        self.place(rng.uniform(0, side, (len(self.pieces), 3)), half)

    @property
    def kind(self) -> np.ndarray:
        """Kind of the body of each piece."""
        return self.bodies["kind"][self.pieces["body"]]

    def place(self, center: np.ndarray, half: np.ndarray) -> None:
        """Put boxes round `center`, and take the pieces up from the start."""
        self.center, self.half = np.round(center * 32) / 32, half
        self.pieces["low"], self.pieces["high"] = self.center - half, self.center + half
        list_pieces(self.bodies, self.pieces, self.state[0])

    def move(self, step: np.ndarray) -> None:
        """Move what can move."""
        self.center[self.moving] += np.round(step[self.moving] * 32) / 32
        self.pieces["low"], self.pieces["high"] = self.center - self.half, self.center + self.half

    def found(self, kind: int) -> list[tuple[int, int]]:
        """Pairs in the order of the broad phase; their bodies are checked on the way."""
        end, lost = find_pairs(self.pieces, kind, 5, self.pairs, self.state[0])
        rows = self.pairs[5:end]
        assert lost == 0
        np.testing.assert_array_equal(rows["body_a"], self.pieces["body"][rows["piece_a"]])
        np.testing.assert_array_equal(rows["body_b"], self.pieces["body"][rows["piece_b"]])
        return list(zip(rows["piece_a"].tolist(), rows["piece_b"].tolist()))

    def wanted(self, kind: int) -> set[tuple[int, int]]:
        """Every wanted pair, by definition."""
        low, high, body = self.pieces["low"], self.pieces["high"], self.pieces["body"]
        meet = (low[:, None] <= high).all(axis=2) & (low <= high[:, None]).all(axis=2)
        driver = self.bodies["driver"][body]
        apart = (body[:, None] != body) & ((driver[:, None] != driver) | (driver < 0))
        kinds = (self.kind == kind)[:, None] | (self.kind == kind)
        return set(zip(*(k.tolist() for k in np.nonzero(np.triu(meet & apart & kinds, 1)))))

    def check(self) -> int:
        """All pairs are found once and none more, for either kind; returns how many there are."""
        count = 0
        for kind in KINDS:
            found, wanted = self.found(kind), self.wanted(kind)
            assert len(found) == len(set(found))
            assert set(found) == wanted
            count += len(found)
        return count


SIZES = {
    "few": (4, 8, 6),
    "many simulated": (5, 60, 6),
    "many driven": (5, 10, 60),
    "many of all": (60, 50, 45),
    "many fixed": (120, 5, 3),
}


SIZED = pytest.mark.parametrize("counts", SIZES.values(), ids=SIZES)


@SIZED
@pytest.mark.parametrize("seed", range(3))
def test_pairs_are_all_pairs_frame_after_frame(counts: tuple[int, int, int], seed: int) -> None:
    """Find what brute force finds over ten frames of motion, when every piece, or one in ten, jumps anywhere,
    and beyond the last square of the hash that is distinct."""
    rng = np.random.default_rng(seed)
    scene = Scene(rng, counts)
    for _ in range(10):
        assert scene.check() > 0
        scene.move(rng.normal(size=scene.center.shape) * 0.05)
    for share in (1.0, 0.1, 0.1, 1.0):
        jumps = rng.random(len(scene.pieces)) < share
        target = rng.uniform(-2, 2, scene.center.shape)
        scene.move(np.where(jumps[:, None], target - scene.center, 0.0))
        scene.check()
    far = Scene(rng, counts)
    far.place(far.center + 100 * COLUMN_FAR * rng.integers(-1, 2, far.center.shape), far.half)
    assert far.check() > 0


@pytest.mark.parametrize("counts", [*SIZES.values(), (1, 2, 6)], ids=[*SIZES, "two of a kind"])
def test_coincident_boxes(counts: tuple[int, int, int]) -> None:
    """Pair all with all where every box is the same, points included."""
    scene = Scene(np.random.default_rng(5), counts, pieces_per_body=1)
    for half in (0.25, 0.0):
        scene.place(np.ones((len(scene.pieces), 3)), np.full((len(scene.pieces), 3), half))
        fixed, simulated, driven = counts
        links = driven * (driven - 1) // 2 - driven // 3 * 3
        assert len(scene.found(SIMULATED)) == simulated * (fixed + driven) + simulated * (simulated - 1) // 2
        assert len(scene.found(DRIVEN)) == driven * (fixed + simulated) + links
        scene.check()


@SIZED
@pytest.mark.parametrize("huge", [0.01, 0.3, 0.95])
def test_huge_beside_tiny(counts: tuple[int, int, int], huge: float) -> None:
    """Find all pairs where a share of the boxes is up to a million times as large as the rest."""
    rng = np.random.default_rng(6)
    scene = Scene(rng, counts)
    large = rng.random(len(scene.pieces)) < huge
    e = np.where(large[:, None], rng.uniform(0, 3, scene.half.shape), rng.uniform(-3, -1, scene.half.shape))
    scene.place(rng.uniform(-3, 3, scene.center.shape), 10**e)
    for _ in range(3):
        scene.check()
        scene.move(rng.normal(size=scene.center.shape) * 0.1)


def test_fixed_pieces_alone_make_no_pair() -> None:
    """Find nothing, whatever is asked, in a scene that cannot move."""
    for count in (1, SPATIAL_HASH_PIECE_COUNT + 10):
        scene = Scene(np.random.default_rng(7), (count, 0, 0))
        assert scene.check() == 0


@pytest.mark.parametrize("counts", [SIZES["few"], SIZES["many of all"]])
def test_fixed_pieces_are_sorted_once(counts: tuple[int, int, int]) -> None:
    """Read the boxes of fixed pieces when they are listed, and never again."""
    scene = Scene(np.random.default_rng(8), counts)
    before = [scene.found(kind) for kind in KINDS]
    for name in ("low", "high"):
        scene.pieces[name][~scene.moving] += 100.0
    assert [scene.found(kind) for kind in KINDS] == before
    list_pieces(scene.bodies, scene.pieces, scene.state[0])
    scene.check()


def test_pairs_without_room_are_counted() -> None:
    """Count the pairs dropped because the pair buffer is full; fill it."""
    scene = Scene(np.random.default_rng(1), SIZES["many of all"])
    wanted = scene.found(SIMULATED)
    pairs = np.zeros(7, PAIR)
    assert find_pairs(scene.pieces, SIMULATED, 0, pairs, scene.state[0]) == (7, len(wanted) - 7)
    assert list(zip(pairs["piece_a"].tolist(), pairs["piece_b"].tolist())) == wanted[:7]


@SIZED
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_diverged_box_makes_no_false_pair(counts: tuple[int, int, int], value: float) -> None:
    """Pair only what meets when a few boxes have become infinite or no numbers, and all of it again after."""
    scene = Scene(np.random.default_rng(12), counts)
    lost = np.flatnonzero(scene.moving)[::7]
    scene.pieces["low"][lost] = scene.pieces["high"][lost] = value
    for kind in KINDS:
        found = scene.found(kind)
        assert len(found) == len(set(found))
        assert set(found) <= scene.wanted(kind)
    scene.move(np.zeros(scene.center.shape))
    assert scene.check() > 0
