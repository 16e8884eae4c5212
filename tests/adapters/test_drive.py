"""The drive of the dynamics engines: closed forms of its wrench, and a loop that cannot diverge."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES
from touchstone.adapters.servo import INERTIA_RATIO, Drive, cut
from touchstone.adapters.vector_products import rotation_between, rotation_matrix
from touchstone.reference_impl.kinematics.skeleton import joint_space_inertia, pose_links
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Body, Box, Joint, Piece, Tracker

DT = 1 / 240
ROUNDING = 1e-12
"""A few dozen operations, relative."""
TURN = (0.8, 0.0, 0.6, 0.0)
TENSOR = ((0.02, 0.003, -0.001), (0.003, 0.03, 0.002), (-0.001, 0.002, 0.025))
STIFFNESS, DAMPING, MASS, TIP_MASS, HINGE = 500.0, 60.0, 1.5, 0.5, 30.0
ROOT_CENTER, TIP_CENTER = np.array([0.1, 0.0, -0.05]), np.array([0.2, 0.0, 0.0])


@pytest.fixture(scope="module")
def scenario(lab):
    """A root that rests, turned, with an off-centre mass and one hinged link; gravity is on."""
    box = (Piece("box", Box((0.1, 0.1, 0.1))),)
    links = (
        Body("tip", "driven", "wood", box, TIP_MASS, tuple(TIP_CENTER), TENSOR),
        Body("root", "driven", "wood", box, MASS, tuple(ROOT_CENTER), TENSOR),
    )
    tracker = Tracker(
        "root", ("hinge",), (0.0, 1.0), ((1.0, 2.0, 3.0),) * 2, (TURN,) * 2, ((0.0,),) * 2,
        stiffness=STIFFNESS, damping=DAMPING, hinge_frequency=HINGE,
    )  # fmt: skip
    joint = Joint("hinge", "root", "tip", (0.1, 0.0, 0.0), (0.0, 1.0, 0.0))
    return lab.scene(*links, joints=(joint,), trackers=(tracker,))


@pytest.fixture(scope="module")
def drive(scenario):
    """The drive of that body."""
    return Drive(scenario, scenario.trackers[0], DT, "torque")


@pytest.fixture(scope="module")
def glove():
    """The drive of the hand of `ball_snip`, its scene and its arrays."""
    scenario = catalogue()["ball_snip"]
    return Drive(scenario, scenario.trackers[0], DT, "torque"), scenario, translate(scenario)


def steiner(mass, center):
    """Inertia of a link about a point that `center` is seen from, with the same axes."""
    return np.array(TENSOR) + mass * (center @ center * np.eye(3) - np.outer(center, center))


def test_torque_of_a_turn_in_closed_form(drive):
    """The torque is I (w^2 theta + 2 w omega) with I about the root's origin, turned with the body."""
    turn, omega = np.array([0.1, -0.2, 0.15]), np.array([1.0, 2.0, -3.0])
    # the body stands turned back by `turn` from its target
    stands = Rotation.from_rotvec(-turn) * Rotation.from_quat(TURN, scalar_first=True)
    force, torque = drive.wrench(
        3, np.array([1.0, 2.0, 3.0]), stands.as_quat(scalar_first=True), np.zeros(3), -omega
    )
    w = (STIFFNESS / (MASS + TIP_MASS)) ** 0.5
    inertia = steiner(MASS, ROOT_CENTER) + steiner(TIP_MASS, np.array([0.1, 0.0, 0.0]) + TIP_CENTER)
    axes = stands.as_matrix()
    wanted = axes @ inertia @ axes.T @ (w * w * turn + 2 * w * omega)
    assert drive.inertia == pytest.approx(inertia, rel=ROUNDING)
    assert torque == pytest.approx(wanted, rel=1e-10)
    assert force == pytest.approx(np.zeros(3), abs=ROUNDING)


