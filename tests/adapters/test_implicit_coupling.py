"""Eq. 6 by the engines' implicit means: its closed form at any step, its static force, and any inertia."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import islice, pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest
from engine_states import states
from scipy.linalg import block_diag, expm
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Settings, State
from touchstone.adapters.engines.implicit_coupling import RESOLVED, step_law
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, installed, missing_reason, profiles_of
from touchstone.adapters.servo import Drive, starting_body
from touchstone.adapters.workers.children import Children
from touchstone.adapters.workers.play import play
from touchstone.scenarios.avatar.tracking import ease, keyframed, sample
from touchstone.scenarios.difficulty.family import families
from touchstone.scenarios.scenario import Body, Scenario, Tracker
from touchstone.scenarios.solids import block, slab

STEPS = (1 / 30, 1 / 60, 1 / 240, 1 / 960)
MASSES = (0.01, 0.4, 100.0)
STIFFNESSES = (10.0, 1e3, 1e5)
HALF = (0.03, 0.05, 0.02)
DEEP = 0.01
"""How deep the tracker ends inside the box [m]."""
NAMES = ("mujoco", "bullet", "dart")
SINGLE = {
    "physx": ("recommended", "default", "pgs"),
    "newton": ("xpbd", "mujoco", "mujoco-elliptic", "steel", "kamino"),
    "rapier": ("recommended", "default", "accurate"),
}
"""Engines in environments of their own, which compute in single precision, and their profiles."""


def critical(mass: float, stiffness: float) -> float:
    """Damping of a critically damped spring [N s/m]."""
    return 2 * (mass * stiffness) ** 0.5


def plate(mass: float, stiffness: float, damping: float, times: Array, path: Array, turns: Array) -> tuple:
    """A driven plate and its tracker along a path (n, 3) [m] with rotation vectors (n, 3) [rad]."""
    body = block("plate", "wood", HALF, mass, kind="driven")
    gains = {"stiffness": stiffness, "damping": damping, "interpolation": "pchip"}
    quaternions = Rotation.from_rotvec(turns).as_quat(scalar_first=True)
    return body, keyframed("plate", times, path, quaternions, **gains)


def played(engine: SimpleNamespace, scenario: Scenario, dt: float) -> Iterator[State]:
    """States after every step; the same object."""
    settings = Settings(next(iter(ENGINES[engine.name].profiles)), dt)
    return islice(states(engine, scenario, settings), 1, None)


def each(*names: str) -> list:
    """Engines of SINGLE with their profiles; skipped where not installed, slow where they compile."""
    return [
        pytest.param(
            name,
            profile,
            id=f"{name} {profile}",
            marks=[
                pytest.mark.engines,
                pytest.mark.skipif(not installed(name), reason=f"{name}: {missing_reason(name)}"),
                *([pytest.mark.slow] if name == "newton" else []),
            ],
        )
        for name in names
        for profile in SINGLE[name]
    ]


@pytest.fixture(scope="module")
def recorded() -> Iterator[Callable[..., Recording]]:
    """What a child process records: one for each engine plays all scenes of this file."""
    with Children(per_engine=True) as children:

        def recorded(scenario: Scenario, name: str, profile: str) -> Recording:
            run = play(scenario, [(name, profile)], children=children)[name, profile]
            assert run.status == "done", run.reason
            return run.recording

        yield recorded


def closed_form(stiffness: float, damping: float, path: Array, start: Array, dt: float) -> Array:
    """Positions at steps' ends by Eq. 6 per mass, for a tracker that is linear in each step."""
    decay = expm(np.array([[0.0, 1.0], [-stiffness, -damping]]) * dt)
    state, found = np.zeros((2, path.shape[1])), []
    before = start
    for old, new in pairwise(path):
        pace = (new - old) / dt
        state[1] += before - pace
        state, before = decay @ state, pace
        found.append(new + state[0])
    return np.array(found)


