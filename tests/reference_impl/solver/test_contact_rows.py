"""Rows of one island: Coulomb's law at one point, and work that no impulse in the cones can turn positive."""

import numpy as np
import pytest

from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.solver.contact_newton import newton
from touchstone.reference_impl.solver.contact_rows import (
    into_cone,
    keep_best,
    make_passive,
    prepare_row,
    rebuild,
    residual_of,
    solve_row,
)
from touchstone.reference_impl.solver.tolerances import NEWTON_FACTORS


def symmetric(rng: np.random.Generator, scale: float) -> np.ndarray:
    """A random inverse inertia (3, 3) [1/(kg m^2)]."""
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return turn @ np.diag(scale * rng.uniform(0.5, 2.0, 3)) @ turn.T


def prepare(solver: np.ndarray, row: np.ndarray) -> None:
    """The mobility of a row, 1/m - [r] I^-1 [r] of both sides, and what follows from it."""
    row["mobility"] = 0.0
    for side in ("a", "b"):
        if row[side] >= 0:
            mover = solver["movers"][row[side]]
            x, y, z = row[f"r_{side}"]
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            row["mobility"] += mover["inverse_mass"] * np.eye(3) - cross @ mover["inverse_inertia"] @ cross
    prepare_row(row)


def island(rng: np.random.Generator, movers: int, rows: int, mu: float, ratio: float = 1.0) -> np.ndarray:
    """A state whose solver holds a random island; some rows are against what does not move."""
    state = np.zeros(1, STATE)
    solver = state[0]["solver"]
    solver["mover_count"], solver["row_count"] = movers, rows
    for m in range(movers):
        mass = float(ratio ** rng.uniform(-1, 1))
        solver["movers"][m]["inverse_mass"] = 1 / mass
        solver["movers"][m]["inverse_inertia"] = symmetric(rng, 400 / mass)
    for k in range(rows):
        row = solver["rows"][k]
        b, a = (k % movers), int(rng.integers(-1, movers))
        row["b"], row["a"] = b, -1 if a == b else a
        row["link_a"] = row["link_b"] = -1
        row["r_a"], row["r_b"] = rng.uniform(-0.05, 0.05, (2, 3))
        normal = rng.normal(size=3)
        row["normal"] = normal / np.linalg.norm(normal)
        row["friction"] = mu
        row["free"], row["before"] = rng.normal(size=(2, 3))
        prepare(solver, row)
    return state


def changes(solver: np.ndarray) -> np.ndarray:
    """Change of each row's velocity by all impulses (n, 3) [m/s], from the movers' velocities."""
    found = np.zeros((int(solver["row_count"]), 3))
    for k, row in enumerate(solver["rows"][: len(found)]):
        for side, sign in (("a", -1), ("b", 1)):
            if row[side] >= 0:
                mover = solver["movers"][row[side]]
                found[k] += sign * (mover["velocity"] + np.cross(mover["omega"], row[f"r_{side}"]))
    return found


def work(solver: np.ndarray) -> float:
    """Work of the contacts over a hold [J]: impulses times the mean of the velocities before and after."""
    rows = solver["rows"][: int(solver["row_count"])]
    return float((rows["impulse"] * (rows["before"] + rows["free"] + changes(solver))).sum() / 2)


@pytest.mark.parametrize("seed", range(60))
def test_no_impulse_in_the_cones_does_work(seed: int) -> None:
    """Scale impulses drawn at random in their cones, of any size, until contacts do no work."""
    rng = np.random.default_rng(seed)
    rows = int(rng.integers(1, 30))
    state = island(rng, int(rng.integers(1, 9)), rows, float(rng.uniform(0, 1)), 1e3)
    solver = state[0]["solver"]
    for k in range(rows):
        solver["rows"][k]["impulse"] = rng.normal(size=3) * 10.0 ** rng.uniform(-6, 6)
        into_cone(solver["rows"][k])
    rebuild(solver)
    size = np.abs(solver["rows"]["impulse"][:rows]).sum()
    make_passive(solver)
    kept = solver["rows"]["impulse"][:rows]
    rounding = 1e-12 * np.abs(kept * (solver["rows"]["before"] + solver["rows"]["free"])[:rows]).sum()
    assert work(solver) <= rounding
    assert np.abs(kept).sum() <= size * (1 + 1e-12)
    # they stay in their cones
    n = solver["rows"]["normal"][:rows]
    j = (kept * n).sum(1)
    across = np.linalg.norm(kept - j[:, None] * n, axis=1)
    assert (across <= solver["rows"]["friction"][:rows] * j + 1e-12 * np.abs(kept).sum(1)).all()


