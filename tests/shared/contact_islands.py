"""Contact problems of single islands, recorded from scenes: rows and movers as `load_island` sets them."""

from pathlib import Path

import numpy as np

from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.solver.contact_rows import prepare_row, rebuild

FOLDER = Path(__file__).parents[1] / "reference_impl" / "solver"
OPEN = FOLDER / "open_islands.npz"
"""Random heaps and wedges (seeds 880013, 880058, 61004, `balanced`) that at most 600 factorisations of
Newton's method left open."""
USUAL = FOLDER / "islands.npz"
"""Dominoes (frames 30 and 54 in `balanced`, 50 in `accurate`), heaps (880013, 61004), a bridge (93077) and
wedges (880058)."""


def names(file: Path) -> list[str]:
    """Names of the islands of a file."""
    with np.load(file) as stored:
        return sorted(name.removesuffix("_rows") for name in stored if name.endswith("_rows"))


def loaded(file: Path, name: str) -> np.ndarray:
    """A state whose solver holds a stored island, without impulses."""
    state = np.zeros(1, STATE)
    solver = state[0]["solver"]
    with np.load(file) as stored:
        rows, movers = stored[f"{name}_rows"], stored[f"{name}_movers"]
    solver["row_count"], solver["mover_count"] = len(rows), len(movers)
    for field in rows.dtype.names:
        solver["rows"][field][: len(rows)] = rows[field]
    for field in movers.dtype.names:
        solver["movers"][field][: len(movers)] = movers[field]
    for k in range(len(rows)):
        prepare_row(solver["rows"][k])
    state[0]["factor_work"] = state[0]["frame_work"] = state[0]["work_left"] = 1e9
    solver["best_residual"] = np.inf
    rebuild(solver)
    return state
