"""Grids of cells: every combination once, and settings only for the engines that have them."""

from __future__ import annotations

import pytest

from touchstone.adapters.knobs import SettingError
from touchstone.reports.sweep.cells import combinations, grid


def test_a_grid_has_every_combination_once():
    """Repeated names and values give no repeated cells."""
    columns = [("mujoco", "recommended"), ("mujoco", "recommended"), ("bullet", "recommended")]
    cells = grid(["fall", "slide"], columns, steps=[1 / 60, 1 / 240], repeats=3)
    assert len(cells) == len(set(cells)) == 2 * 2 * 2 * 3


def test_settings_concern_the_engines_that_have_them():
    """An engine plays all combinations of its own settings; others are no reason to refuse."""
    asked = ["impratio=1,3", "mujoco.solver=CG,Newton", "numSolverIterations=10,50"]
    assert combinations("mujoco", "recommended", asked) == [
        ("solver=CG",),
        (),
        ("solver=CG", "impratio=3.0"),
        ("impratio=3.0",),
    ]
    assert combinations("bullet", "recommended", asked) == [("numSolverIterations=10",), ()]
    assert combinations("dart", "recommended", asked) == [()]
    assert combinations("dart", "recommended", []) == [()]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("impratoi=3", "mujoco: unknown setting 'impratoi'; did you mean 'impratio'"),
        ("impratio=x", "mujoco: impratio: found 'x' .valid: 0.001 to"),
        ("impratio=", "mujoco: impratio: found '' .valid: 0.001 to"),
        ("mujco.impratio=1", "unknown engine 'mujco' .valid: reference, dart, "),
    ],
)
def test_what_no_engine_has_is_refused(text, said):
    """The nearest names and the valid values are named."""
    with pytest.raises(SettingError, match=said):
        combinations("mujoco", "recommended", [text])
