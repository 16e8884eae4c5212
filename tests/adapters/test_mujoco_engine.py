"""MuJoCo behind the contract: conventions, translation, read-back, drive, balance of impulses."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from touchstone.adapters.contract import Settings, State, Unsupported
from touchstone.adapters.recorder import record
from touchstone.scenarios import scenario as sc
from touchstone.scenarios.scenario import Body, Box, Ellipsoid, Hull, Piece, Scenario, Sphere
from touchstone.scenarios.solids import box_inertia, elliptic_hull, sphere_inertia

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
from touchstone.adapters.engines.mujoco.contacts import (  # noqa: E402
    REST_STEPS,
    releasing_ratio,
    releasing_restitution,
    restitution_of,
    solref_of,
)
from touchstone.adapters.engines.mujoco.engine import MujocoEngine, World  # noqa: E402
from touchstone.adapters.engines.mujoco.model import add_piece  # noqa: E402
from touchstone.adapters.engines.mujoco.settings import SETTINGS as TABLE  # noqa: E402

ENGINE = MujocoEngine()
DT = ENGINE.profiles["recommended"]
SETTINGS = Settings("recommended", DT)
R = 0.05
"""Half the height of every shape below [m]."""
SHAPES = {
    "sphere": Sphere(R),
    "box": Box((R, 0.06, R)),
    "ellipsoid": Ellipsoid((0.07, 0.06, R)),
    "hull": Hull(elliptic_hull((R, R, R))),
}
DEPTH = 2e-6
"""Accuracy of a contact's distance [m]: twice MuJoCo's ccd_tolerance, where its GJK and EPA stop."""
SIDEWAYS = (2 * 0.1 * DEPTH) ** 0.5
"""Accuracy of its place [m]: how far a surface of 10 cm radius of curvature runs within DEPTH."""
FULL_INERTIA = ((3e-3, 2e-4, -1e-4), (2e-4, 4e-3, 3e-4), (-1e-4, 3e-4, 5e-3))
CENTER = (0.01, -0.02, 0.03)
TURN = (0.5, 0.5, -0.5, 0.5)
"""A rotation by 120 degrees that no axis of the world survives."""


def scene(*bodies: Body, e: float = 0.3, mu: float = 0.3, duration: float = 1.0, **fields) -> Scenario:
    """A scene of bodies of one material."""
    pair = sc.PairCoefficients("wood", "wood", restitution=e, friction=mu)
    return Scenario("test", "a test", (), bodies, duration, (pair,), **fields)


def free(name: str, shape: sc.Shape, z: float, **fields) -> Body:
    """A simulated body of 1 kg at a height."""
    fields = {"mass": 1.0, "inertia": sphere_inertia(1.0, R), "position": (0.0, 0.0, z)} | fields
    return Body(name, "simulated", "wood", (Piece("piece", shape),), **fields)


FLOOR = Body("floor", "fixed", "wood", (Piece("slab", Box((4.0, 3.0, 0.1)), position=(0.0, 0.0, -0.1)),))


def finger(**fields) -> Scenario:
    """A palm without shape and one link on a hinge, still under gravity unless told otherwise."""
    half, mass = (0.03, 0.01, 0.01), 0.02
    palm = Body("palm", "driven", "wood", (), mass=0.38, inertia=box_inertia(0.38, (0.04, 0.04, 0.01)))
    middle, inertia = (0.03, 0.0, 0.0), box_inertia(mass, half)
    piece = Piece("link", Box(half), position=middle)
    link = Body("link", "driven", "wood", (piece,), mass=mass, center_of_mass=middle, inertia=inertia)
    turned = (np.cos(0.35), 0.0, 0.0, np.sin(0.35))
    hinge = sc.Joint("hinge", "palm", "link", (0.04, 0.0, 0.0), (-np.sin(0.7), np.cos(0.7), 0.0), turned)
    rest = {"positions": ((0.0, 0.0, 1.0),) * 2, "orientations": (TURN,) * 2, "angles": ((0.4,),) * 2}
    tracker = sc.Tracker("palm", ("hinge",), (0.0, 0.5), **(rest | fields))
    return scene(FLOOR, palm, link, joints=(hinge,), trackers=(tracker,), duration=0.5)


def play(world: World, scenario: Scenario, steps: int) -> list[State]:
    """The states after each of some steps, the initial one first."""
    states = [State(scenario)]
    world.read(states[0])
    for step in range(steps):
        world.drive(step)
        world.step()
        states.append(State(scenario))
        world.read(states[-1])
    return states


@pytest.mark.parametrize("lower_is_free", [True, False])
@pytest.mark.parametrize(
    ("lower", "upper"),
    [("sphere", "box"), ("box", "sphere"), ("hull", "sphere"), ("box", "hull"), ("ellipsoid", "box")],
)
def test_contact_goes_from_a_to_b(lower: str, upper: str, lower_is_free: bool) -> None:
    """Report normal, distance, point and impulse from A to B, whatever the order of the shapes."""
    overlap = 1e-3
    bodies = (free("a", SHAPES[lower], 0.0), free("b", SHAPES[upper], 2 * R - overlap))
    fixed = bodies[1 if lower_is_free else 0]
    scenario = scene(
        *(replace(body, kind="fixed") if body is fixed else body for body in bodies), effects=("restitution",)
    )
    states = play(ENGINE.build(scenario, SETTINGS), scenario, 1)
    assert states[0].contact_count == 0 < states[1].contact_count
    contact = states[1].contacts[0]
    assert (contact["body_a"], contact["body_b"]) == (0, 1)
    np.testing.assert_allclose(contact["normal"], (0, 0, 1), atol=SIDEWAYS / R)
    assert contact["distance"] == pytest.approx(-overlap, abs=DEPTH)
    np.testing.assert_allclose(contact["position"], (0, 0, R - overlap / 2), atol=SIDEWAYS)
    assert contact["impulse"][2] > 0
    moved = states[1].linear_velocity[0 if lower_is_free else 1][2]
    impulse = states[1].contacts["impulse"][: states[1].contact_count].sum(axis=0)[2]
    assert moved == pytest.approx(-impulse if lower_is_free else impulse, rel=1e-9)


def test_mass_properties_are_ours() -> None:
    """Read back mass, centre of mass and the full inertia tensor as the scenario gives them."""
    body = free("odd", SHAPES["hull"], 1.0, mass=0.7, center_of_mass=CENTER, inertia=FULL_INERTIA)
    facts = ENGINE.build(scene(FLOOR, body), SETTINGS).describe().bodies
    assert facts["odd"].mass == pytest.approx(0.7, rel=1e-12)
    np.testing.assert_allclose(facts["odd"].center_of_mass, body.center_of_mass, rtol=1e-12)
    # MuJoCo keeps principal moments and axes: one eigenvalue decomposition
    np.testing.assert_allclose(facts["odd"].inertia, FULL_INERTIA, rtol=0, atol=1e-9 * 5e-3)


def test_hull_keeps_its_vertices() -> None:
    """Keep all 42 vertices of a hull and place them to single precision."""
    world = ENGINE.build(scene(FLOOR, free("hull", SHAPES["hull"], 1.0)), SETTINGS)
    model = world._model
    assert model.mesh_graph[model.mesh_graphadr[0]] == 42
    axes, geom = np.zeros(9), model.ngeom - 1
    mujoco.mju_quat2Mat(axes, model.geom_quat[geom])
    placed = model.mesh_vert @ axes.reshape(3, 3).T + model.geom_pos[geom]
    nearest = np.linalg.norm(placed[None] - np.array(elliptic_hull((R, R, R)))[:, None], axis=2).min(axis=1)
    assert nearest.max() < R * np.finfo(np.float32).eps


@pytest.mark.parametrize(("e", "mu"), [(0.0, 0.0), (0.2, 0.3), (0.5, 1.0), (1.0, 0.1)])
def test_pair_coefficients_read_back(e: float, mu: float) -> None:
    """Read back restitution and friction of a pair from the compiled model."""
    scenario = scene(FLOOR, free("ball", SHAPES["sphere"], 1.0), e=e, mu=mu)
    (pair,) = ENGINE.build(scenario, SETTINGS).describe().pairs
    assert (pair.body_a, pair.body_b) == ("floor", "ball")
    assert (pair.restitution, pair.friction) == pytest.approx((e, mu), abs=1e-12)


@pytest.mark.parametrize("dt", [1 / 540, 1 / 240, 1 / 60])
def test_contact_springs_stay_resolved(dt: float) -> None:
    """Keep every bounce's frequency below the profile's, and e = 0 in MuJoCo's own form."""
    settings = Settings("recommended", dt)
    for e in np.linspace(0.1, 1, 10):
        solref = np.array(solref_of(float(e), settings))
        assert np.sqrt(-solref[0]) <= TABLE.in_force("recommended", ())["bounce"] / dt * (1 + 1e-12)
        assert restitution_of(solref, settings) == pytest.approx(e, abs=1e-9)  # a root found to 1e-12
    assert solref_of(0.0, settings) == (REST_STEPS * dt, 1.0)
    assert solref_of(0.0, Settings("default", DT)) == pytest.approx((-2500, -100))
    assert restitution_of(np.array(solref_of(0.0, settings)), settings) == 0.0


