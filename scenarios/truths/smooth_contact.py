"""A body that rolls, slides and leaves, with one contact between smooth surfaces, integrated to rounding.

Conventions: n is the unit normal of the support at the contact, r the contact point from the centre of mass,
F the contact force on the body; all in the world. The first piece of the body, an ellipsoid or a ball,
touches the upper face (local +z) of a fixed box; a ball may touch a fixed ball instead.

With the velocity of the contact point u = v + w x r, Newton's and Euler's laws give u' = K F + b. Rolling
asks u' = 0. Sliding asks (n . u)' = 0 and Coulomb's force F = N (n - mu u / |u|). The modes change where
friction cannot hold (|F_t| = mu N), where the slip ends (u = 0) and where the support would pull (N = 0).

Sources: Montana (1988), *The kinematics of contact and grasp*, for the rates of n and r; Hairer, Norsett and
Wanner (1993), *Solving Ordinary Differential Equations I*, for DOP853.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from touchstone.scenarios.avatar.number_checks import Report
from touchstone.scenarios.scenario import Body, Box, Ellipsoid, Quaternion, Scenario, Shape, Sphere
from touchstone.scenarios.truths.body_motion import Array, Motion

Mode = Literal["roll", "slide", "fly"]

RELATIVE_ERROR, ABSOLUTE_ERROR = 1e-12, 1e-14
"""Tolerances of the integration [1; m, m/s, rad/s]: a hundred times rounding, which a step accumulates."""
LONGEST_STEP = 1 / 240
"""Longest step of the integration [s]: its interpolant, of order 7, is then as exact as its ends."""
STOPPED = 1e-11
"""Slip at which a body rolls [m/s]: the integration's error of a velocity of some m/s."""
ONSET = 1e-12
"""Slip below which friction has the direction that it had in rolling [m/s]: a tenth of STOPPED."""
MOST_MODES = 100
"""Phases of a motion, above which it chatters between two of them."""


class Contact(NamedTuple):
    """The contact at one state: u' = K F + b, w' = P F + c."""

    n: Array
    dn: Array
    u: Array
    mobility: Array  # K
    b: Array
    turning: Array  # (3, 4): P and c