@pytest.mark.parametrize("damping", [0.0, 1.0, 40.0, None, 1e4])
@pytest.mark.parametrize("dt", STEPS)
def test_a_step_is_that_of_the_closed_form(dt: float, damping: float | None) -> None:
    """Follow a jumping tracker by the closed form at any mass and stiffness that the step resolves, and stay
    near it at the others."""
    rng = np.random.default_rng(3)
    for mass, stiffness in product(MASSES, STIFFNESSES):
        drag = critical(mass, stiffness) if damping is None else damping
        law = step_law(stiffness, drag, mass, dt, True)
        path = np.concatenate([[0.0], np.cumsum(rng.normal(size=40)) * dt])[:, None]
        exact = closed_form(stiffness / mass, drag / mass, path, np.zeros(1), dt)[:, 0]
        x = v = w = 0.0
        pace, found = np.diff(path[:, 0]) / dt, []
        for k in range(40):
            force = law.stiffness * (path[k, 0] - x) + law.damping * (w - v) + law.lead * (pace[k] - w)
            v += dt * force / (mass + law.added)
            x, w = x + dt * v, pace[k]
            found.append(x)
        swing = max(stiffness / mass - (drag / mass / 2) ** 2, 0.0) ** 0.5 * dt
        if swing <= RESOLVED:
            np.testing.assert_allclose(found, exact, atol=1e-10 * dt, rtol=1e-10)
        assert np.abs(np.array(found) - path[1:, 0]).max() < 40 * dt


def plates(lab: SimpleNamespace) -> tuple[Scenario, list[tuple[float, float]]]:
    """Plates of every mass and stiffness in one scene, which move and turn 1 m apart; these."""
    times, kinds = np.arange(11) / 30, list(product(MASSES, STIFFNESSES))
    path = np.cumsum(np.random.default_rng(7).normal(size=(11, 3)) * 0.01, axis=0)
    turns = np.zeros((11, 3))
    turns[:, 1] = 0.3 * ease(times, 0.0, times[-1])
    found = []
    for k, (mass, stiffness) in enumerate(kinds):
        body, tracker = plate(mass, stiffness, critical(mass, stiffness), times, path + (k, 0, 0), turns)
        found.append((replace(body, name=f"plate_{k}"), replace(tracker, root=f"plate_{k}")))
    bodies, trackers = zip(*found)
    return lab.scene(*bodies, trackers=trackers, duration=float(times[-1])), kinds


def angles(orientations: Array) -> Array:
    """Angles about y of what turns about y alone [rad]."""
    return Rotation.from_quat(orientations, scalar_first=True).as_rotvec()[:, 1:2]


def free_motion(scenario: Scenario, tracker: Tracker, mass: float, dt: float) -> tuple[Array, Array]:
    """Places and angles about y at steps' ends of a critically damped plate that meets nothing."""
    motion = sample(tracker, np.arange(1 + round(scenario.duration / dt)) * dt)
    rates = tracker.stiffness / mass, 2 * (tracker.stiffness / mass) ** 0.5
    return (
        closed_form(*rates, motion.position, motion.linear_velocity[0], dt),
        closed_form(*rates, angles(motion.orientation), motion.angular_velocity[0, 1:2], dt),
    )


@pytest.mark.engines
@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("name", NAMES)
def test_free_plates_follow_the_closed_form(lab, registry, name: str, dt: float) -> None:
    """Play every mass and stiffness at every step, none refused, as Eq. 6 has it to rounding."""
    scenario, kinds = plates(lab)
    found = [(s.position.copy(), s.orientation.copy()) for s in played(registry.engine(name), scenario, dt)]
    places, quaternions = (np.array(column) for column in zip(*found))
    for k, ((mass, _), tracker) in enumerate(zip(kinds, scenario.trackers)):
        exact, turned = free_motion(scenario, tracker, mass, dt)
        np.testing.assert_allclose(places[:, k], exact, atol=1e-12)
        np.testing.assert_allclose(angles(quaternions[:, k]), turned, atol=1e-8)


