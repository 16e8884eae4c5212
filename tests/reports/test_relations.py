"""The study relations: changes are what they say, and an engine with a preferred place fails them."""

from dataclasses import replace

import numpy as np
import pytest
from fake_world import FakeEngine, FakeWorld

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import load
from touchstone.reports.studies.relations import HELD, NAMES, SPLIT, Task, _rescaled, compare, rows_of_task
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.relations.changes import rescaled
from touchstone.scenarios.relations.table import RELATIONS
from touchstone.scenarios.validation import faults

SETTINGS = Settings("balanced", 1 / 60)


class World(FakeWorld):
    """Bodies fall freely, exactly; the fault bends that."""

    def read(self, state):
        t = self.steps * self.settings.dt
        for k, body in enumerate(self.scenario.bodies):
            fall = np.array(self.scenario.acting_gravity) if body.kind == "simulated" else np.zeros(3)
            place = np.array(body.position) + np.array(body.linear_velocity) * t + fall * t * t / 2
            match self.fake:
                case "has a west":
                    place[0] += 1e-3 * t
                case "rounds places":
                    place = np.round(place, 4)
                case "prefers the first":
                    place[2] += 1e-4 * k * t
                case "weighs":
                    place[2] += 1e-4 * body.mass * t
            state.position[k] = place
            state.orientation[k] = body.orientation
            state.linear_velocity[k] = np.array(body.linear_velocity) + fall * t
            state.angular_velocity[k] = body.angular_velocity


BROKEN = {
    "has a west": {"yaw", "rotation", "mirror", "froude"},
    "rounds places": {"translation", "yaw"},
    "prefers the first": {"bodies"},
    "weighs": {"masses"},
}
"""Fault of a fake engine, and relations that it breaks."""


@pytest.mark.parametrize("fault", ["", *BROKEN])
def test_a_fault_breaks_its_relations(fault):
    """A fault shows in the relations that it contradicts; a faultless engine holds all."""
    scene = catalogue()["collide_oblique"].reduced(effects=("gravity",))
    found = compare(FakeEngine(fault, World), Task(scene, "reference", SETTINGS))
    broken = {name for name, value in found.deviations.items() if value > 1e-12}
    assert broken >= BROKEN.get(fault, set())
    assert bool(broken) == bool(fault)


@pytest.mark.parametrize(
    "name", ["stack", "bounce_e1", "arch_stands", "coin_rolls", "slap_3", "spring", "governor"]
)
@pytest.mark.parametrize("relation", RELATIONS)
def test_changed_scenes_are_valid(name, relation):
    """Every change of a scene passes the checks of scenes."""
    scene, one = catalogue()[name], RELATIONS[relation]
    if one.applies(scene):
        assert faults(one.change(scene)) == []


def test_ratios_with_a_unit_grow_with_the_scene():
    """A slider coupled with a hinge moves as many times as far as the scene is larger; others keep ratios."""
    scene = catalogue()["pendulums"]
    shaft, other, third = scene.body_joints
    rack = replace(other, type="slider", mimics=shaft.name, ratio=3.0)
    gear = replace(third, mimics=shaft.name, ratio=3.0)
    scaled = rescaled(replace(scene, body_joints=(shaft, rack, gear), truths=(), published=()), 2.0)
    assert [joint.ratio for joint in scaled.body_joints] == [1.0, 12.0, 3.0]


def test_froude_keeps_numbers_without_a_dimension():
    """g t^2 / l and v t / l stay."""
    scene = catalogue()["slide"]
    large = rescaled(scene, 2.0)
    body, image = scene.bodies[1], large.bodies[1]
    assert large.duration == 2 * scene.duration
    assert image.pieces[0].shape.half_extents == tuple(4 * h for h in body.pieces[0].shape.half_extents)
    assert image.linear_velocity == tuple(2 * v for v in body.linear_velocity)
    with pytest.raises(ValueError, match="multiple of 7"):
        rescaled(scene, 7.0)


def test_settings_with_a_unit_grow_with_the_scene():
    """A gap in metres falls to a quarter and a speed to a half where times fall to a half; counts stay."""
    changed = _rescaled(Task(catalogue()["slide"], "reference", SETTINGS), 0.5)
    assert changed.dt == SETTINGS.dt / 2
    assert dict(text.split("=") for text in changed.changes) == {"v_rest": "0.0045", "impact_gap": "1.25e-07"}


def test_later_waits():
    """Trackers hold their first pose, then do the same; scenes that move at once are left out."""
    scene, relation = catalogue()["spring"], RELATIONS["later"]
    assert relation.applies(scene)
    tracker, image = scene.trackers[0], relation.change(scene).trackers[0]
    wait = relation.wait / scene.frame_rate
    assert image.times[:2] == (0.0, wait)
    assert image.positions[:2] == (tracker.positions[0],) * 2
    assert image.times[-1] == pytest.approx(tracker.times[-1] + wait)
    assert not relation.applies(catalogue()["slide"])


@pytest.mark.parametrize("name", ["fall", "stack", "collide_oblique", "double_pendulum"])
def test_the_reference_holds_every_relation(name):
    """Motions agree to rounding; one that does not apply has a reason."""
    found = compare(load("reference"), Task(catalogue()[name], "reference", SETTINGS))
    rows = rows_of_task(Task(catalogue()[name], "reference", SETTINGS), found)
    assert {row.verdict for row in rows} <= {"", "pass", "skipped"}, rows
    assert set(found.deviations) == set(NAMES)
    assert found.deviations[SPLIT] <= HELD
    if not catalogue()[name].body_joints:
        assert found.deviations["masses"] == 0.0
