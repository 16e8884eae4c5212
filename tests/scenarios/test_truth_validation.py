"""Every kind of fault in how a body is said to move is reported with the path of its field."""

from dataclasses import replace
from math import nan

import pytest
from sound_scenario import faults_of, sound

from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Arc, Scenario, ScenarioError, Truth
from touchstone.scenarios.solids import box_inertia
from touchstone.scenarios.truths.force_truth import ForceTruth

START = Arc(0.0, (0.0, 0.0, 1.0))
TRUTH = [
    ({"law": "magic"}, "truths[0].law", "unknown law 'magic'; valid: arcs, torque_free, coupling, carried"),
    ({"body": "moon"}, "truths[0].body", "unknown body 'moon'; valid: ground, ball"),
    ({"body": "ground"}, "truths[0].body", "'ground' is fixed, expected a simulated body"),
    ({"law": "coupling", "arcs": ()}, "truths[0].body", "'ball' follows no tracker"),
    ({"law": "coupling", "body": "upper", "arcs": ()}, "truths[0].body", "expected one link"),
    ({"law": "carried", "arcs": ()}, "truths[0].body", "found 0 prescribed bodies, expected one"),
    ({"law": "turntable"}, "truths[0].arcs", "found 1, which does not fit the law 'turntable'"),
    ({"law": "torque_free"}, "truths[0].arcs", "found 1, which does not fit the law 'torque_free'"),
    ({"law": "torque_free", "arcs": ()}, "truths[0].body", "expected three different"),
    ({"arcs": ()}, "truths[0].arcs", "found 0, which does not fit the law 'arcs'"),
    ({"arcs": (replace(START, start=0.1),)}, "truths[0].arcs", "increasing starts from 0 on"),
    ({"arcs": (START, START)}, "truths[0].arcs", "increasing starts from 0 on"),
    ({"arcs": (replace(START, velocity=(nan, 0.0, 0.0)),)}, "truths[0].arcs[0].velocity", "nan"),
    ({"arcs": (replace(START, position=(0.0, 0.0)),)}, "truths[0].arcs[0].position", "found 2 numbers"),
    (
        {"arcs": (replace(START, angular_velocity=(1.0, 0.0, 0.0), angular_acceleration=(0.0, 1.0, 0.0)),)},
        "truths[0].arcs[0].angular_acceleration",
        "expected along the angular velocity",
    ),
]


@pytest.mark.parametrize(("change", "path", "message"), TRUTH)
def test_faults_of_a_truth(change: dict, path: str, message: str) -> None:
    """Tell what is wrong with how a body is said to move."""
    truth = replace(Truth("ball", "arcs", (START,)), **change)
    assert message in faults_of(sound() | {"truths": (truth,)})[path]


WEIGHT = ForceTruth("ground", "ball", 0.0, 1.0, 9.81)
FORCE = [
    ({"body": "moon"}, "forces[0].body", "unknown body 'moon'; valid: ground, ball"),
    ({"other": "moon"}, "forces[0].other", "unknown body 'moon'; valid: ground, ball"),
    ({"other": "ground"}, "forces[0].other", "'ground' and 'ground' cannot touch"),
    ({"quantity": "work"}, "forces[0].quantity", "unknown quantity 'work'; valid: force, impulse"),
    ({"value": 0.0}, "forces[0].value", "found 0.0, expected positive numbers"),
    ({"value": nan}, "forces[0].value", "nan"),
    ({"start": nan}, "forces[0].start", "nan"),
    ({"start": -0.1}, "forces[0].start", "expected 0 <= start < end <= 1.0"),
    ({"start": 1.0}, "forces[0].start", "expected 0 <= start < end <= 1.0"),
    ({"end": 1.5}, "forces[0].start", "expected 0 <= start < end <= 1.0"),
    ({"start": 0.505, "end": 0.53}, "forces[0].end", "no frame of 1/60 s lies between start and end"),
]


