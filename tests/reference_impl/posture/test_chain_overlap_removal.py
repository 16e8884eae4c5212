"""The driven loop with chains: pushed limbs come free within limits and cones, and only as far as needed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.adapters.engines.reference.settings import COLUMNS
from touchstone.adapters.oracles.overlap import measure
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cone
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.posture.attraction import ATTRACTION_TIME
from touchstone.reference_impl.posture.overlap_removal import remove_overlap
from touchstone.scenarios.avatar.avatar import avatar_parts
from touchstone.scenarios.avatar.chains import hinge_axes
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import IDENTITY, Body, Scenario, Tracker

FRAME = 1 / 60
BODIES, JOINTS, CHAINS = avatar_parts()
NAMES = [joint.name for joint in JOINTS]
FACE = 0.75
"""Where the wall begins [m]."""
ORACLE_SLACK = 2e-8
"""Beyond the tolerance [m]: what coal's own tolerance leaves."""


def posture(**given) -> tuple[float, ...]:
    """All angles, 0 unless given: of a hinge by name, of a ball joint by the rotation of its bone."""
    angles = dict.fromkeys(NAMES, 0.0)
    for name, value in given.items():
        if isinstance(value, Rotation):
            names = [f"{name}_{k}" for k in (1, 2, 3)]
            axes = hinge_axes(tuple(joint for joint in JOINTS if joint.name in names))
            turned = Rotation.from_matrix(axes.T @ value.as_matrix() @ axes).as_euler("XYZ")
            angles |= dict(zip(names, map(float, turned)))
        else:
            angles[name] = value
    return tuple(angles.values())


def lifted(heading: float = 0.0) -> Rotation:
    """The right arm lifted forward, a little outwards by `heading` [degrees]."""
    return Rotation.from_euler("ZY", (-heading, -80), degrees=True)


def walking(*others: Body, times, ways, angles) -> Scenario:
    """The person with the torso at (way, 0, 0) and these angles at these times."""
    stiffness = 73.0 * 30.0**2
    tracker = Tracker(
        *("torso", tuple(NAMES), times, tuple((way, 0.0, 0.0) for way in ways)),
        *((IDENTITY,) * len(times), angles),
        stiffness=stiffness,
        damping=2 * stiffness / 30.0,
    )
    bodies = (*BODIES, *others)
    return Scenario(
        *("walk", "", (), bodies, times[-1], TABLE_1, JOINTS, (tracker,), CHAINS), effects=("gravity",)
    )


def wall_push(lab: SimpleNamespace) -> Scenario:
    """Walk into a wall with the right arm stretched forward, and back."""
    angles = posture(right_shoulder=lifted(10), right_elbow=0.3)
    wall = lab.block("wall", (0.5, 3.0, 3.0), (FACE + 0.5, 0.0, 0.0), kind="fixed")
    return walking(wall, times=(0.0, 0.7, 1.0, 1.5), ways=(0.0, 0.3, 0.3, 0.0), angles=(angles,) * 4)


def played(scenario: Scenario, profile: str = "balanced") -> Recording:
    """The scenario as the reference plays it."""
    return record(ReferenceEngine(), scenario, Settings(profile, FRAME))


def work(recording: Recording, name: str) -> np.ndarray:
    """A counter per frame."""
    return recording.work[:, list(recording.work_names).index(name)]


def overlap(recording: Recording, scenario: Scenario) -> np.ndarray:
    """Depth per frame by coal [m]."""
    return measure(recording, scenario).overlap()


def assert_within_limits(recording: Recording, scenario: Scenario) -> None:
    """Every hinge within its limits and every ball joint in its reach cone, in every frame."""
    rows = translate(scenario).joints
    for angles in recording.joint_angle:
        assert (angles >= rows["lower"]).all()
        assert (angles <= rows["upper"]).all()
        rows["angle"] = rows["last_angle"] = angles
        rows["cosine"], rows["sine"] = np.cos(angles), np.sin(angles)
        for k in np.flatnonzero(rows["cone_count"]):
            keep_in_cone(rows, k)
        # a projected direction is inside to rounding
        np.testing.assert_allclose(rows["angle"], angles, atol=1e-9)


