"""Published values against integrations of our own, which use contact laws and no published formula."""

import re
from dataclasses import replace
from fnmatch import fnmatch
from math import cos, radians, sin
from pathlib import Path

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
INTEGRATED = ("ramps", "balls_on_ramps", "slip")
"""Beginnings of the names of scenes whose own truth is the published formula: their values are integrated."""
HEAPS = ("silo_", "column_")
"""Scenes whose values are laws of continua, which sources state differently."""
UNTRUE = (
    "grip",
    "sliding_rings",
    "painleve_mu15",
    "force_plate",
    "tippe_top_small",
    "rod_",
    "domino_wave",
    "ladder",
    *HEAPS,
)
"""Beginnings of the names of scenes without a closed form over time."""
SMOOTH = 1e-6
"""Slip below which the friction of an integration is smooth [m/s]: it stops a millimetre a second creep."""


def row(scene: str, name: str) -> tuple[Scenario, Published]:
    """A scene and one of its published values."""
    return catalogue()[scene], next(one for one in catalogue()[scene].published if one.name == name)


def frames(scenario: Scenario) -> np.ndarray:
    """Times of the displayed frames."""
    return np.arange(scenario.frame_count + 1) / scenario.frame_rate


def test_values_have_sources() -> None:
    """At least 30 values with author and year, in scenes of the tag, all on the page, and in a large one."""
    assert len(ROWS) >= 30
    tag = tagged("literature")
    scenes = (*tag, catalogue()["silo_1000"])
    page = (Path(__file__).parents[2] / "docs" / "published.md").read_text("utf-8")
    named = re.findall(r"`(\w+\*?)`", "".join(re.findall(r"^\|.*", page, re.MULTILINE)))
    assert [one.name for one in tag if not any(fnmatch(one.name, pattern) for pattern in named)] == []
    assert f"plays {len(tag)} scenes" in page
    assert {scene for scene, _ in ROWS} == {scene.name for scene in scenes}
    for scene in scenes:
        for one in scene.published:
            assert re.match(r"[\w&., é-]+ \((1[6-9]|20)\d\d\)", one.source), one.source


def moves(scenario: Scenario, name: str, times: np.ndarray) -> Motion | None:
    """Motion of a body by the truth of its scene, or by its tracker; None without."""
    for tracker in scenario.trackers:
        if tracker.root == name:
            at = sample(tracker, times)
            return Motion(at.position, at.linear_velocity, at.orientation, at.angular_velocity)
    found = [truth for truth in scenario.truths if truth.body == name]
    return motion(scenario, found[0], times) if found else None


@pytest.mark.parametrize(("scene", "name"), [(s, n) for s, n in ROWS if not s.startswith(UNTRUE)])
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
    for scene in (s for s in tagged("literature") if s.name.startswith(INTEGRATED)):
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
    assert checked == 57


def impact(slip: float, speed: float, mu: float, e: float) -> float:
    """Change of a solid ball's speed along a wall [m/s], over small normal impulses per unit mass."""
    steps = 20_000
    part, v = (1 + e) * speed / steps, 0.0
    for _ in range(steps):
        # friction of a part ends the slip, which changes by 1 + 5/2 of it, at most
        v -= max(-mu * part, min((slip + 7 / 2 * v) / (7 / 2), mu * part))
    return v


