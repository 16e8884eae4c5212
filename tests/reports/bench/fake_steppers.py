"""Engines whose steps take as long as they have bodies, for spawned children; dart dies when it builds."""

import os
import time

PER_BODY = 1e-3
"""Seconds a step takes per simulated body."""


class World:
    def __init__(self, bodies):
        self.bodies = bodies

    def drive(self, step):
        pass

    def step(self):
        time.sleep(PER_BODY * self.bodies)


class Engine:
    def __init__(self, name):
        self.name = name

    def build(self, scenario, settings):
        if self.name == "dart":
            os._exit(7)
        return World(len(scenario.bodies) - 1)


def load(name: str) -> Engine:
    """The engine called `name`."""
    return Engine(name)
