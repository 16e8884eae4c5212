"""Closed-form motion of bodies at any times, from a scenario's truths.

Sources: Landau and Lifshitz, *Mechanics*, section 37, for the free asymmetric top; Eq. 6 for the coupling;
Coulomb's law on a prescribed body; Weltner (1979), *Stable circular orbits of freely moving balls on rotating
discs*, for the turntable.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count, pairwise, takewhile

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk, ellipkinc

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.tracking import path, sample
from touchstone.scenarios.scenario import Arc, Body, Scenario, Sphere, Tracker, Truth
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.mechanism import mechanism_motion
from touchstone.scenarios.truths.rolling_cone import rolling_cone
from touchstone.scenarios.truths.smooth_contact import smooth_contact
from touchstone.scenarios.truths.stick_slip import stick_slip
from touchstone.scenarios.truths.tipping import tipping

EVENT_GRID = 1e-3
"""Spacing of the times between which a body on a prescribed one starts or stops to slide at most once [s]."""
EVENT_ERROR = 1e-15
"""Error of the times at which it starts or stops to slide [s]: rounding."""
INTEGRATED = 1e-12
"""Relative tolerance of an integrated orientation [1]."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
"""Quadrature of the precession over one interval: exact to rounding if the body turns less than once."""


def motion(scenario: Scenario, truth: Truth, times: Array) -> Motion:
    """Closed-form motion of `truth.body` at increasing `times` [s] >= 0."""
    body = scenario.bodies[scenario.body_index(truth.body)]
    if truth.law == "arcs":
        return _along_arcs(body, truth.arcs, times)
    return LAWS[truth.law](scenario, body, times)


def support(scenario: Scenario) -> tuple[int, Tracker]:
    """Index and tracker of the first prescribed body of a scene."""
    tracker = next(filter(scenario.prescribes, scenario.trackers))
    return scenario.body_index(tracker.root), tracker


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


