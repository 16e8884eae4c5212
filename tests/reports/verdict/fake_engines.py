"""Engines that fail in one way each: a cube that should rest on a floor, moved by a script."""

import time

import numpy as np
from fake_world import FakeEngine, FakeWorld

from touchstone.adapters.contract import AdapterError

HALF = 0.05


class Engine(FakeEngine):
    """Engine whose worlds do what its name says."""

    def __init__(self, name):
        super().__init__(name, World)

    def build(self, scenario, settings):
        if self.name == "raises":
            raise ZeroDivisionError("one\ntwo")
        return super().build(scenario, settings)


class World(FakeWorld):
    """The cube is moved as a function of the time."""

    def step(self):
        super().step()
        if self.fake == "slow":
            end = time.process_time() + 0.02
            while time.process_time() < end:
                pass
        if self.fake == "announces" and self.steps == 10:
            raise AdapterError("announces: 7 contacts are too many")

    def read(self, state):
        if self.fake == "reads slowly":
            end = time.process_time() + 0.02
            while time.process_time() < end:
                pass
        bodies, t = self.scenario.bodies, self.steps * self.settings.dt
        state.position[:] = [body.position for body in bodies]
        state.orientation[:] = [body.orientation for body in bodies]
        z, v, x = self._moved(t)
        k = len(bodies) - 1
        state.position[k, 2] += z
        state.position[k, 0] += x
        state.linear_velocity[k] = v
        if self.fake == "spins up":
            state.angular_velocity[k] = (0.0, 0.0, 200.0 * t)
        if self.fake == "lies about contacts":
            state.add_contact(0, 1, np.zeros(3), np.array((0.0, 0.0, 1.0)), 0.0, np.array((0.0, 0.0, 1.0)))

    def _moved(self, t):
        """Height and velocity of the cube over its place of rest, and its way along x."""
        still = np.zeros(3)
        match self.fake:
            case "sinks" | "sinks and says so":
                return -0.04 * t, np.array((0.0, 0.0, -0.04)), 0.0
            case "lies about contacts":
                return -0.04 * t, still, 0.0
            case "sinks a little":
                return -0.02 * min(t, 0.4), still, 0.0
            case "tunnels":
                return (0.0 if t < 0.5 else -2.0), still, 0.0
            case "explodes":
                return 0.0, np.array((3.0 * t, 0.0, 0.0)), 0.0
            case "not finite":
                return 0.0, (still if t < 0.5 else np.full(3, np.nan)), 0.0
            case "finite position only":
                return 0.0, np.array((0.0, 0.0, 1e9 if t > 0.5 else 0.0)), 0.0
            case "creeps":
                return 0.0, still, 0.006 * t
            case "jitters":
                sign = 1 if self.steps % 2 else -1
                return 0.0, np.array((0.03 * sign, 0.0, 0.0)), 0.0
            case "resets":
                away = t if t < 0.5 else t - 0.5
                return 0.0, still, 0.1 * away
            case "hovers":
                return 0.01, still, 0.0
        return 0.0, still, 0.0

    def work(self):
        return {"gave_up": 1.0 if self.fake == "sinks and says so" and self.steps == 3 else 0.0}
