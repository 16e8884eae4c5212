"""Engines that treat random scenes in one way each, for spawned children."""

import os
import time

import numpy as np
from fake_world import FakeEngine, FakeWorld

from touchstone.adapters.contract import AdapterError


def load(name):
    """The engine called `name`."""
    return FakeEngine(name, World)


def load_as(fake, name):
    """The engine called `fake`, whatever name is asked for."""
    return load(fake)


class World(FakeWorld):
    """Every body stays where it starts, but for the third step."""

    def step(self):
        super().step()
        if self.steps == 3:
            match self.fake:
                case "hangs":
                    time.sleep(600)
                case "dies":
                    os._exit(7)
                case "reports":
                    raise AdapterError("reports: lost its way")

    def read(self, state):
        bodies = self.scenario.bodies
        state.position[:] = [body.position for body in bodies]
        state.orientation[:] = [body.orientation for body in bodies]
        if self.fake == "stops" and self.steps < 3:
            state.linear_velocity[:] = [body.linear_velocity for body in bodies]
        elif self.fake == "stops":
            state.linear_velocity[:] = 0.0
        moving = np.array([body.kind == "simulated" for body in bodies])
        if self.steps >= 3:
            match self.fake:
                case "explodes":
                    state.linear_velocity[moving] = 1e3
                case "creeps":
                    state.linear_velocity[moving] = 1e-2
                case "sinks":
                    state.position[moving, 2] -= 1e-3
                case "falls through":
                    state.position[moving, 2] -= 3.0
                case "not finite":
                    state.linear_velocity[moving] = np.nan

    def work(self):
        residual = 1e-3 if self.fake == "stalls" else 1e-12
        return {} if self.fake == "silent" else {"gave_up": 0.0, "dropped_time": 2e-3, "residual": residual}