@pytest.mark.parametrize("name", ["oblique", "normal", "elastic", "spinning"])
def test_impacts_by_integration(name: str) -> None:
    """Balls that hit a floor, a large ball or each other, impulse by impulse."""
    scene = catalogue()[f"{name}_impacts"]
    for one in scene.published:
        index = scene.body_index(one.body)
        body, kind = scene.bodies[index], one.body.partition("_")[0]
        partner = {"ball": 0, "left": index + 1, "right": index - 1, "small": index + 1}[kind]
        e, mu = scene.pair_coefficients(*sorted((index, partner)))
        v, w = np.array(body.linear_velocity), np.array(body.angular_velocity)
        radius = body.pieces[0].shape.radius  # type: ignore[union-attr]
        normal = {"ball": 2, "left": 0, "right": 0, "small": 1}[kind]
        speed, meets = abs(v[normal]), kind in ("left", "right")
        # balls that meet have no slip: both surfaces move the same way
        slip = 0.0 if meets else v[0] - radius * w.sum()
        along = impact(slip, speed, mu, e)
        after = {"velocity": v[0] + along, "spin": w.sum() - 5 / 2 * along / radius}
        if meets or one.along[2]:
            after["velocity"] = e * speed
        assert after[one.quantity] == pytest.approx(one.value, abs=one.tolerance), one.name


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


def rod_impact(case: Scenario, law: str) -> float:
    """Rate of the rod of a scene after its impact: slip and approach over 200,000 small normal impulses."""
    rod, pair = case.bodies[1], case.coefficients[0]
    turn = Rotation.from_quat(rod.orientation, scalar_first=True)
    corners = turn.apply(np.array([(0.25, y, z) for y in (-0.02, 0.02) for z in (-0.02, 0.02)]))
    low = corners[corners[:, 2] < corners[:, 2].min() + 1e-9].mean(axis=0)
    moment, mu, e = rod.inertia[1][1], pair.friction, pair.restitution
    v, w, part = np.array(rod.linear_velocity), 0.0, 1.0 / 50_000
    pressed = worked = restored = 0.0

    def slip() -> tuple[float, float]:
        # of the low end: v + w x r, w about y
        return float(v[0] + w * low[2]), float(v[2] - w * low[0])

    first = slip()[1]
    for _ in range(400_000):
        along, down = slip()
        # what stops the slip in this part, with the normal impulse that acts too
        stop = along + (-low[2] * low[0] / moment) * part
        brake = max(-mu * part, min(-stop / (1 + low[2] ** 2 / moment), mu * part))
        v = v + (brake, 0.0, part)
        w += (low[2] * brake - low[0] * part) / moment
        after = slip()[1]
        if after < 0:
            pressed, worked = pressed + part, worked - (down + after) / 2 * part
            continue
        restored += part if law == "Poisson" else max(0.0, down + after) / 2 * part
        if (law == "Newton" and after >= -e * first) or (
            law != "Newton" and restored >= (e * pressed if law == "Poisson" else e**2 * worked)
        ):
            break
    return w


@pytest.mark.parametrize("name", ["rod_e1", "rod_slips"])
def test_rods_by_integration(name: str) -> None:
    """Rates after an impact under two laws; where the end slips on, Newton's gives the same."""
    scene, one = row(name, "rate")
    assert rod_impact(scene, "Stronge") == pytest.approx(one.value, rel=1e-3)
    if name == "rod_slips":
        assert rod_impact(scene, "Newton") == pytest.approx(one.value, rel=1e-3)
    if named := dict(one.outcomes):
        assert rod_impact(scene, "Poisson") == pytest.approx(named["Poisson"], rel=1e-3)
        assert one.outcome(1.01 * named["Newton"]) == "Newton"


