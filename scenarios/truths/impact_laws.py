"""Outcomes of an impact under the laws that engines choose from.

A row or rack of touching balls without friction is hit by one more; c are the separating speeds of touching
pairs before the impact, c' after it, j >= 0 their impulses:

- `sequential`: the pairs that approach fastest meet first, by Newton's law, until none approaches;
- `Newton`: all at once, c' + e c >= 0 and j (c' + e c) = 0 (Moreau);
- `Poisson`: all are compressed to rest by j, then pushed apart by e j or more (Glocker and Pfeiffer);
- `Hertz`, `springs`: elastic contacts whose force grows with d^(3/2) or d, for small depths d; e = 1 only.

The end of a rod meets a floor with friction (planar, one contact): `Newton` sets c' = -e c with the friction
that stops the slip, or opposes what is left of it; `Poisson` and `Stronge` follow the slip over the normal
impulse (Routh) and expand it by e of the impulse, or e^2 of the work, of compression.
"""

from functools import cache
from itertools import combinations, product

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.scenario import Body, Box, Scenario, Sphere

EQUAL = 1e-9
"""Gap of touching balls [m], and difference of equal speeds [m/s]."""
MOST = 100_000
"""Largest number of impacts one after another."""
STATIONARY = 1e-12
"""Speed below which nothing approaches or slips [m/s]."""


@cache
def outcomes(scenario: Scenario) -> tuple[float, dict[str, Array]]:
    """Time of the impact [s], and law -> velocities of the simulated bodies after it (n, 3) [m/s]; of a rod a
    second row has its rate of rotation times its half length.

    Raises:
        ValueError: these laws do not cover the scene.
    """
    bodies = [body for body in scenario.bodies if body.kind == "simulated"]
    moving = [k for k, body in enumerate(bodies) if any(body.linear_velocity)]
    if "impact" in scenario.tags and "gravity" not in scenario.effects and len(moving) == 1:
        pair = scenario.coefficients[0]
        if len(bodies) > 2 and not pair.friction and all(_is(body, Sphere) for body in bodies):
            return _balls(bodies, moving[0], pair.restitution)
        if len(bodies) == 1 and _is(bodies[0], Box):
            return _rod(bodies[0], pair.restitution, pair.friction)
    raise ValueError("no row or rack of balls, and no rod, that one body hits")


def _is(body: Body, shape: type) -> bool:
    return isinstance(body.pieces[0].shape, shape)


def _balls(bodies: list[Body], first: int, e: float) -> tuple[float, dict[str, Array]]:
    """The row or rack at the moment at which the first ball arrives."""
    place, velocity = (
        np.array([getattr(b, name) for b in bodies]) for name in ("position", "linear_velocity")
    )
    radius = np.array([b.pieces[0].shape.radius for b in bodies])  # type: ignore[union-attr]
    root = np.sqrt([b.mass for b in bodies])
    reach, v = radius + radius[first], velocity[first]
    away = place - place[first]
    along = away @ v / np.linalg.norm(v)
    aside2 = (away**2).sum(axis=1) - along**2
    meets = np.where(
        (along > 0) & (aside2 < reach**2), along - np.sqrt(np.maximum(reach**2 - aside2, 0)), np.inf
    )
    time = float(meets.min() / np.linalg.norm(v))
    place = place.copy()
    place[first] += v * time
    rows = []
    for a, b in combinations(range(len(bodies)), 2):
        gap = place[b] - place[a]
        if np.linalg.norm(gap) - radius[a] - radius[b] < EQUAL:
            row = np.zeros_like(place)
            row[b] = gap / np.linalg.norm(gap)
            row[a] = -row[b]
            rows.append((row / root[:, None]).ravel())
    jacobian, start = np.array(rows), (velocity * root[:, None]).ravel()
    found = {
        "sequential": _sequential(jacobian, start, e),
        "Newton": start + _pushed(jacobian, (1 + e) * start),
        "Poisson": _poisson(jacobian, start, e),
    }
    if e == 1:
        found |= {"Hertz": _elastic(jacobian, start, 1.5), "springs": _elastic(jacobian, start, 1.0)}
    return time, {law: x.reshape(-1, 3) / root[:, None] for law, x in found.items()}


def _pushed(jacobian: Array, v: Array) -> Array:
    """What the least impulses add to `v` so that no pair approaches (LCP as least squares)."""
    if (jacobian @ v).min() > -STATIONARY:
        return np.zeros_like(v)
    return np.asarray(jacobian.T @ nnls(jacobian.T, -v)[0])


