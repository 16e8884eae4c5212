"""The DART adapter: conventions, masses, coefficients, drive, impulses; and DART's faults it steers round."""

import dataclasses

import engine_states
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings, State, Unsupported
from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Hull,
    PairCoefficients,
    Piece,
    Scenario,
    Shape,
    Sphere,
    Tracker,
)
from touchstone.scenarios.solids import elliptic_hull, sphere_inertia

pytest.importorskip("dartpy", reason="dartpy is not installed")
from touchstone.adapters.engines.dart import engine as dart_engine

DT = dart_engine.DartEngine.profiles["recommended"]
SETTINGS = Settings("recommended", DT)
RADIUS, MASS, OVERLAP = 0.02, 0.02, 1e-4
HALF_AXES = (0.024, 0.008, 0.008)


def turn(*vector: float) -> tuple[float, ...]:
    """The quaternion of a rotation vector [rad]."""
    return tuple(Rotation.from_rotvec(vector).as_quat(scalar_first=True).tolist())


TILTED = turn(0.3, -0.5, 0.8)


def solid(name: str, shape, position, kind="simulated", **state) -> Body:
    """A body of one piece with the mass of the ball."""
    inertia = sphere_inertia(MASS, RADIUS)
    return Body(name, kind, "wood", (Piece(name, shape),), MASS, (0.0, 0.0, 0.0), inertia, position, **state)


FLOOR = solid("floor", Box((1.0, 1.0, 0.1)), (0.0, 0.0, -0.1), kind="fixed")
BALL = solid("ball", Sphere(RADIUS), (0.0, 0.0, RADIUS - OVERLAP))
HULL = Hull(elliptic_hull(HALF_AXES))


def scene(*bodies: Body, coefficients=TABLE_1, duration=1.0, **more) -> Scenario:
    """A scenario of these bodies."""
    return Scenario("test", "a test", (), bodies=bodies, coefficients=coefficients, duration=duration, **more)


def last(scenario: Scenario, steps: int) -> State:
    """The state after so many steps."""
    return engine_states.last(dart_engine.DartEngine(), scenario, SETTINGS, steps)


def tip(height: float) -> Body:
    """A hull whose lowest vertex, one of its poles, stands at a height."""
    return solid("hull", HULL, (0.0, 0.0, height + HALF_AXES[0]), orientation=turn(0.0, np.pi / 2, 0.0))


def hand_scene(*others: Body) -> Scenario:
    """The hand, whose palm moves by 5 cm while its fingers bend in a tenth of a second, and others."""
    links, joints = hand_parts()
    keys = 11
    glove = Tracker(
        "palm",
        tuple(joint.name for joint in joints),
        times=tuple(np.linspace(0.0, 1.0, keys).tolist()),
        positions=((0.0, 0.0, 1.0),) + ((0.05, 0.0, 1.0),) * (keys - 1),
        orientations=(TILTED,) * keys,
        angles=((0.2,) * len(joints),) + ((0.5,) * len(joints),) * (keys - 1),
    )
    return scene(*links, *others, joints=joints, trackers=(glove,))


def test_settings() -> None:
    """Read back that sleeping and damping are off, limits on, and which detector was chosen."""
    # the engine's own servo is a damper on every hinge
    plain = dataclasses.replace(SETTINGS, profile="default", drive="torque")
    worlds = [dart_engine.DartEngine().build(s, plain) for s in (hand_scene(), hand_scene(BALL))]
    wanted = {"deactivation": False, "joint_damping": 0.0, "driven_feel_gravity": False, "hinge_limits": 15}
    for world, detector in zip(worlds, ("fcl", "bullet")):
        reported = world.describe().settings
        assert {name: reported[name] for name in wanted} == wanted
        assert reported["detector"] == detector


@pytest.mark.parametrize(
    ("shape", "detectors", "reason"),
    [
        (Box((0.1, 0.1, 0.1)), ("dart", "bullet", "fcl"), "only spheres and boxes meet"),
        (Cylinder(0.1, 0.1), ("ode", "ode", "fcl"), "only primitives meet"),
        (Cone(0.1, 0.2), ("bullet", "bullet", "fcl"), "only primitives meet"),
    ],
)
def test_primitives_take_the_advised_detector(shape: Shape, detectors: tuple[str, ...], reason: str) -> None:
    """Use the detector that suits the shapes that meet, but under `default` FCL, and say why."""
    scenario = scene(FLOOR, solid("one", shape, (0.0, 0.0, 1.0)))
    reported = {
        profile: dart_engine.DartEngine().build(scenario, Settings(profile, DT)).describe().settings
        for profile in ("recommended", "accurate", "default")
    }
    assert tuple(reported[profile]["detector"] for profile in reported) == detectors
    assert reported["recommended"]["detector_reason"].startswith(reason)


