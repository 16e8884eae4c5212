"""Published values against integrations of our own, which use contact laws and no published formula."""

from __future__ import annotations

import re
from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import GRAVITY, Scenario, ScenarioError, Sphere
from touchstone.scenarios.transforms import mirrored
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.published import Published

ROWS = [(scene.name, one.name) for scene in catalogue().values() for one in scene.published]
INTEGRATED = ("ramps", "balls_on_ramps", "slip", "oblique_impacts", "cradle")
"""Scenes whose own truth is the published formula: their values are integrated here."""
SMOOTH = 1e-6
"""Slip below which the friction of an integration is smooth [m/s]: it stops a millimetre a second creep."""


def row(scene: str, name: str) -> tuple[Scenario, Published]:
    """A scene and one of its published values."""
    return catalogue()[scene], next(one for one in catalogue()[scene].published if one.name == name)


def frames(scenario: Scenario) -> np.ndarray:
    """Times of the displayed frames."""
    return np.arange(scenario.frame_count + 1) / scenario.frame_rate


def test_values_have_sources() -> None:
    """At least 30 values, each with author and year, in the scenes of the tag and in no others."""
    assert len(ROWS) >= 30
    assert {scene for scene, _ in ROWS} == {scene.name for scene in tagged("literature")}
    for scene in tagged("literature"):
        for one in scene.published:
            assert re.match(r"[\w&., é]+ \(1[6-9]\d\d\)|[\w&., é]+ \(20\d\d\)", one.source), one.source


def moves(scenario: Scenario, name: str, times: np.ndarray) -> Motion | None:
    """Motion of a body by the truth of its scene, or by its tracker; None without."""
    for tracker in scenario.trackers:
        if tracker.root == name:
            at = sample(tracker, times)
            return Motion(at.position, at.linear_velocity, at.orientation, at.angular_velocity)
    found = [truth for truth in scenario.truths if truth.body == name]
    return motion(scenario, found[0], times) if found else None


@pytest.mark.parametrize(
    ("scene", "name"), [(s, n) for s, n in ROWS if s not in ("grip", "sliding_rings", "painleve_mu15")]
)
def test_truths_have_published_values(scene: str, name: str) -> None:
    """The truth of a scene, measured as an engine is, has the published value within its tolerance."""
    scenario, one = row(scene, name)
    times = frames(scenario)
    ours, other = moves(scenario, one.body, times), moves(scenario, one.other, times)
    assert ours is not None
    assert one.measured(times, ours, other) == pytest.approx(one.value, abs=one.tolerance)


def slid(pull: float, friction: float, radius: float, share: float, start: float, end: float) -> np.ndarray:
    """Way, speed and spin of a body with smooth Coulomb friction, integrated.

    `pull` and `friction` [m/s^2]; `share`: moment of inertia over m r^2 of a ball, 0 of a box.
    """

    def rate(_: float, y: np.ndarray) -> list[float]:
        braked = friction * np.tanh((y[1] - radius * y[2]) / SMOOTH)
        return [y[1], pull - braked, braked / (share * radius) if share else 0.0]

    run = solve_ivp(rate, (0.0, end), (0.0, start, 0.0), "LSODA", rtol=1e-9, atol=1e-12)
    return run.y[:, -1]


def test_ramps_and_balls_by_integration() -> None:
    """Each box and ball of the ramps, and each ball that slips, by Coulomb's law from the scene's numbers."""
    checked = 0
    for scene in (s for s in tagged("literature") if s.name.startswith(INTEGRATED[:3])):
        mu = scene.coefficients[0].friction
        for one in scene.published:
            body = scene.bodies[scene.body_index(one.body)]
            angle = radians(float(re.sub(r"^\D+", "", one.body))) if scene.name != "slip" else 0.0
            shape, speed = body.pieces[0].shape, float(np.linalg.norm(body.linear_velocity))
            radius = shape.radius if isinstance(shape, Sphere) else 0.0
            share = body.inertia[0][0] / (body.mass * radius**2) if radius else 0.0
            way, fast, spin = slid(
                GRAVITY * sin(angle), mu * GRAVITY * cos(angle), radius, share, speed, one.end
            )
            found = {"distance": way, "velocity": fast, "spin": spin}[one.quantity]
            assert found == pytest.approx(one.value, rel=1e-4, abs=1e-5), (scene.name, one.name)
            checked += 1
    assert checked == 41


