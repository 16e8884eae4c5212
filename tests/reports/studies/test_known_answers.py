"""Cells of a sweep find what is known of the engines: orders, and errors that no step mends."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.adapters.registry import installed
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.worker import play_one


def value(metric, scene, engine, dt, *changes):
    """Values of a metric by subject, of a cell played in this process."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    cell = Cell(scene, engine, "recommended", dt, changes, options=(f"metrics={metric}",))
    done = play_one(cell)
    assert done.outcome == "done", done.rows
    return {row.subject: row.value for row in done.rows if row.metric == metric}


@pytest.mark.parametrize("engine", ["dart", "bullet", "mujoco"])
def test_free_fall_is_of_first_order(engine):
    """Semi-implicit Euler: the error of a fall is proportional to the step, 1.00 +- 0.02."""
    steps = np.array([1 / 60, 1 / 240, 1 / 960])
    errors = np.array([value("truth.position", "fall", engine, dt)[""] for dt in steps])
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.02)


def test_mujoco_overlaps_less_with_a_shorter_time_constant():
    """A stack's overlap falls with solref, at one step, at least in proportion."""
    found = [
        value("overlap.max", "stack", "mujoco", 1 / 540, f"solref={s}")[""] for s in (0.04, 0.02, 0.01, 0.005)
    ]
    assert found == sorted(found, reverse=True)
    assert found[0] > 8 * found[-1]


def test_bullet_stops_bouncing_as_the_step_shrinks():
    """A first bounce of the height asked for within 20 % at 1/240 s is none at 1/3840 s."""
    heights = [value("bounce.height", "bounce_e05", "bullet", dt)["#1"] for dt in (1 / 240, 1 / 3840)]
    assert abs(heights[0]) < 0.2
    assert heights[1] < -0.99


def test_no_step_mends_friction_along_darts_diagonal():
    """Boxes at three headings stop 30 % apart at any step; the solver of circular cones mends that."""
    at = [value("friction.heading", "slide", "dart", dt)[""] for dt in (1 / 240, 1 / 1020)]
    assert min(at) > 0.3
    assert value("friction.heading", "slide", "dart", 1 / 240, "solver=nsgs")[""] < 0.01
