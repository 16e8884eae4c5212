"""The reference's kinematics and inertia against pinocchio's, and pinocchio's own inverse kinematics."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.kinematics.skeleton import joint_space_inertia, move_links, pose_links
from touchstone.scenarios.avatar.avatar import HAND_LENGTH, arm_with_hand_parts
from touchstone.scenarios.catalogue import catalogue

pytest.importorskip("pinocchio", reason="not installed (pip install pin)")

from touchstone.adapters.oracles.articulated import Articulated, DampedLeastSquares

POSTURES = 20
LENGTHS = 1e-12
"""Of links from the root at 1 m, some dozen joints away [m]: a thousand roundings."""
HAND = (0.0, 0.0, -HAND_LENGTH / 2)


@pytest.fixture(scope="module", params=["avatar", "arm with hand", "ball_snip"])
def posed(request, lab: SimpleNamespace):
    """The scenario, its world in a random posture and motion, and pinocchio's model with its posture."""
    match request.param:
        case "avatar":
            scenario = lab.person()
        case "arm with hand":
            scenario = lab.person(arm_with_hand_parts())
        case _:
            scenario = catalogue()["ball_snip"]
    world = lab.build(scenario)
    return scenario, world, Articulated(scenario, scenario.trackers[0])


def shuffle(posed, rng: np.random.Generator) -> np.ndarray:
    """Pose and move the driven body at random; its posture as pinocchio takes it."""
    _, world, model = posed
    driver, joints = world.drivers[0], world.joints
    driver["position"], driver["velocity"], driver["omega"] = rng.uniform(-1, 1, (3, 3))
    driver["orientation"] = Rotation.random(random_state=rng).as_quat(scalar_first=True)
    joints["angle"] = rng.uniform(joints["lower"], joints["upper"])
    joints["rate"] = rng.normal(size=len(joints))
    pose_links(world.bodies, joints, driver)
    move_links(world.bodies, joints, driver)
    return model.posture(driver["position"], driver["orientation"], joints["angle"])


def test_forward_kinematics_agrees(posed) -> None:
    """Pose every link where pinocchio has it."""
    scenario, world, model = posed
    links = list(scenario.links(scenario.trackers[0]))
    rng = np.random.default_rng(21)
    for _ in range(POSTURES):
        origins, rotations = model.poses(shuffle(posed, rng))
        np.testing.assert_allclose(world.bodies["position"][links], origins, atol=LENGTHS)
        np.testing.assert_allclose(world.bodies["rotation"][links], rotations, atol=LENGTHS)


def test_joint_space_inertia_agrees(posed) -> None:
    """Give the same matrix, root free, along the world's axes."""
    _, world, model = posed
    rng = np.random.default_rng(22)
    for _ in range(POSTURES):
        posture = shuffle(posed, rng)
        mine = joint_space_inertia(world.bodies, world.joints, world.drivers[0])
        theirs = model.inertia(posture)
        np.testing.assert_allclose(mine, theirs, atol=1e-12 * np.abs(theirs).max())


def test_energy_agrees(posed) -> None:
    """Add up the links' kinetic energy to pinocchio's."""
    scenario, world, model = posed
    links = list(scenario.links(scenario.trackers[0]))
    rng = np.random.default_rng(23)
    for _ in range(POSTURES):
        posture = shuffle(posed, rng)
        driver, kinetic = world.drivers[0], 0.0
        for row in world.bodies[links]:
            spin = row["rotation"].T @ row["omega"]
            kinetic += (row["mass"] * row["velocity"] @ row["velocity"] + spin @ row["inertia"] @ spin) / 2
        rates = np.concatenate([driver["velocity"], driver["omega"], world.joints["rate"]])
        assert model.kinetic_energy(posture, rates) == pytest.approx(kinetic, rel=1e-12)


@pytest.fixture(scope="module")
def loop(lab: SimpleNamespace):
    """The scenario of the person, and pinocchio's loop on its left arm."""
    person = lab.person()
    return person, DampedLeastSquares(person, person.chains[1], HAND, damping=0.01, cap=100)


def test_the_loop_knows_where_the_hand_is(loop, lab: SimpleNamespace) -> None:
    """Place the end effector where the reference's forward kinematics does."""
    person, solver = loop
    world = lab.build(person)
    first, last = world.drivers[0]["chains"][1]
    rows = world.joints[first : last + 1]
    rng = np.random.default_rng(24)
    for _ in range(POSTURES):
        rows["angle"] = rng.uniform(rows["lower"], rows["upper"])
        pose_links(world.bodies, world.joints, world.drivers[0])
        hand = world.bodies[rows[-1]["child"]]
        point = hand["position"] + hand["rotation"] @ HAND
        np.testing.assert_allclose(solver.place(rows["angle"].copy()), point, atol=LENGTHS)


def test_the_loop_reaches_near_goals_and_stops(loop) -> None:
    """Arrive within limits, and give up at the cap where the goal is out of reach."""
    _, solver = loop
    start = np.array((0.4, 0.1, 0.2, 0.9, 0.1, 0.05))
    goal = solver.place(start + 0.08).copy()
    steps, left, angles = solver.solve(start, goal, 1e-5)
    assert steps < 10
    assert left <= 1e-5
    np.testing.assert_allclose(solver.place(angles), goal, atol=1e-5)
    steps, left, angles = solver.solve(start, np.array((2.0, 0.0, 0.0)), 1e-5)
    assert (steps, left > 1) == (100, True)
    assert ((solver.lower <= angles) & (angles <= solver.upper)).all()
