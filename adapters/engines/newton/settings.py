"""Table of Newton's settings that `--set` changes, named as the parameters of its solvers."""

from __future__ import annotations

from touchstone.adapters.engines.newton import ENTRY
from touchstone.adapters.knobs import Range, Table

SETTINGS = Table(
    ENTRY.profiles,
    (
        Range("iterations", 1, 1e6, "", ("10", "100", "100", "12", "200"), "most iterations of the solver"),
        Range("worlds", 1, 4096, "", ("1",) * len(ENTRY.profiles), "equal worlds that are stepped together"),
    ),
)
