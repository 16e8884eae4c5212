"""Every engine on every scene with a prescribed body or a belt: loads move by their closed forms."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.metrics.contacts.overlap import contact_gap, overlap_max
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import energy_drive, energy_rise
from touchstone.scenarios.avatar.tracking import keyframed, sample
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import (
    IDENTITY,
    Body,
    Box,
    Cylinder,
    PairCoefficients,
    Piece,
    Scenario,
    vector,
)
from touchstone.scenarios.solids import solid

FARTHEST = {
    "prescribed": {"reference": 2e-2, "dart": 1e-3, "bullet": 5e-3, "mujoco": 1e-2},
    # friction along two axes in DART, and loads that the stiff contacts of MuJoCo lift for a moment
    "belt": {"reference": 1e-9, "dart": 7e-2, "bullet": 5e-3, "mujoco": 2.5e-2},
}
"""Largest distance of a load from its closed form [m]: steps of first order, and soft friction in MuJoCo."""
SCENES = {tag: [scenario.name for scenario in tagged(tag)] for tag in FARTHEST}
DEEPEST = 5e-4
"""Depth to which a load may sink into its support [m]: soft contacts; 1e-6 m in the reference."""


@pytest.fixture
def loaded(registry):
    """What an engine makes of a scene; its loads are near their truths."""

    def play(tag: str, engine: str, scene: str) -> Context:
        try:
            context = Context(registry.played(scene, engine), catalogue()[scene])
        except Unsupported as reason:
            pytest.skip(str(reason))
        for body, truth in context.truths.items():
            away = np.linalg.norm(context.mass_centers[:, body] - truth.position, axis=1)
            assert away.max() < FARTHEST[tag][engine]
        return context

    return play


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scene", SCENES["belt"])
def test_loads_on_belts(loaded, engine, scene):
    """Loads slide at mu g against the slip, then move with the belt, which pays for it."""
    context = loaded("belt", engine, scene)
    # the belt's impulse on a load that ends with its velocity is known, and so is the work
    speeds = [body.linear_velocity for body in context.scenario.bodies[1:]]
    gained = sum((1.0, 0.0, 0.0) @ -np.array(speed) + 1.0 for speed in speeds)
    if scene != "belt_ramp":
        assert energy_drive(context)["belt"] == pytest.approx(gained, rel=1e-3)
    # a load that moves with the belt counts as one at rest on it
    assert contact_gap(context).keys() == {f"belt-{body.name}" for body in context.scenario.bodies[1:]}
    if engine == "reference":
        assert max(map(abs, contact_gap(context).values())) < 1e-6
        assert max(rise.max() for rise in energy_rise(context).values()) < 1e-9


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scene", SCENES["prescribed"])
def test_loads_on_prescribed_bodies(loaded, engine, scene):
    """The load stays near its truth and on its support."""
    context = loaded("prescribed", engine, scene)
    if engine == "reference":
        return
    recording, scenario = context.recording, context.scenario
    tracker = scenario.trackers[0]
    support = recording.position[:, scenario.body_index(tracker.root)]
    assert np.abs(support - sample(tracker, recording.time).position).max() < 1e-9
    assert overlap_max(context)[""] < DEEPEST
    # a load that sticks moves with its support, and its gap counts as that of a body at rest
    if scene in ("platform_lift", "platform_stick", "shaker_along"):
        ((pair, gap),) = contact_gap(context).items()
        assert (pair, abs(gap) < DEEPEST) == ("platform-load", True)


@pytest.mark.parametrize(
    ("shape", "axis", "angle"),
    [
        *((shape, (0.0, 0.0, 1.0), lambda t: 3.0 * t) for shape in ("box", "cylinder")),
        *((shape, (0.0, 0.0, 1.0), lambda t: 0.8 * t * t) for shape in ("box", "cylinder")),
        ("box", (0.0, 1.0, 0.0), lambda t: 0.25 * (1 - np.cos(5 * t))),
    ],
)
def test_what_sticks_to_a_turning_body_turns_with_it(shape, axis, angle):
    """A load on a table that turns, starts to turn or swings stays where it is on it: levers that left their
    arcs along the tangent moved it forward by omega^3 r h^2 / 6 in a second, 1 mm."""
    times = np.arange(0.0, 1.2, 1 / 120)
    turns = [quaternion(Rotation.from_rotvec(np.multiply(axis, angle(t)))) for t in times]
    tracker = keyframed("table", times, np.zeros((len(times), 3)), turns)
    table = Body("table", "prescribed", "wood", (Piece("table", Box((1.0, 1.0, 0.05))),))
    place = np.array((0.5, 0.0, 0.07))
    spin = np.multiply(axis, (angle(1e-6) - angle(0.0)) / 1e-6)
    form = Box((0.03, 0.03, 0.02)) if shape == "box" else Cylinder(0.03, 0.02)
    body = solid(
        "load", "wood", form, 1.0, vector(place), IDENTITY, vector(np.cross(spin, place)), vector(spin)
    )
    pair = PairCoefficients("wood", "wood", 0.0, 3.0)
    scene = Scenario("test", "", (), (table, body), 1.0, (pair,), trackers=(tracker,))
    played = record(load("reference"), scene, Settings("balanced", 1 / 60))
    turned = Rotation.from_quat(played.orientation[:, 0], scalar_first=True)
    held = turned.inv().apply(played.position[:, 1])
    # it slides until the table has its speed
    assert np.abs(held[6:] - held[6]).max() < 1e-8
    assert np.abs(held[6] - place).max() < 1e-5


GRAVITY, STATIC, SLIDING = 9.81, 0.4, 0.2
PLACE = np.array((0.4, 0.0, 0.07))
"""Centre of a load of half height 0.02 on a plate of half height 0.05, about whose centre that turns."""


def ridden(axis: tuple[float, float, float], angle, until: float, rate: int) -> tuple:
    """Times, and centres of a load, in the axes of a plate that turns about its centre by `angle(t)`."""
    times, duration = np.arange(0.0, until + 0.1, 1 / 480), np.ceil(until * rate) / rate
    turns = [quaternion(Rotation.from_rotvec(np.multiply(axis, angle(t)))) for t in times]
    tracker = keyframed("plate", times, np.zeros((len(times), 3)), turns)
    plate = Body("plate", "prescribed", "wood", (Piece("plate", Box((2.0, 2.0, 0.05))),))
    rider = solid("load", "wood", Box((0.03, 0.03, 0.02)), 1.0, vector(PLACE))
    pair = PairCoefficients("wood", "wood", 0.0, SLIDING, static_friction=STATIC)
    scene = Scenario("test", "", (), (plate, rider), duration, (pair,), trackers=(tracker,), frame_rate=rate)
    played = record(load("reference"), scene, Settings("balanced", 1 / rate))
    turned = Rotation.from_quat(played.orientation[:, 0], scalar_first=True)
    return played.time, turned.inv().apply(played.position[:, 1])


@pytest.mark.parametrize("rate", [60, 75, 90])
def test_a_grip_on_a_turntable_holds_to_its_static_limit(rate):
    """On a table of w = t^2 a load stays until (w^4 + w'^2) r^2 = (mu_s g)^2: a slip of some 1e-6 m/s is the
    error of its prediction, and no sliding."""
    limit = brentq(lambda t: PLACE[0] * np.hypot(t**4, 2 * t) - STATIC * GRAVITY, 0.1, 3.0)
    times, centers = ridden((0.0, 0.0, 1.0), lambda t: t**3 / 3, limit + 0.1, rate)
    moved = np.linalg.norm(centers - PLACE, axis=1)
    assert moved[times < limit].max() < 1e-6
    assert moved[times > limit + 1.5 / rate].min() > 1e-5


@pytest.mark.parametrize("rate", [60, 120])
def test_a_grip_on_a_plate_that_tilts_ends_where_it_must(rate):
    """The force until a substep, and that over it, tell the onset as seen from the normal, which turns."""

    def forces(t: float, s: float, speed: float) -> tuple[float, float]:
        """Acceleration along the plate without friction, and normal force of 1 kg."""
        angle, turn, gain, z = 0.4 * t * t, 0.8 * t, 0.8, PLACE[2]
        along = GRAVITY * np.sin(angle) - gain * z + turn * turn * s
        return along, GRAVITY * np.cos(angle) - 2 * turn * speed - turn * turn * z - gain * s

    def margin(t: float) -> float:
        along, normal = forces(t, PLACE[0], 0.0)
        return STATIC * normal - along

    def slide(t: float, state: np.ndarray) -> tuple[float, float]:
        along, normal = forces(t, *state)
        return state[1], along - SLIDING * normal

    onset = brentq(margin, 0.1, 2.0)
    times, centers = ridden((0.0, 1.0, 0.0), lambda t: 0.4 * t * t, onset + 0.25, rate)
    truth = solve_ivp(slide, (onset, times[-1]), (PLACE[0], 0.0), rtol=1e-10, atol=1e-12).y[0, -1]
    assert np.abs(centers[times < onset] - PLACE).max() < 1e-5
    assert abs(centers[-1, 0] - truth) < 2e-5 * (60 / rate) ** 2
