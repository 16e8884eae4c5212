"""Passages on recordings made by hand: what is on the other side after having been apart counts, no more."""

from dataclasses import replace
from math import cos, pi, sin

import numpy as np
import pytest

from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.context import Context, Value
from touchstone.scenarios.avatar.driven_poses import driven_pieces
from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.gallery import TABLE_HALF
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, Box, Capsule, Ellipsoid, Piece, Scenario, Tracker
from touchstone.scenarios.solids import box_inertia

FRAME = 1 / 60
RADIUS = 0.05
"""Of the ball [m]."""
SPEEDS = (6.0, 30.0, 300.0, 3000.0)
"""From a tenth of a metre to fifty metres a frame [m/s]."""
PLATES = (5e-4, 0.02)
"""Half thickness of plates of 1 mm and 4 cm [m]."""
PHASES = (0.05, 0.35, 0.65, 0.95)
"""Share of a frame after which the ball is at the plate [1]."""


@pytest.fixture(scope="module")
def over_plate(lab):
    """A plate of 80 cm by 80 cm round the origin, and balls."""

    def build(*balls, half=0.02, duration=0.2, **fields):
        plate = lab.block("plate", (0.4, 0.4, half), (0.0, 0.0, 0.0), **({"kind": "fixed"} | fields))
        return lab.scene(plate, *(balls or (lab.ball(),)), effects=(), duration=duration)

    return build


@pytest.fixture(scope="module")
def counted(recordings, known):
    """How many passages a recording has in which one body moves as given, or which has given columns."""

    def count(scenario, *moved, **columns):
        given = (known.path(scenario, *moved) if moved else {}) | columns
        return len(passages(Context(recordings.recording(scenario, **given), scenario)))

    return count


def arrays(columns):
    """Printed columns of a recording as arrays, with orientations of unit length."""
    found = {name: np.array(values) for name, values in columns.items()}
    found["orientation"] /= np.linalg.norm(found["orientation"], axis=2, keepdims=True)
    return found


def flight(frames, start, velocity, **bounce):
    """Positions and velocities (f, 3) of a ball that flies straight; hit `at` so many frames it goes on with
    the velocity `after` [m/s]."""
    times = np.arange(frames) * FRAME
    start, velocity = np.array(start, dtype=float), np.array(velocity, dtype=float)
    if not bounce:
        return start + np.outer(times, velocity), np.tile(velocity, (frames, 1))
    hit, after = bounce["at"] * FRAME, np.array(bounce["after"], dtype=float)
    before = times[:, None] <= hit
    place = start + hit * velocity
    position = np.where(
        before, start + np.outer(times, velocity), place + np.outer(np.maximum(times - hit, 0.0), after)
    )
    return position, np.where(before, velocity, after)


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("half", PLATES)
@pytest.mark.parametrize("speed", SPEEDS)
def test_a_ball_through_a_plate_is_one_passage(over_plate, counted, speed, half, phase):
    """A ball that goes straight through a plate passes it once, at any speed and phase of the frame."""
    scenario = over_plate(half=half)
    slanted = np.array((0.2, 0.1, -1.0)) * speed
    start = -slanted * FRAME * (5 + phase)
    position, velocity = flight(13, start, slanted)
    assert counted(scenario, 1, position, velocity) == 1
    # seen from below, and by an engine that slows the ball down in the plate
    slow = np.where(np.arange(13)[:, None] <= 5 + phase, 1.0, 0.3)
    below = -np.where(slow == 1, position, 0.3 * position)
    assert counted(scenario, 1, below, -slow * velocity) == 1


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("half", PLATES)
@pytest.mark.parametrize("speed", SPEEDS)
def test_a_bounce_is_no_passage(over_plate, counted, speed, half, phase):
    """A ball that comes back to the side it came from did not pass, however far it goes in a frame."""
    scenario = over_plate(half=half)
    down = np.array((0.1, 0.0, -1.0)) * speed
    for restitution in (0.8, 0.01):
        start = np.array((0.0, 0.0, half + RADIUS)) - down * FRAME * (5 + phase)
        bounce = {"at": 5 + phase, "after": down * (1, 1, -restitution)}
        position, velocity = flight(13, start, down, **bounce)
        assert counted(scenario, 1, position, velocity) == 0


