"""Impacts: Newton's law, momentum, energy, and the log of impulses."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from touchstone.reference_impl.contact.impact import resting_restitution


def test_restitution_fades_towards_rest() -> None:
    """Fade linearly from e at 2 v_rest to 0 at v_rest."""
    approaches = [0.0, 1.0, 1.5, 2.0, 5.0]
    faded = [resting_restitution(0.8, approach, 1.0) for approach in approaches]
    np.testing.assert_allclose(faded, [0, 0, 0.4, 0.8, 0.8])
    assert resting_restitution(0.8, 0.1, 0.0) == 0.8


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


def grain(lab: SimpleNamespace):
    """A frame of a grain between a wall and a ball a million times heavier: one after the other, about
    pi / 4 sqrt(1e6) impacts turn the ball round."""
    small = lab.ball("grain", (0.0, 0.0, 0.0), mass=1e-6)
    heavy = lab.ball("heavy", (0.1, 0.0, 0.0), linear_velocity=(-1.0, 0.0, 0.0))
    wall = lab.block("wall", (1.0, 1.0, 1.0), (-1.05, 0.0, 0.0), kind="fixed")
    scene = lab.scene(small, heavy, wall, e=1.0, gravity=(0.0, 0.0, 0.0))
    world = lab.build(scene)
    lab.play(world, 1)
    return world


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
    """A ball on a driven shelf sinks with it as Eq. 6 of both says, however the frame is cut."""
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
    mass, (k, r) = 1.4, (1000.0, 40.0)
    motion = solve_ivp(
        lambda _, y: (y[1], -(k * y[0] + r * y[1] + 9.81) / mass), (0, 1 / 60), (0, 0), rtol=1e-10
    )
    truth = motion.y[1, -1]
    # the force is even over a substep
    assert recoils[0] == pytest.approx(truth, rel=0.1)
    assert recoils[1] == pytest.approx(truth, rel=0.05)
