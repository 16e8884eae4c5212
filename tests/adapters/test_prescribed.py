"""Prescribed bodies in every engine: exact poses under any load, and no part in the coupling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings, State, Unsupported
from touchstone.adapters.posed_drive import Posed, coupled
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import profiles_of
from touchstone.scenarios.avatar.tracking import keyframed, sample
from touchstone.scenarios.scenario import Body, Box, Joint, Piece, Scenario, Tracker
from touchstone.scenarios.solids import block, box_inertia

DT = 1 / 240
DYNAMIC = ("mujoco", "bullet", "dart")
PATH_ERROR = 1e-9
"""Distance of a prescribed body from its keyframes' splines [m]: rounding."""
TOP = 0.05
"""Half the height of the platform [m]."""
FRAMES = np.arange(91) / 60
"""Keyframes; they end after the scene, so that its path does not slow down."""


def deck(**fields: object) -> Body:
    """A prescribed platform whose origin is its centre."""
    return Body("deck", "prescribed", "wood", (Piece("deck", Box((2.0, 1.0, TOP))),), **fields)


def path(places: np.ndarray, turns: Rotation | None = None) -> Tracker:
    """Tracker of the platform through places (91, 3) [m], and rotations."""
    turned = (turns or Rotation.identity(91)).as_quat(scalar_first=True)
    return keyframed("deck", FRAMES, places, turned, interpolation="pchip")


def accelerated(x: float, z: float = 0.0) -> Tracker:
    """Path of constant acceleration [m/s^2] from rest."""
    return path(np.outer(FRAMES**2 / 2, (x, 0.0, z)))


def loaded(lab, tracker: Tracker, mass: float = 1.0, **fields: object) -> Scenario:
    """A box at rest on the platform, mu = 0.5."""
    box = block("box", "wood", (0.1, 0.1, 0.05), mass, (0.0, 0.0, TOP + 0.05))
    return lab.scene(deck(**fields), box, mu=0.5, trackers=(tracker,))


def settings(name: str, drive: str = "native") -> Settings:
    """An engine's settings at its own step."""
    profile, dt = next(iter(profiles_of(name).items()))
    return Settings(profile, dt, drive=drive)


def wandering() -> Tracker:
    """A path along a curve, turning about changing axes."""
    angles = np.outer(FRAMES**2, (0.7, -0.4, 1.1))
    places = np.stack([np.sin(3 * FRAMES) - 3 * FRAMES, FRAMES**2, 1 - np.cos(4 * FRAMES)], axis=1)
    return path(places, Rotation.from_rotvec(angles))


@pytest.mark.engines
@pytest.mark.parametrize("drive", ["native", "posed"])
@pytest.mark.parametrize("name", [*DYNAMIC, "reference"])
def test_a_prescribed_body_is_where_its_keyframes_are(registry, lab, name, drive):
    """Poses and velocities of every frame are the splines', also with a centre of mass off the origin."""
    arm, tracker = (0.3, 0.1, 0.0), wandering()
    scene = lab.scene(deck(center_of_mass=arm), trackers=(tracker,))
    seen, at = record(registry.engine(name), scene, settings(name, drive=drive)), sample(tracker, FRAMES[:61])
    turned = Rotation.from_quat(at.orientation, scalar_first=True)
    velocity = at.linear_velocity + np.cross(at.angular_velocity, turned.apply(arm))
    assert np.abs(seen.position[:, 0] - at.position).max() < PATH_ERROR
    assert np.abs(1 - np.abs(np.einsum("fi,fi->f", seen.orientation[:, 0], at.orientation))).max() < 1e-12
    assert np.abs(seen.linear_velocity[:, 0] - velocity).max() < PATH_ERROR
    assert np.abs(seen.angular_velocity[:, 0] - at.angular_velocity).max() < PATH_ERROR
    assert np.isnan(seen.driver_impulse[-1]).all()