@pytest.mark.parametrize(("name", "profile"), each("physx", "newton"))
def test_free_plates_follow_the_closed_form_in_single_precision(
    lab, recorded, name: str, profile: str
) -> None:
    """Move and turn as Eq. 6 has it, at the engine's own step; two profiles damp what turns."""
    scenario, kinds = plates(lab)
    recording, dt = recorded(scenario, name, profile), profiles_of(name)[profile]
    every = round(1 / 60 / dt)
    for k, ((mass, _), tracker) in enumerate(zip(kinds, scenario.trackers)):
        exact, turned = (found[every - 1 :: every] for found in free_motion(scenario, tracker, mass, dt))
        far = 1e-5 if (name, profile) == ("newton", "xpbd") else 2e-6
        np.testing.assert_allclose(recording.position[1:, k], exact, atol=far)
        within = 1e-3 if profile in ("steel", "default") else 4e-5
        np.testing.assert_allclose(angles(recording.orientation[1:, k]), turned, atol=within)


@pytest.mark.parametrize(("name", "profile"), each("rapier"))
def test_motors_of_rapier_are_implicit_euler_in_each_substep(lab, recorded, name: str, profile: str) -> None:
    """Move as m (v' - v) = -h (K y' + R v') does in Rapier's substeps of h, for every mass and stiffness."""
    scenario, kinds = plates(lab)
    recording, dt = recorded(scenario, name, profile), profiles_of(name)[profile]
    parts = recording.facts["settings"]["num_solver_iterations"]
    h = dt / parts
    for k, ((mass, stiffness), tracker) in enumerate(zip(kinds, scenario.trackers)):
        motion = sample(tracker, np.arange(1 + round(scenario.duration / dt)) * dt)
        damping = critical(mass, stiffness)
        x, v, path = motion.position[0], motion.linear_velocity[0], []
        for old, new in pairwise(motion.position):
            pace = (new - old) / dt
            for part in range(parts):
                y = x - (old + (part + 1) * h * pace)
                v = (mass * v - h * stiffness * y + h * damping * pace) / (
                    mass + h * damping + h * h * stiffness
                )
                x = x + h * v
            path.append(x)
        np.testing.assert_allclose(recording.position[1:, k], path, atol=4e-6)


def pressing(lab: SimpleNamespace, mass: float, stiffness: float) -> Scenario:
    """A plate on a box on the floor, whose tracker goes DEEP into the box within 0.3 s."""
    times = np.arange(91) / 60
    path = np.zeros((91, 3))
    path[:, 2] = 0.12 - DEEP * ease(times, 0.0, 0.3)
    body, tracker = plate(mass, stiffness, critical(mass, stiffness), times, path, np.zeros((91, 3)))
    box = block("box", "wood", (0.1, 0.1, 0.05), 1.0, (0.0, 0.0, 0.05))
    return lab.scene(body, box, slab("floor", "wood"), trackers=(tracker,), duration=1.5)


@pytest.mark.engines
@pytest.mark.parametrize(("mass", "stiffness"), [(0.01, 1e3), (0.4, 1e3), (0.4, 1e4), (0.01, 1e5)])
@pytest.mark.parametrize("name", NAMES)
def test_a_plate_presses_with_its_spring(lab, registry, name: str, mass: float, stiffness: float) -> None:
    """Press with K times the distance from the tracker; DART and Bullet with K d, for what is pressed holds.

    MuJoCo's contacts give way: the tracker is less than d away.
    """
    dt = 1 / 240
    forces, ways = [], []
    for state in played(registry.engine(name), pressing(lab, mass, stiffness), dt):
        rows = state.contacts[: state.contact_count]
        met = (rows["body_a"] == 0) & (rows["body_b"] == 1)
        forces.append(np.abs(rows["impulse"][met, 2].sum()) / dt)
        ways.append(state.position[0, 2] - (0.12 - DEEP))
    force, way = np.mean(forces[-60:]), np.mean(ways[-60:])
    assert force == pytest.approx(stiffness * way, rel=0.01)
    if name != "mujoco":
        assert force == pytest.approx(stiffness * DEEP, rel=0.01)


