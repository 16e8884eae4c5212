"""Closed-form motion of bodies at any times, from a scenario's truths.

Sources: Landau and Lifshitz, *Mechanics*, section 37, for the free asymmetric top; Eq. 6 for the coupling.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count, pairwise, takewhile

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk, ellipkinc

from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.scenario import Arc, Body, Scenario, Tracker, Truth

Array = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
"""Quadrature of the precession over one interval: exact to rounding if the body turns less than once."""


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a body at n times: centre of mass and its velocity, orientation wxyz, angular velocity;
    world."""

    position: Array  # (n, 3) [m]
    velocity: Array  # (n, 3) [m/s]
    orientation: Array  # (n, 4)
    angular_velocity: Array  # (n, 3) [rad/s]


def motion(scenario: Scenario, truth: Truth, times: Array) -> Motion:
    """Closed-form motion of `truth.body` at increasing `times` [s] >= 0."""
    body = scenario.bodies[scenario.body_index(truth.body)]
    match truth.law:
        case "arcs":
            return _along_arcs(body, truth.arcs, times)
        case "torque_free":
            return _free_top(scenario, body, times)
        case "coupling":
            tracker = next(t for t in scenario.trackers if t.root == truth.body)
            return _coupled(body, tracker, scenario.frame_rate, times)


def _along_arcs(body: Body, arcs: tuple[Arc, ...], times: Array) -> Motion:
    index = np.searchsorted([arc.start for arc in arcs], times, side="right") - 1
    table = {
        name: np.array([getattr(arc, name) for arc in arcs])
        for name in ("position", "velocity", "acceleration", "angular_velocity", "angular_acceleration")
    }
    starts = np.array([arc.start for arc in arcs])
    t = (times - starts[index])[:, None]
    v, a = table["velocity"][index], table["acceleration"][index]
    w, b = table["angular_velocity"][index], table["angular_acceleration"][index]
    first = [Rotation.from_quat(body.orientation, scalar_first=True)]
    for k, length in enumerate(np.diff(starts)):
        turn = table["angular_velocity"][k] * length + table["angular_acceleration"][k] * length**2 / 2
        first.append(Rotation.from_rotvec(turn) * first[-1])
    turned = Rotation.from_rotvec(w * t + b * t**2 / 2) * Rotation.concatenate(first)[index]
    return Motion(
        table["position"][index] + v * t + a * t**2 / 2,
        v + a * t,
        turned.as_quat(scalar_first=True),
        w + b * t,
    )


@dataclass(frozen=True, slots=True)
class _Top:
    """Free top in principal axes 1, 2, 3: w = (a_1 cn, a_2 sn, a_3 dn)(phase + rate t | m).

    The angular velocity circles about axis 3; axis 2 has the intermediate moment.
    """

    axes: Array  # (3, 3) principal axes in the body frame, right-handed, as columns
    moments: Array  # (3,)
    amplitude: Array  # (3,) signed
    rate: float
    phase: float
    m: float

    def angular_velocity(self, times: Array) -> Array:
        """Angular velocity along the principal axes (n, 3)."""
        sn, cn, dn, _ = ellipj(self.phase + self.rate * times, self.m)
        return np.stack([cn, sn, dn], axis=-1) * self.amplitude


def _top(body: Body) -> _Top:
    moments, axes = np.linalg.eigh(np.array(body.inertia))
    turned = Rotation.from_quat(body.orientation, scalar_first=True).as_matrix()
    w = axes.T @ (turned.T @ np.array(body.angular_velocity))
    # Axis 3, about which the angular velocity circles, has the largest or the smallest moment.
    square, twice_energy = float(np.sum((moments * w) ** 2)), float(np.sum(moments * w**2))
    order = [0, 1, 2] if square >= twice_energy * moments[1] else [2, 1, 0]
    moments, axes, w = moments[order], axes[:, order], w[order]
    if np.linalg.det(axes) < 0:
        axes[:, 1], w[1] = -axes[:, 1], -w[1]
    i1, i2, i3 = moments
    # Differences of the invariants, without cancellation.
    to_third = i1 * (i3 - i1) * w[0] ** 2 + i2 * (i3 - i2) * w[1] ** 2
    to_first = i2 * (i2 - i1) * w[1] ** 2 + i3 * (i3 - i1) * w[2] ** 2
    amplitude = np.sqrt(
        [to_third / (i1 * (i3 - i1)), to_third / (i2 * (i3 - i2)), to_first / (i3 * (i3 - i1))]
    )
    amplitude[2] *= np.copysign(1.0, w[2])
    amplitude[1] *= np.copysign(1.0, amplitude[2] * (i3 - i2))
    rate = float(np.sqrt((i3 - i2) * to_first / (i1 * i2 * i3)))
    m = float((i2 - i1) * to_third / ((i3 - i2) * to_first))
    phase = float(ellipkinc(np.arctan2(w[1] / amplitude[1], w[0] / amplitude[0]), m))
    return _Top(axes, moments, amplitude, rate, phase, m)


