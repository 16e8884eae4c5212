"""Height fields: terrain as columns of triangles, each a convex piece.

The surface is the triangles of a grid, and what is below them down to `bottom` is solid, as in the height
fields of MuJoCo: every engine plays it as convex pieces.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, isfinite

from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Hull, Piece, Vector

MOST_CELLS = 4096
"""Most cells of a height field [1]: each is two pieces."""


@dataclass(frozen=True, slots=True)
class HeightField:
    """Terrain about its body's origin: `heights` [m] are rows along x of points along y, `spacing` [m] apart,
    and the solid ends at the height `bottom` [m]. Cells are split from (i, j) to (i + 1, j + 1)."""

    heights: tuple[tuple[float, ...], ...]
    spacing: tuple[float, float]
    bottom: float

    def faults(self) -> Iterator[tuple[str, str]]:
        widths = {len(row) for row in self.heights}
        if len(self.heights) < 2 or len(widths) > 1 or min(widths) < 2:
            found = f"{plural(len(self.heights), 'row')} of {sorted(widths)} points"
            yield "heights", f"found {found}, expected two or more of two or more, all as long"
        elif (len(self.heights) - 1) * (min(widths) - 1) > MOST_CELLS:
            yield (
                "heights",
                f"found {len(self.heights)} x {min(widths)} points, expected at most {MOST_CELLS} cells",
            )
        for i, row in enumerate(self.heights):
            for j, height in enumerate(row):
                if not isfinite(height):
                    yield f"heights[{i}][{j}]", f"found {height}, expected a finite number"
        for k, step in enumerate(self.spacing):
            if not 0 < step < inf:
                yield f"spacing[{k}]", f"found {step}, expected a positive finite number"
        lowest = min((height for row in self.heights for height in row), default=inf)
        if not self.bottom < lowest:
            yield "bottom", f"found {self.bottom}, expected less than the lowest height, {lowest:g}"

    def pieces(self) -> tuple[Piece, ...]:
        """Two prisms per cell, in the frame of their body; raises ValueError if a field is wrong."""
        for field, text in self.faults():
            raise ValueError(f"{field}: {text}")
        rows, columns = len(self.heights), len(self.heights[0])
        return tuple(
            Piece(f"cell_{i}_{j}_{side}", self._prism(corners))
            for i in range(rows - 1)
            for j in range(columns - 1)
            for side, corners in (
                ("a", ((i, j), (i + 1, j), (i + 1, j + 1))),
                ("b", ((i, j), (i + 1, j + 1), (i, j + 1))),
            )
        )

    def _prism(self, corners: tuple[tuple[int, int], ...]) -> Hull:
        top = [self._point(i, j) for i, j in corners]
        return Hull((*top, *((x, y, self.bottom) for x, y, _ in top)))

    def _point(self, i: int, j: int) -> Vector:
        x, y = self.spacing
        rows, columns = len(self.heights), len(self.heights[0])
        return (i - (rows - 1) / 2) * x, (j - (columns - 1) / 2) * y, self.heights[i][j]