def test_jellett_by_integration() -> None:
    """A top that rubs at the lowest point of its head keeps the momentum along its arm, by any friction."""
    scene, one = row("tippe_top_small", "Jellett")
    top = scene.bodies[1]
    head_piece, mu = top.pieces[0], 0.3
    radius, rise = head_piece.shape.radius, head_piece.position[2]  # type: ignore[union-attr]
    inertia, up = np.array(top.inertia), np.array((0.0, 0.0, 1.0))

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        turn, w = Rotation.from_quat(y[2:6], scalar_first=True), y[6:]
        matrix = turn.as_matrix()
        moment = matrix @ inertia @ matrix.T
        head = rise * matrix[:, 2]
        arm = head - radius * up
        slip = np.append(y[:2], -np.cross(w, head)[2]) + np.cross(w, arm)
        rub = -mu * (slip * (1, 1, 0)) / np.hypot(np.linalg.norm(slip[:2]), 0.01)
        # the head's centre stays at its height, which gives the normal force
        by_force = np.linalg.solve(moment, np.cross(arm, rub + up))
        free = np.linalg.solve(moment, -np.cross(w, moment @ w))
        lift = (np.cross(free, head) + np.cross(w, np.cross(w, head)))[2]
        force = (GRAVITY - lift) / (1 / top.mass + np.cross(by_force, head)[2])
        turning = 0.5 * np.append(-w @ y[3:6], y[2] * w + np.cross(w, y[3:6]))
        return np.concatenate([force * rub[:2] / top.mass, turning, free + force * by_force])

    start = np.concatenate([np.zeros(2), top.orientation, top.angular_velocity])
    run = solve_ivp(rate, (0.0, one.end), start, rtol=1e-8, atol=1e-10)
    turns, spins = run.y[2:6].T, run.y[6:].T
    motions = Motion(np.zeros((len(turns), 3)), np.zeros((len(turns), 3)), turns, spins)
    kept = [replace(one, start=t, end=t).measured(run.t, motions, None, top.inertia) for t in run.t[[0, -1]]]
    assert kept == pytest.approx([one.value, one.value], rel=1e-5)
    # it is the arm that keeps it: neither the vertical nor the axis does
    assert abs(Rotation.from_quat(turns[-1], scalar_first=True).as_matrix()[2, 2] - cos(0.1)) > 1e-3


