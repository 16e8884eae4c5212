"""Integration of motions to rounding.

Source: Hairer, Norsett and Wanner (1993), *Solving Ordinary Differential Equations I*, for DOP853.
"""

from collections.abc import Callable, Sequence
from typing import Any

from scipy.integrate import solve_ivp

from touchstone.scenarios.arrays import Array

RELATIVE_ERROR, ABSOLUTE_ERROR = 1e-12, 1e-14
"""Tolerances [1; m, m/s, rad, rad/s]: a hundred times rounding, which a step accumulates."""
LONGEST_STEP = 1 / 240
"""Longest step of the integration [s]: its interpolant, of order 7, is then as exact as its ends."""


def integrated(
    rate: Callable[[float, Array], Array],
    span: tuple[float, float],
    state: Array,
    falling: Sequence[Callable[[Array], float]] = (),
    longest: float = LONGEST_STEP,
) -> Any:
    """scipy's solution, with its interpolant, which ends where a function of the state falls through 0."""
    return solve_ivp(
        rate,
        span,
        state,
        "DOP853",
        events=[_event(function) for function in falling],
        dense_output=True,
        max_step=longest,
        rtol=RELATIVE_ERROR,
        atol=ABSOLUTE_ERROR,
    )


def _event(function: Callable[[Array], float]) -> Callable[[float, Array], float]:
    def event(_: float, state: Array) -> float:
        return function(state)

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event
