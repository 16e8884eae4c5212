"""A body that rolls, slides and leaves, with one contact between smooth surfaces, integrated to rounding.

Conventions: n is the unit normal of the support at the contact, r the contact point from the centre of mass,
F the contact force on the body; all in the world. The first piece of the body, an ellipsoid, a ball or the
lower rim of a cylinder, touches the upper face (local +z) of a box of the fixed body; a ball may touch balls
of it instead.

With the velocity of the contact point u = v + w x r, Newton's and Euler's laws give u' = K F + b. Rolling
asks u' = 0. Sliding asks (n . u)' = 0 and Coulomb's force F = N (n - mu u / |u|). The modes change where
friction cannot hold (|F_t| = mu N), where the slip ends (u = 0) and where the support would pull (N = 0).
Where another piece of the fixed body is met, the impulse -K^-1 u stops the body's point there (e = 0, no
slip), and the body leaves the piece before.

Source: Montana (1988), *The kinematics of contact and grasp*, for the rates of n and r.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Literal, NamedTuple

import numpy as np
from scipy.integrate import OdeSolution

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import Report
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Piece,
    Quaternion,
    Scenario,
    Shape,
    Sphere,
)
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.integration import integrated

Mode = Literal["roll", "slide", "fly"]

STOPPED = 1e-11
"""Slip at which a body rolls [m/s]: the integration's error of a velocity of some m/s."""
ONSET = 1e-12
"""Slip below which friction has the direction that it had in rolling [m/s]: a tenth of STOPPED."""
TOUCHING = 1e-9
"""Distance at the start up to which a body touches [m]: rounding of its pose."""
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
    arm: Array  # (3,) centre of the touching piece or cap from the centre of mass, body frame
    squares: Array  # (3, 3) squares of the piece's half axes as a matrix, body frame
    gravity: Array
    friction: float
    normal: Array  # (3,) of a flat support
    centre: Array  # (3,) of a round support, or of a flat one's face
    reach: float  # distance of a ball's centre from that of a round support [m]; 0: a flat support

    @classmethod
    def of(cls, scenario: Scenario, body: Body, fixed: Body, under: Piece) -> SmoothContact:
        """The contact of a body with a piece of a fixed one."""
        pair = sorted((scenario.body_index(fixed.name), scenario.body_index(body.name)))
        piece, shape = body.pieces[0], under.shape
        half = _half_axes(piece.shape)
        turn, place = _matrix(piece.orientation), _matrix(fixed.orientation)
        normal = (place @ _matrix(under.orientation))[:, 2]
        height = shape.half_extents[2] if isinstance(shape, Box) else 0.0
        arm = np.subtract(piece.position, body.center_of_mass)
        if isinstance(piece.shape, Cylinder):
            axis = turn[:, 2]
            side = np.sign(normal @ _matrix(body.orientation) @ axis)
            arm = arm - side * piece.shape.half_length * axis
        return cls(
            mass=body.mass,
            inertia=np.array(body.inertia),
            arm=arm,
            squares=turn @ np.diag(half**2) @ turn.T,
            gravity=np.array(scenario.acting_gravity),
            friction=scenario.pair_coefficients(*pair)[1],
            normal=normal,
            centre=fixed.position + place @ under.position + height * normal,
            reach=float(shape.radius + half[0]) if isinstance(shape, Sphere) else 0.0,
        )

    def gap(self, state: Array) -> float:
        """Distance of the body's piece from the support [m]."""
        turn = _matrix(state[3:7])
        away = state[:3] + turn @ self.arm - self.centre
        if self.reach:
            return float(np.linalg.norm(away)) - self.reach
        n = self.normal
        return float(n @ away - np.sqrt(n @ turn @ self.squares @ turn.T @ n))

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

    def landed(self, state: Array) -> Array:
        """State after the impulse that stops the body's point at the support."""
        at = self.contact(state)
        impulse = np.asarray(np.linalg.solve(at.mobility, -at.u), dtype=float)
        if np.linalg.norm(_tangent(at.n, impulse)) > self.friction * (at.n @ impulse):
            raise RuntimeError("the body slips where it lands, which the law does not cover")
        return np.concatenate(
            [state[:7], state[7:10] + impulse / self.mass, state[10:] + at.turning[:, :3] @ impulse]
        )


