"""Measures that need no engine, some of which end their process."""

import os
import time
from dataclasses import replace

from touchstone.adapters.contract import AdapterError, Manifest
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.measures import Measured, base_row


def cells(measure, count, options=()):
    """`count` cells that differ in their seeds."""
    return [
        Cell(
            "fall",
            "mujoco",
            "recommended",
            1 / 60,
            seed=k,
            measure=f"fake_measures:{measure}",
            options=options,
        )
        for k in range(count)
    ]


def load(name):
    """An engine that does nothing."""
    return Engine()


class Engine:
    def build(self, scenario, settings):
        return World(settings)


class World:
    def __init__(self, settings):
        self.settings = settings

    def drive(self, step): ...

    def step(self): ...

    def read(self, state): ...

    def describe(self):
        return Manifest("fake", "1", self.settings.profile, self.settings.dt, {}, {}, ())

    def stage_seconds(self):
        return {}

    def work(self):
        return {}

    def cross(self): ...

    def close(self): ...


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