def test_a_half_turn_goes_the_short_way(drive):
    """Orientations are compared up to sign: the torque of -q is that of q."""
    stands = (Rotation.from_rotvec([0.0, 0.0, 3.0]) * Rotation.from_quat(TURN, scalar_first=True)).as_quat(
        scalar_first=True
    )
    torques = [drive.wrench(0, np.zeros(3), sign * stands, np.zeros(3), np.zeros(3))[1] for sign in (1, -1)]
    assert torques[0] == pytest.approx(torques[1], rel=ROUNDING)
    axes = Rotation.from_quat(stands, scalar_first=True).as_matrix()
    assert (np.linalg.solve(axes @ drive.inertia @ axes.T, torques[0]))[
        2
    ] < 0  # back by 3 rad, not on by 3.28


def test_hinge_torque_in_closed_form(drive):
    """One hinge feels its link's inertia less what the free root gives way."""
    seat = np.array([0.1, 0.0, 0.0])
    axis = np.array([0.0, 1.0, 0.0])
    # momentum of a unit rate: of the tip's centre, and about the root's origin
    linear = TIP_MASS * np.cross(axis, TIP_CENTER)
    angular = np.array(TENSOR) @ axis + np.cross(seat + TIP_CENTER, linear)
    held = axis @ steiner(TIP_MASS, TIP_CENTER) @ axis
    total = MASS * ROOT_CENTER + TIP_MASS * (seat + TIP_CENTER)
    cross = np.array([[0, total[2], -total[1]], [-total[2], 0, total[0]], [total[1], -total[0], 0]])
    inertia = steiner(MASS, ROOT_CENTER) + steiner(TIP_MASS, seat + TIP_CENTER)
    root = np.block([[(MASS + TIP_MASS) * np.eye(3), cross], [cross.T, inertia]])
    across = np.concatenate([linear, angular])
    felt = held - across @ np.linalg.solve(root, across)
    assert 0 < felt < 0.5 * held
    torque = drive.hinge_torques(0, np.array([-0.1]), np.array([0.3]))
    assert torque[0] == pytest.approx(felt * (HINGE**2 * 0.1 - 2 * HINGE * 0.3), rel=1e-10)


def test_targets_are_those_of_the_steps_end(glove):
    """Step k aims at the tracker at (k + 1) dt; there is a target for every step of the run."""
    drive, scenario, _ = glove
    tracker = scenario.trackers[0]
    assert len(drive.target.angle) == round(scenario.duration / DT)
    # keyframes are every fourth step
    assert drive.target.angle[3::4] == pytest.approx(np.array(tracker.angles[1:]), abs=ROUNDING)
    assert drive.start.angle[0] == pytest.approx(tracker.angles[0], abs=ROUNDING)


def test_gains_are_published_as_used(glove):
    """The manifest's gains are those of the drive."""
    drive = glove[0]
    gains = drive.gains()
    assert gains["hinge stiffness [N m/rad]"] == drive.hinge_stiffness.tolist()
    assert gains["rotation inertia [kg m^2]"] == drive.inertia.tolist()
    assert gains["rotation frequency [rad/s]"] == pytest.approx(50.0, rel=ROUNDING)  # sqrt(1000 / 0.4)
    assert (gains["stiffness [N/m]"], gains["damping [N s/m]"]) == (1000.0, 40.0)


@pytest.mark.parametrize("dt", [1 / 240, 1 / 540, 1 / 1020])
def test_the_explicit_loop_is_stable_in_every_posture(glove, dt):
    """Linearised about every posture of the glove, the loop of servo and semi-implicit step contracts."""
    drive, _, world = glove
    # and what is left of a disturbance after a tenth of a second is less than 1/e: a lag no viewer sees
    assert largest_radius(drive, world, dt, 12) ** (0.1 / dt) < np.exp(-1)


