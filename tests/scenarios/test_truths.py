"""How bodies must move: the closed forms against integration, conservation and each other."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import flips, motion
from touchstone.scenarios.scenario import Arc, Scenario, Truth

TAGS = ("probe", "seeded", "prescribed", "curved", "joints")
ALL = [
    (scenario.name, truth.body)
    for scenario in {s.name: s for tag in TAGS for s in tagged(tag)}.values()
    for truth in scenario.truths
]


def truth_of(name: str, body: str) -> tuple[Scenario, Truth]:
    """A scene and the truth of one of its bodies."""
    scenario = catalogue()[name]
    return scenario, next(truth for truth in scenario.truths if truth.body == body)


@pytest.mark.parametrize(("name", "body"), ALL)
def test_a_truth_starts_as_the_scene_does(name: str, body: str) -> None:
    """Begin with the body's own pose and velocities."""
    scenario, truth = truth_of(name, body)
    start, given = motion(scenario, truth, np.zeros(1)), scenario.bodies[scenario.body_index(body)]
    if truth.law == "coupling":
        # a driven body begins where its tracker does, at rest
        tracker = next(tracker for tracker in scenario.trackers if tracker.root == body)
        given = replace(given, position=tracker.positions[0])
    np.testing.assert_allclose(start.position[0], given.position, atol=1e-15)
    np.testing.assert_allclose(start.velocity[0], given.linear_velocity, atol=1e-15)
    np.testing.assert_allclose(start.angular_velocity[0], given.angular_velocity, atol=1e-14)
    np.testing.assert_allclose(np.abs(start.orientation[0] @ given.orientation), 1, atol=1e-15)


@pytest.mark.parametrize(("name", "body"), ALL)
def test_velocities_are_rates(name: str, body: str) -> None:
    """Match differences of positions and orientations away from impacts; never jump in position."""
    scenario, truth = truth_of(name, body)
    step = 1e-5
    starts = np.array([arc.start for arc in truth.arcs] or [0.0])
    times = np.random.default_rng(5).uniform(step, scenario.duration - step, 50)
    times = np.sort(times[np.abs(times[:, None] - starts).min(axis=1) > 2 * step])
    now, before, after = (motion(scenario, truth, times + shift) for shift in (0, -step, step))
    # rounding over the step, and its square times what the velocity's rate changes
    np.testing.assert_allclose(now.velocity, (after.position - before.position) / (2 * step), atol=1e-6)
    turned = Rotation.from_quat(after.orientation, scalar_first=True)
    change = turned * Rotation.from_quat(before.orientation, scalar_first=True).inv()
    np.testing.assert_allclose(now.angular_velocity, change.as_rotvec() / (2 * step), atol=1e-5)
    kinks = starts[(starts > 1e-9) & (starts < scenario.duration)]
    beside = [motion(scenario, truth, kinks + shift).position for shift in (-1e-12, 0.0)]
    # at 20 m/s
    np.testing.assert_allclose(*beside, atol=1e-10)


@pytest.mark.parametrize(
    "scenario", [s for s in tagged("isolated") if s.truths and "impact" in s.tags], ids=lambda s: s.name
)
def test_collisions_keep_momentum(scenario: Scenario) -> None:
    """Keep linear and angular momentum through the impact; lose no energy where the scene is conservative."""
    linear, angular, energy = [np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2)]
    for truth in scenario.truths:
        body = scenario.bodies[scenario.body_index(truth.body)]
        m = motion(scenario, truth, np.array([0.0, scenario.duration]))
        spin = body.inertia[0][0] * m.angular_velocity
        linear += body.mass * m.velocity
        angular += np.cross(m.position, body.mass * m.velocity) + spin
        energy += (body.mass * (m.velocity**2).sum(axis=1) + (spin * m.angular_velocity).sum(axis=1)) / 2
    # rounding of m v: up to 2e6 kg m/s
    scale = max(body.mass for body in scenario.bodies)
    np.testing.assert_allclose(linear[1], linear[0], atol=1e-15 * scale)
    np.testing.assert_allclose(angular[1], angular[0], atol=1e-15 * scale)
    if "conservative" in scenario.tags:
        assert energy[1] == pytest.approx(energy[0], rel=1e-14)
    else:
        assert energy[1] < energy[0]


