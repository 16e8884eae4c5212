"""A sound engine of balls and flat boxes, and adapters of it with one bug each."""

import importlib.util
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import touchstone as ts

_SPEC = importlib.util.spec_from_file_location("toy", Path(__file__).parents[3] / "docs" / "toy_engine.py")
toy = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(toy)


class Sound(toy.ToyWorld):
    """The toy engine; a box that lands flat is a ball of its half height."""

    bug = ""

    def __init__(self, scenario, settings):
        super().__init__(scenario, settings)
        match self.bug:
            case "mass":
                self.mass = self.mass * 1.2
            case "inertia about the origin":
                arms = np.array([body.center_of_mass for body in scenario.bodies])
                squares = np.einsum("ni,ni->n", arms, arms)[:, None, None] * np.eye(3)
                self.inertia = self.inertia + self.mass[:, None, None] * (
                    squares - arms[:, :, None] * arms[:, None, :]
                )
            case "coefficients exchanged":
                self.restitution, self.friction = self.friction, self.restitution
            case "gravity":
                self.gravity = self.gravity / 2
            case "shared state":
                self.angular_velocity = self.linear_velocity = Sound.shared(self.linear_velocity)
            case "step":
                self.dt = 2 * self.dt
        self.reads = 0

    kept: dict = {}  # noqa: RUF012

    @classmethod
    def shared(cls, array):
        return cls.kept.setdefault(array.shape, array.copy())

    def drive(self, step):
        if self.bug != "stale contacts":
            super().drive(step)

    def step(self):
        match self.bug:
            case "raises":
                raise ZeroDivisionError("division by zero")
            case "restitution":
                self.restitution = dict.fromkeys(self.pairs, 0.5)
            case "damping":
                self.linear_velocity *= 0.99
        super().step()

    def push(self, a, b, point, normal, distance, impulse):
        super().push(a, b, point, normal, distance, impulse)
        if self.bug == "twice":
            self._touched.append(self._touched[-1])

    def read(self, state):
        super().read(state)
        rows = state.contacts[: state.contact_count]
        turns = Rotation.from_quat(self.orientation, scalar_first=True)
        arms = turns.apply([body.center_of_mass for body in self.scenario.bodies])
        match self.bug:
            case "normals":
                rows["normal"] *= -1
            case "impulses on A":
                rows["impulse"] *= -1
            case "forces":
                rows["impulse"] /= self.dt
            case "distance":
                rows["distance"] *= -1
            case "full extents":
                rows["distance"] -= 0.1
            case "B first":
                rows["body_a"], rows["body_b"] = rows["body_b"].copy(), rows["body_a"].copy()
            case "xyzw":
                state.orientation[:] = np.roll(state.orientation, -1, axis=1)
            case "inverse orientation":
                state.orientation[:, 1:] *= -1
            case "mass centre's position":
                state.position += arms
            case "origin's velocity":
                state.linear_velocity -= np.cross(self.angular_velocity, arms)
            case "body axes":
                state.angular_velocity[:] = turns.inv().apply(state.angular_velocity)
            case "order":
                state.position[:] = state.position[::-1].copy()
            case "reads":
                self.position[self.free] += 1e-3 * self.linear_velocity[self.free] * self.dt
            case "replaces":
                state.position = self.position
            case "wrong shape":
                state.position = self.position[:, :2]
            case "not finite":
                state.linear_velocity[-1] = np.nan
            case "random":
                self.linear_velocity[self.free] += 1e-9 * np.random.default_rng().normal()


class Engine:
    """The sound engine, or one with a bug."""

    name, profiles = "planted", {"default": 1 / 240}

    def __init__(self, bug=""):
        self._bug = bug

    def version(self):
        return "1"

    def build(self, scenario, settings):
        if any(body.kind == "driven" for body in scenario.bodies):
            raise ts.Unsupported("planted: no driven bodies")
        return type("World", (Sound,), {"bug": self._bug})(scenario, settings)
