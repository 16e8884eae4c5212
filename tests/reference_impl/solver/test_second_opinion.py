"""Siconos solves the same contact problems: equal velocities wherever both solvers converge."""

import numpy as np
import pytest
from contact_islands import OPEN, USUAL, loaded, names
from siconos_library import library, solved

from touchstone.reference_impl.solver.contact_solver import solve_loaded

CONVERGED = 1e-11
"""Error of Coulomb's law up to which a solution counts as converged [m/s]."""
TWO_SOLUTIONS = ("dominoes_d", "heap_h", "wedge_b")
"""Islands in which Coulomb's law has two solutions: both solvers meet it to 1e-12 m/s, with velocities 2e-6
m/s apart; halfway between them the error is 1e-8 m/s. A sliding point presses in one of them only."""
ISLANDS = [(file, name) for file in (USUAL, OPEN) for name in names(file)]


def problem(rows: np.ndarray, movers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrix (3 n, 3 n), free velocities (3 n,) and frames (n, 3, 3) of an island: normal, two tangents."""
    frames = np.stack([rows["normal"], rows["across_1"], rows["across_2"]], axis=1)
    jacobian, inverse = np.zeros((3 * len(rows), 6 * len(movers))), np.zeros((6 * len(movers),) * 2)
    for m, mover in enumerate(movers):
        inverse[6 * m : 6 * m + 3, 6 * m : 6 * m + 3] = mover["inverse_mass"] * np.eye(3)
        inverse[6 * m + 3 : 6 * m + 6, 6 * m + 3 : 6 * m + 6] = mover["inverse_inertia"]
    for k, row in enumerate(rows):
        for side, sign in (("a", -1.0), ("b", 1.0)):
            m = 6 * row[side]
            if m >= 0:
                jacobian[3 * k : 3 * k + 3, m : m + 3] = sign * frames[k]
                jacobian[3 * k : 3 * k + 3, m + 3 : m + 6] = sign * np.cross(row[f"r_{side}"], frames[k])
    free = np.einsum("kij,kj->ki", frames, rows["free"])
    free[:, 0] -= rows["floor"]
    return jacobian @ inverse @ jacobian.T, free.ravel(), frames


def error(impulses: np.ndarray, velocities: np.ndarray, friction: np.ndarray, mass: float) -> float:
    """Largest error of Coulomb's law as a velocity [m/s]: r = P(r - mass (u + mu |u_t| n)), with P the
    projection on the friction cones (De Saxce & Feng 1998)."""
    r, u = impulses.reshape(-1, 3), velocities.reshape(-1, 3).copy()
    u[:, 0] += friction * np.hypot(u[:, 1], u[:, 2])
    z = r - mass * u
    across = np.hypot(z[:, 1], z[:, 2])
    # projection on the cone: inside, in its polar, or on its surface
    j = np.where(friction * across <= -z[:, 0], 0.0, (z[:, 0] + friction * across) / (1 + friction**2))
    inside = across <= friction * z[:, 0]
    j = np.where(inside, z[:, 0], j)
    share = np.where(inside, 1.0, friction * j / np.where(across > 0, across, 1.0))
    projected = np.stack([j, share * z[:, 1], share * z[:, 2]], axis=1)
    return float(np.abs(r - projected).max() / mass)


@pytest.fixture(scope="module")
def numerics():
    """Siconos' library."""
    found = library()
    if found is None:
        pytest.skip("Siconos is not installed (libsiconos-numerics7)")
    return found


def test_both_solvers_find_the_same_velocities(numerics) -> None:
    """Velocities differ by at most 1e-8 m/s in every island where both converge, and these are most."""
    compared = 0
    for file, name in ISLANDS:
        state = loaded(file, name)
        solver = state[0]["solver"]
        solve_loaded(solver, state[0])
        rows, movers = solver["rows"][: solver["row_count"]], solver["movers"][: solver["mover_count"]]
        rows = rows[rows["floor"] > -1e200]
        matrix, free, frames = problem(rows, movers)
        ours = np.einsum("kij,kj->ki", frames, rows["impulse"]).ravel()
        theirs = solved(numerics, matrix, free, rows["friction"])
        u, v, mass = matrix @ ours + free, matrix @ theirs + free, float(rows["mass"].min())
        one, other = error(ours, u, rows["friction"], mass), error(theirs, v, rows["friction"], mass)
        difference = np.abs(u - v).max()
        print(
            f"{name:16} {len(rows):3} contacts: errors {one:.0e} {other:.0e}, difference {difference:.0e} m/s"
        )
        if max(one, other) <= CONVERGED:
            compared += 1
            between = (ours + theirs) / 2
            missed = error(between, matrix @ between + free, rows["friction"], mass)
            assert difference <= 1e-8 or (name in TWO_SOLUTIONS and missed > 100 * max(one, other)), name
    assert compared >= 15
