"""How bodies must move, free and on prescribed bodies: closed forms against integration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import flips, motion
from touchstone.scenarios.scenario import GRAVITY, Scenario, Truth

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


MU = 0.3
EXACT = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
CARRIED = [s.name for s in tagged("prescribed") if s.truths[0].law == "carried"]


def splines(scene: Scenario) -> tuple[CubicSpline, CubicSpline]:
    """Paths of the platform along x and z."""
    tracker = scene.trackers[0]
    x, _, z = np.transpose(tracker.positions)
    return tuple(CubicSpline(tracker.times, row, bc_type="clamped") for row in (x, z))


def slid(scene: Scenario) -> np.ndarray:
    """Place of the load along x at the frames (f,) by integration with events: Coulomb's law, piece by
    piece."""
    x, z = splines(scene)
    frames, found = np.arange(scene.frame_count + 1) / scene.frame_rate, []
    grip = lambda t: scene.coefficients[0].friction * (GRAVITY + z(t, 2))  # noqa: E731
    t, y, sign = 0.0, np.array([0.0, float(x(0, 1))]), 0
    sign = int(np.sign(x(t, 2))) if abs(x(t, 2)) > grip(t) else 0
    knots = [*(one for one in scene.trackers[0].times[1:] if one < scene.duration), scene.duration]
    while t < scene.duration:
        # the right side has kinks at the knots: no step passes one
        knot = next(one for one in knots if one > t + 1e-12)
        late = lambda s, y: (y[1] - x(s, 1)) if sign else abs(x(s, 2)) - grip(s)  # noqa: B023, E731
        late.terminal, late.direction = True, sign or 1
        law = (lambda s, y: (y[1], sign * grip(s))) if sign else (lambda s, y: (y[1], x(s, 2)))  # noqa: B023
        mine = frames[(frames >= t - 1e-12) & (frames < knot - 1e-12)]
        run = solve_ivp(law, (t, knot), y, events=late, dense_output=True, **EXACT)
        end = float(run.t[-1])
        found += [(one, float(run.sol(max(one, t))[0])) for one in mine if one < end - 1e-12]
        stopped = run.status == 1
        t, y = end, run.y[:, -1]
        if stopped:
            y[1] = x(t, 1)
            held = abs(x(t, 2)) <= grip(t) if sign else False
            sign = 0 if held else int(np.sign(x(t, 2)))
    found.append((scene.duration, float(y[0])))
    times, places = np.transpose(found)
    return np.interp(frames, times, places)


@pytest.mark.parametrize("name", CARRIED)
def test_loads_move_by_friction(name):
    """Follow Coulomb's law along the platform and the platform itself across it."""
    scene = catalogue()[name]
    times = np.arange(scene.frame_count + 1) / scene.frame_rate
    found = motion(scene, scene.truths[0], times)
    # events found to 1e-12 s at speeds of 2 m/s, and the integration's own error
    np.testing.assert_allclose(found.position[:, 0], slid(scene), atol=1e-9)
    lift = splines(scene)[1]
    np.testing.assert_allclose(found.position[:, 2], 0.05 + lift(times) - lift(0.0), atol=1e-15)
    np.testing.assert_allclose(found.velocity[:, 2], lift(times, 1), atol=1e-15)
    assert (lift(times, 2) > -GRAVITY).all()  # the load presses all the time


@pytest.mark.parametrize(("name", "slides"), [("platform_slip", True), ("platform_stick", False)])
def test_friction_decides_who_slides(name, slides):
    """Stay on the platform's path to rounding below mu g; above it, slide by what mu g leaves."""
    scene = catalogue()[name]
    times = np.linspace(0.0, scene.duration, 1001)
    found, x = motion(scene, scene.truths[0], times), splines(scene)[0]
    away = np.abs(found.position[:, 0] - x(times)).max()
    assert away > 0.1 if slides else away < 1e-14
    assert np.abs(x(times, 2)).max() == pytest.approx(4.5 if slides else 2.9, abs=1e-9)
    if slides:
        # it slides at mu g until it is as fast as the platform, 2.025 m/s
        at = np.array([0.4, 2.025 / (MU * GRAVITY) + 0.01])
        begun = motion(scene, scene.truths[0], at)
        assert begun.velocity[:, 0] == pytest.approx([MU * GRAVITY * 0.4, 2.025], abs=1e-9)


