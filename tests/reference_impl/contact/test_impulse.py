"""Eqs. 7 to 10 by hand, and what no impact may do."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.contact.impulse import contact_impulse, resting_restitution
from touchstone.reference_impl.core.conventions import (
    FRICTION_COULOMB,
    FRICTION_PAPER,
    RESTITUTION_GUARDED,
    RESTITUTION_NEWTON,
)

UP = np.array([0.0, 0.0, 1.0])
NUMBER = st.floats(-10, 10)
DIRECTION = st.tuples(NUMBER, NUMBER, NUMBER).filter(lambda v: np.linalg.norm(v) > 0.1)


def impulse(
    v, n=UP, mobility=None, e=0.0, mu=0.0, friction=FRICTION_COULOMB, restitution=RESTITUTION_NEWTON
) -> np.ndarray:
    """Impulse on B; the mobility is that of 1 kg unless given."""
    out = np.zeros(3)
    m = np.eye(3) if mobility is None else np.array(mobility, dtype=float)
    contact_impulse(np.array(v, dtype=float), np.array(n, dtype=float), m, e, mu, friction, restitution, out)
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


MASS = st.floats(-3, 3).map(lambda power: 10.0**power)


@st.composite
def bodies(draw) -> tuple:
    """(mass, inertia, r) of a body of about 10 cm whose contact is up to 20 cm off its centre."""
    mass = draw(MASS)
    moments = np.array(draw(st.tuples(*[st.floats(0.5, 1.0)] * 3))) * mass * 0.1**2
    turn = Rotation.from_rotvec(draw(DIRECTION)).as_matrix()
    return mass, turn @ np.diag(moments) @ turn.T, np.array(draw(DIRECTION)) / 100


@st.composite
def approaches(draw) -> tuple[np.ndarray, np.ndarray]:
    """A unit normal, and a velocity that approaches along it, from head on to grazing."""
    n, v = np.array(draw(DIRECTION)), np.array(draw(DIRECTION))
    n = n / np.linalg.norm(n)
    slip = (v - (v @ n) * n) * 10.0 ** draw(st.floats(-12, 1))
    return n, slip - draw(st.floats(0.01, 10)) * n


def energy_change(v: np.ndarray, m: np.ndarray, p: np.ndarray) -> float:
    """Of what meets with v and mobility m, by the impulse p [J]."""
    return float(p @ (v + m @ p / 2))


ROUNDING = 1e-12
"""Of the laws, relative: a solved 3 x 3 matrix of condition up to some thousands."""
EVERY = {"e": st.floats(0, 1), "mu": st.floats(0, 3)}


@settings(max_examples=500, deadline=None, derandomize=True)
@given(one=bodies(), two=bodies(), meets=approaches(), **EVERY)
def test_guarded_impacts_keep_every_law(one, two, meets, e, mu) -> None:
    """Part at e v unless the guard acted, stay in the cone, never gain energy, never leave an approach."""
    (n, v), m = meets, mobility_of(one, two)
    out = np.zeros(3)
    acted = contact_impulse(v, n, m, e, mu, FRICTION_COULOMB, RESTITUTION_GUARDED, out)
    j, after, size = out @ n, (v + m @ out) @ n, np.linalg.norm(v)
    assert np.linalg.norm(out - j * n) <= mu * j + ROUNDING * j
    assert energy_change(v, m, out) <= ROUNDING * abs(out @ v)
    assert after >= -ROUNDING * size
    asked = -e * (v @ n)
    assert after <= asked + ROUNDING * size if acted else after == pytest.approx(asked, abs=ROUNDING * size)


@settings(max_examples=500, deadline=None, derandomize=True)
@given(one=bodies(), two=bodies(), meets=approaches(), **EVERY)
def test_newtons_law_holds_with_friction(one, two, meets, e, mu) -> None:
    """Part at e v within the cone for every friction, also where friction alone would jam (Painleve)."""
    (n, v), m = meets, mobility_of(one, two)
    p = impulse(v, n, m, e, mu)
    assert np.linalg.norm(p - (p @ n) * n) <= mu * (p @ n) + ROUNDING * (p @ n)
    assert (v + m @ p) @ n == pytest.approx(-e * (v @ n), abs=ROUNDING * np.linalg.norm(v))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(one=bodies(), two=bodies(), meets=approaches(), **EVERY)
def test_the_papers_impulse_is_guarded_too(one, two, meets, e, mu) -> None:
    """Keep Eq. 10's cone, and never gain energy where the guard is asked for."""
    (n, v), m = meets, mobility_of(one, two)
    p = impulse(v, n, m, e, mu, FRICTION_PAPER, RESTITUTION_GUARDED)
    assert np.linalg.norm(p - (p @ n) * n) <= mu * (p @ n) + ROUNDING * (p @ n)
    assert energy_change(v, m, p) <= ROUNDING * abs(p @ v)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(masses=st.tuples(MASS, MASS), meets=approaches(), **EVERY)
