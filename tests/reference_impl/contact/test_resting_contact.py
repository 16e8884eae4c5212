"""Contacts that hold one point after the other (`impulses=sequential`), beside Eqs. 9 and 10 by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.core.conventions import IMPULSES_SEQUENTIAL, IMPULSES_TOGETHER

G, MU, SPEED = 9.81, 0.1, 0.29
HALF = np.array((0.16, 0.16, 0.1))
INERTIA = (HALF @ HALF - HALF**2) / 3
"""Of a box of 1 kg: a third of the other two squares [kg m^2]."""
CORNERS = [HALF * (x, y, -1) for x in (-1, 1) for y in (-1, 1)]


def sliding(lab: SimpleNamespace, dt: float, spin=(0.0, 0.0, 0.0)):
    """A box of 1 kg that slides along x on the ground, under `paper`."""
    box = lab.block(
        "box",
        tuple(HALF.tolist()),
        (0.0, 0.0, float(HALF[2])),
        linear_velocity=(SPEED, 0.0, 0.0),
        angular_velocity=spin,
    )
    return lab.build(lab.scene(box, lab.ground(), mu=MU), "paper", dt)


def held_in_turn(v, w, dt: float):
    """Velocities of that box after a step: gravity, then the corner that approaches fastest, again and again,
    with j of Eq. 9 at e = 0 and mu j against its slip at that moment (Eq. 10), down to 1e-4 m/s."""
    v, w = np.array(v) - (0.0, 0.0, G * dt), np.array(w)
    while True:
        r = min(CORNERS, key=lambda corner: (v + np.cross(w, corner))[2])
        meeting = v + np.cross(w, r)
        if meeting[2] >= -1e-4:
            return v, w
        slip = meeting * (1, 1, 0)
        j = -meeting[2] / (1 + r[1] ** 2 / INERTIA[0] + r[0] ** 2 / INERTIA[1])
        p = j * np.array((0, 0, 1)) - MU * j * slip / np.linalg.norm(slip)
        v, w = v + p, w + np.cross(r, p) / INERTIA


def test_corners_hold_one_after_the_other(lab: SimpleNamespace) -> None:
    """Leave a step of `paper` with the velocities of Eqs. 9 and 10 at one corner after the other."""
    # slower than contacts hold to, and enough that rounding does not choose among the corners
    spin = (1e-4, 3e-4, 0.0)
    world = sliding(lab, 1 / 60, spin)
    lab.play(world, 1)
    v, w = held_in_turn((SPEED, 0.0, 0.0), spin, 1 / 60)
    np.testing.assert_allclose(world.bodies[0]["velocity"], v, atol=1e-8)
    np.testing.assert_allclose(world.bodies[0]["omega"], w, atol=1e-7)


def braked(lab: SimpleNamespace, rate: int, way: int) -> tuple[float, float]:
    """Of the steps in which the box should lose three quarters of its speed: the share of mu m g that brakes
    it, and that of its weight which corners bear."""
    world = sliding(lab, 1 / rate)
    world.state["impulses"] = way
    steps = round(0.75 * SPEED / (MU * G) * rate)

    def borne(world) -> float:
        rows = world.contacts[: int(world.state[0]["contact_count"])]
        return abs(float(rows["impulse"][:, 2].sum()))

    weight = sum(lab.play(world, steps, borne))
    lost = SPEED - float(world.bodies["velocity"][0, 0])
    return lost / (MU * G * steps / rate), weight / (G * steps / rate)


def test_corners_in_turn_brake_less(lab: SimpleNamespace) -> None:
    """Bear the weight, but brake by less than mu of it: each impulse turns the box, the next corner slips
    aside, and Eq. 10 follows it. The loss is of second order in g h / v; held together there is none."""
    shares = {}
    for rate in (60, 240):
        shares[rate], weight = braked(lab, rate, IMPULSES_SEQUENTIAL)
        assert weight == pytest.approx(1, abs=1e-4)
    assert 0.01 < 1 - shares[60] < 0.05
    assert 1 - shares[240] == pytest.approx((1 - shares[60]) / 16, rel=0.5)
    assert braked(lab, 60, IMPULSES_TOGETHER) == pytest.approx((1, 1), abs=1e-9)