@pytest.mark.parametrize(("name", "sticks"), [("collide_slips", False), ("collide_sticks", True)])
def test_friction_stops_the_slip_or_not(name: str, sticks: bool) -> None:
    """Leave no slip where friction suffices, else Coulomb's impulse against it; Newton's law along n."""
    scenario = catalogue()[name]
    e, mu = scenario.pair_coefficients(0, 1)
    met = [truth.arcs[1] for truth in scenario.truths]
    n = np.subtract(met[1].position, met[0].position)
    n /= np.linalg.norm(n)

    def slip(arcs: list[Arc]) -> np.ndarray:
        arms = (0.05 * n, -0.05 * n)
        a, b = (np.array(arc.velocity) + np.cross(arc.angular_velocity, r) for arc, r in zip(arcs, arms))
        return b - a

    before, after = slip([truth.arcs[0] for truth in scenario.truths]), slip(met)
    assert n @ after == pytest.approx(-e * (n @ before), rel=1e-14)
    across = after - n @ after * n
    if sticks:
        np.testing.assert_allclose(across, 0, atol=1e-15)
    else:
        impulse = np.subtract(met[1].velocity, scenario.truths[1].arcs[0].velocity)
        tangential = impulse - n @ impulse * n
        assert np.linalg.norm(tangential) == pytest.approx(mu * (n @ impulse), rel=1e-14)
        assert across @ (before - n @ before * n) > 0


@pytest.mark.parametrize("scenario", [catalogue()[f"slip_seed{k}"] for k in range(3)] + [catalogue()["slip"]])
def test_slip_ends_in_rolling(scenario: Scenario) -> None:
    """End without slip at the contact, after 2 s / (7 mu g) for a first slip s."""
    mu = scenario.pair_coefficients(0, 1)[1]
    for truth in scenario.truths:
        slid, rolled = truth.arcs
        slips = [np.array(arc.velocity) + np.cross(arc.angular_velocity, (0, 0, -0.05)) for arc in truth.arcs]
        np.testing.assert_allclose(slips[1], 0, atol=1e-15)
        assert rolled.start == pytest.approx(2 * np.linalg.norm(slips[0]) / (7 * mu * 9.81), rel=1e-14)
        # what friction takes from the velocity it gives to the spin: L about the contact is kept
        moved = np.cross((0, 0, 0.05), np.subtract(rolled.velocity, slid.velocity))
        turned = 0.4 * 0.05**2 * np.subtract(rolled.angular_velocity, slid.angular_velocity)
        np.testing.assert_allclose(moved + turned, 0, atol=1e-16)


@pytest.mark.parametrize("e", [0.0, 0.3, 0.5, 0.8, 1.0])
def test_bounces_rise_by_the_square(e: float) -> None:
    """Rise to h e^2k, meet the floor every 2 v / g, and lie still only after all bounces."""
    scenario = catalogue()[f"bounce_e{e:g}".replace(".", "")]
    arcs = scenario.truths[0].arcs
    for k, arc in enumerate(arcs[1:6], start=1):
        assert arc.velocity[2] ** 2 / (2 * 9.81) == pytest.approx(0.3 * e ** (2 * k), rel=1e-12)
    for one, two in pairwise(arcs[1:]):
        assert two.start - one.start == pytest.approx(2 * one.velocity[2] / 9.81, abs=1e-12)
    # the whole time of an endless series of bounces
    if arcs[-1].velocity == (0.0, 0.0, 0.0):
        fall = (2 * 0.3 / 9.81) ** 0.5
        assert arcs[-1].start == pytest.approx(fall * (1 + 2 * e / (1 - e)), abs=1e-6)