@dataclass(frozen=True, slots=True)
class SmoothContact:
    """A body and the support that it touches. States are (p, q, v, w), p that of the centre of mass."""

    mass: float
    inertia: Array  # (3, 3) body frame
    arm: Array  # (3,) centre of the touching piece from the centre of mass, body frame
    squares: Array  # (3, 3) squares of the piece's half axes as a matrix, body frame
    gravity: Array
    friction: float
    normal: Array  # (3,) of a level support
    centre: Array  # (3,) of a round support
    reach: float  # distance of a ball's centre from that of a round support [m]; 0: a level support

    @classmethod
    def of(cls, scenario: Scenario, body: Body) -> SmoothContact:
        """The contact of a body with the scene's fixed body."""
        fixed = next(one for one in scenario.bodies if one.kind == "fixed")
        pair = sorted((scenario.body_index(fixed.name), scenario.body_index(body.name)))
        under, piece = fixed.pieces[0], body.pieces[0]
        half = _half_axes(piece.shape)
        turn, place = _matrix(piece.orientation), _matrix(fixed.orientation)
        return cls(
            mass=body.mass,
            inertia=np.array(body.inertia),
            arm=np.subtract(piece.position, body.center_of_mass),
            squares=turn @ np.diag(half**2) @ turn.T,
            gravity=np.array(scenario.acting_gravity),
            friction=scenario.pair_coefficients(*pair)[1],
            normal=(place @ _matrix(under.orientation))[:, 2],
            centre=fixed.position + place @ under.position,
            reach=float(under.shape.radius + half[0]) if isinstance(under.shape, Sphere) else 0.0,
        )

    def contact(self, state: Array) -> Contact:
        """Contact at a state: its normal, slip and mobility."""
        p, v, w = state[:3], state[7:10], state[10:]
        turn = _matrix(state[3:7])
        arm = turn @ self.arm
        n, dn = self.normal, np.zeros(3)
        if self.reach:
            n = (p + arm - self.centre) / np.linalg.norm(p + arm - self.centre)
            pace = v + _cross(w, arm)
            dn = (pace - n * (n @ pace)) / self.reach
        # the lowest point of the ellipsoid, -B n / sqrt(n . B n) with B = S^2 in the world, and its rate
        square = turn @ self.squares @ turn.T
        low = square @ n
        depth = np.sqrt(n @ low)
        rate = _cross(w, low) - square @ _cross(w, n) + square @ dn
        depth_rate = (n @ rate + dn @ low) / (2 * depth)
        r = arm - low / depth
        dr = _cross(w, arm) - rate / depth + low * depth_rate / depth**2
        # Euler's law: I w' = r x F - w x I w
        inertia = turn @ self.inertia @ turn.T
        lever = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
        turning = np.linalg.solve(inertia, np.column_stack([lever, -_cross(w, inertia @ w)]))
        mobility = np.eye(3) / self.mass - lever @ turning[:, :3]
        b = self.gravity + _cross(turning[:, 3], r) + _cross(w, dr)
        return Contact(n, dn, v + _cross(w, r), mobility, b, turning)

    def force(self, at: Contact, mode: Mode, onset: Array) -> Array:
        """Contact force on the body [N]. In the mode slide, friction is along `onset` where u is 0."""
        if mode == "fly":
            return np.zeros(3)
        if mode == "roll":
            return np.asarray(np.linalg.solve(at.mobility, -at.b))
        against = onset - at.u
        size = np.linalg.norm(against)
        direction = at.n + (self.friction / size * against if size else 0.0)
        return np.asarray(-(at.n @ at.b + at.dn @ at.u) / (at.n @ at.mobility @ direction) * direction)

    def rate(self, state: Array, mode: Mode, onset: Array) -> Array:
        """Rate of a state."""
        at = self.contact(state)
        force = self.force(at, mode, onset)
        q, w = state[3:7], state[10:]
        turned = np.array([-q[1:] @ w, *(q[0] * w + _cross(w, q[1:]))]) / 2
        pace = self.gravity + force / self.mass
        return np.concatenate([state[7:10], turned, pace, at.turning[:, :3] @ force + at.turning[:, 3]])

    def pressure(self, state: Array, mode: Mode, onset: Array) -> float:
        """Normal force [N]."""
        at = self.contact(state)
        return float(at.n @ self.force(at, mode, onset))

    def margin(self, state: Array) -> float:
        """What friction could hold beyond what rolling asks of it [N]; negative: it cannot hold."""
        at = self.contact(state)
        force = self.force(at, "roll", np.zeros(3))
        return self.friction * float(at.n @ force) - float(np.linalg.norm(_tangent(at.n, force)))

    def unstopped(self, state: Array) -> float:
        """Positive while a slip goes on: it is above STOPPED, or friction could not hold the point."""
        return max(float(np.linalg.norm(self.contact(state).u)) - STOPPED, -self.margin(state))

    def onset(self, state: Array) -> Array:
        """Slip of size ONSET against the friction that rolling asks for."""
        at = self.contact(state)
        friction = _tangent(at.n, self.force(at, "roll", np.zeros(3)))
        size = np.linalg.norm(friction)
        return np.asarray(ONSET * friction / size if size and self.friction else 0 * friction)

    def phases(self, state: Array, end: float) -> Iterator[Phase]:
        """Phases from 0 to `end` [s].

        A slip that begins during the motion has a direction that does not turn, as in a plane motion: the
        law is stiff across it.
        """
        time = 0.0
        mode: Mode = "slide" if self.unstopped(state) > 0 else "roll"
        for _ in range(MOST_MODES):
            onset = self.onset(state)
            ends: dict[Mode, tuple[Callable[[Array], float], ...]] = {
                "roll": (self.margin,),
                "slide": (lambda y: self.pressure(y, "slide", onset), self.unstopped),  # noqa: B023
                "fly": (),
            }
            run = solve_ivp(
                lambda _, y: self.rate(y, mode, onset),  # noqa: B023
                (time, end),
                state,
                "DOP853",
                events=[_event(end_of) for end_of in ends[mode]],
                dense_output=True,
                max_step=LONGEST_STEP,
                rtol=RELATIVE_ERROR,
                atol=ABSOLUTE_ERROR,
            )
            assert run.sol is not None
            assert run.t_events is not None
            yield Phase(time, mode, run.sol)
            if run.status == 0:
                return
            time, state = float(run.t[-1]), run.y[:, -1]
            if mode == "roll":
                # the integration's error of the velocity is no slip
                state[7:10] -= self.contact(state).u
            left = mode == "slide" and len(run.t_events[0])
            mode = "fly" if left else "slide" if mode == "roll" else "roll"
        raise RuntimeError(f"more than {MOST_MODES} phases: the motion chatters at {time:g} s")


