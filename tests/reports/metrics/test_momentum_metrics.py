"""Momentum and energy of isolated and conservative scenes, kept and broken by known amounts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.energy import energy_ledger
from touchstone.scenarios.catalogue import catalogue, tagged

ROUNDING, INTEGRATED = 1e-12, 1e-10
"""Energy over the largest kinetic one that closed forms and integrated truths may gain or lose [1]."""


@pytest.mark.parametrize("scene", [scenario.name for scenario in tagged("isolated") if scenario.truths])
def test_the_closed_form_keeps_momentum(recordings, known, scene):
    """What moves by the closed form keeps linear and angular momentum, unless nothing turns at all."""
    scenario = catalogue()[scene]
    recording = known.ideal(recordings, scenario)
    assert known.value("momentum.linear", recording, scenario)[""] < ROUNDING
    if scene in ("collide_central", "collide_ratio_1e3", "collide_ratio_1e6", "cradle"):
        assert "nothing turns" in known.unmeasured("momentum.angular", recording, scenario)
    else:
        assert known.value("momentum.angular", recording, scenario)[""] < ROUNDING


@pytest.mark.slow
@pytest.mark.parametrize("scene", [scenario.name for scenario in tagged("conservative") if scenario.truths])
def test_the_closed_form_keeps_energy(recordings, known, scene):
    """What moves by the closed form of a conservative scene neither gains nor loses energy."""
    scenario = catalogue()[scene]
    recording = known.ideal(recordings, scenario)
    error = INTEGRATED if {"curved", "joints"} & {*scenario.tags} else ROUNDING
    assert 0 <= known.value("energy.gain", recording, scenario)[""] < error
    assert 0 >= known.value("energy.loss", recording, scenario)[""] > -error


def test_energy_without_a_closed_form_is_relative_to_the_start(recordings, known):
    """Judge what a break gains or loses by the kinetic energy of its cue ball."""
    scenario = catalogue()["break_15"]
    start = np.array([body.linear_velocity for body in scenario.bodies])
    velocity = np.tile(start, (scenario.frame_count + 1, 1, 1))
    velocity[10:] *= 1.1
    velocity[20:] = 0.0
    broken = recordings.recording(scenario, linear_velocity=velocity)
    assert known.value("energy.gain", broken, scenario)[""] == pytest.approx(0.21, rel=1e-12)
    assert known.value("energy.loss", broken, scenario)[""] == pytest.approx(-1.0, rel=1e-12)


def test_lost_and_won_momentum_is_relative(recordings, known):
    """A target that leaves 10 % too fast breaks linear momentum by its share, at the largest frame."""
    scenario = catalogue()["collide_central"]
    right = known.ideal(recordings, scenario)
    velocity = right.linear_velocity.copy()
    velocity[20:, 1] *= 1.1
    broken = replace(right, linear_velocity=velocity)
    extra = 0.1 * right.linear_velocity[-1, 1, 0] * scenario.bodies[1].mass
    start = scenario.bodies[0].mass * 2.0
    assert known.value("momentum.linear", broken, scenario)[""] == pytest.approx(extra / start, rel=ROUNDING)


def test_spin_from_nowhere_breaks_angular_momentum(recordings, known):
    """A spin that appears on one ball counts over the largest sum of |L|."""
    scenario = catalogue()["collide_oblique"]
    right = known.ideal(recordings, scenario)
    spin = right.angular_velocity.copy()
    spin[30:, 1, 2] = -7.0
    found = known.value("momentum.angular", replace(right, angular_velocity=spin), scenario)[""]
    added = scenario.bodies[1].inertia[2][2] * 7.0
    # each of the balls passes the common centre at 1 m/s, 25 mm off, turning the same way
    orbital = 2 * 1.0 * 1.0 * 0.025
    assert found == pytest.approx(added / (orbital + added), rel=1e-9)


def test_momentum_withheld_by_a_row(recordings, known):
    """The share that the last ball of a cradle lacks is what stayed behind, whoever has it."""
    scenario = catalogue()["cradle"]
    right = known.ideal(recordings, scenario)
    velocity = right.linear_velocity.copy()
    velocity[-1] = [(v, 0.0, 0.0) for v in (-0.5, 0.25, 0.25, 0.25, 0.75)]
    found = known.value("momentum.withheld", replace(right, linear_velocity=velocity), scenario)
    assert found == {"ball_5": pytest.approx(0.25, abs=ROUNDING)}
    oblique = catalogue()["collide_oblique"]
    recording = known.ideal(recordings, oblique)
    assert "no body hands all" in known.unmeasured("momentum.withheld", recording, oblique)


def test_the_law_of_an_impact_is_the_nearest(recordings, known):
    """The cradle's truth is one impact after another; a row that parts together follows another law."""
    scenario = catalogue()["cradle"]
    right = known.ideal(recordings, scenario)
    found = known.value("impact.law", right, scenario)
    assert found["sequential"] == pytest.approx(0, abs=ROUNDING)
    velocity = right.linear_velocity.copy()
    velocity[12:] = [(v, 0.0, 0.0) for v in (-0.6, 0.4, 0.4, 0.4, 0.4)]
    found = known.value("impact.law", replace(right, linear_velocity=velocity), scenario)
    assert found["Newton"] == pytest.approx(0, abs=ROUNDING)
    assert found["sequential"] == pytest.approx(0.6)
    said = known.unmeasured("impact.law", recordings.recording(catalogue()["slide"]), catalogue()["slide"])
    assert "no row or rack" in said