def test_a_lift_presses_as_it_accelerates():
    """The platform bears 12.81, 9.81 and 6.81 N per kg while it starts, moves and stops."""
    scene, h = catalogue()["platform_lift"], 1e-3
    times = np.add.outer((0.2, 0.8, 1.3), (-h, 0.0, h)).ravel()
    z = motion(scene, scene.truths[0], times).position[:, 2].reshape(3, 3)
    felt = GRAVITY + (z[:, 0] - 2 * z[:, 1] + z[:, 2]) / h**2
    # second differences of metres
    assert felt == pytest.approx([12.81, 9.81, 6.81], abs=1e-8)
    assert motion(scene, scene.truths[0], np.array([0.8])).velocity[0, 2] == pytest.approx(1.5, abs=1e-12)


def test_shakers_shake_sines():
    """Splines of the shakers' keyframes are cosines of 2 Hz to 1e-4 of their largest acceleration."""
    for name, axis, largest in (("shaker_across", 0, 2 * MU * GRAVITY), ("shaker_along", 1, 0.8 * GRAVITY)):
        spline, times = splines(catalogue()[name])[axis], np.linspace(0.0, 2.0, 997)
        rate = 4 * np.pi
        wanted = largest / rate**2 * (1 - np.cos(rate * times)) - 0.05 * axis
        np.testing.assert_allclose(spline(times), wanted, atol=1e-5 * largest / rate**2)
        np.testing.assert_allclose(spline(times, 1), largest / rate * np.sin(rate * times), atol=1e-3)


def test_a_ball_on_a_turntable_circles():
    """The ball's centre circles at 2/7 of the plate's rate about a fixed point, without slip."""
    scene = catalogue()["turntable"]
    times = np.arange(scene.frame_count + 1) / scene.frame_rate
    found = motion(scene, scene.truths[0], times)
    arm = found.position - (-0.25, 0.0, 0.1)
    assert np.linalg.norm(arm, axis=1) == pytest.approx(0.35, abs=1e-14)
    angle = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    assert angle == pytest.approx(2 / 7 * 2.0 * times, abs=1e-13)
    # no slip: the ball's lowest point is as fast as the plate below it
    below = found.velocity + np.cross(found.angular_velocity, (0.0, 0.0, -0.05))
    assert below == pytest.approx(np.cross((0.0, 0.0, 2.0), found.position), abs=1e-14)
    # no torque acts about the vertical through the contact
    assert found.angular_velocity[:, 2] == pytest.approx(scene.bodies[1].angular_velocity[2], abs=1e-14)


def test_platforms_bear_what_their_paths_ask():
    """12.81, 9.81 and 6.81 N per kg where a platform starts, moves and stops; the weight across gravity; and
    m g (1 +- 0.8 sin x / x), x = 4 pi 0.1, within 0.1 s of the extremes of a shaken one."""
    forces = {s.name: [truth.value for truth in s.forces] for s in tagged("prescribed") if s.forces}
    assert forces.pop("platform_lift") == pytest.approx([12.81, 9.81, 6.81, 9.81], rel=1e-12)
    swing = 0.8 * np.sin(0.4 * np.pi) / (0.4 * np.pi)
    assert forces.pop("shaker_along") == pytest.approx([9.81 * (1 + swing), 9.81 * (1 - swing)], rel=2e-5)
    assert forces == {name: [9.81] for name in ("platform_slip", "platform_stick", "shaker_across")}
