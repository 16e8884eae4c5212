"""World of simulated and fixed bodies, kept in NumPy arrays: the base of small engines of your own."""

from collections.abc import Mapping

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Array, BodyFacts, Manifest, PairFacts, Settings, State
from touchstone.scenarios.scenario import Scenario


class SimpleWorld:
    """World of which an engine of your own writes `step` alone: it changes velocities, calls `push` for each
    contact, and `advance` at its end.

        def step(self):
            self.linear_velocity[self.free] += self.gravity * self.dt
            for a, b in self.pairs:
                ...  # find where the two touch, and the impulse that self.friction[a, b] allows
                self.push(a, b, point, normal, distance, impulse)
            self.advance()

    The engine's `build(scenario, settings)` returns it, and raises Unsupported for shapes, kinds of bodies
    and laws that `step` does not have. `describe` reports the arrays below, so `step` must use them.

    Attributes (n bodies in the scenario's order; conventions as in `adapters/contract.py`):
        scenario, settings: those of `build`; shapes are in `scenario.bodies[k].pieces`.
        position (n, 3): origins of the bodies, world [m]; orientation (n, 4): quaternions wxyz.
        linear_velocity (n, 3): of the centres of mass, world [m/s].
        angular_velocity (n, 3): along the world's axes [rad/s].
        free (n,): whether forces move a body: true of `simulated` ones, false of `fixed` ones.
        mass (n,) [kg]; inverse_mass (n,) [1/kg]: 0 for bodies that are not free.
        inertia (n, 3, 3): about the centre of mass, along the body's axes [kg m^2].
        pairs: indices (a, b) with a < b of all bodies that may touch, whether they are near or not.
        restitution, friction: coefficient of each of `pairs` [1], as friction[a, b].
        gravity (3,): acting gravity [m/s^2]; dt: native step [s].
    """

    engine, version = "simple", "0"

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        self.scenario, self.settings, self.dt = scenario, settings, settings.dt
        bodies = scenario.bodies
        self.position = np.array([body.position for body in bodies])
        self.orientation = np.array([body.orientation for body in bodies])
        self.linear_velocity = np.array([body.linear_velocity for body in bodies])
        self.angular_velocity = np.array([body.angular_velocity for body in bodies])
        self.mass = np.array([body.mass for body in bodies])
        self.inertia = np.array([body.inertia for body in bodies])
        self.free = np.array([body.kind == "simulated" for body in bodies])
        self.inverse_mass = np.where(self.free, 1 / np.where(self.free, self.mass, 1.0), 0.0)
        self._center = np.array([body.center_of_mass for body in bodies])
        self.gravity = np.array(scenario.acting_gravity)
        self.pairs = list(scenario.touching_pairs())
        self.restitution = {pair: scenario.pair_coefficients(*pair)[0] for pair in self.pairs}
        self.friction = {pair: scenario.pair_coefficients(*pair)[1] for pair in self.pairs}
        self._touched: list[tuple[int, int, Array, Array, float, Array]] = []

    def step(self) -> None:
        """Advance by one native step; raises AdapterError, because each engine defines its own."""
        raise AdapterError(f"{self.engine}: {type(self).__name__} defines no step(self)")

    def push(self, a: int, b: int, point: Array, normal: Array, distance: float, impulse: Array) -> None:
        """Change the velocities of two bodies by an impulse, and report it as a contact of this step.

        Args:
            a, b: indices of the bodies.
            point (3,): where the impulse acts, halfway between the two surfaces, world [m].
            normal (3,): unit vector from a to b, world.
            distance: between the surfaces at the start of the step, negative in overlap [m].
            impulse (3,): on b, its reverse acts on a; friction included, world [N s].
        """
        turns = self._turns()
        for body, sign in ((a, -1.0), (b, 1.0)):
            if self.free[body]:
                axes, arm = turns[body].as_matrix(), point - self._centers()[body]
                self.linear_velocity[body] += sign * self.inverse_mass[body] * impulse
                torque = axes.T @ np.cross(arm, sign * impulse)
                self.angular_velocity[body] += axes @ np.linalg.solve(self.inertia[body], torque)
        self._touched.append((a, b, point, normal, distance, impulse))

    def advance(self) -> None:
        """Move free bodies over a step by the velocities that they now have, once at the end of `step`; their
        angular momentum is kept."""
        centers, before = self._centers() + self.free[:, None] * self.linear_velocity * self.dt, self._turns()
        turned = Rotation.from_rotvec(self.free[:, None] * self.angular_velocity * self.dt) * before
        for body in np.flatnonzero(self.free):
            one, two, inertia = before[body].as_matrix(), turned[body].as_matrix(), self.inertia[body]
            momentum = one @ inertia @ one.T @ self.angular_velocity[body]
            self.angular_velocity[body] = two @ np.linalg.solve(inertia, two.T @ momentum)
        self.orientation = turned.as_quat(scalar_first=True)
        self.position = centers - turned.apply(self._center)

    def _turns(self) -> Rotation:
        return Rotation.from_quat(self.orientation, scalar_first=True)

    def _centers(self) -> Array:
        """Centres of mass (n, 3) [m], world."""
        centers: Array = self.position + self._turns().apply(self._center)
        return centers

    def drive(self, step: int) -> None:
        """Command the driven bodies: there are none. Forgets the contacts of the last step."""
        self._touched.clear()

    def read(self, state: State) -> None:
        state.position[:], state.orientation[:] = self.position, self.orientation
        state.linear_velocity[:], state.angular_velocity[:] = self.linear_velocity, self.angular_velocity
        state.clear_contacts()
        for contact in self._touched:
            state.add_contact(*contact)

    def describe(self) -> Manifest:
        """Manifest of the arrays that `step` uses."""
        bodies, names = self.scenario.bodies, [body.name for body in self.scenario.bodies]
        facts = {
            body.name: BodyFacts.of(mass, body.center_of_mass, inertia)
            for body, mass, inertia in zip(bodies, self.mass, self.inertia)
        }
        pairs = tuple(
            PairFacts(names[a], names[b], self.restitution[a, b], self.friction[a, b]) for a, b in self.pairs
        )
        return Manifest(self.engine, self.version, self.settings.profile, self.dt, {}, facts, pairs)

    def cross(self) -> None:
        """Make an empty call."""

    def stage_seconds(self) -> Mapping[str, float]:
        """No stages are timed."""
        return {}

    def work(self) -> Mapping[str, float]:
        """Nothing is counted."""
        return {}

    def close(self) -> None:
        """There is nothing to release."""