def impact(slip: float, down: float, mu: float, e: float, share: float) -> tuple[float, float]:
    """Change of a ball's speed along the floor and of r w, per unit mass, over small normal impulses."""
    steps = 200_000
    part = (1 + e) * down / steps
    v = turned = 0.0
    for _ in range(steps):
        brake = min(mu * part, max(0.0, slip + v - turned) / (1 + 1 / share))
        v, turned = v - brake, turned + brake / share
    return v, turned


def test_impacts_by_integration() -> None:
    """Balls that hit a floor, impulse by impulse; a rigid ball has 5/7 where elastic ones have less."""
    scene = catalogue()["oblique_impacts"]
    pair = next(c for c in scene.coefficients if {c.material_a, c.material_b} == {"glass", "oxide"})
    for body in scene.bodies[1:]:
        fast, _, down = body.linear_velocity
        radius = body.pieces[0].shape.radius  # type: ignore[union-attr]
        v, turned = impact(fast, -down, pair.friction, pair.restitution, 2 / 5)
        values = [one for one in scene.published if one.body == body.name]
        for one, found in zip(values, (fast + v, turned / radius), strict=True):
            assert found == pytest.approx(one.value, abs=one.tolerance)


def test_a_row_by_single_impacts() -> None:
    """In a row of equal elastic balls the last takes all: each pair swaps its speeds in turn."""
    _, one = row("cradle", "last ball")
    speeds = [1.0, 0.0, 0.0, 0.0, 0.0]
    while met := [k for k in range(4) if speeds[k] > speeds[k + 1]]:
        speeds[met[0] : met[0] + 2] = speeds[met[0] + 1], speeds[met[0]]
    assert speeds == [0.0, 0.0, 0.0, 0.0, one.value]


def test_a_grip_holds_by_statics() -> None:
    """The friction that the plates of `grip` can give is 1.5 times the weight, so that nothing slips."""
    scene, one = row("grip", "slip")
    cube, plate = scene.bodies[scene.body_index("cube")], scene.trackers[0]
    # the plates meet the cube after 5 mm, beyond which their couplings press
    closed = abs(plate.positions[0][0]) - abs(plate.positions[-1][0])
    force = plate.stiffness * (closed - 0.005)
    mu = next(c.friction for c in scene.coefficients if c.material_a == c.material_b == "pad")
    assert 2 * mu * force == pytest.approx(1.5 * cube.mass * GRAVITY)
    assert one.value == 0


def test_rings_by_integration() -> None:
    """A ring on three feet with a third of its weight each ends with v = R w, from both starts."""
    scene, one = row("sliding_rings", "fast v / w")
    mu, step = scene.coefficients[0].friction, 1e-4
    for ring in scene.bodies[1:]:
        feet = np.array([piece.position[:2] for piece in ring.pieces])
        v, w, angle = np.array(ring.linear_velocity[:2]), ring.angular_velocity[2], 0.0
        for _ in range(round(one.end / step)):
            arm = feet @ Rotation.from_rotvec((0.0, 0.0, angle)).as_matrix()[:2, :2].T
            slip = v + w * np.stack([-arm[:, 1], arm[:, 0]], axis=-1)
            force = -mu * GRAVITY / 3 * slip / np.hypot(np.linalg.norm(slip, axis=1), SMOOTH)[:, None]
            v = v + step * force.sum(axis=0)
            w += step * (arm[:, 0] @ force[:, 1] - arm[:, 1] @ force[:, 0]) / ring.inertia[2][2]
            angle += step * w
        assert np.linalg.norm(v) > 0.01
        assert np.linalg.norm(v) / w == pytest.approx(one.value, abs=one.tolerance)


def test_a_jammed_rod_by_integration() -> None:
    """Beyond mu = 4/3 impulses at the sliding tip press it down; once it sticks they bring it to rest."""
    scene, one = row("painleve_mu15", "stops")
    rod, mu = scene.bodies[1], scene.coefficients[0].friction
    centre = np.array(rod.position)
    arm = np.array((-centre[0], 0.0, -centre[2]))
    v, spin, part = np.array(rod.linear_velocity), 0.0, np.array((mu, 0.0, 1.0)) * 1e-4
    tip = v[::2]
    sinks = []
    while tip[0] < 0:
        v = v + part / rod.mass
        # the torque about y
        spin += (arm[2] * part[0] - arm[0] * part[2]) / rod.inertia[1][1]
        tip = np.array((v[0] + spin * arm[2], v[2] - spin * arm[0]))
        sinks.append(tip[1])
    assert min(np.diff(sinks)) < 0
    assert sinks[-1] < 0
    # no slip, no rebound: the impulse that stops both components
    mobility = (
        np.eye(2) / rod.mass
        + np.array([[arm[2] ** 2, -arm[0] * arm[2]], [-arm[0] * arm[2], arm[0] ** 2]]) / rod.inertia[1][1]
    )
    impulse = np.linalg.solve(mobility, -tip)
    assert v[0] + impulse[0] / rod.mass == pytest.approx(one.value, rel=1e-3)