@dataclass(frozen=True, slots=True)
class Phase:
    """Part of a motion from `start` [s] in one mode."""

    start: float
    mode: Mode
    solution: OdeSolution


@lru_cache(maxsize=32)
def phases(scenario: Scenario, body: Body) -> tuple[Phase, ...]:
    """Phases of a body's motion to one frame after the end of the scene."""
    centre = body.position + _matrix(body.orientation) @ body.center_of_mass
    state = np.concatenate([centre, body.orientation, body.linear_velocity, body.angular_velocity])
    end = scenario.duration + 1 / scenario.frame_rate
    return tuple(SmoothContact.of(scenario, body).phases(state, end))


def smooth_contact(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a body with one contact between smooth surfaces."""
    played = phases(scenario, body)
    index = np.searchsorted([phase.start for phase in played], times, side="right") - 1
    states = np.empty((len(times), 13))
    for k, phase in enumerate(played):
        if (mine := index == k).any():
            states[mine] = phase.solution(times[mine]).T
    q = states[:, 3:7] / np.linalg.norm(states[:, 3:7], axis=1)[:, None]
    return Motion(states[:, :3], states[:, 7:10], q, states[:, 10:])


def check_smooth_contact(scenario: Scenario, body: Body, path: str, report: Report) -> None:
    """Report what the law does not cover: other supports, other shapes, a first piece that does not touch."""
    fixed = [one for one in scenario.bodies if one.kind == "fixed"]
    under = fixed[0].pieces[0].shape if len(fixed) == 1 and len(fixed[0].pieces) == 1 else None
    shapes = (Sphere,) if isinstance(under, Sphere) else (Sphere, Ellipsoid)
    if not isinstance(under, Box | Sphere) or not body.pieces or not isinstance(body.pieces[0].shape, shapes):
        report(path, "expected a ball, or on a fixed box an ellipsoid, as its first piece; one fixed piece")


def _half_axes(shape: Shape) -> Array:
    assert isinstance(shape, Sphere | Ellipsoid)
    return np.array([shape.radius] * 3 if isinstance(shape, Sphere) else shape.half_axes)


def _matrix(q: Array | Quaternion) -> Array:
    """Rotation matrix of a quaternion wxyz of any length."""
    w, x, y, z = np.array(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _cross(a: Array, b: Array) -> Array:
    """Product of two vectors; ten times faster than numpy's for one pair."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _tangent(n: Array, v: Array) -> Array:
    return np.asarray(v - (n @ v) * n)


def _event(function: Callable[[Array], float]) -> Callable[[float, Array], float]:
    """An event of `solve_ivp` that ends the integration where a function of the state falls through 0."""

    def event(_: float, state: Array) -> float:
        return function(state)

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event
