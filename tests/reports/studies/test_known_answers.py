"""Cells of a sweep find what is known of the engines: orders, and errors that no step mends."""

import pytest

from touchstone.adapters.registry import installed, load
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.executors import play_cell


def value(metric, scene, engine, dt, *changes):
    """Values of a metric by subject, of a cell played in this process."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    cell = Cell(scene, engine, "recommended", dt, changes, options=(f"metrics={metric}",))
    done = play_cell(load(engine), cell)
    assert done.outcome == "done", done.rows
    return {row.subject: row.value for row in done.rows if row.metric == metric}


def test_mujoco_overlaps_less_with_a_shorter_time_constant():
    """A stack's overlap falls with solref, at one step, at least in proportion."""
    found = [
        value("overlap.max", "stack", "mujoco", 1 / 540, f"solref={s}")[""] for s in (0.04, 0.02, 0.01, 0.005)
    ]
    assert found == sorted(found, reverse=True)
    assert found[0] > 8 * found[-1]


def test_no_step_mends_friction_along_darts_diagonal():
    """Boxes at three headings stop 30 % apart at any step; the solver of circular cones mends that."""
    at = [value("friction.heading", "slide", "dart", dt)[""] for dt in (1 / 240, 1 / 1020)]
    assert min(at) > 0.3
    assert value("friction.heading", "slide", "dart", 1 / 240, "solver=nsgs")[""] < 0.01