def circling(times: np.ndarray) -> Motion:
    """A body that circles at radius 2 with 0.5 rad/s, tilted by 0.3 rad and turning as it circles."""
    c, s, zero = np.cos(0.5 * times), np.sin(0.5 * times), 0 * times
    turn = Rotation.from_euler("ZY", np.stack([0.5 * times, 0.3 + zero], axis=-1))
    return Motion(
        np.stack([2 * c, 2 * s, zero], axis=-1),
        np.stack([-s, c, zero], axis=-1),
        turn.as_quat(scalar_first=True),
        np.stack([zero, zero, 0.5 + zero], axis=-1),
    )


@pytest.mark.parametrize(
    ("quantity", "fields", "value"),
    [
        ("distance", {"start": 0.0, "end": 4.0}, 4 * sin(1.0)),
        ("velocity", {"along": (0.0, 1.0, 0.0)}, 1.0),
        ("velocity", {"start": 4.0, "along": (0.0, 1.0, 0.0)}, cos(2.0)),
        ("spin", {"along": (0.0, 0.0, 1.0)}, 0.5),
        ("spin", {"along": (0.0, 0.0, 1.0), "along_body": (0.0, 0.0, -1.0)}, 0.5 - 0.5 * cos(0.3)),
        ("tilt", {}, 0.3),
        ("precession", {}, 0.5),
        ("turning", {}, 0.5),
        ("radius", {}, 2.0),
    ],
)
def test_quantities(quantity: str, fields: dict[str, object], value: float) -> None:
    """Each quantity of a body that circles and turns at a constant rate."""
    times = np.linspace(0.0, 8.0, 481)
    given = {"start": 0.0, "end": 4.0} | fields
    one = Published("one", "body", quantity, value, 1.0, "X (2000)", **given)  # type: ignore[arg-type]
    assert one.measured(times, circling(times)) == pytest.approx(value)


def test_quantities_relative_to_another() -> None:
    """A body does not move relative to one that moves the same way."""
    times = np.linspace(0.0, 8.0, 481)
    for quantity in ("distance", "velocity"):
        one = Published("one", "a", quantity, 0.0, 1.0, "X (2000)", 0.0, 8.0, other="b")  # type: ignore[arg-type]
        assert one.measured(times, circling(times), circling(times)) == 0


FAULTS = [
    ({"quantity": "colour"}, "published[0].quantity: unknown quantity 'colour'; valid: distance, velocity"),
    ({"body": "moon"}, "published[0].body: unknown body 'moon'; valid: table, ball_0"),
    ({"other": "moon"}, "published[0].other: unknown body 'moon'; valid: table, ball_0"),
    ({"value": np.nan}, "published[0].value: found nan to 0.0142857, expected two numbers"),
    ({"tolerance": 0.0}, "published[0].value: found 1.42857 to 0, expected two numbers"),
    ({"end": 9.0}, "published[0].start: expected 0 <= start <= end <= 1.0"),
    ({"source": ""}, "published[0].source: found none, expected author and year"),
    ({"name": "45° speed"}, "published[2].name: '45° speed' is used twice"),
]
"""Faulty fields, and what is said of them."""


@pytest.mark.parametrize(("fields", "message"), FAULTS)
def test_faults_are_named(fields: dict[str, object], message: str) -> None:
    """A faulty published value is refused with its place."""
    scene = catalogue()["slip"]
    first, *rest = scene.published
    with pytest.raises(ScenarioError, match=re.escape(message)):
        replace(scene, published=(replace(first, **fields), *rest))  # type: ignore[arg-type]


def test_a_mirror_image_states_no_values() -> None:
    """Values hold for the scene as it was published: a mirror image would change their signs."""
    assert mirrored(catalogue()["slip"]).published == ()