@pytest.mark.parametrize("profile", COLUMNS)
def test_a_pushed_arm_gives_way(lab: SimpleNamespace, profile: str) -> None:
    """Push an arm 30 cm into a wall: it folds, the body goes on, and no frame shows an overlap."""
    scenario = wall_push(lab)
    recording = played(scenario, profile)
    assert overlap(recording, scenario).max() <= OVERLAP_TOLERANCE + ORACLE_SLACK
    assert not work(recording, "gave_up").any()
    assert not work(recording, "way_back").any()
    assert_within_limits(recording, scenario)
    tracked = np.array(scenario.trackers[0].angles[0])
    off = np.abs(recording.joint_angle - tracked)
    arm = [name.startswith(("right_shoulder", "right_elbow", "right_wrist")) for name in NAMES]
    assert off[60][arm].max() > 0.15
    assert not off[:, np.logical_not(arm)].any()
    # the torso has room: it goes as if there were no wall
    alone = replace(scenario, bodies=BODIES)
    np.testing.assert_array_equal(recording.position[:, 0], played(alone, profile).position[:, 0])
    # free again, the arm goes back by e^-3 in 0.3 s
    assert off[-1].max() < 0.1 * off[60].max()
    touched = work(recording, "ik.rounds") > 0
    assert 30 < touched.sum() < 80
    assert ((work(recording, "posture_qp.solves") + work(recording, "ccd.passes"))[touched] > 0).all()
    assert (work(recording, "ik.joints")[touched] >= 4).all()
    assert work(recording, "pairs.contacting")[touched].min() >= 1


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_a_pushed_arm_stays_near_the_best_posture(lab: SimpleNamespace, profile: str) -> None:
    """Come within 1.3 of the free posture nearest to the tracker's, by SLSQP from five starts (sum over
    frames of the distance of all angles); reach cones bind the reference alone."""
    scenario = wall_push(lab)
    recording, world = played(scenario, profile), translate(scenario)
    first, last = world.drivers[0]["chains"][2]
    arm, rows = slice(first, last + 1), world.joints[first : last + 1]
    tracked = np.array(scenario.trackers[0].angles[0])
    vertices = [
        (b, Rotation.from_quat(p.orientation, scalar_first=True).apply(p.shape.vertices) + p.position)
        for b, body in enumerate(BODIES)
        for p in body.pieces
        if body.name in ("right_upper_arm", "right_forearm", "right_hand")
    ]

    def room(angles: np.ndarray, root: np.ndarray) -> np.ndarray:
        """What is left between each part of the arm and the wall's face [m]."""
        world.joints["angle"], world.drivers[0]["position"] = tracked, root
        world.joints["angle"][arm] = angles
        pose_links(world.bodies, world.joints, world.drivers[0])
        placed = [
            (world.bodies[b]["position"] + v @ world.bodies[b]["rotation"].T)[:, 0] for b, v in vertices
        ]
        return FACE - np.array([x.max() for x in placed])

    rng, found, best = np.random.default_rng(3), 0.0, 0.0
    for frame in range(30, 75, 9):
        root, goal, shown = recording.position[frame, 0], tracked[arm], recording.joint_angle[frame, arm]
        assert room(goal, root).min() < -0.01
        starts = [shown, goal, *(goal + rng.normal(0, 0.4, len(goal)) for _ in range(3))]
        answers = [
            minimize(
                lambda q, goal=goal: ((q - goal) ** 2).sum(),
                np.clip(start, rows["lower"], rows["upper"]),
                jac=lambda q, goal=goal: 2 * (q - goal),
                bounds=list(zip(rows["lower"], rows["upper"])),
                constraints={"type": "ineq", "fun": room, "args": (root,)},
                method="SLSQP",
            ).x
            for start in starts
        ]
        best += min(np.linalg.norm(q - goal) for q in answers if room(q, root).min() > -1e-6)
        found += np.linalg.norm(shown - goal)
    assert 0.9 * best < found <= 1.3 * best


@pytest.mark.parametrize("profile", COLUMNS)
def test_what_chains_cannot_take_the_body_does(lab: SimpleNamespace, profile: str) -> None:
    """Stop before a wall that the tracker walks through, though the chains alone could not come free."""
    wall = lab.block("wall", (0.5, 3.0, 3.0), (1.25, 0.0, 0.0), kind="fixed")
    angles = (posture(),) * 2
    scenario = walking(wall, times=(0.0, 1.0), ways=(0.3, 0.7), angles=angles)
    recording = played(scenario, profile)
    assert overlap(recording, scenario).max() <= OVERLAP_TOLERANCE + ORACLE_SLACK
    assert not work(recording, "gave_up").any()
    assert_within_limits(recording, scenario)
    assert 0.5 < recording.position[-1, 0, 0] < 0.65