ACCURATE = Settings("accurate", ENGINE.profiles["accurate"])


@pytest.mark.parametrize("zeta", [0.05, 0.3, 0.7, 0.9, 1.0, 1.5, 3.0])
def test_a_spring_that_may_not_pull(zeta: float) -> None:
    """Let go when the force turns: the closed form is what an integrated damped spring leaves."""

    def force(t: float, state: np.ndarray) -> float:
        return -state[0] - 2 * zeta * state[1]

    # it starts at the surface, moving in, where damping alone holds it: the force turns later
    force.terminal, force.direction = True, -1  # type: ignore[attr-defined]
    start, span = (0.0, -1.0), (0.0, 100.0)
    contact = solve_ivp(lambda t, s: (s[1], force(t, s)), span, start, events=force, rtol=1e-11, atol=1e-13)
    assert releasing_restitution(zeta) == pytest.approx(contact.y[1, -1], abs=1e-8)
    assert releasing_ratio(releasing_restitution(zeta)) == pytest.approx(zeta, abs=1e-7)


def test_the_ends_of_the_closed_form() -> None:
    """Return everything undamped, exp(-2) at critical damping, and ever less beyond."""
    assert releasing_restitution(0.0) == pytest.approx(1.0, abs=1e-15)
    assert releasing_restitution(1.0) == np.exp(-2)
    for side in (1 - 1e-9, 1 + 1e-9):
        assert releasing_restitution(side) == pytest.approx(np.exp(-2), abs=1e-8)
    assert releasing_ratio(1.0) == 0.0
    assert releasing_ratio(np.exp(-2)) == pytest.approx(1.0, abs=1e-7)
    falling = [releasing_restitution(zeta) for zeta in np.linspace(0, 5, 51)]
    assert (np.diff(falling) < 0).all()


