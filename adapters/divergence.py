"""Divergence checks of a run: finite values, bounded energy, and positions within the plan's bounds."""

import numpy as np

from touchstone.adapters.contract import LARGEST_STATE, STATE_FIELDS, Array, State
from touchstone.adapters.motion_bounds import extent
from touchstone.adapters.vector_products import turned, turned_back
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.plan import Plan
from touchstone.scenarios.scenario import UNMOVED, BodyJoint, Piece, Scenario, Tracker

SPEED_MAX = 1e6
"""Speed [m/s] beyond which a run has diverged: 16 km per frame, in scenes that measure metres and last
seconds. A rotation has diverged if it moves a point that fast at the body's radius, but at most at 1 m."""
EXPLODED = 300.0
"""Factor over the allowed energy beyond which a run has diverged, wherever its bodies are. Known defects stay
below: the worst of the catalogue, under the reference's `paper`, are 13 (`rod_e1`) and 42 (`stack`, which
starts at rest). An explosion exceeds it within a few frames."""
GROWN = 2.0
"""Factor over the allowed energy beyond which a body outside its plan's bounds counts as diverged. Below it
the bounds themselves are wrong: a first-order integrator gains a few percent."""
UNSEEN = 0.1
"""Speed of all bodies whose energy is allowed in any scene [m/s]: numerical noise of bodies at rest."""
ROUNDING = 1e-9
"""Relative error by which rounding may lower a bound on an energy [1]."""


class Watch:
    """Checks of a run. A fault is one sentence; the caller adds the time."""

    def __init__(self, scenario: Scenario, plan: Plan | None = None) -> None:
        self._plan = plan
        self._names = [body.name for body in scenario.bodies]
        kind = np.array([body.kind for body in scenario.bodies])
        self._moving, self._simulated = ~np.isin(kind, UNMOVED), kind == "simulated"
        self._mass = np.where(self._moving, [body.mass for body in scenario.bodies], 0.0)
        self._inertia = np.array([body.inertia for body in scenario.bodies]) * self._moving[:, None, None]
        self._center = np.array([body.center_of_mass for body in scenario.bodies])
        self._weight = self._mass * self._simulated
        self._largest_inertia = np.linalg.eigvalsh(self._inertia)[:, -1]  # the largest moment
        self._offset = self._center[self._simulated].any()
        sizes = [max(map(extent, body.pieces), default=1.0) for body in scenario.bodies]
        self._arm = np.minimum(sizes, 1.0)  # radius at which a rotation's speed is judged [m]
        self._gravity = np.array(scenario.acting_gravity)
        self._driven = bool(scenario.trackers) or any(map(surface_moves, scenario.bodies))
        drive_speed = max((_drive_speed(scenario, tracker) for tracker in scenario.trackers), default=0.0)
        pieces = [piece for body in scenario.bodies for piece in body.pieces]
        drive_speed += max(map(_surface_speed, pieces), default=0.0)
        start = State(scenario)
        for name in ("position", "orientation", "linear_velocity", "angular_velocity"):
            getattr(start, name)[:] = [getattr(body, name) for body in scenario.bodies]
        self._top = self._potential(start)
        # A body hit by a wall of speed u leaves with up to 2 u.
        paid = self._mass.sum() * (UNSEEN**2 + (2 * drive_speed) ** 2) / 2
        paid += sum(largest_work(joint, scenario.duration) for joint in scenario.body_joints)
        self._paid = paid + float(self._kinetic(start).sum())
        self._fall = 0.0

    def step_fault(self, state: State) -> str | None:
        """Message if a value is not finite or a speed exceeds SPEED_MAX; None otherwise."""
        if np.vdot(state.values, state.values) < SPEED_MAX**2:
            return None
        for name in STATE_FIELDS:
            rows = getattr(state, name)
            # The comparison is false for values that are not finite or overflow.
            if not np.vdot(rows, rows) < SPEED_MAX**2:
                fault = self._explained(name, rows)
                if fault:
                    return fault
        return None

    def _explained(self, name: str, rows: Array) -> str | None:
        """Message for a faulty field of the state; None if it is sound."""
        quantity = name.replace("_", " ")
        most = np.inf if name.endswith("velocity") else LARGEST_STATE  # SPEED_MAX is lower
        sound = (np.abs(rows) < most).reshape(len(rows), -1).all(axis=1)
        if not sound.all():
            row = int(np.argmin(sound))
            of = f"joint {row}" if name.startswith("joint") else repr(self._names[row])
            what = f"beyond {LARGEST_STATE:g}" if np.isfinite(rows[row]).all() else "not finite"
            return f"diverged: the {quantity} of {of} is {what}"
        if not name.endswith("velocity"):
            return None
        angular = name.startswith("angular")
        values = np.abs(rows).max(axis=1)
        speeds = values * self._arm if angular else values
        row = int(np.argmax(speeds))
        if speeds[row] < SPEED_MAX:
            return None
        unit = "rad/s" if angular else "m/s"
        return f"diverged: the {quantity} of {self._names[row]!r} is {values[row]:.2g} {unit}"

    def frame_fault(self, state: State) -> str | None:
        """Message if energy grows without a cause or a body leaves its plan's bounds; None otherwise."""
        left = self._plan and self._plan.broken(state.position, self._names)
        grown = self._grown(state, GROWN if left else EXPLODED)
        if grown or not left:
            return grown
        return f"{left} (the plan does not hold; --effects all plays it)"

    def _grown(self, state: State, factor: float) -> str | None:
        """Message if the energy exceeds `factor` times what the start, gravity and the drivers allow; else
        None.

        Without drivers, kinetic energy is bounded by the initial one plus the potential energy released, and
        a rise above the start counts as energy. Drivers lift bodies: with them the fall counts from the
        highest potential energy reached, and a rise is free.
        """
        potential = self._potential(state)
        if self._driven:
            self._top = max(self._top, potential)
        self._fall = max(self._fall, self._top - potential)
        allowed = self._paid + self._fall
        risen = max(0.0, potential - self._top)
        if self._largest_kinetic(state) + risen <= factor * allowed:
            return None
        energies = self._kinetic(state)
        energy = float(energies.sum()) + risen
        if energy <= factor * allowed:
            return None
        row = int(np.argmax(energies))
        speed = float(np.linalg.norm(state.linear_velocity[row]))
        fast = f"moves at {speed:.2g} m/s"
        if energies[row] > self._mass[row] * speed**2:
            fast = f"turns at {np.linalg.norm(state.angular_velocity[row]):.2g} rad/s"
        return f"diverged: {self._names[row]!r} {fast}, energy {energy:.3g} J of at most {allowed:.2g} J"

    def _kinetic(self, state: State) -> Array:
        """Kinetic energy of every body (n,) [J]."""
        spin = turned_back(state.orientation, state.angular_velocity)
        linear = self._mass * np.einsum("ni,ni->n", state.linear_velocity, state.linear_velocity)
        return np.asarray((linear + np.einsum("ni,nij,nj->n", spin, self._inertia, spin)) / 2)

    def _largest_kinetic(self, state: State) -> float:
        """Bound on the kinetic energy of all bodies [J], in a tenth of its time."""
        linear = np.einsum("ni,ni->n", state.linear_velocity, state.linear_velocity)
        angular = np.einsum("ni,ni->n", state.angular_velocity, state.angular_velocity)
        return float(self._mass @ linear + self._largest_inertia @ angular) / 2 * (1 + ROUNDING)

    def _potential(self, state: State) -> float:
        """Potential energy of all simulated bodies [J]."""
        centers = state.position
        if self._offset:
            centers = centers + turned(state.orientation, self._center)
        return -float(self._weight @ (centers @ self._gravity))


