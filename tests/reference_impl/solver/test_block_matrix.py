"""Steps of Newton's method equal those of a dense matrix, in islands of any shape."""

from itertools import pairwise

import numpy as np
import pytest

from touchstone.reference_impl.core.solver_dtypes import NEWTON_ROWS
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.solver.block_matrix import (
    add_row,
    begin_matrix,
    factorise,
    lay_out,
    solve_factors,
)

CHAIN = [(k, k + 1) for k in range(19)] + [(-1, k) for k in range(20)]
"""Dominoes on a floor, which is no mover."""
STAR = [(k, 0) for k in range(1, 7)]
"""Six bodies on one."""


def loop(rng: np.random.Generator) -> list[tuple[int, int]]:
    """Twelve bodies in random order with twenty contacts more."""
    order = rng.permutation(12).tolist()
    return [*pairwise(order), *(tuple(rng.choice(12, 2, replace=False)) for _ in range(20))]


def heap(rng: np.random.Generator) -> list[tuple[int, int]]:
    """150 bodies, of more than two words of neighbours, with 300 contacts, a fifth of them on a floor."""
    sides = [tuple(rng.choice(150, 2, replace=False)) for _ in range(240)]
    return [*sides, *((-1, k) for k in rng.integers(0, 150, 60).tolist()), (148, 149)]


def cross(r: np.ndarray) -> np.ndarray:
    """Matrix of the cross product with r (3, 3)."""
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def loaded(rng: np.random.Generator, sides: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray]:
    """A solver with one row per pair of movers, and its dense matrix; places are laid out."""
    state = np.zeros(1, STATE)
    solver = state[0]["solver"]
    state[0]["factor_work"] = state[0]["frame_work"] = 1e9
    rows, movers = solver["rows"], solver["movers"]
    solver["mover_count"], solver["row_count"] = 1 + max(max(pair) for pair in sides), len(sides)
    for mover in movers[: solver["mover_count"]]:
        mover["inverse_mass"] = rng.uniform(0.5, 2)
        mover["inertia"] = np.diag(rng.uniform(0.5, 2, 3))
    for row, (a, b) in zip(rows, sides):
        row["a"], row["b"] = a, b
        row["r_a"], row["r_b"] = rng.normal(size=(2, 3))
    assert lay_out(solver, state[0])
    begin_matrix(solver)
    size = 6 * solver["mover_count"]
    dense = np.zeros((size, size))
    for mover in movers[: solver["mover_count"]]:
        base = 6 * mover["place"]
        dense[base : base + 3, base : base + 3] = np.eye(3) / mover["inverse_mass"]
        dense[base + 3 : base + 6, base + 3 : base + 6] = mover["inertia"]
    for row in rows[: len(sides)]:
        # friction makes it unsymmetric
        solver["kernel"] = np.eye(3) + rng.uniform(-0.3, 0.3, (3, 3))
        add_row(solver, row)
        jacobian = np.zeros((3, size))
        for side, sign in (("a", -1), ("b", 1)):
            if row[side] >= 0:
                base = 6 * movers[row[side]]["place"]
                jacobian[:, base : base + 3] = sign * np.eye(3)
                jacobian[:, base + 3 : base + 6] = -sign * cross(row[f"r_{side}"])
        dense += jacobian.T @ solver["kernel"] @ jacobian
    return state, dense


@pytest.mark.parametrize("kind", ["one", "chain", "star", "loop", "heap"])
def test_a_step_solves_the_dense_system(kind: str) -> None:
    """Solve for minus the inverse of M + sum of J^T K J times the gradient."""
    rng = np.random.default_rng(len(kind))
    fixed = {"one": [(-1, 0), (0, -1)], "chain": CHAIN, "star": STAR}
    sides = fixed[kind] if kind in fixed else {"loop": loop, "heap": heap}[kind](rng)
    state, dense = loaded(rng, sides)
    solver = state[0]["solver"]
    gradient = rng.normal(size=len(dense))
    solver["gradient"][: len(dense)] = gradient
    factorise(solver)
    for _ in range(2):
        solve_factors(solver)
        assert solver["step"][: len(dense)] == pytest.approx(-np.linalg.solve(dense, gradient), abs=1e-12)


def test_a_cancelled_pivot_stays_finite() -> None:
    """Replace a pivot of 0 by a rounding of its diagonal."""
    state, _ = loaded(np.random.default_rng(0), [(-1, 0)])
    solver = state[0]["solver"]
    solver["lower"][:36] = np.ones(36)
    factorise(solver)
    solve_factors(solver)
    assert np.isfinite(solver["step"][:6]).all()


@pytest.mark.parametrize("limit", ["blocks", "factor_work", "frame_work"])
def test_what_exceeds_a_limit_does_not_fit(limit: str) -> None:
    """Refuse an island whose matrix has too many blocks or takes too much work, and any in a frame that has
    used up its work."""
    state = np.zeros(1, STATE)
    solver = state[0]["solver"]
    state[0]["factor_work"] = state[0]["frame_work"] = 1e15
    sides = CHAIN
    if limit == "blocks":
        rng = np.random.default_rng(0)
        sides = [tuple(rng.choice(800, 2, replace=False)) for _ in range(NEWTON_ROWS)]
    elif limit == "factor_work":
        state[0]["factor_work"] = 6.0**3 * (19 * 2 * 2 + 1) - 1
    else:
        state[0]["work_left"] = -1.1e15
    solver["mover_count"], solver["row_count"] = 1 + max(map(max, sides)), len(sides)
    for row, (a, b) in zip(solver["rows"], sides):
        row["a"], row["b"] = a, b
    assert not lay_out(solver, state[0])
    assert solver["work"] <= 0


def test_a_chain_takes_the_work_of_its_blocks() -> None:
    """Order a chain of twenty bodies without fill: 19 columns of two blocks, one of one."""
    state, _ = loaded(np.random.default_rng(0), CHAIN)
    assert state[0]["solver"]["work"] == 6.0**3 * (19 * 2 * 2 + 1)
    assert state[0]["solver"]["begin"][20] == 39