def test_friction_between_spheres_turns_nothing_round(masses, meets, e, mu) -> None:
    """Slow the sliding of spheres at most to rest, against its own direction, and never need the guard."""
    n, v = meets
    m, p = central(*masses, 0.1, n), np.zeros(3)
    assert not contact_impulse(v, n, m, e, mu, FRICTION_COULOMB, RESTITUTION_GUARDED, p)
    after = v + m @ p
    slip, left = v - (v @ n) * n, after - (after @ n) * n
    size = np.linalg.norm(v) ** 2
    assert slip @ left >= -ROUNDING * size
    assert np.linalg.norm(np.cross(slip, left)) <= ROUNDING * size


def rod(cosine_squared: float) -> np.ndarray:
    """Mobility of the end of a slender rod of 1 kg that slopes down along +x, hit by the ground (normal +z).

    The end is half a length L off the centre and I = m L^2 / 12: M = (1 + 3 u u^T) / m, u across the rod.
    """
    u = np.array([-np.sqrt(1 - cosine_squared), 0.0, np.sqrt(cosine_squared)])
    return np.eye(3) + 3 * np.outer(u, u)


def test_the_papers_friction_gains_on_a_rod() -> None:
    """Gain 11 % of m v^2 / 2 in one hit at e = mu = 0.3, in closed form; stick instead, and lose."""
    m, v, e, mu = rod(0.1), np.array([0.1, 0.0, -1.0]), 0.3, 0.3
    kinetic = v @ v / 2
    # M_nn = 1.3 and j = 1.3 / 1.3; friction points along -x, M_nt = -3 sqrt(0.09), M_tt = 3.7
    expected = -(1 + 0.1 * mu) + (1.3 + mu**2 * 3.7 + 2 * mu * 0.9) / 2
    p = impulse(v, UP, m, e, mu, FRICTION_PAPER)
    assert energy_change(v, m, p) == pytest.approx(expected, rel=1e-12)
    assert expected / kinetic == pytest.approx(0.11, abs=0.005)
    guarded = impulse(v, UP, m, e, mu, FRICTION_PAPER, RESTITUTION_GUARDED)
    assert energy_change(v, m, guarded) == pytest.approx(0.0, abs=1e-14)
    assert energy_change(v, m, impulse(v, UP, m, e, mu)) < 0