def test_energy_is_relative_to_the_truth(recordings, known):
    """A ball that falls too fast gains over m g h, one that falls too slowly loses."""
    scenario = catalogue()["fall"]
    right = known.ideal(recordings, scenario)
    scale = 0.5 * 9.81**2 + 0.5 * 0.4 * 0.05**2 * 25.0
    for factor, metric in ((1.1, "energy.gain"), (0.9, "energy.loss")):
        moved = replace(right, linear_velocity=factor * right.linear_velocity)
        change = 0.5 * 9.81**2 * (factor**2 - 1) / scale
        assert known.value(metric, moved, scenario)[""] == pytest.approx(change, rel=1e-9)


def test_a_soft_contact_that_stores_energy_loses_none(recordings, known):
    """Frames in which a body overlaps its support are left out: the spring gives back what it holds."""
    scenario = catalogue()["bounce_e1"]
    right = known.ideal(recordings, scenario)
    position, velocity = right.position.copy(), right.linear_velocity.copy()
    low = int(np.argmin(position[:20, 1, 2]))
    position[low, 1, 2], velocity[low, 1, 2] = 0.05 - 2e-4, 0.0
    stored = replace(right, position=position, linear_velocity=velocity)
    assert known.value("energy.loss", stored, scenario)[""] > -ROUNDING
    position[low, 1, 2] = 0.05 - 5e-5
    # at a depth that stores none all is lost that was kinetic in the frame
    shallow = replace(right, position=position, linear_velocity=velocity)
    assert known.value("energy.loss", shallow, scenario)[""] < -0.9


@pytest.mark.parametrize(
    "metric", ["momentum.linear", "momentum.angular", "momentum.withheld", "energy.gain", "energy.loss"]
)
def test_where_work_is_done_nothing_is_measured(recordings, known, metric):
    """Scenes with friction, gravity or a drive are not measured, with the tag that is missing."""
    scenario = catalogue()["slide"]
    assert "not tagged" in known.unmeasured(metric, recordings.recording(scenario), scenario)


def test_energy_of_bodies_that_always_overlap_is_not_measured(recordings, known):
    """A cue ball inside another one in every frame: contacts may store energy all the time."""
    scenario = catalogue()["break_15"]
    position = np.tile([body.position for body in scenario.bodies], (scenario.frame_count + 1, 1, 1))
    position[:, 0] = position[:, 1]
    with pytest.raises(NotMeasured, match=r"overlap by more than 0\.0001 m in every frame"):
        known.value("energy.gain", recordings.recording(scenario, position=position), scenario)


FRAME = 1 / 60


def ledger(registry: SimpleNamespace, scene) -> dict[str, float]:
    recording = record(registry.engine("reference"), scene, Settings("balanced", FRAME))
    return dict(energy_ledger(Context(recording, scene)))


def test_a_bounce_loses_by_restitution(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Lose (1 - e^2) m g h in one bounce, and nothing otherwise."""
    scene = lab.scene(lab.ground(), lab.ball(), e=0.6, duration=0.5)
    reported = ledger(registry, scene)
    # the impact is taken up to 7e-7 m above the ground
    assert reported["restitution"] == pytest.approx(-(1 - 0.6**2) * 9.81 * 0.95, abs=1e-5)
    assert reported["friction"] == reported["drive"] == 0
    assert abs(reported["correction"]) < ROUNDING


def test_a_sliding_box_loses_by_friction(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Lose all kinetic energy by friction."""
    box = lab.block("box", (0.1, 0.1, 0.1), (0.0, 0.0, 0.1), linear_velocity=(2.0, 0.0, 0.0))
    reported = ledger(registry, lab.scene(lab.ground(), box, mu=0.5))
    # every hold ends at a residual of 1e-12 m/s at most, which adds up over 0.4 s
    assert reported["friction"] == pytest.approx(-2.0, abs=1e-10)
    # the box stands 1e-6 m over the ground at most
    assert abs(reported["restitution"]) < 1e-9
    assert abs(reported["correction"]) < ROUNDING


def test_engines_tell_no_mechanisms(registry: SimpleNamespace, recordings: SimpleNamespace, lab) -> None:
    """Be measured on the reference alone."""
    scene = lab.scene(lab.ground(), lab.ball())
    with pytest.raises(NotMeasured, match="only the reference"):
        energy_ledger(Context(recordings.recording(scene), scene))
