"""Interior-point method: islands where Newton's method cycles, and those that it solves too."""

import numpy as np
import pytest
from contact_islands import OPEN, USUAL, loaded, names

from touchstone.reference_impl.core.counters import COUNT_FACTORS
from touchstone.reference_impl.solver.contact_interior import INTERIOR_STEPS, INTERIOR_TARGET, interior
from touchstone.reference_impl.solver.contact_newton import newton
from touchstone.reference_impl.solver.contact_rows import residual_of, take_best
from touchstone.reference_impl.solver.contact_solver import FIRST_SWEEPS, _sweep
from touchstone.reference_impl.solver.tolerances import NEWTON_FACTORS, RESIDUAL_ACCEPTED, RESIDUAL_DENSE

SOLVED = ("heap_c", "heap_d", "heap_e", "two_in_a_wedge", "wedge")
"""Islands in which the method reaches its target without Newton's."""


@pytest.mark.parametrize("name", names(OPEN))
def test_newton_finishes_what_it_could_not_begin(name: str) -> None:
    """Reach Coulomb's law in few factorisations, from no impulse, where Newton's method alone cycles."""
    state = loaded(OPEN, name)
    solver = state[0]["solver"]
    interior(solver, True, state[0])
    take_best(solver)
    newton(solver, False, True, NEWTON_FACTORS, state[0])
    take_best(solver)
    residual, _ = residual_of(solver)
    assert residual <= RESIDUAL_ACCEPTED
    assert state[0]["counters"][COUNT_FACTORS] <= 200


@pytest.mark.parametrize("name", SOLVED)
def test_steps_are_few(name: str) -> None:
    """Reach the target before the steps run out; the impulses stay in their cones."""
    state = loaded(OPEN, name)
    solver = state[0]["solver"]
    interior(solver, True, state[0])
    take_best(solver)
    residual, _ = residual_of(solver)
    assert residual == solver["best_residual"] <= INTERIOR_TARGET
    assert state[0]["counters"][COUNT_FACTORS] < INTERIOR_STEPS
    rows = solver["rows"][: solver["row_count"]]
    j = (rows["impulse"] * rows["normal"]).sum(1)
    across = np.linalg.norm(rows["impulse"] - j[:, None] * rows["normal"], axis=1)
    assert (j >= 0).all()
    assert (across <= rows["friction"] * j * (1 + 1e-12)).all()


def test_a_start_near_the_solution_saves_steps() -> None:
    """Rows of dominoes take at most three quarters of the steps from the impulses that some sweeps leave."""
    steps = [0, 0]
    for name in names(USUAL):
        for afar in range(2) if name.startswith("dominoes") else ():
            state = loaded(USUAL, name)
            solver = state[0]["solver"]
            state[0]["dense_substep"], solver["target"] = 1, RESIDUAL_DENSE
            _sweep(solver, state[0], FIRST_SWEEPS)
            take_best(solver)
            interior(solver, afar == 1, state[0])
            steps[afar] += int(state[0]["counters"][COUNT_FACTORS])
    assert steps[0] < 0.75 * steps[1]


def test_the_answer_does_not_depend_on_the_order_of_rows() -> None:
    """Solve an island with its rows in reverse: the same velocities, to the target."""
    state, other = loaded(OPEN, "heap_d"), loaded(OPEN, "heap_d")
    count, movers = int(state[0]["solver"]["row_count"]), int(state[0]["solver"]["mover_count"])
    other[0]["solver"]["rows"][:count] = other[0]["solver"]["rows"][:count][::-1].copy()
    for one in (state, other):
        interior(one[0]["solver"], True, one[0])
        take_best(one[0]["solver"])
    change = state[0]["solver"]["movers"]["velocity"] - other[0]["solver"]["movers"]["velocity"]
    assert np.abs(change[:movers]).max() <= 10 * INTERIOR_TARGET