def _coupled(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion under Eq. 6, m p'' = -K (p - p_t) - R (p' - p_t'), with a tracker that is linear between frames.

    Each frame applies the exponential of the linear system in (p - p_t, p' - p_t'); p_t' jumps at frames.
    """
    tracker = next(one for one in scenario.trackers if one.root == body.name)
    frame_rate = scenario.frame_rate
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


@dataclass(frozen=True, slots=True)
class _Phase:
    """Part of a motion on a moving support: from `start` [s] the body slides relative to it in the direction
    `sign` along the line (0: sticks), from `place` [m] and at `speed` [m/s] along the line, world."""

    start: float
    sign: float
    place: float
    speed: float


class _Ride:
    """Body on the level top of a support that translates in a vertical plane, with friction mu: while it
    slides, v' = -sign mu (g + z''); it sticks where |x''| <= mu (g + z'') for the support's x and z."""

    def __init__(self, scenario: Scenario, body: Body) -> None:
        index, tracker = support(scenario)
        pair = sorted((index, scenario.body_index(body.name)))
        self.mu, self.path = scenario.pair_coefficients(*pair)[1], path(tracker)
        gravity = np.array(scenario.acting_gravity)
        self.g = float(np.linalg.norm(gravity))
        self.up, self.end = -gravity / self.g, scenario.duration
        moves = np.diff(tracker.positions, axis=0)
        level = moves - np.outer(moves @ self.up, self.up)
        longest = level[np.argmax(np.linalg.norm(level, axis=1))]
        self.line = longest / (np.linalg.norm(longest) or 1.0)

    def along(self, t: Array | float, order: int = 0) -> Array:
        """The support's place along the line, or a derivative of it."""
        return np.asarray(self.path(t, order) @ self.line)

    def height(self, t: Array | float, order: int = 0) -> Array:
        """The support's height, or a derivative of it."""
        return np.asarray(self.path(t, order) @ self.up)

    def speed(self, phase: _Phase, t: Array | float) -> Array:
        """Speed along the line [m/s] in a phase."""
        if phase.sign == 0:
            return self.along(t, 1)
        felt = self.g * (t - phase.start) + self.height(t, 1) - self.height(phase.start, 1)
        return np.asarray(phase.speed - phase.sign * self.mu * felt)

    def place(self, phase: _Phase, t: Array | float) -> Array:
        """Place along the line [m] in a phase."""
        since = t - phase.start
        if phase.sign == 0:
            return np.asarray(phase.place + self.along(t) - self.along(phase.start))
        start = self.height(phase.start) + self.height(phase.start, 1) * since
        felt = self.g * since**2 / 2 + self.height(t) - start
        return np.asarray(phase.place + phase.speed * since - phase.sign * self.mu * felt)

    def excess(self, t: Array | float) -> Array:
        """Acceleration that the support needs of the body beyond what friction gives [m/s^2]."""
        return np.asarray(np.abs(self.along(t, 2)) - self.mu * (self.g + self.height(t, 2)))

    def phases(self) -> list[_Phase]:
        """All phases from the start, at rest on the support, to the end of the scene."""
        sign = self._slip(0.0) if self.excess(0.0) > 0 else 0.0
        found = [_Phase(0.0, sign, 0.0, float(self.along(0.0, 1)))]
        while True:
            last = found[-1]
            times = np.linspace(last.start, self.end, 2 + int((self.end - last.start) / EVENT_GRID))
            over = np.flatnonzero(self._ended(last, times[1:]) > 0)
            if not len(over):
                return found
            time = self._event(last, *times[over[0] : over[0] + 2].tolist())
            sign = self._slip(time) if last.sign == 0 or self.excess(time) > 0 else 0.0
            found.append(_Phase(time, sign, float(self.place(last, time)), float(self.along(time, 1))))

    def _event(self, phase: _Phase, low: float, high: float) -> float:
        """Time at which a phase ends [s]."""
        return float(brentq(lambda t: float(self._ended(phase, t)), low, high, xtol=EVENT_ERROR))

    def _ended(self, phase: _Phase, t: Array | float) -> Array:
        """Positive where a phase has ended: friction no longer holds, or the slip would reverse."""
        if phase.sign == 0:
            return self.excess(t)
        return np.asarray((self.along(t, 1) - self.speed(phase, t)) * phase.sign)

    def _slip(self, t: float) -> float:
        """Sign of a slip that begins at t: against the support's acceleration."""
        return -float(np.sign(self.along(t, 2)))


def _carried(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a body on a prescribed support, at rest on it at the start."""
    ride = _Ride(scenario, body)
    phases = ride.phases()
    index = np.searchsorted([phase.start for phase in phases], times, side="right") - 1
    along, speed = np.zeros(len(times)), np.zeros(len(times))
    for k, phase in enumerate(phases):
        mine = index == k
        along[mine], speed[mine] = ride.place(phase, times[mine]), ride.speed(phase, times[mine])
    turned = Rotation.from_quat(body.orientation, scalar_first=True)
    center = np.array(body.position) + turned.apply(body.center_of_mass)
    rise = ride.height(times) - ride.height(0.0)
    return Motion(
        center + np.outer(along, ride.line) + np.outer(rise, ride.up),
        np.outer(speed, ride.line) + np.outer(ride.height(times, 1), ride.up),
        np.tile(body.orientation, (len(times), 1)),
        np.zeros((len(times), 3)),
    )


def _on_turntable(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a ball that rolls on a plate of constant angular velocity W n: its centre circles at the rate
    k = W b / (1 + b), b = I / (m r^2), 2/7 W for a solid ball.

    v' = k n x v follows from m r n x v' = I w' and from v - r w x n = W n x (p - c), with c on the axis. The
    orientation is integrated.
    """
    _, tracker = support(scenario)
    start = sample(tracker, np.zeros(1))
    gravity, size = np.array(scenario.acting_gravity), _radius(body)
    n = -gravity / np.linalg.norm(gravity)
    rate = float(start.angular_velocity[0] @ n)
    share = body.inertia[0][0] / (body.mass * size**2)
    k = rate * share / (1 + share)
    p, v = np.array(body.position), np.array(body.linear_velocity)
    middle = p - np.cross(v, n) / k
    arm, ahead = p - middle, np.cross(n, p - middle)
    off = middle - start.position[0]
    constant = rate / size * (off - n * (n @ off)) + float(np.array(body.angular_velocity) @ n) * n

    def spin(t: Array | float) -> Array:
        now = np.multiply.outer(np.cos(k * t), arm) + np.multiply.outer(np.sin(k * t), ahead)
        return np.asarray((rate - k) / size * now + constant)

    def turning(t: float, q: Array) -> Array:
        (a, x, y, z), (u, v, w) = q, spin(t)
        rates = (-u * x - v * y - w * z, a * u + v * z - w * y, a * v + w * x - u * z, a * w + u * y - v * x)
        return np.array(rates) / 2

    end = float(times.max(initial=scenario.duration)) + 1 / scenario.frame_rate
    asked = [*times.tolist(), end]
    run = solve_ivp(
        turning, (0.0, end), body.orientation, "DOP853", asked, rtol=INTEGRATED, atol=INTEGRATED / 100
    )
    turned = run.y.T[:-1]
    c, s = np.cos(k * times)[:, None], np.sin(k * times)[:, None]
    return Motion(
        middle + c * arm + s * ahead,
        k * (c * ahead - s * arm),
        turned / np.linalg.norm(turned, axis=1)[:, None],
        spin(times),
    )


def _radius(ball: Body) -> float:
    """Radius of a body of one ball [m]."""
    shape = ball.pieces[0].shape
    assert isinstance(shape, Sphere)
    return shape.radius


LAWS: dict[str, Callable[[Scenario, Body, Array], Motion]] = {
    "torque_free": _free_top,
    "coupling": _coupled,
    "carried": _carried,
    "turntable": _on_turntable,
    "smooth_contact": smooth_contact,
    "rolling_cone": rolling_cone,
    "tipping": tipping,
    "mechanism": mechanism_motion,
    "stick_slip": stick_slip,
}
"""Motion of a body by each law but that of arcs."""