@dataclass(frozen=True, slots=True)
class Phase:
    """Part of a motion from `start` [s] in one mode, on a support or after it."""

    start: float
    mode: Mode
    support: SmoothContact
    solution: OdeSolution


@lru_cache(maxsize=32)
def phases(scenario: Scenario, body: Body) -> tuple[Phase, ...]:
    """Phases of a body's motion to one frame after the end of the scene."""
    end = scenario.duration + 1 / scenario.frame_rate
    return tuple(_phases(supports(scenario, body), initial_state(body), end))


def supports(scenario: Scenario, body: Body) -> tuple[SmoothContact, ...]:
    """Contacts of a body with the pieces of the scene's fixed body."""
    fixed = next(one for one in scenario.bodies if one.kind == "fixed")
    return tuple(SmoothContact.of(scenario, body, fixed, piece) for piece in fixed.pieces)


def initial_state(body: Body) -> Array:
    """State of a body at the start."""
    centre = body.position + _matrix(body.orientation) @ body.center_of_mass
    return np.concatenate([centre, body.orientation, body.linear_velocity, body.angular_velocity])


def _phases(pieces: Sequence[SmoothContact], state: Array, end: float) -> Iterator[Phase]:
    """Phases from 0 to `end` [s].

    A slip that begins during the motion has a direction that does not turn, as in a plane motion: the law is
    stiff across it. What a body has left it does not meet again before it meets another piece.
    """
    time, here = 0.0, min(pieces, key=lambda piece: abs(piece.gap(state)))
    mode: Mode = "slide" if here.unstopped(state) > 0 else "roll"
    for _ in range(MOST_MODES):
        onset = here.onset(state)
        others = [piece for piece in pieces if piece is not here]
        ends: dict[Mode, list[Callable[[Array], float]]] = {
            "roll": [here.margin],
            "slide": [partial(here.pressure, mode="slide", onset=onset), here.unstopped],
            "fly": [],
        }
        run = integrated(
            lambda _, y: here.rate(y, mode, onset),  # noqa: B023
            (time, end),
            state,
            [*ends[mode], *(other.gap for other in others)],
        )
        yield Phase(time, mode, here, run.sol)
        if run.status == 0:
            return
        time, state = float(run.t[-1]), run.y[:, -1]
        met = next(k for k, times in enumerate(run.t_events) if len(times)) - len(ends[mode])
        if met >= 0:
            here, mode = others[met], "roll"
            state = here.landed(state)
        elif mode == "roll":
            # the integration's error of the velocity is no slip
            state[7:10] -= here.contact(state).u
            mode = "slide"
        else:
            mode = "fly" if met == -2 else "roll"
    raise RuntimeError(f"more than {MOST_MODES} phases: the motion chatters at {time:g} s")


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
    under = {type(piece.shape) for one in fixed for piece in one.pieces}
    shapes = (Sphere,) if Sphere in under else (Sphere, Ellipsoid, Cylinder)
    round_one = body.pieces and isinstance(body.pieces[0].shape, shapes)
    if len(fixed) != 1 or not round_one or not under <= {Box, Sphere, HalfSpace}:
        expected = "a ball, or on fixed boxes or half-spaces an ellipsoid or a cylinder, as its first piece"
        expected += "; one fixed body"
        report(path, f"expected {expected}")
        return
    gap = min(abs(one.gap(initial_state(body))) for one in supports(scenario, body))
    if gap > TOUCHING:
        report(path, f"starts {gap:.3g} m from its support, expected a body that touches")


def _half_axes(shape: Shape) -> Array:
    if isinstance(shape, Cylinder):
        return np.array([shape.radius, shape.radius, 0.0])
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