def test_attraction_closes_the_gap_as_fast_as_a_lag() -> None:
    """Follow a posture that stands still at least as fast as exp(-t / tau), at any frame rate, and turn no
    hinge by more than that share of what parts the whole posture."""
    angles = (posture(), posture(left_elbow=1.0, right_knee=0.5))
    scenario = walking(times=(0.0, 1.0), ways=(0.0, 0.0), angles=angles)
    targets = np.array(angles[1])
    for rate in (30, 60, 120):
        world = ReferenceEngine().build(scenario, Settings("balanced", 1 / rate))
        world.drive(0)
        world._targets = []
        joints = world._world.joints
        joints["target_angle"] = joints["last_target_angle"] = targets
        slow = 1 - np.exp(-1 / rate / ATTRACTION_TIME)
        for frame in range(1, rate // 3):
            before = joints["angle"].copy()
            world.step()
            left = np.exp(-frame / rate / ATTRACTION_TIME) * targets
            assert (targets - joints["angle"] <= left + 1e-12).all()
            turned = np.abs(joints["angle"] - before).max()
            assert turned <= slow * np.linalg.norm(targets - before) + 1e-12


def test_velocities_lead_from_frame_to_frame(lab: SimpleNamespace) -> None:
    """Give links the velocities, and hinges the rates, by which they came to where they are."""
    scenario = wall_push(lab)
    recording = played(scenario)
    links = len(BODIES)
    centers = np.zeros((len(recording.time), links, 3))
    for b, body in enumerate(BODIES):
        turned = Rotation.from_quat(recording.orientation[:, b], scalar_first=True)
        centers[:, b] = recording.position[:, b] + turned.apply(body.center_of_mass)
        step = (turned[1:] * turned[:-1].inv()).as_rotvec() / FRAME
        np.testing.assert_allclose(recording.angular_velocity[1:, b], step, atol=1e-6)
    moved = np.diff(centers, axis=0) / FRAME
    np.testing.assert_allclose(recording.linear_velocity[1:, :links], moved, atol=1e-9)
    turned = np.diff(recording.joint_angle, axis=0) / FRAME
    np.testing.assert_allclose(recording.joint_rate[1:], turned, atol=1e-9)


def test_a_struck_ball_moves_the_body_no_farther_than_its_momentum(lab: SimpleNamespace) -> None:
    """Send a ball away with a hand, whose person recoils by at most p / (m w e) under critical damping."""
    arm = posture(right_shoulder=lifted())
    ball = lab.ball(position=(0.75, -0.2, 0.58), mass=5.0)
    coming = {"times": (0.0, 0.5, 1.0), "ways": (0.0, 0.4, 0.4), "angles": (arm,) * 3}
    alone, hit = walking(**coming), walking(ball, **coming)
    one, two = played(alone), played(hit)
    speed = two.linear_velocity[-1, -1, 0]
    assert speed > 0.3
    tracker, links = hit.trackers[0], hit.links(hit.trackers[0])
    mass = sum(hit.bodies[link].mass for link in links)
    root = links[0]
    away = np.abs(one.position[:, root] - two.position[:, root]).max()
    # twice the ball's momentum at most: it may bounce, and is pushed again
    assert 0.0 < away < 2 * 5.0 * speed / np.sqrt(mass * tracker.stiffness)


@pytest.mark.parametrize("profile", COLUMNS)
def test_a_tracker_may_start_in_a_wall(lab: SimpleNamespace, profile: str) -> None:
    """Come out of a wall that the tracker starts in, by the first frame."""
    arm = posture(right_shoulder=lifted(), right_elbow=0.3)
    wall = lab.block("wall", (0.5, 3.0, 3.0), (1.1, 0.0, 0.0), kind="fixed")
    scenario = walking(wall, times=(0.0, 0.2), ways=(0.0, 0.0), angles=(arm,) * 2)
    recording = played(scenario, profile)
    depth = overlap(recording, scenario)
    assert depth[0] > 0.03
    assert depth[1:].max() <= OVERLAP_TOLERANCE + ORACLE_SLACK
    assert_within_limits(recording, scenario)


@pytest.mark.parametrize("sunk", [0.001, 0.01, 0.03])
def test_straight_legs_give_way_to_a_risen_ground(lab: SimpleNamespace, sunk: float) -> None:
    """Free both feet of a ground that rose into the soles of straight legs; the torso stays."""
    person = lab.person()
    world = lab.build(person)
    sole = min(world.pieces["low"][:, 2])
    ground = lab.block("ground", (5.0, 5.0, 0.5), (0.0, 0.0, float(sole) - 0.5 + sunk), kind="fixed")
    world = lab.build(lab.person(bodies=(*person.bodies, ground)))
    world.state["counters"][:] = 0
    remove_overlap(world.of_stages())
    assert world.drivers[0]["is_free"] == 1
    assert abs(world.drivers[0]["position"][2]) <= 0.1 * sunk + OVERLAP_TOLERANCE
