"""The reference behind the contract: scenes become arrays, odd starts are played, constants may vary."""

import importlib
import json
import os
import subprocess
import sys
from dataclasses import replace
from resource import RUSAGE_SELF, getrusage

import numpy as np
import pytest

from touchstone.adapters.contract import AdapterError, State, Unsupported
from touchstone.adapters.engines.reference.compiling import small_world
from touchstone.adapters.engines.reference.reference_world import (
    translate,
)
from touchstone.adapters.engines.reference.variable import MECHANISMS, constants, install, vary
from touchstone.adapters.recorder import ready, record
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE
from touchstone.reference_impl.core.state_dtype import MATERIAL_CAPACITY
from touchstone.scenarios.catalogue import catalogue, find
from touchstone.scenarios.relations.changes import similar
from touchstone.scenarios.scenario import PairCoefficients


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


@pytest.mark.parametrize("name", ["fall", "ball_snip", "arms_cross", "table_slide"])
def test_all_worlds_have_arrays_of_the_same_types(name):
    """Hand every world to the same compiled step, which does not look its types up (`entry_point`)."""
    for array, usual in zip(translate(catalogue()[name]), small_world(), strict=True):
        assert array.dtype == usual.dtype
        assert array.ndim == usual.ndim
        assert array.flags.carray


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


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_overlap_at_the_start_is_parted_without_a_throw(lab, profile):
    """Part two boxes that start half in each other on the reference, leave them at rest, and say so: the
    energy of lifting the upper one by 5 cm."""
    half = (0.05, 0.05, 0.05)
    low, high = (lab.block(f"box_{z}", half, (0.0, 0.0, z)) for z in (0.05, 0.1))
    world = lab.build(lab.scene(lab.ground(), low, high), profile)
    told = lab.play(world, 10, lambda w: (w.state[0]["parted_energy"], w.bodies["velocity"].copy()))
    assert told[0][0] == pytest.approx(9.81 * 0.05, rel=1e-4)  # lifted from where it fell to in a frame
    # what is lifted keeps the speed of the frame at most: g / 60
    assert np.abs([velocity for _, velocity in told]).max() <= 9.81 / 60 + 1e-9
    # as deep as two pairs may be left
    assert world.bodies["position"][:, 2] == pytest.approx([-0.5, 0.05, 0.15], abs=2 * OVERLAP_TOLERANCE)


def test_bodies_in_one_place_are_not_played(lab, registry):
    """Refuse a run in which two bodies start in one place, in one line."""
    scene = lab.scene(lab.ground(), lab.ball("one"), lab.ball("two"))
    told = r"^bodies\[2\].position: 'two' starts where 'one' does: .* \(0, 0, 1\) m; move one of them$"
    with pytest.raises(AdapterError, match=told):
        record(registry.engine("reference"), scene, registry.settings("reference"))


def test_a_mass_without_a_reciprocal_is_refused(lab, registry):
    """Refuse a subnormal mass beside an enormous one by name: no unit of mass represents both."""
    grain = replace(lab.ball("grain"), mass=1e-310, inertia=np.eye(3) * 1e-313)
    giant = replace(lab.ball("giant"), position=(3.0, 0.0, 1.0), mass=1e300, inertia=np.eye(3) * 1e297)
    scene = lab.scene(grain, giant, lab.ground())
    with pytest.raises(Unsupported, match=r"reference: mass or inertia of 'grain' is too small"):
        registry.engine("reference").build(scene, registry.settings("reference"))


@pytest.mark.parametrize("exponent", [-1000, -120, 120, 900])
def test_masses_of_any_magnitude_move_in_the_same_way(lab, registry, exponent):
    """Scale impulses and the manifest's masses by a power of two, and change no bit of the motion."""
    unit, ball = 2.0**exponent, lab.ball("ball")
    mass, inertia = ball.mass * unit, np.array(ball.inertia) * unit
    scaled = replace(ball, mass=mass, inertia=tuple(map(tuple, inertia.tolist())))
    settings = registry.settings("reference")
    one, two = (
        record(registry.engine("reference"), lab.scene(lab.ground(), body), settings)
        for body in (ball, scaled)
    )
    assert len(one.contacts)
    np.testing.assert_array_equal(two.position, one.position)
    np.testing.assert_array_equal(two.contacts["impulse"], one.contacts["impulse"] * unit)
    facts = json.loads(two.manifest)["bodies"]["ball"]
    assert facts["mass"] == mass
    assert facts["inertia"] == inertia.tolist()


def stack(lab, size):
    """Two cubes of an edge [m], one above the other and a tenth of it apart, fall onto the ground."""
    half = (size / 2,) * 3
    places = ((0.0, 0.0, 0.6 * size), (0.1 * size, 0.0, 1.7 * size))
    mass, inertia = 1e3 * size**3, np.eye(3) * 1e3 * size**5 / 6
    cubes = (
        replace(lab.block(f"cube_{k}", half, place), mass=mass, inertia=tuple(map(tuple, inertia.tolist())))
        for k, place in enumerate(places)
    )
    return lab.scene(lab.ground(), *cubes)


