"""Measures that need no engine, some of which end their process."""

import os
import time
from dataclasses import replace

from fake_world import FakeEngine

from touchstone.adapters.contract import AdapterError
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.measures import Measured, base_row


def fake_cells(measure, count, options=()):
    """`count` cells that differ in their seeds."""
    cell = Cell("fall", "mujoco", "recommended", 1 / 60, measure=f"fake_measures:{measure}", options=options)
    return [replace(cell, seed=k) for k in range(count)]


def load(name):
    """An engine that does nothing."""
    return FakeEngine()


def square(cell, scenario, engine):
    """The seed's square."""
    row = base_row(cell)
    return Measured((row, replace(row, metric="square", value=float(cell.seed**2))))


def slow(cell, scenario, engine):
    """The square, after as many milliseconds as the option says."""
    time.sleep(float(cell.option("ms")) / 1000)
    return square(cell, scenario, engine)


def faulty(cell, scenario, engine):
    """The square, except for seeds that crash, hang, diverge or raise."""
    match cell.seed:
        case 3:
            os._exit(7)
        case 5:
            time.sleep(600)
        case 7:
            raise AdapterError("diverged: the ball is gone")
        case 9:
            raise ZeroDivisionError("one\ntwo")
    return square(cell, scenario, engine)