def test_a_rods_edge_is_hit_once_in_paper(lab: SimpleNamespace) -> None:
    """Gain those 11 % in a step of `paper`, in closed form: one impact at the middle of the edge that lands,
    mu j against the sliding there was."""
    half, e, mu = (0.25, 0.02, 0.001), 0.3, 0.3
    slope, velocity = np.arccos(np.sqrt(0.1)), np.array([-0.1, 0.0, -1.0])
    turn = Rotation.from_euler("y", slope)
    orientation = tuple(turn.as_quat(scalar_first=True).tolist())
    r = turn.apply((half[0], 0.0, -half[2]))
    place = (0.0, 0.0, float(0.01 - r[2]))
    rod = lab.block("rod", half, place, orientation=orientation, linear_velocity=tuple(velocity.tolist()))
    world = lab.build(lab.scene(rod, lab.ground(), e=e, mu=mu, gravity=(0.0, 0.0, 0.0)), "paper")
    lab.play(world, 1)
    assert int(world.state[0]["contact_count"]) == 1
    reported = world.contacts[0]
    # the rod is A, and its impulse the opposite
    np.testing.assert_allclose(-reported["impulse"] / -reported["impulse"][2], (mu, 0.0, 1.0), atol=1e-12)
    # of 1 kg
    inertia = (half[0] ** 2 + half[2] ** 2) / 3
    nn, nt, tt = 1 + r[0] ** 2 / inertia, -r[0] * r[2] / inertia, 1 + r[2] ** 2 / inertia
    j = (1 + e) / nn
    gain = -j * (1 + 0.1 * mu) + j**2 * (nn + 2 * mu * nt + mu**2 * tt) / 2
    body = world.bodies[0]
    spin = body["rotation"].T @ body["omega"]
    left = (body["velocity"] @ body["velocity"] + spin @ body["inertia"] @ spin) / 2
    kinetic = velocity @ velocity / 2
    # where impacts are found, 5e-7 m over the rod's length
    assert left - kinetic == pytest.approx(gain, rel=1e-5)
    assert gain / kinetic == pytest.approx(0.11, abs=0.005)


def test_sticking_at_e_1_gains_56_percent() -> None:
    """Gain 9/16 where a rod at 45 degrees sticks; guarded, part at the e that keeps all the energy."""
    m, v = rod(0.5), np.array([0.6, 0.0, -1.0])
    # the least energy with which its end can move with v
    kinetic = v @ np.linalg.solve(m, v) / 2
    p = impulse(v, UP, m, e=1.0, mu=2.0)
    np.testing.assert_allclose(v + m @ p, (0, 0, 1), atol=1e-14)
    assert energy_change(v, m, p) / kinetic == pytest.approx(9 / 16, rel=1e-12)
    guarded = impulse(v, UP, m, 1.0, 2.0, restitution=RESTITUTION_GUARDED)
    assert energy_change(v, m, guarded) == pytest.approx(0.0, abs=1e-15)
    # e^2 (n.v)^2 n.M^-1 n = v.M^-1 v: e = sqrt(0.4 / 0.625)
    np.testing.assert_allclose(v + m @ guarded, (0, 0, 0.8), atol=1e-14)


def test_a_jammed_rod_comes_off() -> None:
    """Part at e v where friction at the cone's edge would drive a steep rod into the ground (Painleve)."""
    m, v, mu = rod(0.2), np.array([1.0, 0.0, -1.0]), 2.0
    v[0] = -1.0  # against the slope: M_nt - mu pulls the end down
    t = np.array([-1.0, 0.0, 0.0])
    assert UP @ m @ (UP - mu * t) < 0
    for restitution in (RESTITUTION_NEWTON, RESTITUTION_GUARDED):
        p = impulse(v, UP, m, 0.5, mu, restitution=restitution)
        assert (v + m @ p)[2] == pytest.approx(0.5, rel=1e-13)
        assert np.hypot(*p[:2]) <= mu * p[2]
        assert energy_change(v, m, p) < 0


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


