"""Bodies that start in overlap or in one place; masses and sizes of any magnitude."""

import json
from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import AdapterError, State, Unsupported
from touchstone.adapters.recorder import record
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE
from touchstone.scenarios.catalogue import find
from touchstone.scenarios.relations.changes import similar


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