@pytest.mark.parametrize("speed", [2.5, 3.0, 6.0])
def test_a_hand_through_its_table(counted, speed):
    """A hand whose parts all go through a table of 4 cm is counted; one that stops on it is not."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    origin, upright = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    glove = Tracker("palm", names, (0.0, 1.0), (origin,) * 2, (upright,) * 2, ((0.1, 0.15, 0.1) * 5,) * 2)
    fields = {"name": "t", "summary": "t", "tags": (), "coefficients": TABLE_1, "duration": 0.25}
    pieces = driven_pieces(Scenario(bodies=links, joints=joints, trackers=(glove,), **fields))
    inertia = box_inertia(0.4, (0.045, 0.04, 0.014))
    hand = Body("hand", "driven", "human", tuple(pieces), mass=0.4, inertia=inertia)
    table = Body("table", "fixed", "wood", (Piece("top", Box(TABLE_HALF)),))
    still = Tracker("hand", (), (0.0, 1.0), (origin,) * 2, (upright,) * 2, ((), ()))
    scenario = Scenario(bodies=(table, hand), trackers=(still,), **fields)
    frames = np.arange(16)
    height = 0.3 - speed * FRAME * frames
    path = np.column_stack((np.zeros((16, 2)), height))
    down = np.tile((0.0, 0.0, -speed), (16, 1))
    assert counted(scenario, 1, path, down) == 1
    stopped = np.maximum(path, (-1.0, -1.0, 0.04))
    assert counted(scenario, 1, stopped, down) == 0


def rod(position=(0.0, 0.0, 0.0), **fields):
    """A rod of a metre along x, 2 cm thick."""
    turn = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
    piece = Piece("rod", Capsule(0.01, 0.49), (0.0, 0.0, 0.0), turn)
    inertia = box_inertia(1.0, (0.5, 0.01, 0.01))
    return Body("rod", "simulated", "wood", (piece,), mass=1.0, inertia=inertia, position=position, **fields)


def spun(frames, rate, start=0.0):
    """Orientations (f, 4) of a body that turns about z at a rate [rad/s]."""
    angle = start + rate * FRAME * np.arange(frames)
    return np.column_stack((np.cos(angle / 2), np.zeros((frames, 2)), np.sin(angle / 2)))


@pytest.mark.parametrize("rate", [2.0, 30.0, 100.0, 200.0])
def test_a_spinning_rod_that_sweeps_through_a_ball(lab, counted, rate):
    """Both ends of a rod that turns go through a ball in its reach, none through one beyond or above it."""
    frames = round(60 * 1.2 * pi / rate) + 2
    rate, start = 1.2 * pi / ((frames - 1) * FRAME), -0.1 * pi  # 1.2 half turns in whole frames
    for place, passed in (((0.4, 0, 0), 2), ((0.3, 0.0, 0.01), 2), ((0.57, 0, 0), 0), ((0.4, 0.0, 0.07), 0)):
        scenario = lab.scene(rod(), lab.ball(position=place), effects=(), duration=(frames - 1) * FRAME)
        turned, spin = spun(frames, rate, start), (0.0, 0.0, rate)
        assert counted(scenario, 0, (0.0, 0.0, 0.0), 0.0, turned, spin) == passed


@pytest.fixture
def two_balls(lab, known, counted):
    """Passages of two balls that fly, from starts with velocities; a bounce as in `flight` for each."""

    def count(ways, starts, bounce=None):
        balls = lab.ball("one", (0.0, 0.0, 1.0)), lab.ball("two", (0.0, 0.0, 2.0))
        scenario = lab.scene(*balls, effects=(), duration=0.1)
        columns = known.path(scenario, 0)
        for k in (0, 1):
            hit = {"at": bounce, "after": ways[1 - k]} if bounce else {}
            columns["position"][:, k], columns["linear_velocity"][:, k] = flight(7, starts[k], ways[k], **hit)
        return counted(scenario, **columns)

    return count


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("speed", [6.0, 100.0, 3000.0])
def test_two_fast_balls(two_balls, speed, phase):
    """Two balls that go through each other pass; that bounce, miss, or cross one after the other do not."""
    east, west, north = np.eye(3)[0] * speed, -np.eye(3)[0] * speed, np.eye(3)[1] * speed
    meet = (2 + phase) * FRAME
    aside = np.array((0.0, 0.12, 0.0))
    assert two_balls((east, west), (-east * meet, -west * meet)) == 1
    assert two_balls((east, north), (-east * meet, -north * meet)) == 1
    assert two_balls((east, west), (-east * meet, -west * meet + aside)) == 0
    late = meet + 0.2 / speed
    assert two_balls((east, north), (-east * meet, -north * late)) == 0
    gap = np.array((-RADIUS, 0.0, 0.0))
    starts = (gap - east * meet, -gap - west * meet)
    assert two_balls((east, west), starts, bounce=2 + phase) == 0


@pytest.mark.parametrize("speed", SPEEDS)
def test_a_graze_is_no_passage(over_plate, counted, speed):
    """Along a face, a few millimetres deep, and over a corner of it: no passage."""
    scenario = over_plate()
    along = np.array((speed, 0.0, 0.0))
    position, velocity = flight(13, (-5.3 * speed * FRAME, 0.0, 0.067), along)
    assert counted(scenario, 1, position, velocity) == 0
    slanted = np.array((0.7, 0.0, -0.7)) * speed
    position, velocity = flight(13, np.array((0.42, 0.0, 0.05)) - 5.3 * FRAME * slanted, slanted)
    assert counted(scenario, 1, position, velocity) == 0


@pytest.mark.parametrize("seconds", [1 / 60, 2 / 60, 0.2])
def test_round_an_edge_is_no_passage(over_plate, counted, seconds):
    """From over a plate to under it on a half circle round its edge, in one frame or in many."""
    scenario = over_plate(duration=0.4)
    frames = np.arange(scenario.frame_count + 1)
    radius = 0.02 + RADIUS + 1e-4
    for shift in (0.0, 0.3, 0.7):
        angle = np.clip((frames - 8 + shift) * FRAME / seconds, 0.0, 1.0) * pi
        rate = np.where((angle > 0) & (angle < pi), pi / seconds, 0.0)
        position = np.array([(0.4 + radius * sin(t), 0.0, radius * cos(t)) for t in angle])
        velocity = np.array([(radius * cos(t), 0.0, -radius * sin(t)) for t in angle]) * rate[:, None]
        # in and out along the faces
        before, after = np.minimum(frames - 8, 0), np.maximum(frames - 8 - round(seconds * 60) - 1, 0)
        position[:, 0] -= 0.02 * (np.abs(before) + after)
        speeds = np.where(rate > 0, 0.0, radius * pi / seconds)
        velocity[:, 0] += speeds * np.where(angle > 0, -1.0, 1.0)
        assert counted(scenario, 1, position, velocity) == 0


def test_over_a_spinning_capsule_is_no_passage(lab, recordings, counted):
    """A fingertip goes over a capsule at 100 rad/s within a frame: the chord leads through the capsule, the
    velocities after the frame along its surface (random scene 8186 of kind press)."""
    links, _ = hand_parts()
    tip = next(link for link in links if link.name == "ring_distal")
    capsule = Piece("capsule", Capsule(0.008668, 0.015991))
    inertia = box_inertia(0.05, (0.01, 0.01, 0.01))
    one = Body("capsule", "simulated", "wood", (capsule,), mass=0.05, inertia=inertia)
    two = replace(tip, kind="simulated", material="wood")
    scenario = lab.scene(one, two, effects=("gravity",), duration=FRAME)
    columns = {
        "position": [
            [(-0.0306, 0.0391, 0.0329), (0.0213, 0.0194, 0.0537)],
            [(-0.0105, 0.0280, 0.0394), (-0.0128, 0.0424, 0.0591)],
        ],
        "orientation": [
            [(0.1429, -0.8131, -0.3394, 0.4508), (0.3542, -0.1914, 0.0708, 0.9126)],
            [(-0.5059, -0.8452, -0.0507, 0.1651), (0.3455, -0.1758, 0.0639, 0.9196)],
        ],
        "linear_velocity": [
            [(1.0189, -0.3658, 1.0091), (-2.0781, 1.3650, 0.4119)],
            [(1.0143, -0.4294, 0.7326), (-1.9641, 1.3389, 0.3053)],
        ],
        "angular_velocity": [
            [(-93.1678, -37.2017, 13.5260), (1.9169, 2.4086, 1.1631)],
            [(-55.8222, -76.3919, 16.6325), (1.6785, 1.4653, 1.0469)],
        ],
    }
    told = recordings.contacts({"time": 1e-3, "body_a": 0, "body_b": 1, "normal": (-0.18, 0.51, 0.84)})
    turned = arrays(columns)
    assert counted(scenario, **turned, contacts=told) == 0
    assert counted(scenario, **turned) == 1  # no contact reported: nothing turned it aside


def test_tumbling_past_each_other_is_no_passage(lab, counted):
    """A capsule that tumbles by half a revolution a frame flies past a spinning disc: torque-free rotation
    keeps them 12 mm apart, constant spins lead both in (random scene 135793329)."""
    pieces = Piece("disc", Ellipsoid((0.03936, 0.0131, 0.03933))), Piece("capsule", Capsule(0.00809, 0.03127))
    bodies = [replace(lab.ball(), name=piece.name, pieces=(piece,)) for piece in pieces]
    scenario = lab.scene(*bodies, effects=(), duration=FRAME)
    columns = {
        "position": [
            [(0.05255, -0.00518, 0.11353), (0.02274, -0.04059, 0.04053)],
            [(0.06511, 0.01093, 0.13729), (0.03347, -0.00037, 0.09936)],
        ],
        "orientation": [
            [(0.20209, -0.55901, 0.02933, -0.80362), (0.66168, -0.74286, 0.02042, 0.09965)],
            [(0.68796, -0.30763, -0.3073, -0.58107), (0.27505, 0.23719, 0.21131, -0.90743)],
        ],
        "linear_velocity": [
            [(0.75372, 0.9668, 1.50706), (0.64403, 2.41284, 3.61126)],
            [(0.75372, 0.9668, 1.34356), (0.64403, 2.41284, 3.44776)],
        ],
        "angular_velocity": [
            [(7.32994, -20.95969, 80.21614), (147.88658, -177.68108, 55.38355)],
            [(7.65793, -20.524, 80.29797), (183.73794, 100.87717, -112.12722)],
        ],
    }
    assert counted(scenario, **arrays(columns)) == 0


def test_to_end_inside_is_no_passage(over_plate, counted):
    """A ball that sinks into a plate and stays, or that started there and leaves, is not through; nor is one
    that sinks to the middle and comes back."""
    scenario = over_plate(duration=10 * FRAME)
    down = np.linspace(0.2, -0.06, 11)
    back = np.concatenate((np.linspace(0.2, -0.005, 6), np.linspace(0.02, 0.2, 5)))
    for height in (down, -down[::-1], np.maximum(down, 0.0), back):
        position = np.column_stack((np.zeros((11, 2)), height))
        velocity = np.gradient(position, FRAME, axis=0)
        assert counted(scenario, 1, position, velocity) == 0
    through = np.column_stack((np.zeros((11, 2)), np.linspace(0.2, -0.08, 11)))
    assert counted(scenario, 1, through) == 1


def test_what_stands_on_a_plate_can_pass_it(over_plate, counted):
    """A ball that rests on a plate, a thousandth of it deep, and is under it in the next frame passed."""
    scenario = over_plate(duration=0.1)
    height = np.array([0.07, 0.07, 0.07, -0.09, -0.2, -0.3, -0.4]) - 7e-5
    position = np.column_stack((np.zeros((7, 2)), height))
    assert counted(scenario, 1, position) == 1


def test_no_contact_reported_convicts(recordings, known, over_plate, counted):
    """Hit under the plate with an ambiguous path: a passage if no contact with the plate is reported."""
    scenario = over_plate(duration=2 * FRAME)
    position = np.array([(0.0, 0.0, 25.0), (0.0, 0.0, -5.0), (0.0, 0.0, -4.0)])
    velocity = np.array([(0.0, 0.0, -3000.0), (0.0, 0.0, 60.0), (0.0, 0.0, 60.0)])
    columns = known.path(scenario, 1, position, velocity)
    assert counted(scenario, **columns) == 1
    told = recordings.contacts({"time": 1e-3, "body_a": 0, "body_b": 1, "normal": (0.0, 0.0, 1.0)})
    assert counted(scenario, **columns, contacts=told) == 0


@pytest.mark.parametrize(("down", "expected"), [(1.5, 1), (0.6, 0)])
def test_a_body_struck_often_has_no_known_path(recordings, known, over_plate, counted, down, expected):
    """Both velocities lead through the plate; a displacement that neither explains shows other impacts."""
    scenario = over_plate(duration=2 * FRAME)
    position = np.array([(0.0, 0.0, z) for z in (0.3, 0.3 - down, -1.2 - down)])
    columns = known.path(scenario, 1, position, (0.0, 0.0, -1.5 / FRAME))
    told = recordings.contacts({"time": 1e-3, "body_a": 0, "body_b": 1, "normal": (0.0, 0.0, 1.0)})
    assert counted(scenario, **columns, contacts=told) == expected


def test_a_body_struck_aside_counts_no_passage(over_plate, counted):
    """No contact with the plate is reported, but others struck the ball: it may have gone round."""
    scenario = over_plate(duration=2 * FRAME)
    position = np.array([(0.0, 0.0, 0.3), (0.0, 0.0, -0.3), (1.0, 0.0, -0.3)])
    velocity = np.array([(0.0, 0.0, -1.5), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)]) / FRAME
    assert counted(scenario, 1, position, velocity) == 0


def test_pieces_of_a_body_pass_together(lab, known, over_plate, counted):
    """A body of two balls that goes through a plate passes once; two bodies twice."""
    dumbbell = lab.ball("dumbbell")
    ends = [replace(dumbbell.pieces[0], name=f"{x}", position=(x, 0.0, 0.0)) for x in (-0.06, 0.06)]
    scenario = over_plate(replace(dumbbell, pieces=tuple(ends)), duration=0.1)
    position, velocity = flight(7, (0.0, 0.0, 0.3), (0.0, 0.0, -6.0))
    assert counted(scenario, 1, position, velocity) == 1
    scenario = over_plate(lab.ball("one"), lab.ball("two", (0.2, 0.0, 1.0)), duration=0.1)
    columns = known.path(scenario, 1, position, velocity)
    columns["position"][:, 2] = position + (0.2, 0.0, 0.0)
    assert counted(scenario, **columns) == 2


@pytest.mark.parametrize(
    ("start", "way", "expected"),
    [
        ((0.0, 0.0, 0.25), (0.0, 0.0, -0.5), 1),  # straight through, within one frame
        ((0.3, 0.0, 0.25), (0.15, 0.0, -0.5), 1),  # slanted, through the rim
        ((0.4, 0.0, 0.25), (0.15, 0.0, -0.5), 0),  # slanted, past the rim
        ((0.6, 0.0, 0.25), (0.0, 0.0, -0.5), 0),  # beside it
        ((0.0, 0.0, 0.25), (0.0, 0.0, -0.01), 1),  # slowly, it goes in and out once
        ((0.0, 0.0, 0.03), (0.3, 0.0, 0.0), 0),  # along the surface, half sunk
        ((0.0, 0.0, -0.25), (0.0, 0.0, 0.5), 1),  # from below
    ],
)
def test_ways_by_a_plate(over_plate, counted, start, way, expected):
    """A ball without any velocity told passes where its places say so, however fast."""
    duration = 1.0 if way[2] == -0.01 else 2 / 60
    scenario = over_plate(half=0.005, duration=duration)
    frames = np.arange(scenario.frame_count + 1)
    assert counted(scenario, 1, np.array(start) + np.outer(frames, way)) == expected


def test_there_and_back_are_two(over_plate, counted):
    """A plate that stands upright is passed, and passed again."""
    turn = (0.5**0.5, 0.5**0.5, 0.0, 0.0)
    scenario = over_plate(half=0.005, duration=2 / 60, orientation=turn)
    position = np.array([[0.0, 0.2, 0.1], [0.0, -0.2, 0.1], [0.0, 0.2, 0.1]])
    assert counted(scenario, 1, position) == 2


def test_a_plate_that_moves_over_a_ball_passes(lab, known, over_plate, counted):
    """It does not matter which of two moves, nor whether both fall."""
    scenario = over_plate(lab.ball(position=(0.0, 0.0, 0.5)), half=5e-4, kind="simulated")
    position, velocity = flight(13, (0.0, 0.0, -1.0), (0.0, 0.0, 9.0))
    assert counted(scenario, 0, position, velocity) == 1
    columns = known.path(scenario, 0, position + velocity / 3, velocity)
    columns["position"][:, 1], columns["linear_velocity"][:, 1] = flight(13, (0, 0, 0.5), (0, 0, 8.9))
    assert counted(scenario, **columns) == 0


def test_the_first_passage_is_named(recordings, known, over_plate):
    """The metric counts passages and names the first, with its time."""
    scenario = over_plate()
    position, velocity = flight(13, (0.0, 0.0, 0.45), (0.0, 0.0, -6.0))
    columns = known.path(scenario, 1, position, velocity)
    found = known.value("overlap.tunnelled", recordings.recording(scenario, **columns), scenario)[""]
    assert found == Value(1.0, "first plate through ball at 0.075 s")


def test_a_spinning_needle_is_far_from_a_plate(lab, counted):
    """A needle turns about its length by a revolution a frame, 2 cm from a thin plate. The shortest rotation
    between the frames has another axis, and with a revolution about that the needle would sweep the plate."""
    sizes = {"needle": (3.2e-4, 3.2e-4, 0.0323), "plate": (0.0226, 0.0226, 1.6e-4)}
    bodies = [lab.block(name, half, (0.0, 0.0, 0.0)) for name, half in sizes.items()]
    scenario = lab.scene(*bodies, effects=("gravity",), duration=1 / 240, frame_rate=240)
    columns = {
        "position": [
            [(-0.01031, 0.11165, 0.02352), (0.02508, 0.14593, 0.0411)],
            [(-0.00999, 0.11283, 0.02361), (0.02502, 0.14648, 0.04882)],
        ],
        "orientation": [
            [(0.28898, 0.19788, 0.90512, -0.241), (1.0, 0.0, 0.0, 0.0)],
            [(-0.32633, -0.25334, -0.87744, 0.24378), (1.0, 0.0, 0.0, 0.0)],
        ],
        "linear_velocity": [
            [(0.07716, 0.2829, 0.04227), (-0.01413, 0.13312, 1.87465)],
            [(0.07716, 0.2829, 0.0014), (-0.01413, 0.13312, 1.83377)],
        ],
        "angular_velocity": [
            [(644.42, -855.93, -1104.47), (0.0, 0.0, 0.0)],
            [(677.33, -921.33, -1029.62), (0.0, 0.0, 0.0)],
        ],
    }
    assert counted(scenario, **arrays(columns)) == 0
