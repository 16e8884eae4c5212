"""Boxes that persons and hinged drivers hold, lift and carry."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pushing import play, worst

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.adapters.recording import Recording
from touchstone.adapters.servo import servo_stiffness
from touchstone.reference_impl import frame
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.tracking import ease, sample
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import (
    GRAVITY,
    IDENTITY,
    Body,
    Box,
    Chain,
    Joint,
    PairCoefficients,
    Piece,
    Scenario,
    Tracker,
)
from touchstone.scenarios.solids import block, box_inertia, slab

PROFILES = ("balanced", "accurate")
SCENES = ("hold", "carry")
STILL = 1.0
"""Time after the last motion of a tracker in which a held box must not move [s]."""


@cache
def played(name: str, profile: str) -> tuple[Scenario, Recording]:
    """A scene of the catalogue, whose tracker stays at its end for a second more."""
    scene = catalogue()[name]
    one = scene.trackers[0]
    longer = replace(
        one,
        times=(*one.times, one.times[-1] + STILL),
        positions=(*one.positions, one.positions[-1]),
        orientations=(*one.orientations, one.orientations[-1]),
        angles=(*one.angles, one.angles[-1]),
    )
    scene = replace(scene, trackers=(longer,), duration=scene.duration + STILL)
    return scene, play(scene, profile)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", SCENES)
def test_a_held_box_hangs_still(name, profile):
    """Creep by less than a micrometre in the last half second, off the table, and overlap nothing."""
    scene, recording = played(name, profile)
    box = recording.position[:, scene.body_index("box")]
    assert box[-1, 2] > box[0, 2] + 0.05
    assert np.ptp(box[-round(STILL / 2 * 60) :], axis=0).max() < 1e-6
    assert worst(scene, recording, "overlap.max") < 1e-6
    assert worst(scene, recording, "solver.dropped_time") == 0
    assert worst(scene, recording, "joint.limit") < 1e-9


@pytest.mark.parametrize("name", SCENES)
def test_both_hands_bear_the_box_alike(name):
    """Share the load evenly, and bear the whole weight."""
    scene, recording = played(name, "balanced")
    context, rows = Context(recording, scene), recording.contacts
    late = context.contact_frame >= len(recording.time) - 7
    forces = {}
    for side in ("left", "right"):
        total = np.zeros(3)
        for link in (f"{side}_hand", f"{side}_forearm"):
            mine = late & (rows["body_a"] == scene.body_index(link))
            total += rows["impulse"][mine].sum(axis=0) * 10
        forces[side] = total
    left, right = forces["left"], forces["right"]
    weight = scene.bodies[scene.body_index("box")].mass * GRAVITY
    np.testing.assert_allclose(left + right, (0, 0, weight), atol=1e-6 * weight)
    np.testing.assert_allclose(left * (1, -1, 1), right, atol=1e-5 * weight)


def paddles(angle: float) -> Scenario:
    """Two paddles, each on a hinge of its root, squeeze a box of 0.2 kg by an angle [rad] and lift it by 0.2
    m."""
    times = np.arange(241) / 60
    close, up = ease(times, 0.1, 0.4), ease(times, 0.8, 1.0)
    bodies: list[Body] = []
    joints, chains, trackers = [], [], []
    root, paddle, half = (0.02, 0.02, 0.02), (0.03, 0.01, 0.05), (0.03, 0.03, 0.03)
    for side, name in ((1, "left"), (-1, "right")):
        hanging = Piece("paddle", Box(paddle), position=(0.0, 0.0, -0.05))
        link, hinge = f"{name}_paddle", f"{name}_hinge"
        massive = {"mass": 0.3, "inertia": box_inertia(0.3, paddle), "center_of_mass": (0.0, 0.0, -0.05)}
        bodies += [
            Body(name, "driven", "wood", (Piece("root", Box(root)),), 1.0, inertia=box_inertia(1.0, root)),
            Body(link, "driven", "wood", (hanging,), **massive),
        ]
        joints.append(Joint(hinge, name, link, (0.0, 0.0, -0.03), (1.0, 0.0, 0.0), IDENTITY, -1.5, 1.5))
        chains.append(Chain(f"{name}_chain", (hinge,)))
        places = tuple((0.0, side * 0.045, 0.145 + 0.2 * float(u)) for u in up)
        turned = (IDENTITY,) * len(times), tuple((-side * angle * float(c),) for c in close)
        coupling = {"stiffness": 4000.0, "damping": 2 * (4000.0 * 1.3) ** 0.5}
        trackers.append(Tracker(name, (hinge,), tuple(times.tolist()), places, *turned, **coupling))
    box = block("box", "wood", half, 0.2, (0.0, 0.0, half[2]))
    given = (
        (slab("ground", "wood"), *bodies, box),
        float(times[-1]),
        (PairCoefficients("wood", "wood", 0.0, 0.6),),
    )
    driven = {"joints": tuple(joints), "chains": tuple(chains), "trackers": tuple(trackers)}
    return Scenario("paddles", "", (), *given, **driven)


@pytest.mark.parametrize("profile", PROFILES)
def test_hinged_paddles_lift_a_box_and_do_not_climb_it(profile):
    """Hold it at 0.2 m, where the withheld turn of a hinge acted as a belt before."""
    scene = paddles(0.8)
    recording = play(scene, profile)
    box = recording.position[:, scene.body_index("box")]
    assert box[-1, 2] - box[0, 2] == pytest.approx(0.2, abs=1e-3)
    assert np.ptp(box[-60:], axis=0).max() < 1e-9


@pytest.mark.parametrize("profile", PROFILES)
def test_a_hinge_bears_the_torque_of_its_servo(profile):
    """Balance the contact's moment about the hinge by its servo times the angle by which it stays behind."""
    scene = paddles(0.8)
    recording = play(scene, profile)
    context, rows = Context(recording, scene), recording.contacts
    world = translate(scene)
    frame.prepare(*world)
    target = sample(scene.trackers[0], recording.time[-1:])
    driver, last = world.drivers[0], recording.joint_angle[-1]
    driver["position"] = recording.position[-1, driver["root"]]
    driver["orientation"] = recording.orientation[-1, driver["root"]]
    world.joints["angle"] = last
    pose_links(world.bodies, world.joints, driver)
    link = scene.body_index("left_paddle")
    mine = (context.contact_frame == len(recording.time) - 2) & (rows["body_a"] == link)
    arm = rows["position"][mine] - world.bodies["position"][link]
    moment = -np.cross(arm, rows["impulse"][mine]).sum(axis=0)[0] * 60
    behind = target.angle[0, 0] - last[0]
    (stiffness,) = servo_stiffness(scene, scene.trackers[0])
    np.testing.assert_allclose(moment + stiffness * behind, 0.0, atol=1e-4 * abs(moment))
