"""Closed-form final positions of simulated bodies, for any start near the scene's own."""

from math import sqrt

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.scenario import Body, Scenario, Sphere

STILL = 1e-9
"""Bounce speed below which a ball is at rest [m/s]: it would rise by 5e-20 m."""
ROLLING = 2 / 7
"""Effective mass of balls for the tangential impulse, relative to the normal one [1]."""


def final_positions(scenario: Scenario) -> Array | None:
    """Final positions (n, 3) [m] of a body in free flight, a ball dropped on level ground, or two free balls;
    None for other scenes."""
    if scenario.body_joints:
        return None
    simulated = [body for body in scenario.bodies if body.kind == "simulated"]
    others = [body for body in scenario.bodies if body.kind != "simulated"]
    gravity = np.array(scenario.acting_gravity)
    round_ones = all(len(one.pieces) == 1 and isinstance(one.pieces[0].shape, Sphere) for one in simulated)
    if not others and len(simulated) == 1:
        p, v = (np.array(x) for x in (simulated[0].position, simulated[0].linear_velocity))
        return np.asarray((p + v * scenario.duration + gravity * scenario.duration**2 / 2)[None])
    if not others and len(simulated) == 2 and round_ones and not gravity.any() and not _spins(simulated):
        return _two_balls(scenario, simulated[0], simulated[1])
    if [body.name for body in others] == ["floor"] and len(simulated) == 1 and round_ones:
        ball = simulated[0]
        if not _spins(simulated) and ball.linear_velocity == (0.0, 0.0, 0.0):
            e = scenario.pair_coefficients(*sorted(map(scenario.body_index, ("floor", ball.name))))[0]
            height = _bounced(ball.position[2] - _radius(ball), e, -float(gravity[2]), scenario.duration)
            return np.array([[*ball.position[:2], _radius(ball) + height]])
    return None


def _radius(body: Body) -> float:
    shape = body.pieces[0].shape
    assert isinstance(shape, Sphere)
    return shape.radius


def _spins(bodies: list[Body]) -> bool:
    return any(body.angular_velocity != (0.0, 0.0, 0.0) for body in bodies)


def _bounced(height: float, e: float, g: float, duration: float) -> float:
    """Final height [m] of a ball dropped from rest above the ground at 0."""
    fall = sqrt(2 * height / g)
    if duration <= fall:
        return height - g * duration**2 / 2
    left, speed = duration - fall, e * g * fall
    while speed > STILL:
        if left <= 2 * speed / g:
            return speed * left - g * left**2 / 2
        left, speed = left - 2 * speed / g, e * speed
    return 0.0


def _two_balls(scenario: Scenario, a: Body, b: Body) -> Array:
    """Final positions of two free balls by Newton's and Coulomb's laws; B relative to A, normal from A to
    B."""
    p = np.array([a.position, b.position])
    v = np.array([a.linear_velocity, b.linear_velocity])
    apart, pace, reach = p[1] - p[0], v[1] - v[0], _radius(a) + _radius(b)
    square, half, rest = pace @ pace, apart @ pace, apart @ apart - reach**2
    met = half < 0 <= half**2 - square * rest
    # The smaller root, without cancellation.
    time = rest / (sqrt(half**2 - square * rest) - half) if met else scenario.duration
    if time >= scenario.duration:
        return np.asarray(p + v * scenario.duration)
    e, mu = scenario.pair_coefficients(0, 1)
    n = (apart + pace * time) / reach
    approach = -float(n @ pace)
    slip = pace + approach * n
    speed = float(np.linalg.norm(slip))
    mass = 1 / (1 / a.mass + 1 / b.mass)
    j_n = (1 + e) * mass * approach
    j_t = min(mu * j_n, ROLLING * mass * speed)
    impulse = j_n * n - (j_t / speed * slip if speed > 0 else 0.0)
    after = v + np.array([-impulse / a.mass, impulse / b.mass])
    return np.asarray(p + v * time + after * (scenario.duration - time))
