"""Pairs of convex shapes from a file: JSON or TOML with an array `pairs`."""

from dataclasses import dataclass
from pathlib import Path

from touchstone.scenarios.files.read import SceneFileError, built, data_of_file, placed
from touchstone.scenarios.files.schema import model_of
from touchstone.scenarios.scenario import IDENTITY, ORIGIN, Piece, Quaternion, Shape, Vector
from touchstone.scenarios.validation import check_piece


@dataclass(frozen=True, slots=True)
class Placed:
    """Shape with its pose in the world: origin [m] and unit quaternion wxyz."""

    shape: Shape
    position: Vector = ORIGIN
    orientation: Quaternion = IDENTITY


@dataclass(frozen=True, slots=True)
class GivenPair:
    """Two shapes, a name, and where the pair comes from."""

    name: str
    a: Placed
    b: Placed
    source: str = ""

    @property
    def pieces(self) -> tuple[Piece, Piece]:
        """The two shapes as pieces."""
        one, two = (
            Piece(side, p.shape, p.position, p.orientation) for side, p in (("a", self.a), ("b", self.b))
        )
        return one, two


@dataclass(frozen=True, slots=True)
class PairFile:
    """Content of a file of pairs."""

    pairs: tuple[GivenPair, ...]


def read_pairs(path: Path) -> tuple[GivenPair, ...]:
    """Pairs of a file; raises SceneFileError with a line per fault."""
    data, faults, message_of = data_of_file(path, model_of(PairFile))
    pairs = built(PairFile, data).pairs if data else ()
    names: set[str] = set()
    for i, pair in enumerate(pairs):
        for piece in pair.pieces:
            check_piece(
                piece, f"pairs[{i}].{piece.name}", lambda where, text: faults.append((placed(where), text))
            )
        if pair.name in names or not pair.name:
            faults.append((("pairs", i, "name"), f"found {pair.name!r}, expected a name of its own"))
        names.add(pair.name)
    if not (pairs or faults):
        faults.append((("pairs",), "found none, expected at least one"))
    if faults:
        raise SceneFileError(message_of(faults))
    return pairs