def test_accurate_solver() -> None:
    """Read back that the accurate profile has the solver with the circular cone, the others DART's own."""
    for profile, solver, cone in (
        ("recommended", "DantzigBoxedLcpSolver", "two directions"),
        ("accurate", "NsgsFrictionSolver", "circular"),
    ):
        reported = (
            dart_engine.DartEngine().build(scene(FLOOR, BALL), Settings(profile, DT)).describe().settings
        )
        assert reported["lcp_solver"] == solver
        assert reported["friction_cone"].startswith(cone)


def test_unsupported() -> None:
    """Refuse coefficients, shapes and profiles that DART cannot represent, saying which."""
    engine = dart_engine.DartEngine()
    # both balls need .4 against the metal one, and then have it against each other
    rough = (PairCoefficients("wood", "wood", 0.3, 0.1), PairCoefficients("wood", "metal", 0.3, 0.4))
    others = (dataclasses.replace(BALL, name="other"), dataclasses.replace(BALL, name="m", material="metal"))
    with pytest.raises(Unsupported, match="dart: no friction per body gives the pairs ball-other"):
        engine.build(scene(BALL, *others, coefficients=rough), SETTINGS)
    egg = solid("egg", Ellipsoid(HALF_AXES), (0.0, 0.0, 1.0))
    with pytest.raises(Unsupported, match="dart: spheres meet hulls, and no detector has"):
        engine.build(scene(BALL, tip(0.0), egg), SETTINGS)
    slippery = (PairCoefficients("wood", "wood", 0.3, 1e-3),)
    with pytest.raises(Unsupported, match=r"dart: friction must be 0 or above 0.001.*floor-ball"):
        engine.build(scene(FLOOR, BALL, coefficients=slippery), SETTINGS)
    with pytest.raises(Unsupported, match="dart: no profile 'paper'; valid: recommended, equal-step"):
        engine.build(scene(BALL), Settings("paper", DT))


def test_fault_of_fcl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stop a ball on a hull; notice when FCL, DART's default, no longer lets it through."""
    ball = dataclasses.replace(BALL, position=(0.0, 0.0, HALF_AXES[2] + RADIUS + 0.01))
    scenario = scene(solid("hull", HULL, (0.0, 0.0, 0.0), kind="fixed"), ball)
    assert last(scenario, 200).position[1, 2] > HALF_AXES[2] + RADIUS - 1e-3
    fcl = dart_engine.dartpy.collision.FCLCollisionDetector
    monkeypatch.setattr(dart_engine, "detector_of", lambda scenario, profile: fcl())
    assert last(scenario, 200).position[1, 2] < 0


def test_fault_of_fcl_with_capsules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rest a capsule on its side; notice when DART no longer hands FCL a ball of 10 cm in its place."""
    lying = {"orientation": turn(0.0, np.pi / 2, 0.0)}
    low, high = (
        scene(FLOOR, solid("pill", Capsule(RADIUS, 0.2), (0.0, 0.0, z), **lying))
        for z in (RADIUS + 1e-3, 0.05 - OVERLAP)
    )
    assert last(low, 200).position[1, 2] == pytest.approx(RADIUS, abs=1e-4)
    fcl = dart_engine.dartpy.collision.FCLCollisionDetector
    monkeypatch.setattr(dart_engine, "detector_of", lambda scenario, profile: fcl())
    state = last(high, 1)
    assert state.contacts[: state.contact_count]["distance"].min() == pytest.approx(-OVERLAP, abs=1e-6)


def test_fault_of_bullet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Touch an ellipsoid where it is; notice when Bullet's detector no longer makes it 1 cm larger."""
    scenario = scene(FLOOR, solid("egg", Ellipsoid(HALF_AXES), (0.0, 0.0, HALF_AXES[2] - OVERLAP)))
    # FCL's iterative depth of ellipsoids: within 1e-6 m
    assert last(scenario, 1).contacts[0]["distance"] == pytest.approx(-OVERLAP, abs=1e-6)
    bullet = dart_engine.dartpy.collision.BulletCollisionDetector
    monkeypatch.setattr(dart_engine, "detector_of", lambda scenario, profile: bullet())
    state = last(scenario, 1)
    assert state.contacts[: state.contact_count]["distance"].min() == pytest.approx(-0.01 - OVERLAP, abs=1e-6)