@pytest.mark.parametrize("name", ["tumble_stable", "tumble_unstable"])
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_a_free_top_by_integration(name: str, seed: int | None) -> None:
    """Match Euler's equations integrated to rounding, also for a body whose axes are no principal ones."""
    scenario = catalogue()[name]
    body = scenario.bodies[0]
    if seed is not None:
        rng = np.random.default_rng(seed)
        axes, start = Rotation.random(2, rng=rng)
        inertia = axes.as_matrix() @ np.array(body.inertia) @ axes.as_matrix().T
        body = replace(
            body,
            inertia=tuple(map(tuple, ((inertia + inertia.T) / 2).tolist())),
            orientation=tuple(start.as_quat(scalar_first=True).tolist()),
            angular_velocity=tuple(rng.normal(size=3) * 3),
        )
        scenario = replace(scenario, bodies=(body,), duration=3.0)
    times = np.linspace(0, scenario.duration, 61)
    reported = motion(scenario, scenario.truths[0], times)
    moments, turn = np.array(body.inertia), Rotation.from_quat(body.orientation, scalar_first=True)

    def rate(_: float, state: np.ndarray) -> np.ndarray:
        q, w = state[:4], state[4:]
        turned = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
        return np.concatenate([turned, np.linalg.solve(moments, np.cross(moments @ w, w))])

    first = np.concatenate([body.orientation, turn.inv().apply(body.angular_velocity)])
    end = solve_ivp(rate, times[[0, -1]], first, "DOP853", times, rtol=1e-13, atol=1e-14)
    turned = Rotation.from_quat(end.y[:4].T, scalar_first=True)
    away = (turned * Rotation.from_quat(reported.orientation, scalar_first=True).inv()).magnitude()
    # the integration's tolerance, over some 60 rad near the separatrix
    assert away.max() < 1e-9
    np.testing.assert_allclose(turned.apply(end.y[4:].T), reported.angular_velocity, atol=1e-9)


def test_flips_are_where_the_middle_rate_is_zero() -> None:
    """Tell every change of sign of the rate about the middle axis: some seconds apart near its own."""
    scenario = catalogue()["tumble_unstable"]
    reported = flips(scenario, scenario.truths[0])
    assert len(reported) == 2
    for sign in (-1, 1):
        near = motion(scenario, scenario.truths[0], reported + sign * 1e-6)
        turned = Rotation.from_quat(near.orientation, scalar_first=True)
        rates = turned.inv().apply(near.angular_velocity)[:, 1]
        assert (np.sign(rates) == sign * np.array([-1, 1])).all()
    # on the stable axis the small rates change sign ten times as often
    assert len(flips(catalogue()["tumble_stable"], catalogue()["tumble_stable"].truths[0])) > 8


@pytest.mark.parametrize("body", ["light", "critical", "heavy"])
def test_a_coupled_mass_by_integration(body: str) -> None:
    """Match Eq. 6 integrated frame by frame behind a tracker that moves linearly within the frame."""
    scenario, truth = truth_of("spring", body)
    tracker = next(tracker for tracker in scenario.trackers if tracker.root == body)
    mass = scenario.bodies[scenario.body_index(body)].mass
    times = np.arange(scenario.frame_count + 1) / 60
    target = sample(tracker, times).position[:, 0]
    state, seen = np.zeros(2), [0.0]
    for start, end in pairwise(target):
        pace = 60 * (end - start)

        def rate(t: float, s: np.ndarray, start: float = start, pace: float = pace) -> list[float]:
            pull = -tracker.stiffness * (s[0] - start - pace * t) - tracker.damping * (s[1] - pace)
            return [s[1], pull / mass]

        state = solve_ivp(rate, (0, 1 / 60), state, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        seen.append(state[0])
    reported = motion(scenario, truth, times)
    # the integration's tolerance over 90 frames
    np.testing.assert_allclose(reported.position[:, 0], seen, atol=1e-11)
    between = motion(scenario, truth, times[:-1] + 1 / 240).position[:, 0]
    assert (np.abs(between - reported.position[:-1, 0]) <= 0.02).all()