def leaning(front: float, count: int, gap: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles of dominoes that lean on the one before, front first, their rates over its rate, and weights
    by which contact and friction cancel from the sum of their moments; about their front edges."""
    high, thick, mu = 0.1, 0.012, 0.4
    pitch = gap + thick
    angle, rate, weight = [front], [1.0], [1.0]
    for _ in range(count - 1):
        t = angle[-1]
        reach = (pitch * cos(t) - thick) / high
        a, slope = t + np.arcsin(reach), 1 - pitch * sin(t) / high / np.sqrt(1 - reach**2)
        corner, face = high * np.array((sin(a), cos(a))), np.array((sin(t), cos(t)))
        turned = np.array((corner[1], -corner[0])), np.array((corner[1], pitch - corner[0]))
        slides = (slope * turned[0] - turned[1]) @ face
        push = np.array((cos(t), -sin(t))) + mu * np.sign(slides) * face
        angle.append(a)
        rate.append(rate[-1] * slope)
        weight.append(weight[-1] * (push @ turned[1]) / (push @ turned[0]))
    return np.array(angle), np.array(rate), np.array(weight)


@pytest.mark.parametrize("name", ["domino_wave_28", "domino_wave_50"])
def test_domino_waves_by_integration(name: str) -> None:
    """Dominoes that turn about their front edges, lean on the next and rub; impacts keep the weighted sum."""
    scene, one = row(name, "speed")
    first, second = scene.bodies[1:3]
    pitch = second.position[1] - first.position[1]
    gap, about_edge = pitch - 0.012, (0.1**2 + 0.012**2) / 3
    speed, times = -first.angular_velocity[0], []
    for count in range(1, 18):

        def rate(_: float, y: np.ndarray, count: int = count) -> list[float]:
            angle, ratio, weight = leaning(y[0], count, gap)
            bend = (leaning(y[0] + 1e-6, count, gap)[1] - leaning(y[0] - 1e-6, count, gap)[1]) / 2e-6
            pull = GRAVITY * (0.05 * np.sin(angle) - 0.006 * np.cos(angle))
            return [y[1], weight @ (pull - about_edge * y[1] ** 2 * bend) / (about_edge * weight @ ratio)]

        def met(_: float, y: np.ndarray) -> float:
            return float(y[0] - np.arcsin(gap / 0.1))

        met.terminal = True  # type: ignore[attr-defined]
        run = solve_ivp(rate, (0.0, 1.0), (0.0, speed), events=met, rtol=1e-7, atol=1e-9)
        times.append(run.t[-1])
        end = run.y[:, -1]
        _, ratio, _ = leaning(end[0], count, gap)
        _, after, weight = leaning(0.0, count + 1, gap)
        speed = weight[1:] @ (ratio * end[1]) / (weight @ after)
    between = slice(int(one.body.split("_")[1]) - 1, int(one.other.split("_")[1]) - 1)
    passed = times[between]
    assert len(passed) * pitch / sum(passed) == pytest.approx(one.value, rel=2e-4)


def test_a_force_plate_by_momentum() -> None:
    """What the cubes gain and weigh, of their own masses and speeds."""
    scene = catalogue()["force_plate"]
    for one in scene.published:
        cube = scene.bodies[scene.body_index(one.body)]
        lost = -cube.linear_velocity[2] if one.start == 0 else 0.0
        assert one.value == pytest.approx(cube.mass * (GRAVITY + lost / (one.end - one.start)))


@pytest.mark.parametrize("name", ["silo_160", "silo_1000"])
def test_a_silo_by_integration(name: str) -> None:
    """Weight less what the walls carry, layer by layer, between two pressures on a wall by Mohr's circle."""
    scene = catalogue()[name]
    (one,), count = scene.published, sum(body.name.startswith("grain") for body in scene.bodies)
    mu, width, grain = scene.coefficients[0].friction, 0.46, 4 / 3 * np.pi * 0.05**3
    high = count * grain / 0.58 / width**2
    # stresses over their mean, on planes of all directions; the circle touches the line of slip
    angles = np.linspace(0.0, np.pi, 100_001)
    normal, shear = 1 + np.sin(np.arctan(mu)) * np.cos(angles), np.sin(np.arctan(mu)) * np.sin(angles)
    slips = normal[np.argmax(shear / normal)]
    carried = []
    for sideways in (normal.min() / normal.max(), slips / (2 - slips)):
        load, layers = 0.0, 100_000
        for _ in range(layers):
            load += (count * GRAVITY - 4 / width * mu * sideways * load * high) / layers
        carried.append(load)
    assert one.value == pytest.approx(sum(carried) / 2, rel=1e-3)


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
        ("momentum", {"along": (0.0, 0.0, 1.0)}, 0.5 * (2 * sin(0.3) ** 2 + 5 * cos(0.3) ** 2)),
        ("radius", {}, 2.0),
    ],
)
def test_quantities(quantity: str, fields: dict[str, object], value: float) -> None:
    """Each quantity of a body that circles and turns at a constant rate."""
    times = np.linspace(0.0, 8.0, 481)
    given = {"start": 0.0, "end": 4.0} | fields
    one = Published("one", "body", quantity, value, 1.0, "X (2000)", **given)  # type: ignore[arg-type]
    inertia = ((2.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, 5.0))
    assert one.measured(times, circling(times), None, inertia) == pytest.approx(value)


def test_a_wave_passes_from_one_to_another() -> None:
    """Bodies 3 m apart topple at 1 rad/s, 0.5 s one after the other, between frames; a third stands."""
    times = np.linspace(0.0, 2.0, 49)

    def falling(place: float, begins: float) -> Motion:
        tilt = np.clip(times - begins, 0.0, 1.0)
        turn = Rotation.from_rotvec(np.outer(tilt, (1.0, 0.0, 0.0))).as_quat(scalar_first=True)
        still = np.zeros((len(times), 3))
        return Motion(still + (0.0, place, 0.0), still, turn, still)

    one = Published("speed", "a", "wave", 6.0, 1.0, "X (2000)", 0.0, 2.0, other="b")
    assert one.measured(times, falling(1.0, 0.31), falling(4.0, 0.81)) == pytest.approx(6.0)
    assert one.measured(times, falling(1.0, 0.31), falling(4.0, 9.0)) == 0


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
    ({"quantity": "wave"}, "published[0].other: a wave is between two bodies; valid: table, ball_0"),
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
