"""Contacts of a run and the work of its drives, computed for many native steps at a time.

A step leaves copies of its contacts, of the state at its end and of what its drive applied. numpy takes
microseconds per call on a few numbers, so a block of steps costs little more than a single one.
"""

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import CONTACT_FIELDS, Array, State, applied_fields, state_fields
from touchstone.adapters.vector_products import cross, turned
from touchstone.scenarios.avatar.surface_motion import material_velocity, surface_moves
from touchstone.scenarios.scenario import Scenario

STEPS, ROWS = 64, 4096
"""Steps, or rows of contacts, after which a block is computed."""


class StepLog:
    """Log of a run from its start; `mark` closes a displayed frame.

    Work is that of the drives: applied force and torque times the mean velocity of a step [J]. Impulses are
    those of the forces on the roots [N s].
    """

    def __init__(self, scenario: Scenario, dt: float, start: State) -> None:
        self._scenario, self._dt = scenario, dt
        self._mass_center = np.array([body.center_of_mass for body in scenario.bodies])
        self._moving = [k for k, body in enumerate(scenario.bodies) if surface_moves(body)]
        self._roots = [scenario.body_index(tracker.root) for tracker in scenario.trackers]
        self._values = np.zeros((STEPS + 1, len(start.values)))
        self._values[0] = start.values
        self._applied = np.zeros((STEPS, len(start.applied)))
        self._steps = 0  # of the block
        self._rows: list[NDArray[np.int64]] = []
        self._origins: list[tuple[int, float]] = []  # step of the block and its start [s], per item of _rows
        self._waiting = 0  # rows in _rows
        self._done: list[np.ndarray] = []
        self._count = self._whole = 0  # rows so far, and in closed frames
        self._marks: list[int] = []  # steps of the block at which a frame ended
        self._work, self._impulse = 0.0, np.zeros((len(scenario.trackers), 3))
        self._work_of_frames: list[float] = []
        self._impulse_of_frames: list[Array] = []

    def add(self, time: float, state: State) -> None:
        """Append a step that started at `time` [s] and ended in `state`."""
        if self._steps == STEPS or self._waiting >= ROWS:
            self._compute()
        if state.contact_count:
            self._rows.append(state.contact_words[: state.contact_count].copy())
            self._origins.append((self._steps, time))
            self._waiting += state.contact_count
            self._count += state.contact_count
        self._applied[self._steps] = state.applied
        self._steps += 1
        self._values[self._steps] = state.values

    def mark(self) -> None:
        """Close a displayed frame; the first one is the start."""
        self._marks.append(self._steps)
        self._whole = self._count

    def contacts(self) -> np.ndarray:
        """Rows of CONTACT_FIELDS of all closed frames. If the engine knows no time of impact, velocities are
        those at the step's start and end."""
        self._compute()
        return np.concatenate([np.zeros(0, CONTACT_FIELDS), *self._done])[: self._whole]

    def drive(self) -> tuple[Array, Array]:
        """Work (f,) [J] and impulses (f, t, 3) [N s] of the drives by the end of each closed frame."""
        self._compute()
        return np.array(self._work_of_frames), np.array(self._impulse_of_frames)

    def _compute(self) -> None:
        """Compute the steps of the block, and begin another one."""
        values = self._values[: self._steps + 1]
        position, orientation, linear, angular, _, rate = state_fields(values, self._scenario)
        if self._rows:
            self._done.append(self._contact_rows(position, orientation, linear, angular))
            self._rows, self._origins, self._waiting = [], [], 0
        work, impulse = self._drive_sums(position, orientation, linear, angular, rate)
        self._work_of_frames += [work[mark] for mark in self._marks]
        self._impulse_of_frames += [impulse[mark] for mark in self._marks]
        self._work, self._impulse = work[-1], impulse[-1]
        self._values[0] = self._values[self._steps]
        self._steps, self._marks = 0, []

    def _contact_rows(self, position: Array, orientation: Array, linear: Array, angular: Array) -> np.ndarray:
        """Rows of the block, with times of the run and velocities where the engine gave none."""
        counts = [len(words) for words in self._rows]
        rows = np.concatenate(self._rows).view(CONTACT_FIELDS).reshape(-1)
        step, start = (np.repeat(column, counts) for column in zip(*self._origins))
        timeless = np.isnan(rows["time"])
        rows["time"] = np.where(timeless, start, start + rows["time"])
        columns = [[rows[f"velocity_{side}_{moment}"] for side in "ab"] for moment in ("before", "after")]
        if not any(np.isnan(column).any() for pair in columns for column in pair):
            return rows
        body, first = np.concatenate((rows["body_a"], rows["body_b"])), np.concatenate((step, step))
        turn, place = orientation[first, body], np.concatenate((rows["position"],) * 2)
        arm = place - (position[first, body] + turned(turn, self._mass_center[body]))
        motion = self._surface_motion(rows["normal"], turn, place - position[first, body], body)
        for moment, pair in zip((first, first + 1), columns):
            velocity = linear[moment, body] + cross(angular[moment, body], arm) + motion
            for column, own in zip(pair, (velocity[: len(rows)], velocity[len(rows) :])):
                column[:] = np.where(np.isnan(column), own, column)
        return rows

    def _surface_motion(self, normal: Array, turn: Array, arm: Array, body: NDArray[np.int64]) -> Array:
        """Velocities (2 n, 3) [m/s] of the material of both surfaces of n contacts relative to their bodies,
        whose orientations are `turn`, at `arm` [m] from their origins."""
        motion, normal = np.zeros_like(arm), np.concatenate((normal, normal))
        for k in self._moving:
            own = body == k
            motion[own] = material_velocity(self._scenario.bodies[k], turn[own], arm[own], normal[own])
        return motion

    def _drive_sums(
        self, position: Array, orientation: Array, linear: Array, angular: Array, rate: Array
    ) -> tuple[list[float], Array]:
        """Work and impulses by the end of each step of the block; item 0 is the block's start."""
        force, torque, hinge_torque = applied_fields(self._applied[: self._steps], self._scenario)
        impulse = np.add.accumulate(np.concatenate((self._impulse[None], force * self._dt)), axis=0)
        work = [self._work]
        if not self._roots:
            return work * (self._steps + 1), impulse
        if np.isnan(force).all():
            return [*work, *[float("nan")] * self._steps], impulse
        moved, turning = [], []
        for root in self._roots:
            center = position[:, root] + turned(orientation[:, root], self._mass_center[root])
            velocity = linear[:, root] + cross(angular[:, root], position[:, root] - center)
            moved.append(velocity[:-1] + velocity[1:])
            turning.append((angular[:-1, root] + angular[1:, root]) / 2)
        turned_by = rate[:-1] + rate[1:]
        for step in range(self._steps):
            done = 0.0
            for k in range(len(self._roots)):
                done += float(force[step, k] @ moved[k][step] / 2 + torque[step, k] @ turning[k][step])
            done += float(hinge_torque[step] @ turned_by[step] / 2)
            work.append(work[-1] + done * self._dt)
        return work, impulse