@pytest.mark.parametrize("e", [0.05, 0.3, 1.0])
def test_accurate_steps_are_the_springs(e: float) -> None:
    """Step semi-implicitly through the samples of a damped spring of the wanted frequency."""
    dt, zeta = ACCURATE.dt, releasing_ratio(e)
    stiffness, damping = np.negative(solref_of(e, ACCURATE))
    x, v, samples = 1.0, 0.0, []
    for _ in range(20):
        v -= dt * (stiffness * x + damping * v)
        x += dt * v
        samples.append(x)
    roots = TABLE.in_force("accurate", ())["bounce"] * (
        -zeta + np.sqrt(complex(zeta * zeta - 1)) * np.array((1, -1))
    )
    basis = np.exp(np.outer(np.arange(1, 21), roots))
    fit = np.linalg.lstsq(basis, np.array(samples, complex), rcond=None)[0]
    np.testing.assert_allclose((basis @ fit).real, samples, atol=1e-10)


@pytest.mark.parametrize("dt", [ACCURATE.dt, 1 / 240, 1 / 60])
def test_accurate_restitutions_read_back(dt: float) -> None:
    """Find the restitution again in the stiffness and damping, on both sides of critical damping."""
    settings = Settings("accurate", dt)
    for e in (0.0, 0.05, 0.1, np.exp(-2), 0.2, 0.5, 0.9, 1.0):
        reported = restitution_of(np.array(solref_of(e, settings)), settings)
        assert reported == pytest.approx(e, abs=1e-9)  # a root found to 1e-12