@pytest.mark.engines
@pytest.mark.parametrize("mass", [0.01, 100.0])
@pytest.mark.parametrize("name", DYNAMIC)
def test_no_load_moves_a_prescribed_body(registry, lab, name, mass):
    """Loads of 0.01 and 100 kg follow equally well."""
    seen = record(registry.engine(name), loaded(lab, accelerated(2.0, 1.0), mass), settings(name))
    away = seen.position[:, 1] - seen.position[:, 0] - (0.0, 0.0, TOP + 0.05)
    assert np.abs(away).max() < 1e-3


@pytest.mark.engines
@pytest.mark.parametrize("name", DYNAMIC)
def test_driven_bodies_keep_their_coupling(registry, lab, name):
    """Beside a prescribed body, whose tracker comes first, a driven one moves and is reported as without."""
    half, middle = (0.05, 0.01, 0.01), (0.05, 0.0, 0.0)
    palm = Body("palm", "driven", "wood", (), mass=2.0, inertia=box_inertia(2.0, (0.1, 0.1, 0.1)))
    piece = (Piece("link", Box(half), middle),)
    inertia = box_inertia(0.1, half)
    link = Body("link", "driven", "wood", piece, mass=0.1, center_of_mass=middle, inertia=inertia)
    hinge = Joint("hinge", "palm", "link", (0.1, 0.0, 0.0), (0.0, 1.0, 0.0))
    places, upright = ((0.0, 0.0, 1.0), (0.1, 0.0, 1.0)), ((1.0, 0.0, 0.0, 0.0),) * 2
    hand = Tracker("palm", ("hinge",), (0.0, 1.0), places, upright, ((0.0,), (0.5,)))
    plain = lab.scene(palm, link, joints=(hinge,), trackers=(hand,))
    both = replace(plain, bodies=(deck(), palm, link), trackers=(accelerated(1.0), hand))
    worlds = [registry.engine(name).build(scene, Settings("equal-step", DT)) for scene in (plain, both)]
    states = [State(scene) for scene in (plain, both)]
    for step in range(60):
        for world, state in zip(worlds, states):
            world.drive(step)
            world.step()
            world.read(state)
    alone, beside = states
    for field in ("position", "linear_velocity", "angular_velocity"):
        assert getattr(beside, field)[1:] == pytest.approx(getattr(alone, field), abs=1e-9), field
    assert beside.joint_angle == pytest.approx(alone.joint_angle, abs=1e-9)
    assert np.isnan(beside.force[0]).all()
    assert beside.force[1] == pytest.approx(alone.force[0], abs=1e-6)
    assert beside.hinge_torque == pytest.approx(alone.hinge_torque, abs=1e-6)
    first, second = (world.describe() for world in worlds)
    assert (second.freedom, set(second.drives), second.limits) == (first.freedom, {"palm"}, first.limits)
    for world in worlds:
        world.close()


def test_paces_lead_from_pose_to_pose(lab):
    """The mean velocity of each step is that of the poses around it; the first is the tracker's own."""
    tracker = wandering()
    scene = lab.scene(deck(), trackers=(tracker,))
    posed, at = Posed(scene, tracker, DT), sample(tracker, np.arange(241) * DT)
    assert coupled(scene, Settings("balanced", DT)) == []
    assert posed.pace(0)[1] == pytest.approx(at.angular_velocity[0], abs=1e-15)
    for step in (1, 17, 240, 241):
        velocity, omega = posed.pace(step)
        before, after = min(step, 240) - 1, min(step, 240)
        assert velocity == pytest.approx((at.position[after] - at.position[before]) / DT, abs=1e-12)
        turned = Rotation.from_quat(at.orientation[[before, after]], scalar_first=True)
        assert omega == pytest.approx((turned[1] * turned[0].inv()).as_rotvec() / DT, abs=1e-9)


def test_who_cannot_play_them_says_so(registry, lab):
    """Profile `paper` has no prescribed bodies."""
    with pytest.raises(Unsupported, match="no prescribed bodies"):
        registry.engine("reference").build(loaded(lab, accelerated(1.0)), Settings("paper", 1 / 60))