@pytest.mark.parametrize(("name", "profile"), each(*SINGLE))
def test_a_plate_presses_with_its_spring_in_single_precision(lab, recorded, name: str, profile: str) -> None:
    """Press with K times the distance from the tracker, by what the contacts of plate and box report."""
    mass, stiffness = 0.4, 1e3
    recording = recorded(pressing(lab, mass, stiffness), name, profile)
    rows = recording.contacts
    met = (rows["body_a"] == 0) & (rows["body_b"] == 1) & (rows["time"] >= 1.25 - 1e-6)
    force = np.abs(rows["impulse"][met, 2].sum()) / 0.25
    way = recording.position[-15:, 0, 2].mean() - (0.12 - DEEP)
    assert force == pytest.approx(stiffness * way, rel=0.01)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("level", [1.0, 1e3, 1e6])
def test_links_of_any_mass_leave_the_coupling_stable(level: float, dt: float) -> None:
    """Contract the linearised loop of coupling and step with free hinges, whatever the links weigh."""
    scenario = families()["mass_links"].scene(level)[0]
    tracker = scenario.trackers[0]
    drive, body = Drive(scenario, tracker, dt), starting_body(scenario, tracker)
    added = block_diag(drive.ballast[0] * np.eye(3), drive.ballast[1])
    stiff = block_diag(drive.stiffness * np.eye(3), drive.frequency**2 * drive.inertia)
    root = body.inertia[:6, :6] - body.inertia[:6, 6:] @ np.linalg.solve(
        body.inertia[6:, 6:], body.inertia[6:, :6]
    )
    mass = root + added
    drag = block_diag(drive._linear.damping * np.eye(3), drive._angular.damping * drive.inertia)
    pull, brake = (dt * np.linalg.solve(mass, gain) for gain in (stiff, drag))
    one = np.eye(6)
    loop = np.block([[one - dt * pull, dt * (one - brake)], [-pull, one - brake]])
    assert np.abs(np.linalg.eigvals(loop)).max() < 1 + 1e-9


def held(lab: SimpleNamespace, *others: Body) -> Scenario:
    """A plate with an off-centre mass and a turned inertia, whose tracker rests."""
    times, zero = np.arange(3) / 10, np.zeros((3, 3))
    body, tracker = plate(0.05, 1e4, 10.0, times, zero + 1.0, zero + 0.4)
    tensor = ((0.002, 0.0003, -0.0001), (0.0003, 0.003, 0.0002), (-0.0001, 0.0002, 0.0025))
    body = replace(body, center_of_mass=(0.05, 0.02, -0.03), inertia=tensor)
    return lab.scene(body, *others, trackers=(tracker,), duration=0.2)


@pytest.mark.engines
@pytest.mark.parametrize("name", NAMES)
def test_the_added_inertia_feels_no_gravity(lab, registry, name: str) -> None:
    """Stay at a tracker that rests, under gravity, with an off-centre mass and a turned inertia."""
    for state in played(registry.engine(name), held(lab), 1 / 60):
        assert state.position[0] == pytest.approx(np.ones(3), abs=1e-9)
        assert np.abs(state.force).max() < 1e-6


@pytest.mark.parametrize(("name", "profile"), each(*SINGLE))
def test_a_driven_body_feels_no_gravity_in_single_precision(lab, recorded, name: str, profile: str) -> None:
    """Stay at a tracker that rests, with an off-centre mass and a turned inertia."""
    recording = recorded(held(lab, slab("floor", "wood")), name, profile)
    np.testing.assert_allclose(recording.position[:, 0], 1.0, atol=1e-5)


@pytest.mark.engines
@pytest.mark.parametrize("level", [1e3, 1e6])
@pytest.mark.parametrize("name", NAMES)
def test_heavy_links_do_not_explode(registry, name: str, level: float) -> None:
    """Swing links of any mass on a root of 20 kg at no more than the speed that the tracker explains."""
    scenario, checks = families()["mass_links"].scene(level)
    for state in played(registry.engine(name), scenario, 1 / 240):
        assert np.abs(state.linear_velocity).max() < checks.speed
