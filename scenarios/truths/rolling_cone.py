"""A cone that rolls on its side on a fixed plane without slip, about its apex, integrated to rounding.

Conventions: n is the normal of the plane, u the direction of the line of contact from the apex, which has the
angle theta about n from its start, and alpha the half angle of the cone. The cone's axis from the apex is
a = cos(alpha) u + sin(alpha) n.

The line of contact does not move, so the angular velocity is along it: omega = -theta' cot(alpha) u. With the
distance d of the centre of mass from the apex and the moment I about the line of contact,

    I cot(alpha)^2 theta'' = m d cos(alpha) g . (n x u),

a pendulum on a slope, and a steady circle on a level plane. The torque about the apex along n x u places the
resultant of the normal forces on the line of contact; the cone lifts off where it leaves that line.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, sin

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import Report
from touchstone.scenarios.scenario import Body, Box, Cone, HalfSpace, Scenario
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.integration import ABSOLUTE_ERROR, RELATIVE_ERROR

TOUCHING = 1e-9
"""Height of the apex over the plane [m], sine of the angle of the side to it [1], and deviation of velocities
from rolling [m/s, rad/s], that are rounding."""


@dataclass(frozen=True, slots=True)
class Roll:
    """A cone on its side at the start of a scene, and its plane; vectors are in the world."""

    normal: Array
    line: Array  # u at the start
    axis: Array  # a at the start
    apex: Array
    alpha: float
    arm: float  # d [m]
    inertia: float  # I [kg m^2]
    mass: float
    gravity: Array
    length: float  # of the line of contact [m]
    rate: float  # theta' at the start [rad/s]

    @classmethod
    def of(cls, scenario: Scenario, body: Body) -> Roll:
        """The roll of a body of one cone on the scene's fixed plane."""
        fixed = next(one for one in scenario.bodies if one.kind == "fixed")
        piece, under = body.pieces[0], fixed.pieces[0]
        shape = piece.shape
        assert isinstance(shape, Cone)
        turn = Rotation.from_quat(body.orientation, scalar_first=True)
        own = Rotation.from_quat(piece.orientation, scalar_first=True)
        plane = Rotation.from_quat(fixed.orientation, scalar_first=True)
        normal = (plane * Rotation.from_quat(under.orientation, scalar_first=True)).apply((0.0, 0.0, 1.0))
        axis = (turn * own).apply((0.0, 0.0, -1.0))
        line = axis - (axis @ normal) * normal
        line /= np.linalg.norm(line)
        height, slant = 2 * shape.half_length, hypot(shape.radius, 2 * shape.half_length)
        apex = body.position + turn.apply(piece.position) - shape.half_length * axis
        center = body.position + turn.apply(body.center_of_mass)
        arm = float((center - apex) @ axis)
        matrix = turn.as_matrix() @ np.array(body.inertia) @ turn.as_matrix().T
        alpha = float(np.arctan2(shape.radius, height))
        about = float(line @ matrix @ line) + body.mass * (arm * sin(alpha)) ** 2
        spin = float(np.array(body.angular_velocity) @ line)
        gravity, rate = np.array(scenario.acting_gravity), -spin * np.tan(alpha)
        return cls(normal, line, axis, apex, alpha, arm, about, body.mass, gravity, slant, float(rate))

    def turned(self, angle: Array) -> Rotation:
        """Rotations from the start by which the cone has rolled through angles theta (n,)."""
        rolled = Rotation.from_rotvec(np.outer(-angle / sin(self.alpha), self.axis))
        return Rotation.from_rotvec(np.outer(angle, self.normal)) * rolled

    def lines(self, angle: Array) -> Array:
        """u (n, 3)."""
        across = np.cross(self.normal, self.line)
        return np.outer(np.cos(angle), self.line) + np.outer(np.sin(angle), across)

    def bend(self, angle: float) -> float:
        """theta'' [rad/s^2]."""
        across = np.cross(self.normal, self.lines(np.array([angle]))[0])
        force = self.mass * self.arm * cos(self.alpha) * float(self.gravity @ across)
        return force * np.tan(self.alpha) ** 2 / self.inertia

    def bearing(self, angle: Array, rate: Array) -> Array:
        """Distance of the resultant of the normal forces from the apex over the length of the line (n,)."""
        press = -float(self.gravity @ self.normal)
        weight = self.arm * (press * cos(self.alpha) + sin(self.alpha) * (self.lines(angle) @ self.gravity))
        turning = rate**2 / np.tan(self.alpha) * self.inertia / self.mass
        return np.asarray((weight + turning) / (press * self.length))

    def angles(self, times: Array) -> tuple[Array, Array]:
        """theta [rad] and theta' [rad/s] at times (n,)."""
        end = float(times.max(initial=0.0)) + 1e-3
        run = solve_ivp(
            lambda _, y: (y[1], self.bend(y[0])),
            (0.0, end),
            (0.0, self.rate),
            "DOP853",
            [*times.tolist(), end],
            rtol=RELATIVE_ERROR,
            atol=ABSOLUTE_ERROR,
        )
        return run.y[0, :-1], run.y[1, :-1]


def rolling_cone(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a cone that rolls on its side at increasing `times` [s] >= 0."""
    roll = Roll.of(scenario, body)
    angle, rate = roll.angles(times)
    turned = roll.turned(angle)
    omega = -rate[:, None] / np.tan(roll.alpha) * roll.lines(angle)
    out = roll.arm * turned.apply(roll.axis)
    first = Rotation.from_quat(body.orientation, scalar_first=True)
    return Motion(roll.apex + out, np.cross(omega, out), (turned * first).as_quat(scalar_first=True), omega)


def check_rolling_cone(scenario: Scenario, body: Body, path: str, report: Report) -> None:
    """Report what the law does not cover: other shapes and supports, and a cone that does not roll."""
    fixed = [one.pieces[0].shape for one in scenario.bodies if one.kind == "fixed"]
    if len(fixed) != 1 or not isinstance(fixed[0], HalfSpace | Box) or not any(scenario.acting_gravity):
        report(path, "expected one fixed half-space or box, whose upper face is the plane, and gravity")
        return
    if len(body.pieces) != 1 or not isinstance(body.pieces[0].shape, Cone):
        report(path, "expected a body of one cone")
        return
    roll = Roll.of(scenario, body)
    under = next(one for one in scenario.bodies if one.kind == "fixed")
    top = fixed[0].half_extents[2] if isinstance(fixed[0], Box) else 0.0
    place = Rotation.from_quat(under.orientation, scalar_first=True).apply(under.pieces[0].position)
    level = float((np.array(under.position) + place) @ roll.normal) + top
    off = float(roll.apex @ roll.normal) - level, float(roll.axis @ roll.normal) - sin(roll.alpha)
    if max(map(abs, off)) > TOUCHING:
        report(path, "expected a cone whose side lies on the plane")
    omega = -roll.rate / np.tan(roll.alpha) * roll.line
    slip = np.array(body.linear_velocity) - np.cross(omega, roll.arm * roll.axis)
    if max(np.abs(slip).max(), np.abs(np.array(body.angular_velocity) - omega).max()) > TOUCHING:
        report(path, "expected velocities of rolling about the apex")
    angle, rate = roll.angles(np.linspace(0.0, scenario.duration, scenario.frame_count + 1))
    bearing = roll.bearing(angle, rate)
    if not (bearing.min() > 0 and bearing.max() < 1):
        report(
            path, f"the normal forces act at {bearing.max():.3g} of the line of contact: the cone lifts off"
        )