def _free_top(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a free top by Euler angles about the angular momentum.

    Two angles follow from its components in the body, the precession from quadrature of L (I_1 w_1^2 + I_2
    w_2^2) / (L_1^2 + L_2^2).
    """
    top = _top(body)
    w = top.angular_velocity(times)
    momentum = top.moments * top.angular_velocity(np.zeros(1))[0]
    size = float(np.linalg.norm(momentum))

    def precession(t: Array) -> Array:
        rates = top.angular_velocity(t.ravel())[:, :2].reshape(*t.shape, 2)
        across = top.moments[:2] * rates
        return np.asarray(size * np.sum(across * rates, axis=-1) / np.sum(across**2, axis=-1))

    angle = _integral(precession, times, top.rate)
    turned = _about_momentum(top, w, size, angle)
    start = _about_momentum(top, top.angular_velocity(np.zeros(1)), size, np.zeros(1))
    first = Rotation.from_quat(body.orientation, scalar_first=True)
    principal = Rotation.from_matrix(top.axes)
    world = first * principal * start.inv() * turned
    t, gravity = times[:, None], np.array(scenario.acting_gravity)
    v = np.array(body.linear_velocity) + gravity * t
    center = np.array(body.position) + first.apply(body.center_of_mass)
    return Motion(
        center + np.array(body.linear_velocity) * t + gravity * t**2 / 2,
        v,
        (world * principal.inv()).as_quat(scalar_first=True),
        world.apply(w),
    )


def _about_momentum(top: _Top, w: Array, size: float, precession: Array) -> Rotation:
    """Orientation of the principal axes in a frame whose z is along the angular momentum."""
    x, y, z = (top.moments * w / size).T
    nutation, spin = np.arctan2(np.hypot(x, y), z), np.arctan2(x, y)
    return Rotation.from_euler("ZXZ", np.stack([precession, nutation, spin], axis=-1))


def _integral(function: Callable[[Array], Array], times: Array, rate: float) -> Array:
    """Integral of a smooth function from 0 to increasing times, in intervals of at most 1 / (16 `rate`)."""
    found, total, last = np.zeros(len(times)), 0.0, 0.0
    for k, time in enumerate(times):
        pieces = max(1, int(np.ceil((time - last) * rate * 16)))
        ends = np.linspace(last, time, pieces + 1)
        half = np.diff(ends)[:, None] / 2
        total += float(np.sum(half * WEIGHTS * function(ends[:-1, None] + half * (1 + NODES))))
        found[k], last = total, time
    return found


def flips(scenario: Scenario, truth: Truth) -> Array:
    """Times [s] at which a free top's rate about its intermediate axis changes sign."""
    top = _top(scenario.bodies[scenario.body_index(truth.body)])
    half = 2 * float(ellipk(top.m)) / top.rate
    first = -top.phase / top.rate % half
    return np.array(list(takewhile(lambda t: t <= scenario.duration, (first + k * half for k in count()))))


def _coupled(body: Body, tracker: Tracker, frame_rate: int, times: Array) -> Motion:
    """Motion under Eq. 6, m p'' = -K (p - p_t) - R (p' - p_t'), with a tracker that is linear between frames.

    Each frame applies the exponential of the linear system in (p - p_t, p' - p_t'); p_t' jumps at frames.
    """
    k, r = tracker.stiffness / body.mass, tracker.damping / body.mass
    system = np.array([[0.0, 1.0], [-k, -r]])
    knots = np.arange(round(tracker.times[-1] * frame_rate) + 1) / frame_rate
    target = sample(tracker, np.minimum(knots, tracker.times[-1])).position
    pace = np.diff(target, axis=0) * frame_rate
    whole = expm(system / frame_rate)
    start = [np.stack([np.zeros(3), -pace[0]])]
    for before, after in pairwise(pace):
        state = whole @ start[-1]
        state[1] += before - after
        start.append(state)
    index = np.minimum(np.searchsorted(knots, times, side="right") - 1, len(pace) - 1)
    since = times - knots[index]
    state = np.array([expm(system * t) @ start[f] for f, t in zip(index, since)]).reshape(-1, 2, 3)
    n = len(times)
    return Motion(
        target[index] + pace[index] * since[:, None] + state[:, 0],
        pace[index] + state[:, 1],
        np.tile(tracker.orientations[0], (n, 1)),
        np.zeros((n, 3)),
    )