@pytest.mark.parametrize("seed", range(4))
def test_boxes_that_meet_gain_no_energy(lab: SimpleNamespace, seed: int) -> None:
    """Keep both momenta of two tumbling boxes to rounding, and never gain energy at e = 1."""
    rng = np.random.default_rng(seed)
    spins = rng.normal(0, 4, (2, 3))
    # the first pair meets face on face while both slide: a patch
    spins *= seed > 0
    one, two = (
        lab.block(name, (0.1,) * 3, (x, 0.0, 0.0), linear_velocity=velocity, angular_velocity=spin)
        for name, x, velocity, spin in zip(("one", "two"), (0.0, 0.4), ((2.0, 1.0, 0.5), (-1.0, 0, 0)), spins)
    )
    world = lab.build(lab.scene(one, two, e=1.0, mu=1.0, gravity=(0.0, 0.0, 0.0)))
    seen = [lab.motion(world)]
    seen += lab.play(world, 20, watch=lab.motion)
    linear, angular, energy = map(np.array, zip(*seen))
    assert abs(world.bodies["velocity"][0, 0] - 2.0) > 0.1
    np.testing.assert_allclose(linear - linear[0], 0, atol=1e-14)
    np.testing.assert_allclose(angular - angular[0], 0, atol=1e-14)
    assert np.diff(energy).max() <= 1e-12 * energy[0]


def test_a_cradle_passes_the_blow_on(lab: SimpleNamespace) -> None:
    """Send off the last of three touching balls: impacts are resolved one at a time."""
    balls = [lab.ball(f"ball_{k}", (0.1 * k, 0.0, 0.0)) for k in range(3)]
    striker = lab.ball("striker", (-0.2, 0.0, 0.0), linear_velocity=(1.0, 0.0, 0.0))
    world = lab.build(lab.scene(*balls, striker, e=1.0, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 20)
    np.testing.assert_allclose(world.bodies["velocity"][:, 0], (0, 0, 1, 0), atol=1e-12)


def grain(lab: SimpleNamespace, *changes: str):
    """A frame of a grain between a wall and a ball a million times heavier: one after the other, about
    pi / 4 sqrt(1e6) impacts turn the ball round."""
    small = lab.ball("grain", (0.0, 0.0, 0.0), mass=1e-6)
    heavy = lab.ball("heavy", (0.1, 0.0, 0.0), linear_velocity=(-1.0, 0.0, 0.0))
    wall = lab.block("wall", (1.0, 1.0, 1.0), (-1.05, 0.0, 0.0), kind="fixed")
    scene = lab.scene(small, heavy, wall, e=1.0, gravity=(0.0, 0.0, 0.0))
    world = lab.build(scene, "balanced", 1 / 60, *changes)
    lab.play(world, 1)
    return world


def test_a_cap_that_is_hit_is_counted(lab: SimpleNamespace) -> None:
    """Count giving up when 200 impulses one after the other do not suffice."""
    counted = lab.counters(grain(lab, "impulses=sequential"))
    assert counted["impulses"] >= 200
    assert counted["gave_up"] > 0


def test_contacts_act_together_where_impacts_go_to_and_fro(lab: SimpleNamespace) -> None:
    """Turn the ball round with its whole energy after 64 rounds, of which each moves the grain alone."""
    world = grain(lab)
    counted = lab.counters(world)
    assert counted["gave_up"] == 0
    assert counted["impulses"] <= 66
    assert world.bodies[1]["velocity"][0] == pytest.approx(1.0, abs=1e-9)
    assert world.bodies["velocity"][0] @ world.bodies["velocity"][0] * 1e-6 < 1e-9


def test_the_log_balances_the_momentum(lab: SimpleNamespace) -> None:
    """Log for a ball at rest what gravity gave it, also in frames that another ball's impact cuts in two."""
    rest, fall = lab.ball("rest", (0.0, 0.0, 0.05)), lab.ball("fall", (1.0, 0.0, 0.3))
    world = lab.build(lab.scene(rest, fall, lab.ground(), e=0.5, mu=0.3))
    cut = 0
    for _ in range(60):
        lab.play(world, 1)
        rows = world.contacts[: int(world.state[0]["contact_count"])]
        reported = rows[rows["body_a"] == 0]
        cut += len(reported) > 1
        # the ground is B: its share is the opposite
        assert -reported["impulse"][:, 2].sum() == pytest.approx(9.81 / 60, rel=1e-9)
        np.testing.assert_allclose(reported["velocity_a_after"], 0, atol=1e-12)
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
