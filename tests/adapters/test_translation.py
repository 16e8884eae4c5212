"""Scenario to the reference's arrays: every number lands where it belongs, and can be read back."""

from dataclasses import replace
from resource import RUSAGE_SELF, getrusage

import numpy as np
import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.engines.reference.compiling import small_world
from touchstone.adapters.engines.reference.reference_world import (
    PAIRS_AT_LEAST,
    PAIRS_PER_PIECE,
    pair_capacity,
    translate,
)
from touchstone.adapters.engines.reference.settings import configure
from touchstone.adapters.recorder import ready
from touchstone.reference_impl.core.kernel import entry_point
from touchstone.reference_impl.core.state_dtype import MATERIAL_CAPACITY
from touchstone.reference_impl.frame import prepare, step
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.scenarios.avatar.avatar import arm_with_hand_parts
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import (
    PairCoefficients,
)


def test_too_many_materials_are_unsupported(lab):
    """More materials than the reference's table holds are Unsupported, with both numbers."""
    count = MATERIAL_CAPACITY + 1
    names = [f"m{k:02}" for k in range(count)]
    balls = [replace(lab.ball(f"b{k}"), material=name) for k, name in enumerate(names)]
    table = tuple(PairCoefficients(one, two, 0.1, 0.1) for k, one in enumerate(names) for two in names[k:])
    scenario = replace(lab.scene(lab.ball()), bodies=tuple(balls), coefficients=table)
    with pytest.raises(
        Unsupported, match=f"reference: {count} materials in one scene, at most {MATERIAL_CAPACITY}"
    ):
        translate(scenario)


def test_room_for_pairs_follows_the_scene(lab):
    """Small scenes hold every pair that can meet, with patches; large ones a number per piece."""
    two = lab.scene(lab.ground(), *(lab.block(f"b{k}", (0.1, 0.1, 0.1), (k, 0.0, 0.1)) for k in range(2)))
    # three pairs of boxes: four points each at the start, and the pairs twice again at the end
    assert len(translate(two).pairs) == 3 * 6
    assert len(translate(lab.scene(lab.ground())).pairs) == 0
    balls = [lab.ball(f"b{k}", (k, 0.0, 1.0)) for k in range(300)]
    sizes = [pair_capacity(lab.scene(*balls[:count])) for count in (50, 300)]
    assert sizes == [PAIRS_AT_LEAST, 300 * PAIRS_PER_PIECE]


def test_links_know_what_moves_them(lab) -> None:
    """Fix the hand's fingers to the last hinge of the arm; bare links are passed over on the way up."""
    scenario = lab.person(arm_with_hand_parts())
    world = translate(scenario)
    pose_links(world.bodies, world.joints, world.drivers[0])
    index = scenario.body_index
    last = int(world.drivers[0]["chains"][0, 1])
    for name in ("palm", "thumb_distal", "little_proximal"):
        assert world.bodies[index(name)]["hinge"] == last
        assert world.bodies[index(name)]["chain"] == 0
    assert world.bodies[0]["hinge"] == world.bodies[0]["chain"] == -1
    assert world.bodies[index("right_forearm")]["above"] == index("right_upper_arm")
    assert world.bodies[index("thumb_middle")]["above"] == index("thumb_proximal")
    # the palm has no pieces
    assert world.bodies[index("thumb_proximal")]["above"] == index("right_forearm")


@pytest.mark.parametrize("name", ["fall", "ball_snip", "arms_cross", "table_slide"])
def test_all_worlds_have_arrays_of_the_same_types(name):
    """Hand every world to the same compiled step, which does not look its types up (`entry_point`)."""
    for array, usual in zip(translate(catalogue()[name]), small_world(), strict=True):
        assert array.dtype == usual.dtype
        assert array.ndim == usual.ndim
        assert array.flags.carray


def test_entry_point_is_the_kernel():
    """The compiled code of a step advances a world as the kernel does, to the bit."""
    one, two = (translate(catalogue()["fall"]) for _ in range(2))
    for world in (one, two):
        configure(world.state[0], "balanced")
        world.state["dt"], world.state["gravity"] = 1 / 60, (0.0, 0.0, -9.81)
        prepare(*world)
    compiled = entry_point(step, *small_world())
    for _ in range(10):
        step(*one)
        compiled(*two)
    assert one.bodies["velocity"].any()
    for name in ("position", "orientation", "velocity", "omega"):
        assert np.array_equal(one.bodies[name], two.bodies[name])


def test_first_contacts_find_their_memory_ready(registry) -> None:
    """Play a first impact without waiting for the system to provide pages of memory."""
    scene, settings = catalogue()["bounce_e05"], registry.settings("reference")
    worlds = [ready(registry.engine("reference"), scene, settings).world for _ in range(4)]
    faults = []
    for world in worlds:  # the first one also loads code
        before = getrusage(RUSAGE_SELF).ru_minflt
        for frame in range(scene.frame_count):
            world.drive(frame)
            world.step()
        faults.append(getrusage(RUSAGE_SELF).ru_minflt - before)
    assert min(faults[1:]) == 0
    assert max(faults[1:]) <= 2
