"""Eqs. 7 to 10 by hand, and what no impact may do."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference_impl.conventions import FRICTION_COULOMB, FRICTION_PAPER
from reference_impl.impulse import contact_impulse, resting_restitution

UP = np.array([0.0, 0.0, 1.0])
NUMBER = st.floats(-10, 10)
DIRECTION = st.tuples(NUMBER, NUMBER, NUMBER).filter(lambda v: np.linalg.norm(v) > 0.1)


def impulse(v, n=UP, mobility=None, e=0.0, mu=0.0, friction=FRICTION_COULOMB) -> np.ndarray:
    """Impulse on B; the mobility is that of 1 kg unless given."""
    out = np.zeros(3)
    m = np.eye(3) if mobility is None else np.array(mobility, dtype=float)
    contact_impulse(np.array(v, dtype=float), np.array(n, dtype=float), m, e, mu, friction, out)
    return out


def mobility_of(*bodies) -> np.ndarray:
    """Sum of 1/m + (e_i x r) . I^-1 (e_j x r) over (mass, inertia, r): the definition."""
    total = np.zeros((3, 3))
    for mass, inertia, r in bodies:
        cross = np.cross(np.eye(3), r)
        total += np.eye(3) / mass + cross @ np.linalg.inv(inertia) @ cross.T
    return total


def central(mass_a: float, mass_b: float, radius: float, n: np.ndarray) -> np.ndarray:
    """Mobility of two solid spheres of one radius that meet along n."""
    return mobility_of(
        (mass_a, 0.4 * mass_a * radius**2 * np.eye(3), radius * n),
        (mass_b, 0.4 * mass_b * radius**2 * np.eye(3), -radius * n),
    )


@pytest.mark.parametrize("friction", [FRICTION_PAPER, FRICTION_COULOMB])
@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_restitution_reverses_the_approach(e: float, friction: int) -> None:
    """Give 1 kg on fixed ground the impulse (1 + e) v."""
    np.testing.assert_allclose(impulse((0, 0, -2), e=e, mu=0.5, friction=friction), (0, 0, 2 * (1 + e)))


def test_effective_mass_has_the_inertia_in_it() -> None:
    """Divide by 1/m + r^2/I for a blow off the centre: 1 + 0.5^2 / 0.1 = 3.5."""
    m = mobility_of((1.0, 0.1 * np.eye(3), np.array([0.5, 0, 0])))
    assert m[2, 2] == pytest.approx(3.5)
    for friction in (FRICTION_PAPER, FRICTION_COULOMB):
        p = impulse((0, 0, -7), mobility=m, e=0.5, friction=friction)
        np.testing.assert_allclose(p, (0, 0, 3.0), atol=1e-14)


def test_sticking_stops_the_sliding() -> None:
    """Stop slow sliding whole: 0.3 m/s against 2 m/s at mu = 0.2."""
    np.testing.assert_allclose(impulse((0.3, 0, -2), mu=0.2), (-0.3, 0, 2), atol=1e-15)


def test_sliding_feels_mu_j() -> None:
    """Brake fast sliding by mu j against it."""
    np.testing.assert_allclose(impulse((3, 4, -2), mu=0.2), (-0.4 * 0.6, -0.4 * 0.8, 2), atol=1e-15)


def test_the_papers_friction_reverses_slow_sliding() -> None:
    """Always take mu j: 0.4 against a sliding of 0.3, none without a direction."""
    np.testing.assert_allclose(impulse((0.3, 0, -2), mu=0.2, friction=FRICTION_PAPER), (-0.4, 0, 2))
    np.testing.assert_allclose(impulse((1e-10, 0, -2), mu=0.2, friction=FRICTION_PAPER), (0, 0, 2))


def test_a_ball_that_lands_sliding_keeps_two_sevenths_of_the_slip() -> None:
    """Stop a sphere's slip by 2/7 of it: 1/M across is 2 m / 7."""
    m = mobility_of((1.0, 0.4 * 0.05**2 * np.eye(3), np.array([0, 0, -0.05])))
    np.testing.assert_allclose(impulse((0.7, 0, -1), mobility=m, mu=0.5), (-0.2, 0, 1), atol=1e-14)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    v=DIRECTION,
    n=DIRECTION,
    masses=st.tuples(st.floats(0.01, 10), st.floats(0.01, 10)),
    e=st.floats(0, 1),
    mu=st.floats(0, 2),
)
def test_central_impacts_keep_the_laws(v, n, masses, e, mu) -> None:
    """Keep Newton's law and the cone and never add energy when spheres meet."""
    n, v = np.array(n) / np.linalg.norm(n), np.array(v)
    v = v - 2 * max(0.0, v @ n) * n - 0.01 * n
    m = central(*masses, 0.1, n)
    p = impulse(v, n, m, e, mu)
    after, j = v + m @ p, p @ n
    size = np.linalg.norm(v)
    assert after @ n == pytest.approx(-e * (v @ n), abs=1e-12 * size)
    # the direction of a slip of SLIP_MIN is good to 1e-16 / 1e-9
    assert np.linalg.norm(p - j * n) <= mu * j + 1e-7 * j
    # energy: p . (v + after) / 2
    assert p @ (v + after) <= 1e-12 * np.linalg.norm(p) * size
    # friction never turns the sliding round
    slip, left = v - (v @ n) * n, after - (after @ n) * n
    assert slip @ left >= -1e-12 * size * size


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    v=DIRECTION,
    n=DIRECTION,
    r=DIRECTION,
    moments=st.tuples(*[st.floats(0.5, 1.0)] * 3),
    e=st.floats(0, 1),
    mu=st.floats(0, 0.3),
    friction=st.sampled_from([FRICTION_PAPER, FRICTION_COULOMB]),
)
def test_eccentric_impacts_stay_in_the_cone(v, n, r, moments, e, mu, friction) -> None:
    """Keep the cone off the centre too, and Newton's law where the friction is Coulomb's."""
    n, v, r = np.array(n) / np.linalg.norm(n), np.array(v), np.array(r) / 10
    v = v - 2 * max(0.0, v @ n) * n - 0.01 * n
    m = mobility_of((1.0, np.diag(moments), r))
    p = impulse(v, n, m, e, mu, friction)
    j = p @ n
    assert j > 0
    # the direction of a slip of SLIP_MIN is good to 1e-16 / 1e-9
    assert np.linalg.norm(p - j * n) <= mu * j + 1e-7 * j
    slip = v - (v @ n) * n
    jams = n @ m @ (n - mu * slip / max(np.linalg.norm(slip), 1e-9)) <= 1e-3
    if friction == FRICTION_COULOMB and not jams:
        assert (v + m @ p) @ n == pytest.approx(-e * (v @ n), abs=1e-9 * np.linalg.norm(v))