def largest_radius(drive, world, dt, every):
    """Spectral radius of servo and semi-implicit step, the largest over every so many-th posture."""
    row = world.drivers[0]
    largest = []
    for angles in drive.target.angle[::every]:
        world.joints["angle"] = angles
        pose_links(world.bodies, world.joints, row)
        inertia = joint_space_inertia(world.bodies, world.joints, row)
        turned = world.bodies[row["root"]]["rotation"]
        root = turned @ drive.inertia @ turned.T
        stiff = block_diag(drive.stiffness * np.eye(3), drive.frequency**2 * root, drive.hinge_stiffness)
        damp = block_diag(drive.damping * np.eye(3), 2 * drive.frequency * root, drive.hinge_damping)
        # v' = v - h M^-1 (K x + D v), x' = x + h v'
        pull, drag = (dt * np.linalg.solve(inertia, gain) for gain in (stiff, damp))
        one = np.eye(len(inertia))
        loop = np.block([[one - dt * pull, dt * (one - drag)], [-pull, one - drag]])
        largest.append(np.abs(np.linalg.eigvals(loop)).max())
    assert len(largest) > 10
    return max(largest)


def test_a_cut_inertia_is_bounded_by_both():
    """Where the servo has more than twice what hinges feel it gets just that; elsewhere nothing changes."""
    rng = np.random.default_rng(5)
    servo, felt = (m @ m.T + 0.1 * np.eye(6) for m in rng.normal(size=(2, 6, 6)))
    smaller = cut(servo, felt)
    ratios = np.linalg.eigvals(np.linalg.solve(felt, smaller)).real
    before = np.linalg.eigvals(np.linalg.solve(felt, servo)).real
    assert before.max() > INERTIA_RATIO > before.min()
    assert np.sort(ratios) == pytest.approx(np.sort(np.minimum(before, INERTIA_RATIO)), rel=1e-9)
    assert np.linalg.eigvalsh(servo - smaller).min() > -ROUNDING * np.abs(servo).max()
    assert (cut(0.1 * felt, felt) == 0.1 * felt).all()


@pytest.mark.parametrize("name", ["wall_push", "corner_slide", "two_arms", "arms_cross"])
def test_a_persons_explicit_loop_is_stable(name):
    """At the engines' largest step, linearised about the tracker's postures, the loop contracts."""
    scenario = catalogue()[name]
    drive = Drive(scenario, scenario.trackers[0], DT, "torque")
    assert largest_radius(drive, translate(scenario), DT, 60) < 1


@pytest.mark.engines
@pytest.mark.parametrize("name", ["dart", "bullet", "mujoco"])
def test_engines_follow_the_plain_recurrence_of_the_coupling(lab, registry, name):
    """Under explicit torques the path of `spring` is that of the held force alone, on every engine."""
    scenario, engine = catalogue()["spring"], registry.engine(name)
    dt = 1 / 240
    profile = next(iter(ENGINES[name].profiles))
    run = record(engine, scenario, Settings(profile, dt, effects=PLANNED, drive="torque"))
    for tracker in scenario.trackers:
        k = scenario.body_index(tracker.root)
        drive, mass = Drive(scenario, tracker, dt, "torque"), scenario.bodies[k].mass
        x, v, path = drive.start_position[0], np.zeros(3), []
        for step in range(round(scenario.duration / dt)):
            force = drive.stiffness * (drive.target.position[step] - x)
            force += drive.damping * (drive.target.linear_velocity[step] - v)
            v = v + dt / mass * force
            x = x + dt * v
            path.append(x)
        assert run.position[1:, k] == pytest.approx(np.array(path)[3::4], abs=1e-6)


def test_single_rotations_are_those_of_scipy():
    """Matrix and rotation vector of random quaternions, near and far, of any length: equal to the bit."""
    rng = np.random.default_rng(18)
    for k in range(2000):
        a = rng.normal(size=4)
        b = rng.normal(size=4) if k % 2 else a + rng.normal(size=4) * 10.0 ** -rng.integers(1, 9)
        first, second = (Rotation.from_quat(one, scalar_first=True) for one in (a, b))
        assert np.array_equal(rotation_matrix(a), first.as_matrix())
        assert np.array_equal(rotation_between(a, b), (second * first.inv()).as_rotvec())
    with pytest.raises(ValueError, match="length 0"):
        rotation_matrix(np.zeros(4))