@pytest.mark.parametrize("size", [1e-6, 1e-5, 1e-4, 1e-3, 1.0])
def test_cubes_of_any_size_rest_on_each_other(lab, registry, size):
    """Tolerances go with the size of the bodies: cubes of 10 um rested 0.16 edges too high."""
    scene = stack(lab, size)
    recording = record(registry.engine("reference"), scene, registry.settings("reference"))
    np.testing.assert_allclose(recording.position[-1, 1:, 2] / size, (0.5, 1.5), atol=1e-4)
    last = recording.contacts[recording.contacts["time"] > scene.duration - 1.5 / 60]
    assert last["impulse"][:, 2].sum() == pytest.approx((1 + 2) * 1e3 * size**3 * 9.81 / 60, rel=1e-6)


@pytest.mark.parametrize("exponent", [-9, -6, 7])
@pytest.mark.parametrize("name", ["stack", "belt", "push_box"])
def test_scenes_of_any_size_move_in_the_same_way(registry, name, exponent):
    """Froude's law to the bit: lengths, times and speeds by powers of two, far from what a hand can hold."""
    scene, times, frames = find(name), 2.0**exponent, 40
    rate = round(scene.frame_rate * max(1, 1 / times))
    scaled = similar(scene, times, duration=scene.duration * times, frame_rate=rate)
    settings, found = registry.settings("reference"), []
    for one, dt in ((scene, settings.dt), (scaled, settings.dt * times)):
        world, state = registry.engine("reference").build(one, replace(settings, dt=dt)), State(one)
        for frame in range(frames):
            world.drive(frame)
            world.step()
        world.read(state)
        found.append((state, state.contacts[: state.contact_count]))
    (one, contacts), (two, others) = found
    np.testing.assert_array_equal(two.position, one.position * times**2)
    np.testing.assert_array_equal(two.linear_velocity, one.linear_velocity * times)
    np.testing.assert_array_equal(two.angular_velocity, one.angular_velocity / times)
    for field, unit in (("position", times**2), ("distance", times**2), ("velocity_b_after", times)):
        np.testing.assert_array_equal(others[field], contacts[field] * unit)
    np.testing.assert_array_equal(others["impulse"], contacts["impulse"] * times)


PLAY = """
import json
from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference import variable
from touchstone.adapters.recorder import build, frame_seconds
from touchstone.adapters.registry import load
from touchstone.scenarios.catalogue import catalogue

variable.install()
engine, scene, settings = load("reference"), catalogue()["slide"], Settings("balanced", 1 / 60)
def end(values={}, off=()):
    variable.vary(values, off)
    world = build(engine, scene, settings)[0]
    for frame in range(2):
        frame_seconds(world, scene, settings, frame)
    return world._world.bodies["position"].tolist()
first = end()
print(json.dumps({
    "plain": first,
    "varied": end({"core.conventions.TOUCH_DISTANCE": -1.0}),
    "switched": end(off=[one.name for one in variable.MECHANISMS]),
    "again": end(),
}))
"""


def test_constants_are_those_of_their_modules() -> None:
    """Every constant has the value that its module gives it, and a type that varying keeps."""
    assert len(constants()) > 100
    for one in constants():
        value = getattr(importlib.import_module(f"touchstone.reference_impl.{one.module}"), one.name)
        assert (one.value, one.whole) == (value, isinstance(value, int))
        assert not one.whole or one.times(0.25) == int(one.times(0.25)) >= 1


def test_mechanisms_are_kernels() -> None:
    """Every mechanism names a function of the reference, and no two have one name."""
    for one in MECHANISMS:
        assert hasattr(importlib.import_module(f"touchstone.reference_impl.{one.module}"), one.function)
    assert len({one.name for one in MECHANISMS}) == len(MECHANISMS)


@pytest.mark.slow
def test_values_in_memory_play_as_the_reference_does_and_can_be_varied() -> None:
    """With its own values the motion is the reference's to the bit; another value or a switch changes it."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PLAY], capture_output=True, text=True, check=True, env=environment
    )
    found = json.loads(done.stdout)
    plain = PLAY.replace("variable.install()", "").replace("    variable.vary(values, off)\n", "")
    usual = subprocess.run(
        [sys.executable, "-c", plain], capture_output=True, text=True, check=True, env=environment
    )
    assert found["plain"] == found["again"] == json.loads(usual.stdout)["plain"]
    assert found["plain"] not in (found["varied"], found["switched"])


def test_a_reference_that_is_imported_stays() -> None:
    """Constants cannot be moved to memory once kernels are compiled with them."""
    importlib.import_module("touchstone.reference_impl.core.kernel")
    with pytest.raises(RuntimeError, match="imported already"):
        install()
    vary({})