def test_restitution_fades_towards_rest() -> None:
    """Fade linearly from e at 2 v_rest to 0 at v_rest."""
    approaches = [0.0, 1.0, 1.5, 2.0, 5.0]
    faded = [resting_restitution(0.8, approach, 1.0) for approach in approaches]
    np.testing.assert_allclose(faded, [0, 0, 0.4, 0.8, 0.8])
    assert resting_restitution(0.8, 0.1, 0.0) == 0.8


def test_balls_keep_their_momentum(lab: SimpleNamespace) -> None:
    """Exchange velocities in a central hit of equal balls at e = 1, and keep the momentum of unequal ones."""
    for mass, e in ((1.0, 1.0), (3.0, 0.4)):
        one = lab.ball("one", (0.0, 0.0, 0.0), linear_velocity=(2.0, 0.0, 0.0))
        two = lab.ball("two", (0.2, 0.0, 0.0), mass=mass)
        world = lab.build(lab.scene(one, two, e=e, mu=0.3, gravity=(0.0, 0.0, 0.0)))
        lab.play(world, 30)
        v = world.bodies["velocity"]
        assert v[0, 0] + mass * v[1, 0] == pytest.approx(2.0, rel=1e-14)
        assert v[1, 0] - v[0, 0] == pytest.approx(2 * e, rel=1e-13)
        np.testing.assert_allclose(v[:, 1:], 0, atol=1e-15)


