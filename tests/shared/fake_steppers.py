"""Engines whose steps take as long as they have bodies, for spawned children; dart dies when it builds."""

import os
import time

from fake_world import FakeEngine, FakeWorld

PER_BODY = 1e-3
"""Seconds a step takes per simulated body."""


class World(FakeWorld):
    def step(self):
        time.sleep(PER_BODY * (len(self.scenario.bodies) - 1))


class Engine(FakeEngine):
    def build(self, scenario, settings):
        return os._exit(7) if self.name == "dart" else super().build(scenario, settings)


def load(name: str) -> Engine:
    """The engine called `name`."""
    return Engine(name, World)
