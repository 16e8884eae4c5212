"""Engines that fail in one way each, by their name: bodies that should rest are moved by a script."""

import os
import time

import numpy as np
from fake_world import FakeEngine, FakeWorld

from touchstone.adapters.contract import AdapterError

UP = np.array((0.0, 0.0, 1.0))
START = 3
"""Step from which on sudden failures show."""


class Engine(FakeEngine):
    """Engine whose worlds do what its name says."""

    def __init__(self, name):
        super().__init__(name, World)

    def build(self, scenario, settings):
        if self.name == "raises":
            raise ZeroDivisionError("one\ntwo")
        return super().build(scenario, settings)


def load_as(fake, name):
    """The engine called `fake`, whatever name is asked for."""
    return Engine(fake)


class World(FakeWorld):
    """The simulated bodies are moved as a function of the time."""

    def step(self):
        super().step()
        self._compute("slow")
        if self.steps == START:
            match self.fake:
                case "hangs":
                    time.sleep(600)
                case "dies":
                    os._exit(7)
                case "announces":
                    raise AdapterError("announces: lost its way")

    def _compute(self, fake):
        """Take 0.02 s of processor time, if this is that fake."""
        end = time.process_time() + 0.02
        while self.fake == fake and time.process_time() < end:
            pass

    def read(self, state):
        self._compute("reads slowly")
        bodies, t = self.scenario.bodies, self.steps * self.settings.dt
        moving = np.array([body.kind == "simulated" for body in bodies])
        way, velocity = self._moved(t, self.steps >= START)
        state.position[:] = [body.position for body in bodies]
        state.orientation[:] = [body.orientation for body in bodies]
        state.position[moving] += way
        state.linear_velocity[moving] = velocity
        if self.fake == "stops" and self.steps < START:
            state.linear_velocity[:] = [body.linear_velocity for body in bodies]
        if self.fake == "spins up":
            state.angular_velocity[moving] = 200.0 * t * UP
        if self.fake == "lies about contacts":
            state.add_contact(0, 1, np.zeros(3), UP, 0.0, UP)

    def _moved(self, t, late):
        """Way from the place of rest, and velocity."""
        still, along = np.zeros(3), np.array((1.0, 0.0, 0.0))
        match self.fake:
            case "sinks" | "sinks and says so":
                return -0.04 * t * UP, -0.04 * UP
            case "lies about contacts":
                return -0.04 * t * UP, still
            case "sinks a little":
                return -0.02 * min(t, 0.4) * UP, still
            case "drops a millimetre":
                return -1e-3 * late * UP, still
            case "tunnels":
                return -3.0 * late * UP, still
            case "explodes":
                return still, 1e3 * late
            case "gains a little":
                return still, 1e-2 * late
            case "not finite":
                return still, np.nan if late else 0.0
            case "finite position only":
                return still, 1e9 * (t > 0.5) * UP
            case "creeps":
                return 0.006 * t * along, still
            case "jitters":
                return still, 0.03 * (1 if self.steps % 2 else -1) * along
            case "resets":
                return 0.1 * (t if t < 0.5 else t - 0.5) * along, still
            case "hovers":
                return 0.01 * UP, still
        return still, still

    def work(self):
        if self.fake == "silent":
            return {}
        gave_up = float(self.fake == "sinks and says so" and self.steps == START)
        dropped, residual = (2e-3, 1e-3) if self.fake == "stalls" else (0.0, 1e-12)
        return {"gave_up": gave_up, "dropped_time": dropped, "residual": residual}
