"""A link that lies along a surface is lifted off as it lies; hinges keep orientations, chains bend."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.core.conventions import BEND_SHARE, OVERLAP_TOLERANCE
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.posture.chain_overlap_ik import bend, keep_orientation
from touchstone.reference_impl.posture.overlap_removal import remove_overlap

CHAIN = 1
"""The left arm."""
FOREARM_RADIUS = 0.04


def forearm_in_a_table(lab: SimpleNamespace, depth: float):
    """The left forearm level, so deep in a table that ends before the hand."""
    person = lab.person()
    names = [joint.name for joint in person.joints]
    world = lab.build(person, "paper")
    first, last = world.drivers[0]["chains"][CHAIN]
    # upper arm half-way forward, the elbow makes up for it
    axes = world.joints[first]["cone_axes"]
    lifted = Rotation.from_euler("y", -45, degrees=True).as_matrix()
    angles = Rotation.from_matrix(axes.T @ lifted @ axes).as_euler("XYZ")
    world.joints["angle"][first : first + 3] = angles
    world.joints["angle"][names.index("left_elbow")] = np.pi / 4
    pose_links(world.bodies, world.joints, world.drivers[0])
    elbow = world.bodies[person.body_index("left_forearm")]["position"].copy()
    top = elbow[2] - FOREARM_RADIUS + depth
    table = lab.block("table", (0.06, 0.3, 0.1), (elbow[0] + 0.13, elbow[1], top - 0.1), kind="fixed")
    built = lab.build(lab.person(bodies=(*person.bodies, table)), "paper")
    built.joints["angle"] = world.joints["angle"]
    pose_links(built.bodies, built.joints, built.drivers[0])
    built.state["counters"][:] = 0
    return built, person.body_index("left_forearm"), first, last


def test_a_link_along_a_surface_is_lifted_as_it_lies(lab: SimpleNamespace) -> None:
    """Raise the forearm off the table by 5 mm with its orientation kept, by shoulder and elbow alone."""
    world, forearm, first, last = forearm_in_a_table(lab, 0.005)
    before = world.bodies[forearm].copy()
    angles = world.joints["angle"].copy()
    remove_overlap(world.of_stages())
    assert world.drivers[0]["is_free"] == 1
    counted = lab.counters(world)
    assert counted["ik.rounds"] >= 1
    assert counted["gave_up"] == counted["way_back"] == counted["rounds"] == 0
    after = world.bodies[forearm]
    assert after["position"][2] - before["position"][2] == pytest.approx(0.005, abs=2e-5)
    # one hinge cannot undo the shoulder's turns out of its plane; turned by its own
    # contact it would tilt by 0.04
    assert abs(after["rotation"][2, 2] - before["rotation"][2, 2]) < 1e-3
    turned = world.joints["angle"] - angles
    assert np.abs(turned[first : first + 4]).max() > 5e-3
    assert not turned[first + 4 : last + 1].any()


def test_the_kept_orientation_is_the_nearest(lab: SimpleNamespace) -> None:
    """Turn a hinge to the angle that a search over all angles finds, within its limits."""
    rng = np.random.default_rng(4)
    for trial in range(20):
        world = lab.build(lab.person())
        first, last = world.drivers[0]["chains"][CHAIN]
        k = int(rng.integers(first, last + 1))
        joint = world.joints[k]
        parent, child = world.bodies[joint["parent"]], world.bodies[joint["child"]]
        wanted = Rotation.random(random_state=trial)
        child["orientation"] = wanted.as_quat(scalar_first=True)
        frame, axis = Rotation.from_matrix(parent["rotation"]), joint["axis"].copy()

        def apart(angle: float, frame=frame, axis=axis, wanted=wanted) -> float:
            return float((wanted.inv() * frame * Rotation.from_rotvec(angle * axis)).magnitude())

        keep_orientation(parent, joint, child)
        allowed = np.linspace(joint["lower"], joint["upper"], 400)
        turned = wanted.inv() * frame * Rotation.from_rotvec(allowed[:, None] * axis)
        coarse = allowed[turned.magnitude().argmin()]
        found = minimize_scalar(
            apart,
            bounds=(max(coarse - 0.02, joint["lower"]), min(coarse + 0.02, joint["upper"])),
            method="bounded",
            options={"xatol": 1e-10},
        )
        # off the limits the best angle; at a limit, the end of the range that is nearer round the circle
        assert joint["lower"] <= joint["angle"] <= joint["upper"]
        if joint["lower"] + 0.02 < found.x < joint["upper"] - 0.02:
            assert apart(float(joint["angle"])) <= found.fun + 1e-7
            turned = frame * Rotation.from_rotvec(joint["angle"] * joint["axis"])
            np.testing.assert_allclose(child["rotation"], turned.as_matrix(), atol=1e-12)


def test_only_hinges_of_their_own_bend(lab: SimpleNamespace) -> None:
    """Bend elbow and wrist by a twentieth of the way to the middle of their ranges, no ball joint."""
    world = lab.build(lab.person())
    first, last = map(int, world.drivers[0]["chains"][CHAIN])
    bend(world.joints, first, last)
    rows = world.joints[first : last + 1]
    assert not rows["angle"][:3].any()
    np.testing.assert_allclose(
        rows["angle"][3:], BEND_SHARE * (rows["lower"] + rows["upper"])[3:] / 2, rtol=1e-14
    )


@pytest.mark.parametrize("profile", ["paper", "balanced"])
@pytest.mark.parametrize("sunk", [0.001, 0.01, 0.03])
def test_straight_legs_give_way_to_a_risen_ground(lab: SimpleNamespace, profile: str, sunk: float) -> None:
    """Free both feet of a ground that rose into the soles of straight legs; the torso stays."""
    person = lab.person()
    world = lab.build(person, profile)
    sole = min(world.pieces["low"][:, 2])
    ground = lab.block("ground", (5.0, 5.0, 0.5), (0.0, 0.0, float(sole) - 0.5 + sunk), kind="fixed")
    world = lab.build(lab.person(bodies=(*person.bodies, ground)), profile)
    world.state["counters"][:] = 0
    remove_overlap(world.of_stages())
    assert world.drivers[0]["is_free"] == 1
    assert abs(world.drivers[0]["position"][2]) <= 0.1 * sunk + OVERLAP_TOLERANCE