def test_accurate_contacts_are_told_as_meant() -> None:
    """Read the elliptic cone, friction's own damping and a constant impedance off the compiled model."""
    scenario = scene(FLOOR, free("ball", SHAPES["sphere"], 1.0), e=0.4, mu=0.2)
    manifest = ENGINE.build(scenario, ACCURATE).describe()
    facts = manifest.settings
    assert (facts["cone"], facts["impratio"]) == ("mjCONE_ELLIPTIC", 10.0)
    assert facts["pair_solreffriction"] == "[[-1.0, -100.0]]"
    assert facts["pair_solimp"].startswith("[[0.95, 0.95,")
    assert (manifest.pairs[0].restitution, manifest.pairs[0].friction) == pytest.approx((0.4, 0.2), abs=1e-9)


@pytest.mark.parametrize("e", [0.3, 0.5, 0.8, 1.0])
def test_ball_bounces(e: float) -> None:
    """Bounce a ball of 2 m/s with its coefficient, on average over the phases of a step; a bounce takes only
    some eight steps, over which a single one spreads."""
    found = []
    for phase in np.linspace(0, 0.9, 10):
        ball = free("ball", SHAPES["sphere"], R + (1 + phase) * 2 * DT, linear_velocity=(0.0, 0.0, -2.0))
        scenario = scene(FLOOR, ball, e=e, gravity=(0.0, 0.0, 0.0))
        states = play(ENGINE.build(scenario, SETTINGS), scenario, 40)
        found.append(states[-1].linear_velocity[1, 2] / 2)
    assert np.mean(found) == pytest.approx(e, abs=0.015)


def test_settings_are_neutral() -> None:
    """Switch off autoreset, sleep and damping and say so from the compiled model; write no log file."""
    facts = ENGINE.build(scene(FLOOR, free("ball", SHAPES["sphere"], 1.0)), SETTINGS).describe().settings
    assert facts["autoreset"] is facts["sleep"] is False
    assert facts["dof_damping_max"] == facts["pair_margin_max"] == 0.0
    assert (facts["integrator"], facts["cone"]) == ("mjINT_IMPLICITFAST", "mjCONE_ELLIPTIC")
    assert not mujoco.MjLogConfig.get().logto_file


def test_free_fall() -> None:
    """Fall as semi-implicit Euler does, from the pose and the velocities given."""
    motion = {"linear_velocity": (1.0, 2.0, 3.0), "angular_velocity": (0.0, 0.0, 2.0), "orientation": TURN}
    body = free("ball", SHAPES["sphere"], 5.0, **motion)
    scenario = scene(FLOOR, replace(body, center_of_mass=CENTER))
    first = play(ENGINE.build(scenario, SETTINGS), scenario, 0)[0]
    np.testing.assert_allclose(first.position[1], (0, 0, 5), atol=1e-15)
    np.testing.assert_allclose(first.orientation[1], TURN, atol=1e-15)
    velocities = [first.linear_velocity[1], first.angular_velocity[1]]
    np.testing.assert_allclose(velocities, [(1, 2, 3), (0, 0, 2)], atol=1e-14)
    t, scenario = 100 * DT, scene(FLOOR, body)
    last = play(ENGINE.build(scenario, SETTINGS), scenario, 100)[-1]
    np.testing.assert_allclose(last.linear_velocity[1], (1, 2, 3 - 9.81 * t), atol=1e-12)
    np.testing.assert_allclose(last.position[1], (t, 2 * t, 5 + 3 * t - 9.81 * t * (t + DT) / 2), atol=1e-12)
    np.testing.assert_allclose(last.angular_velocity[1], (0, 0, 2), atol=1e-12)


def test_driven_body_feels_no_gravity() -> None:
    """Hold a driven body still at a tracker that rests, gravity or not."""
    scenario = finger()
    states = play(ENGINE.build(scenario, SETTINGS), scenario, 200)
    # exact but for rounding: the compensation enters as a force at each centre of mass
    np.testing.assert_allclose(states[-1].position, states[0].position, atol=1e-12)
    assert states[-1].joint_angle == pytest.approx([0.4], abs=1e-12)


