"""Engines that treat random scenes in one way each, for spawned children."""

from __future__ import annotations

import os
import time

import numpy as np

from touchstone.adapters.contract import AdapterError, Manifest, Unsupported


def load(name):
    """The engine called `name`."""
    return Engine(name)


def load_as(fake, name):
    """The engine called `fake`, whatever name is asked for."""
    return Engine(fake)


class Engine:
    """Builds worlds that do what its name says."""

    def __init__(self, name):
        self.name = name

    def build(self, scenario, settings):
        if self.name == "unsupported":
            raise Unsupported("unsupported: no shapes")
        return World(self.name, scenario, settings)


class World:
    """Every body stays where it starts, but for the third step."""

    def __init__(self, name, scenario, settings):
        self.name, self.scenario, self.settings, self.steps = name, scenario, settings, 0

    def drive(self, step):
        pass

    def step(self):
        self.steps += 1
        if self.steps == 3:
            match self.name:
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
        if self.name == "stops" and self.steps < 3:
            state.linear_velocity[:] = [body.linear_velocity for body in bodies]
        elif self.name == "stops":
            state.linear_velocity[:] = 0.0
        moving = np.array([body.kind == "simulated" for body in bodies])
        if self.steps >= 3:
            match self.name:
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

    def describe(self):
        return Manifest(self.name, "1", self.settings.profile, self.settings.dt, {}, {}, ())

    def work(self):
        told = {"gave_up": 0.0, "residual": 1e-3 if self.name == "stalls" else 1e-12}
        return {} if self.name == "silent" else told

    def stage_seconds(self):
        return {}

    def cross(self):
        pass

    def close(self):
        pass