def test_a_cradle_passes_the_blow_on(lab: SimpleNamespace) -> None:
    """Send off the last of three touching balls: impacts are resolved one at a time."""
    balls = [lab.ball(f"ball_{k}", (0.1 * k, 0.0, 0.0)) for k in range(3)]
    striker = lab.ball("striker", (-0.2, 0.0, 0.0), linear_velocity=(1.0, 0.0, 0.0))
    world = lab.build(lab.scene(*balls, striker, e=1.0, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 20)
    np.testing.assert_allclose(world.bodies["velocity"][:, 0], (0, 0, 1, 0), atol=1e-12)


def test_a_cap_that_is_hit_is_told(lab: SimpleNamespace) -> None:
    """Count giving up when 200 impulses do not suffice: a grain between a wall and a ball a million times
    heavier is hit about pi / 4 sqrt(1e6) times before the ball turns round."""
    grain = lab.ball("grain", (0.0, 0.0, 0.0), mass=1e-6)
    heavy = lab.ball("heavy", (0.1, 0.0, 0.0), linear_velocity=(-1.0, 0.0, 0.0))
    wall = lab.block("wall", (1.0, 1.0, 1.0), (-1.05, 0.0, 0.0), kind="fixed")
    world = lab.build(lab.scene(grain, heavy, wall, e=1.0, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 1)
    counted = lab.counters(world)
    assert counted["impulses"] >= 200
    assert counted["gave_up"] > 0


def test_the_log_balances_the_momentum(lab: SimpleNamespace) -> None:
    """Log for a ball at rest what gravity gave it, also in frames that another ball's impact cuts in two."""
    rest, fall = lab.ball("rest", (0.0, 0.0, 0.05)), lab.ball("fall", (1.0, 0.0, 0.3))
    world = lab.build(lab.scene(rest, fall, lab.ground(), e=0.5, mu=0.3))
    cut = 0
    for _ in range(60):
        lab.play(world, 1)
        rows = world.contacts[: int(world.state[0]["contact_count"])]
        told = rows[rows["body_a"] == 0]
        cut += len(told) > 1
        # the ground is B: its share is the opposite
        assert -told["impulse"][:, 2].sum() == pytest.approx(9.81 / 60, rel=1e-9)
        np.testing.assert_allclose(told["velocity_a_after"], 0, atol=1e-12)
    assert cut >= 3


def test_a_cut_hold_pushes_the_hand_once(lab: SimpleNamespace) -> None:
    """Give a driven body the recoil of a held contact for the time it acted, however the frame is cut."""
    recoils = []
    for height in (5.0, 0.051):
        shelf = lab.block("shelf", (0.2, 0.2, 0.02), (0.0, 0.0, -0.02), kind="driven")
        shelf = dataclasses.replace(shelf, mass=0.4, position=(0.0, 0.0, 0.0), pieces=shelf.pieces)
        tracker = lab.still("shelf", (0.0, 0.0, -0.02))
        rest, fall = lab.ball("rest", (0.0, 0.0, 0.05)), lab.ball("fall", (2.0, 0.0, height))
        floor = lab.block("floor", (0.5, 0.5, 0.5), (2.0, 0.0, -0.5), kind="fixed")
        fast = dataclasses.replace(fall, linear_velocity=(0.0, 0.0, -0.12))
        world = lab.build(lab.scene(shelf, rest, fast, floor, trackers=(tracker,)))
        lab.play(world, 1)
        recoils.append(float(world.drivers[0]["velocity"][2]))
    assert recoils[0] < -0.05
    # cutting the frame in two changes how the shares of it are spread, not their sum
    assert recoils[1] == pytest.approx(recoils[0], rel=1e-9)