def _surface_speed(piece: Piece) -> float:
    """Upper bound on the speed of a piece's material relative to its body [m/s]."""
    return float(np.linalg.norm(piece.surface_velocity)) + extent(piece) * float(
        np.linalg.norm(piece.surface_angular_velocity)
    )


def largest_work(joint: BodyJoint, duration: float) -> float:
    """Upper bound on what the spring of a joint releases, k target^2 / 2, and on the work of its motor, whose
    power c (rate - dq/dt) dq/dt is at most c rate^2 / 4, and the largest force times the rate [J]."""
    rate = abs(joint.target_rate)
    power = min(joint.damping * rate**2 / 4, joint.largest_force * rate)
    return joint.stiffness * joint.target**2 / 2 + power * duration


def _drive_speed(scenario: Scenario, tracker: Tracker) -> float:
    """Upper bound on the speed of all points of a driven body that follows its tracker [m/s]."""
    joints = {joint.name: joint for joint in scenario.joints}
    pieces = [piece for k in scenario.links(tracker) for piece in scenario.bodies[k].pieces]
    reach = sum(float(np.linalg.norm(joints[name].position)) for name in tracker.joints)
    reach += max(map(extent, pieces), default=0.0)
    motion = sample(tracker, np.arange(scenario.frame_count + 1) / scenario.frame_rate)
    turning = np.linalg.norm(motion.angular_velocity, axis=1) + np.abs(motion.rate).sum(axis=1)
    return float((np.linalg.norm(motion.linear_velocity, axis=1) + reach * turning).max())
