"""A body that a spring holds on a moving surface: it sticks by static, and slips back by sliding friction.

With x the travel of the spring, m what moves with it and N the weight of the body on the surface, x follows
the surface at the speed V until k x = mu_s N. Then it oscillates about mu_k N / k with w = sqrt(k / m),

    x = mu_k N / k + A cos(w t) + V / w sin(w t),   A = (mu_s - mu_k) N / k,

until its speed is V again, at w t = 2 pi - 2 atan(A w / V), and sticks. (Den Hartog (1956), *Mechanical
Vibrations*, section 7.)
"""

from math import atan, hypot, pi, sqrt

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import Report
from touchstone.scenarios.scenario import ORIGIN, Body, BodyJoint, Scenario
from touchstone.scenarios.truths.body_motion import Motion


def stick_slip(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of `body`, which sticks from the start, at `times` [s]."""
    (joint,), surface = _springs(scenario), _surface(scenario)
    axis = np.array(joint.axis)
    law = scenario.friction_law(*sorted(map(scenario.body_index, (surface.name, body.name))))
    mu = scenario.pair_coefficients(*sorted(map(scenario.body_index, (surface.name, body.name))))[1]
    speed = float(np.dot(surface.pieces[0].surface_velocity, axis))
    load = body.mass * hypot(*scenario.acting_gravity)
    w = sqrt(joint.stiffness / sum(one.mass for one in scenario.bodies if one.kind == "simulated"))
    middle, most = mu * load / joint.stiffness, max(law.static, mu) * load / joint.stiffness
    swing = most - middle
    slips = (2 * pi - 2 * atan(swing * w / speed)) / w
    back = 2 * middle - most
    # it sticks again as far below the middle as it left above
    period = slips + (most - back) / speed
    t = np.where(times < most / speed, times - most / speed, np.mod(times - most / speed, period))
    sticks = (t < 0) | (t >= slips)
    place = np.where(t < 0, most + speed * t, back + speed * (t - slips))
    x = np.where(sticks, place, middle + swing * np.cos(w * t) + speed / w * np.sin(w * t))
    v = np.where(sticks, speed, speed * np.cos(w * t) - swing * w * np.sin(w * t))
    count = len(times)
    return Motion(
        np.array(body.position) + x[:, None] * axis,
        v[:, None] * axis,
        np.tile(body.orientation, (count, 1)),
        np.zeros((count, 3)),
    )


def _springs(scenario: Scenario) -> list[BodyJoint]:
    return [joint for joint in scenario.body_joints if joint.stiffness > 0]


def _surface(scenario: Scenario) -> Body:
    return next(body for body in scenario.bodies if body.kind == "fixed" and body.pieces)


def check_stick_slip(scenario: Scenario, body: Body, path: str, report: Report) -> None:
    """Check for what the closed form takes for granted: a slider with a spring along a surface that moves
    with the body at the start, and friction."""
    springs = _springs(scenario)
    moving = [one for one in scenario.bodies if any(p.surface_velocity != ORIGIN for p in one.pieces)]
    if len(springs) != 1 or springs[0].type != "slider" or springs[0].target != 0:
        report(path, f"found {len(springs)} joints with springs, expected one slider that starts at rest")
    elif len(moving) != 1 or moving[0].pieces[0].surface_velocity != body.linear_velocity:
        report(path, "expected one moving surface, and the body to move with it at the start")
    elif not np.dot(springs[0].axis, body.linear_velocity) > 0:
        report(path, "expected the surface to move along the axis of the spring")
    elif not any(scenario.acting_gravity):
        report(path, "expected gravity, which presses the body on the surface")