@pytest.mark.parametrize("seed", range(100))
def test_one_row_obeys_coulomb(seed: int) -> None:
    """Solve one row exactly, friction that couples strongly with the normal included."""
    rng = np.random.default_rng(seed)
    state = island(rng, 1, 1, float(rng.uniform(0, 1.5)))
    solver = state[0]["solver"]
    row = solver["rows"][0]
    row["floor"] = -abs(rng.normal()) if seed % 3 == 0 else 0.0
    rebuild(solver)
    solve_row(row, solver)
    residual, _ = residual_of(solver)
    assert residual <= 1e-12
    if row["free"] @ row["normal"] >= row["floor"]:
        np.testing.assert_array_equal(row["impulse"], 0.0)
    else:
        assert row["impulse"] @ row["normal"] > 0


@pytest.mark.parametrize("evenly", [False, True])
@pytest.mark.parametrize("friction", [1.0, 0.1])
@pytest.mark.parametrize("seed", range(20))
def test_newton_solves_chains(seed: int, friction: float, evenly: bool) -> None:
    """Reach Coulomb's law from no impulse, where friction holds a chain of bodies and where it slides."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 8))
    state = island(rng, count, count, 0.0)
    solver = state[0]["solver"]
    solver["rows"]["a"][:count] = np.arange(count) - 1
    for k in range(count):
        row = solver["rows"][k]
        row["normal"], row["friction"] = (0.0, 0.0, 1.0), friction
        row["free"] = (*rng.uniform(-0.05, 0.05, 2), -0.16 if k == 0 else 0.0)
        row["r_a"], row["r_b"] = (0.0, 0.0, 0.05), (0.0, 0.0, -0.05)
        prepare(solver, row)
    rebuild(solver)
    solver["best_residual"] = np.inf
    residual, _ = residual_of(solver)
    keep_best(solver, residual)
    state[0]["factor_work"] = state[0]["frame_work"] = state[0]["work_left"] = 1e7
    newton(solver, evenly, True, NEWTON_FACTORS, state[0])
    assert solver["best_residual"] <= 1e-9


@pytest.mark.parametrize("along", [1.0, 1e-95, 1e-160, 1e-310, 5e-324])
@pytest.mark.parametrize("across", [1e3, 1e-134, 1e-170, 5e-324, 0.0])
@pytest.mark.parametrize("mu", [0.02, 1.0, 1e-300])
def test_a_row_of_any_speed_gets_a_finite_impulse(along: float, across: float, mu: float) -> None:
    """Stop an approach along a tilted normal, as of a box whose velocities have decayed to 1e-134 m/s."""
    state = island(np.random.default_rng(0), 1, 1, mu)
    solver = state[0]["solver"]
    row = solver["rows"][0]
    row["free"] = -along * row["normal"] + across * row["across_1"]
    assert np.isfinite(solve_row(row, solver))
    assert np.isfinite(row["impulse"]).all()
    assert row["impulse"] @ row["normal"] >= 0
    assert residual_of(solver)[0] <= 1e-12 * max(along, across) + 1e-99


def test_an_impulse_that_is_no_number_is_no_solution() -> None:
    """Report a residual of NaN whatever the rows after it leave."""
    for place in range(3):
        state = island(np.random.default_rng(1), 3, 3, 0.5)
        solver = state[0]["solver"]
        solver["rows"][place]["impulse"] = np.nan
        residual, worst = residual_of(solver)
        assert np.isnan(residual)
        assert worst == place