def _sequential(jacobian: Array, v: Array, e: float) -> Array:
    """Impacts of the pairs that approach fastest, equally fast ones at once."""
    for _ in range(MOST):
        c = jacobian @ v
        if c.min() > -STATIONARY:
            return v
        pairs = jacobian[c < c.min() + EQUAL]
        v = v + _pushed(pairs, (1 + e) * v)
    raise ValueError("the impacts one after another do not end")


def _poisson(jacobian: Array, v: Array, e: float) -> Array:
    compression = _pushed(jacobian, v)
    v = v + (1 + e) * compression
    return v + _pushed(jacobian, v)


def _elastic(jacobian: Array, start: Array, power: float) -> Array:
    """Contacts of unit stiffness: with e = 1 the scale of time does not matter while depths are small."""
    n = len(start)

    def rate(_: float, state: Array) -> Array:
        depth = np.maximum(0.0, -jacobian @ state[:n])
        return np.concatenate([state[n:], jacobian.T @ depth**power])

    state = np.concatenate([np.zeros(n), start])
    for _ in range(MOST):
        state = solve_ivp(rate, (0.0, 10.0), state, method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
        if (jacobian @ state[:n] >= 0).all() and (jacobian @ state[n:] > -STATIONARY).all():
            return np.asarray(state[n:])
    raise ValueError("the contacts do not end")


def _rod(rod: Body, e: float, mu: float) -> tuple[float, dict[str, Array]]:
    """The lower end of a rod that flies at the plane z = 0 in its own plane."""
    half = np.array(rod.pieces[0].shape.half_extents)  # type: ignore[union-attr]
    turn = Rotation.from_quat(rod.orientation, scalar_first=True)
    corners = turn.apply(np.array(list(product((-1, 1), repeat=3))) * half)
    low = corners[corners[:, 2] < corners[:, 2].min() + EQUAL].mean(axis=0)
    v = np.array(rod.linear_velocity)
    time = float(-(rod.position[2] + low[2]) / v[2])
    side = np.array([v[0], v[1], 0.0]) / np.hypot(v[0], v[1])
    axes = np.array([side, [0.0, 0.0, 1.0]])
    inverse = turn.as_matrix() @ np.linalg.inv(rod.inertia) @ turn.as_matrix().T
    arms = np.cross(low, axes)
    mobility = np.eye(2) / rod.mass + arms @ inverse @ arms.T
    found = {}
    for law, j in {
        "Newton": _newton(mobility, axes @ v, e, mu),
        "Poisson": _routh(mobility, axes @ v, e, mu, of_work=False),
        "Stronge": _routh(mobility, axes @ v, e, mu, of_work=True),
    }.items():
        spin = inverse @ np.cross(low, axes.T @ j)
        found[law] = np.array([v + axes.T @ j / rod.mass, spin * half.max()])
    return time, found


def _newton(mobility: Array, c: Array, e: float, mu: float) -> Array:
    """Impulse (tangential, normal) that reverses the approach and stops the slip, or opposes what is left."""
    stop = np.linalg.solve(mobility, [-c[0], -(1 + e) * c[1]])
    if abs(stop[0]) <= mu * stop[1]:
        return np.asarray(stop)
    for sign in (-1.0, 1.0):
        j = np.array([sign * mu, 1.0])
        j = j * -(1 + e) * c[1] / (mobility[1] @ j)
        if sign * (c + mobility @ j)[0] <= 0:
            return j
    raise ValueError("no friction opposes the slip")


def _routh(mobility: Array, c: Array, e: float, mu: float, of_work: bool) -> Array:
    """Impulse (tangential, normal) at the end of expansion: slip stops, sticks or reverses on the way."""
    j, left = np.zeros(2), 0.0
    while c[1] < -STATIONARY or left > 0:
        slope = np.array([-mu * np.sign(c[0]), 1.0])
        if abs(c[0]) <= STATIONARY:
            held = -mobility[0, 1] / mobility[0, 0]
            slope[0] = np.clip(held, -mu, mu)
        rate = mobility @ slope
        ends = [-c[0] / rate[0]] if abs(c[0]) > STATIONARY and c[0] * rate[0] < 0 else []
        if c[1] < -STATIONARY:
            step = min([-c[1] / rate[1] if rate[1] > 0 else np.inf, *ends])
            left += -(e**2) * (c[1] + rate[1] * step / 2) * step if of_work else e * step
        elif of_work:
            last = (np.sqrt(max(0.0, c[1] ** 2 + 2 * rate[1] * left)) - c[1]) / rate[1]
            step = min([last, *ends])
            left = 0.0 if step == last else left - (c[1] + rate[1] * step / 2) * step
        else:
            step = min([left, *ends])
            left = 0.0 if step == left else left - step
        j, c = j + step * slope, c + step * rate
    return np.asarray(j)