def test_driven_body_tracks() -> None:
    """Follow a tracker that moves, turns and bends, from the link poses of the shared kinematics."""
    moved = {"positions": ((0.0, 0.0, 1.0), (0.2, 0.1, 1.1)), "angles": ((0.4,), (1.0,))}
    scenario = finger(orientations=(TURN, (0.0, 0.0, 0.0, 1.0)), **moved)
    world = ENGINE.build(scenario, SETTINGS)
    states, drive = play(world, scenario, 270), world._drives[0]
    np.testing.assert_allclose(states[0].position[1:], drive.start_position, atol=1e-14)
    turned = np.abs((states[0].orientation[1:] * drive.start_orientation).sum(axis=1))
    np.testing.assert_allclose(turned, 1, atol=1e-14)
    # critically damped at 50 1/s or faster with speeds up to 0.8 m/s and fed forward: the lag is small
    np.testing.assert_allclose(states[-1].position[1], (0.2, 0.1, 1.1), atol=5e-3)
    assert states[-1].joint_angle == pytest.approx([1.0], abs=0.05)
    assert np.isfinite([*states[-1].hinge_torque, *states[-1].force[0], *states[-1].torque[0]]).all()


def test_impulses_balance_momentum() -> None:
    """Account for every change of a sliding and rolling ball's momentum by its contact impulses."""
    ball = free("ball", SHAPES["sphere"], R, linear_velocity=(2.0, 0.5, 0.0), mass=0.5)
    states = play(ENGINE.build(scene(FLOOR, ball), SETTINGS), scene(FLOOR, ball), 300)
    weight = 0.5 * np.array([0, 0, -9.81]) * DT
    for before, after in pairwise(states):
        impulse = after.contacts["impulse"][: after.contact_count].sum(axis=0)
        change = 0.5 * (after.linear_velocity[1] - before.linear_velocity[1])
        # MuJoCo's solver stops at a residual of 1e-8
        np.testing.assert_allclose(impulse, change - weight, atol=1e-6 * np.linalg.norm(weight))


def test_worlds_do_not_interfere() -> None:
    """Play a world the same to the bit alone, again, and interleaved with another."""
    first = scene(FLOOR, free("ball", SHAPES["sphere"], R, linear_velocity=(1.0, 0.0, 0.0)))
    alone = play(ENGINE.build(first, SETTINGS), first, 50)[-1]
    second = finger()
    a, b = ENGINE.build(first, SETTINGS), ENGINE.build(second, Settings("equal-step", 1 / 240))
    for _ in range(50):
        play(b, second, 1)
        both = play(a, first, 1)[-1]
    b.close()
    np.testing.assert_array_equal(alone.position, both.position)
    np.testing.assert_array_equal(alone.angular_velocity, both.angular_velocity)


def test_recording_has_stages_and_work() -> None:
    """Record a scene without trackers, with MuJoCo's own timers and counters."""
    recording = record(ENGINE, scene(FLOOR, free("ball", SHAPES["sphere"], R), duration=0.1), SETTINGS)
    assert recording.stage_names.tolist() == ["collision", "impulses", "integration"]
    assert recording.stage_seconds.sum() > 0
    assert recording.work[:, recording.work_names.tolist().index("contacts")].sum() > 0
    assert recording.facts["version"] == ENGINE.version() == mujoco.__version__


def test_unsupported_is_said() -> None:
    """Raise Unsupported for friction below MuJoCo's least, for an unknown shape and for a profile."""
    ball = free("ball", SHAPES["sphere"], 1.0)
    with pytest.raises(Unsupported, match=r"mujoco: .*floor-ball"):
        ENGINE.build(scene(FLOOR, ball, mu=1e-6), SETTINGS)
    spec = mujoco.MjSpec()
    with pytest.raises(Unsupported, match="mujoco: no shape"):
        add_piece(spec, spec.worldbody, Piece("odd", object()), "odd")  # type: ignore[arg-type]
    with pytest.raises(Unsupported, match=r"mujoco: restitution must be 0 or above 0.02.*floor-ball"):
        ENGINE.build(scene(FLOOR, ball, e=0.01), ACCURATE)
    with pytest.raises(Unsupported, match="valid: recommended, equal-step, default, accurate, sleeping"):
        ENGINE.build(scene(FLOOR, ball), Settings("paper", DT))


def test_default_is_as_it_comes() -> None:
    """Leave integrator and cone as MuJoCo comes with them under the profile `default`."""
    scenario, plain = scene(FLOOR, free("ball", SHAPES["sphere"], 1.0)), mujoco.MjSpec().option
    facts = ENGINE.build(scenario, Settings("default", DT)).describe().settings
    assert facts["integrator"] == mujoco.mjtIntegrator(plain.integrator).name
    assert facts["cone"] == mujoco.mjtCone(plain.cone).name
    assert (facts["tolerance"], facts["impratio"]) == (plain.tolerance, plain.impratio)
