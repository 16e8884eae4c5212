"""Contacts that no finite force lets slide on (Painleve)."""

from dataclasses import replace
from math import atan2, cos, hypot
from types import SimpleNamespace

import pytest
from scipy.integrate import solve_ivp

from touchstone.scenarios.catalogue import catalogue

GRAVITY = 9.81


@pytest.mark.parametrize(("mu", "speed"), [(1.34, 20.0), (1.4, 3.0), (1.5, 20.0), (2.0, 1.0), (4.0, 5.0)])
def test_a_rod_jams_at_once(lab: SimpleNamespace, mu: float, speed: float) -> None:
    """Turn about the tip, as after an impact that stops it, however large friction is beyond mu = 4/3."""
    scene = catalogue()["painleve_mu15"]
    rod = replace(scene.bodies[1], linear_velocity=(-speed, 0.0, 0.0))
    coefficients = tuple(replace(pair, friction=mu) for pair in scene.coefficients)
    world = lab.build(replace(scene, bodies=(scene.bodies[0], rod), coefficients=coefficients))
    lab.play(world, 2)
    x, _, z = rod.position
    length, moment = hypot(x, z), rod.inertia[1][1] + x * x + z * z
    pendulum = solve_ivp(
        lambda _, state: (state[1], -GRAVITY * length * cos(state[0]) / moment),
        (0.0, scene.duration),
        (atan2(z, x), speed * z / moment),
        rtol=1e-12,
    )
    # the tip is round: it rolls over a thousandth of the rod's half length
    assert -world.bodies[1]["omega"][1] == pytest.approx(pendulum.y[1, -1], rel=1e-5)