@pytest.mark.parametrize(("change", "path", "message"), FORCE)
def test_faults_of_a_force(change: dict, path: str, message: str) -> None:
    """Refuse invalid force truths, also in scenes with invalid bodies; a root stands for its links."""
    truth = replace(WEIGHT, **change)
    fields = sound() | {"forces": (truth,)}
    assert message in faults_of(fields)[path]
    if "cannot touch" not in message:
        assert message in faults_of(fields | {"joints": ()})[path]
    assert Scenario(**sound() | {"forces": (WEIGHT, replace(WEIGHT, body="upper"))}).forces[1].body == "upper"


def test_frames_of_a_force() -> None:
    """The frames of a window lie within it; rounding of its ends does not move them."""
    for start, end, frames in ((0.1, 0.3, (6, 18)), (0.1 - 1e-12, 0.3, (6, 18)), (0.11, 0.29, (7, 17))):
        assert replace(WEIGHT, start=start, end=end).frames(60) == frames


def test_truths_that_cannot_both_be() -> None:
    """Tell a second truth of one body, and a top that spins about a principal axis."""
    truth = Truth("ball", "arcs", (START,))
    assert "has two truths" in faults_of(sound() | {"truths": (truth, truth)})["truths[1].body"]
    fields = sound()
    box = box_inertia(1.0, (0.1, 0.2, 0.3))
    spinning = replace(fields["bodies"][1], inertia=box, angular_velocity=(0.0, 1.0, 0.0))
    fields["bodies"] = (fields["bodies"][0], spinning, *fields["bodies"][2:])
    fields["truths"] = (Truth("ball", "torque_free"),)
    assert "about a principal axis" in faults_of(fields)["truths[0].body"]
    fields["bodies"] = tuple(
        replace(body, angular_velocity=(0.0, 1.0, 0.1)) if body.name == "ball" else body
        for body in fields["bodies"]
    )
    assert Scenario(**fields).truths == fields["truths"]


@pytest.mark.filterwarnings("error")
def test_enormous_spins_are_compared_without_overflow() -> None:
    """Tell a spin that turns its axis at any magnitude, and print no warning."""
    fast = replace(START, angular_velocity=(1e30, 0.0, 0.0), angular_acceleration=(1e30, 0.0, 0.0))
    turning = replace(fast, angular_acceleration=(0.0, 1e30, 0.0))
    path = "truths[0].arcs[0].angular_acceleration"
    fine, wrong = (sound() | {"truths": (Truth("ball", "arcs", (arc,)),)} for arc in (fast, turning))
    assert Scenario(**fine).truths == fine["truths"]
    assert "expected along the angular velocity" in faults_of(wrong)[path]


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("platform_lift", {"linear_velocity": (0.1, 0.0, 0.0)}, "at rest on a prescribed one"),
        ("platform_lift", {"angular_velocity": (0.0, 0.0, 1.0)}, "at rest on a prescribed one"),
        ("turntable", {"center_of_mass": (0.01, 0.0, 0.0)}, "a ball about its centre of mass"),
    ],
)
def test_truths_on_a_prescribed_body(name: str, change: dict, message: str) -> None:
    """Tell a start or a shape that the closed form does not cover, and a support that moves otherwise."""
    scene = catalogue()[name]
    bodies = (scene.bodies[0], replace(scene.bodies[1], **change))
    with pytest.raises(ScenarioError, match=message):
        replace(scene, bodies=bodies)
    tracker, turned = scene.trackers[0], (0.0, 0.0, 0.0, 1.0)
    positions = (*tracker.positions[:-1], (0.0, 0.0, 9.0))
    orientations = (*tracker.orientations[:-1], turned)
    moved = replace(tracker, positions=positions, orientations=orientations)
    with pytest.raises(ScenarioError, match="prescribed"):
        replace(scene, trackers=(moved,))
