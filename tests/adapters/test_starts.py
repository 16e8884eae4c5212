"""Bodies that start in overlap or in one place."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import AdapterError, Unsupported
from touchstone.adapters.recorder import record
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE


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
