"""Every kind of fault is reported with the path of its field, all at once."""

from dataclasses import replace
from math import inf, nan
from types import SimpleNamespace

import pytest
from scipy.spatial.transform import Rotation
from sound_scenario import CUBE, QUIET, faults_of, sound

from touchstone.scenarios.avatar.noisy_tracker import noisy
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.places import coinciding
from touchstone.scenarios.relations.changes import heavier, rescaled, rotated
from touchstone.scenarios.scenario import (
    HOLD_LAST,
    UNMOVED,
    Arc,
    Body,
    Box,
    Capsule,
    Chain,
    Cone,
    Cylinder,
    Ellipsoid,
    Hull,
    Joint,
    Piece,
    ReachCone,
    RoundedBox,
    RoundedHull,
    Scenario,
    ScenarioError,
    Sphere,
    Tracker,
    Truth,
)
from touchstone.scenarios.solids import box_inertia
from touchstone.scenarios.truths.force_truth import ForceTruth


def test_a_sound_scenario_is_accepted() -> None:
    """Accept the scenarios that all the faulty ones differ from."""
    assert Scenario(**sound()).frame_count == 60
    assert Scenario(**with_ball()).chains
    assert Scenario(**prescribed()).trackers


TOP = [
    # (fields that change, path, part of the message)
    ({"name": ""}, "name", "expected a name"),
    ({"gravity": (0.0, 0.0, nan)}, "gravity", "nan"),
    ({"gravity": (0.0, 0.0)}, "gravity", "found 2 numbers, expected 3"),
    ({"frame_rate": 59.94}, "frame_rate", "59.94"),
    ({"frame_rate": 0}, "frame_rate", "whole number from 1 on"),
    ({"seed": -1}, "seed", "-1"),
    ({"frame_rate": 10**400}, "duration", "a whole number from 1 to 999999999"),
    ({"duration": 1e-300}, "duration", "a whole number from 1 to 999999999"),
    ({"duration": 1e308}, "duration", "a whole number from 1 to 999999999"),
    ({"seed": 0.5}, "seed", "whole number"),
    ({"duration": 0.0}, "duration", "positive"),
    ({"duration": inf}, "duration", "inf"),
    ({"duration": 0.99}, "duration", "59.4 frames"),
    ({"effects": ("gravity", "magnetism")}, "effects[1]", "valid: gravity"),
    ({"effects": ("gravity", "gravity")}, "effects[1]", "twice"),
    ({"trackers": ()}, "bodies[2]", "by no tracker"),
    ({"trackers": ()}, "joints[0]", "posed by no tracker"),
    ({"joints": ()}, "trackers[0].joints[0]", "unknown joint 'elbow'"),
    ({"coefficients": ()}, "bodies[0].material", "unknown 'wood'"),
]
BODY = [
    (0, {"name": "ball"}, "bodies[1].name", "twice"),
    (0, {"name": ""}, "bodies[0].name", "expected a name"),
    (0, {"pieces": ()}, "bodies[0].pieces", "found none"),
    (0, {"linear_velocity": (1.0, 0.0, 0.0)}, "bodies[0].linear_velocity", "standing still"),
    (1, {"kind": "ghost"}, "bodies[1].kind", "valid: fixed, simulated, driven"),
    (1, {"material": "glass"}, "bodies[1].material", "unknown 'glass'; valid: human, wood"),
    (1, {"mass": 0.0}, "bodies[1].mass", "positive"),
    (1, {"mass": nan}, "bodies[1].mass", "nan"),
    (1, {"position": (0.0, -1e300, 0.0)}, "bodies[1].position", "found -1e+300, expected a magnitude"),
    (1, {"mass": "heavy"}, "bodies[1].mass", "'heavy'"),
    (1, {"orientation": (1.0, 1.0, 0.0, 0.0)}, "bodies[1].orientation", "1.41421"),
    (1, {"orientation": (1.0, 0.0, 0.0)}, "bodies[1].orientation", "expected 4"),
    (1, {"position": (0.0, inf, 0.0)}, "bodies[1].position", "inf"),
    (1, {"linear_velocity": (0.0, nan, 0.0)}, "bodies[1].linear_velocity", "nan"),
    (1, {"inertia": ((nan, 0, 0), (0, 1, 0), (0, 0, 1))}, "bodies[1].inertia[0]", "nan"),
    (1, {"inertia": ((1e99, 0, 0), (0, 1e99, 0), (0, 0, 1e99))}, "bodies[1].inertia", "radii of gyration"),
    (1, {"inertia": ((1e-99, 0, 0), (0, 1e-99, 0), (0, 0, 1e-99))}, "bodies[1].inertia", "radii of gyration"),
    (1, {"inertia": ((1, 0, 0), (0, 1, 0))}, "bodies[1].inertia", "found 2 rows"),
    (1, {"inertia": ((1, 0), (0, 1), (0, 0))}, "bodies[1].inertia[0]", "expected 3"),
    (1, {"inertia": ((1, 0.5, 0), (0, 1, 0), (0, 0, 1))}, "bodies[1].inertia", "asymmetric"),
    (1, {"inertia": ((1, 0, 0), (0, -1, 0), (0, 0, 1))}, "bodies[1].inertia", "principal moment -1"),
    (1, {"inertia": ((1, 0, 0), (0, 1, 0), (0, 0, 3))}, "bodies[1].inertia", "triangle inequality"),
    (2, {"position": (0.0, 0.0, 1.0)}, "bodies[2].position", "by its tracker"),
]
SHAPED = "bodies[0].pieces[0].shape"
SHAPE = [
    (Sphere(0.0), ".radius", "positive"),
    (Sphere(nan), ".radius", "nan"),
    (Box((1.0, -1.0, 1.0)), ".half_extents", "positive"),
    (Box((1.0, 1.0)), ".half_extents", "found 2 numbers"),
    (Capsule(0.0, 1.0), ".radius", "positive"),
    (Capsule(1.0, -1.0), ".half_length", "positive"),
    (Cylinder(0.0, 1.0), ".radius", "positive"),
    (Cylinder(1.0, inf), ".half_length", "inf"),
    (Cone(1.0, 0.0), ".half_length", "positive"),
    (RoundedBox((1.0, 1.0, 0.0), 1.0), ".half_extents", "positive"),
    (RoundedBox((1.0, 1.0, 1.0), -1.0), ".radius", "positive"),
    (RoundedBox((1.0, 1.0, 1e-14), 1.0), ".half_extents", "degenerate"),
    (Box((1.0, 1.0, 1e-16)), ".half_extents", "found 1e-16, expected numbers of at least 1e-15"),
    (RoundedHull(CUBE[:3], 1.0), ".vertices", "at least 4"),
    (Ellipsoid((1.0, 0.0, 1.0)), ".half_axes", "positive"),
    (Hull(CUBE[:3]), ".vertices", "at least 4"),
    (Hull(((nan, 0.0, 0.0), *CUBE)), ".vertices[0]", "nan"),
    (Hull((*CUBE, (0.5, 0.5, 0.5))), ".vertices", "not convex: vertices [8]"),
    (Hull((*CUBE, CUBE[0])), ".vertices", "repeated"),
    (Hull(CUBE[:4]), ".vertices", "degenerate"),
    (Hull(tuple((1e-16 * x, 1e-16 * y, 1e-16 * z) for x, y, z in CUBE)), ".vertices", "of at least 1e-15"),
    (Hull(tuple((x, y, 1e-9 * z) for x, y, z in CUBE)), ".vertices", "degenerate"),
    (
        SimpleNamespace(),
        "",
        "unknown shape SimpleNamespace; valid: Sphere, Box, Capsule, Cylinder, Cone, Ellipsoid, Hull",
    ),
]
JOINT = [
    ({"parent": "torso"}, "joints[0].parent", "unknown body 'torso'"),
    ({"child": "ball"}, "joints[0].child", "'ball' is simulated"),
    ({"child": "upper"}, "joints[0].child", "its own parent"),
    ({"axis": (0.0, 2.0, 0.0)}, "joints[0].axis", "found length 2"),
    ({"orientation": (0.0, 0.0, 0.0, 0.0)}, "joints[0].orientation", "found length 0"),
    ({"position": (nan, 0.0, 0.0)}, "joints[0].position", "nan"),
    ({"lower": 4.0}, "joints[0].lower", "less than upper"),
    ({"upper": nan}, "joints[0].lower", "nan"),
]
TRACKER = [
    ({"root": "ball"}, "trackers[0].root", "not a driven or prescribed body"),
    ({"root": "lower"}, "bodies[3]", "driven by trackers[0].root and trackers[0].joints[0]"),
    ({"joints": ("wrist",)}, "trackers[0].joints[0]", "unknown joint 'wrist'"),
    ({"root": "lower"}, "trackers[0].joints[0]", "before the joint that leads to its parent"),
    ({"times": (0.0, 0.5)}, "trackers[0].times", "must cover 0 to 1.0 s"),
    ({"times": (1.0, 0.0)}, "trackers[0].times", "increasing"),
    ({"times": (0.0, nan)}, "trackers[0].times", "nan"),
    ({"positions": ((0.0, 0.0, 0.0),)}, "trackers[0].positions", "2 rows of 3"),
    ({"positions": ((0.0, 0.0, inf),) * 2}, "trackers[0].positions[0]", "inf"),
    ({"orientations": (QUIET, (1.0, 1.0, 0.0, 0.0))}, "trackers[0].orientations[1]", "expected 1"),
    ({"orientations": (QUIET, (0.6, 0.0, 0.8, 1e-3))}, "trackers[0].orientations[1]", "such as [0.5999997, "),
    ({"orientations": (QUIET, (0.0, 0.0, 0.0, 0.0))}, "trackers[0].orientations[1]", "length 0, expected 1"),
    ({"orientations": (QUIET, (nan, 0.0, 0.0, 0.0))}, "trackers[0].orientations[1]", "nan"),
    ({"angles": ((0.0,), (-inf,))}, "trackers[0].angles[1]", "-inf"),
    ({"angles": ((0.0, 0.0),) * 2}, "trackers[0].angles", "2 rows of 1"),
    ({"stiffness": 0.0}, "trackers[0].stiffness", "positive"),
    ({"damping": -1.0}, "trackers[0].damping", "positive"),
    ({"hinge_frequency": nan}, "trackers[0].hinge_frequency", "nan"),
    ({"interpolation": "akima"}, "trackers[0].interpolation", "unknown 'akima'; valid: pchip, cubic, linear"),
]
PRESCRIBED = [
    ({"stiffness": 500.0}, "trackers[1].stiffness", "'deck' is prescribed"),
    ({"damping": 4.0}, "trackers[1].damping", "found 4.0"),
    ({"hinge_frequency": 7.0}, "trackers[1].hinge_frequency", "'deck' is prescribed"),
    ({"interpolation": "held"}, "trackers[1].interpolation", "does not jump"),
    ({"joints": ("elbow",)}, "trackers[1].joints", "without joints"),
    ({"times": (0.0, 0.5, 0.5)}, "trackers[1].times[2]", "'deck' has two poses at 0.5 s"),
    ({"times": (0.0, 0.0, 1.0)}, "trackers[1].times[1]", "'deck' has two poses at 0 s"),
    ({"times": (0.1, 0.5, 1.0)}, "trackers[1].times", "must cover 0 to 1.0 s"),
    ({"root": "upper"}, "bodies[4]", "'deck' is prescribed by no tracker, expected one"),
    ({"positions": ((0.0, 0.0, 5.0), (0.0, 0.0, nan), (0.0, 0.0, 5.0))}, "trackers[1].positions[1]", "nan"),
]
PAIR = [
    ({"restitution": 1.1}, "coefficients[0].restitution", "0 to 1"),
    ({"restitution": nan}, "coefficients[0].restitution", "nan"),
    ({"friction": -0.1}, "coefficients[0].friction", "expected 0 to 1e+30"),
    ({"friction": inf}, "coefficients[0].friction", "inf"),
    ({"rolling_friction": -0.1}, "coefficients[0].rolling_friction", "expected 0 to 1e+15 m"),
    ({"torsional_friction": nan}, "coefficients[0].torsional_friction", "found nan"),
    ({"static_friction": -1.0}, "coefficients[0].static_friction", "expected 0 to 1e+30"),
    ({"rolling_friction": 1e16}, "coefficients[0].rolling_friction", "expected 0 to 1e+15 m"),
    ({"static_friction": 1e-3}, "coefficients[0].static_friction", "expected at least friction = "),
    ({"material_b": "human"}, "coefficients[1]", "named twice"),
    ({"material_a": "metal"}, "coefficients", "no coefficients for the pair wood and wood"),
]
EXPECTATION = [
    ({"event": "explode"}, "expectations[0].event", "valid: touch"),
    ({"body": "moon"}, "expectations[0].body", "unknown body 'moon'"),
    ({"other": "moon"}, "expectations[0].other", "unknown body 'moon'"),
    ({"other": "ball"}, "expectations[0].other", "the body itself"),
    ({"earliest": 1.0}, "expectations[0].earliest", "earliest < latest"),
    ({"latest": nan}, "expectations[0].earliest", "earliest < latest"),
]


def test_all_faults_at_once() -> None:
    """Tell faults of many kinds in one error."""
    fields = sound()
    ball = replace(fields["bodies"][1], mass=-1.0, orientation=(2.0, 0.0, 0.0, 0.0))
    fields |= {"duration": -1.0, "effects": ("gravty",), "expectations": ()}
    fields["bodies"] = (fields["bodies"][0], ball, *fields["bodies"][2:])
    found = faults_of(fields)
    assert {"duration", "effects[0]", "bodies[1].mass", "bodies[1].orientation"} <= set(found)


def test_a_tracker_holds_its_last_good_sample() -> None:
    """Repeat the whole last good keyframe and count it; refuse one before the first good one all the same."""
    fields = sound()
    good = fields["trackers"][0]
    jumpy = replace(
        good,
        times=(0.0, 0.2, 0.4, 0.6, 1.0),
        positions=((0.0, 0.0, 1.0), (0.0, nan, 2.0), (0.0, 0.0, 3.0), (0.0, 0.0, 4.0), (0.0, 0.0, inf)),
        orientations=(QUIET, QUIET, QUIET, QUIET, QUIET),
        angles=((0.1,), (0.2,), (0.3,), (nan,), (0.5,)),
    )
    reported = faults_of(fields | {"trackers": (jumpy,)})
    assert set(reported) == {f"trackers[0].{k}" for k in ("positions[1]", "angles[3]", "positions[4]")}
    held = jumpy.hold_last()
    assert [place[2] for place in held.positions] == [1.0, 1.0, 3.0, 3.0, 3.0]
    assert held.angles == ((0.1,), (0.1,), (0.3,), (0.3,), (0.3,))
    assert (good.hold_last(), held.held, held.hold_last()) == (good, 3, held)
    token = HOLD_LAST.set(True)
    try:
        assert Scenario(**fields | {"trackers": (jumpy,)}).trackers == (held,)
        first = replace(good, angles=((nan,), (1.0,)))
        assert "nan" in faults_of(fields | {"trackers": (first,)})["trackers[0].angles[0]"]
    finally:
        HOLD_LAST.reset(token)


def prescribed() -> dict:
    """The sound scenario with a prescribed deck far away, without mass."""
    deck = Body("deck", "prescribed", "wood", (Piece("deck", Box((1.0, 1.0, 0.1))),))
    path = Tracker("deck", (), (0.0, 0.5, 1.0), ((0.0, 0.0, 5.0),) * 3, (QUIET,) * 3, ((),) * 3)
    fields = sound()
    return fields | {"bodies": (*fields["bodies"], deck), "trackers": (*fields["trackers"], path)}


def test_a_prescribed_body_needs_neither_mass_nor_partners() -> None:
    """Accept it without mass; let it touch bodies that move, but no fixed and no other prescribed ones."""
    fields = prescribed()
    scene = Scenario(**fields)
    index = {body.name: k for k, body in enumerate(scene.bodies)}
    met = {frozenset((scene.bodies[a].name, scene.bodies[b].name)) for a, b in scene.touching_pairs()}
    assert frozenset(("deck", "ball")) in met
    assert frozenset(("deck", "upper")) in met
    assert frozenset(("deck", "ground")) not in met
    assert [scene.prescribes(tracker) for tracker in scene.trackers] == [False, True]
    assert scene.groups()[index["deck"]] == 1
    *others, deck = fields["bodies"]
    placed = replace(deck, position=(1.0, 0.0, 0.0), linear_velocity=(0.0, 1.0, 0.0))
    found = faults_of(fields | {"bodies": (*others, placed)})
    assert {"bodies[4].position", "bodies[4].linear_velocity"} <= found.keys()
    hung = replace(fields["joints"][0], child="deck")
    assert "expected a driven body" in faults_of(fields | {"joints": (hung,)})["joints[0].child"]


def test_faults_of_moving_surfaces() -> None:
    """Accept them on fixed and prescribed bodies; refuse them on others, and what are not three numbers."""
    fields = prescribed()
    for k, body in enumerate(fields["bodies"]):
        moved = replace(body.pieces[0], surface_velocity=(1.0, 0.0, 0.0)) if body.pieces else None
        others = fields["bodies"][:k], fields["bodies"][k + 1 :]
        changed = fields | {"bodies": (*others[0], replace(body, pieces=(moved,)), *others[1])}
        if body.kind in UNMOVED:
            scene = Scenario(**changed)
            assert rescaled(scene, 2.0).bodies[k].pieces[0].surface_velocity == (2.0, 0.0, 0.0)
        elif moved:
            message = f"{body.name!r} is {body.kind}, expected fixed or prescribed"
            assert message in faults_of(changed)[f"bodies[{k}].pieces[0].surface_velocity"]
    bad = replace(fields["bodies"][0].pieces[0], surface_angular_velocity=(nan, 0.0, 0.0))
    first = replace(fields["bodies"][0], pieces=(bad,))
    found = faults_of(fields | {"bodies": (first, *fields["bodies"][1:])})
    assert "nan" in found["bodies[0].pieces[0].surface_angular_velocity"]


def test_changed_scenes_keep_prescribed_paths() -> None:
    """Scale masses and times, add noise to other trackers, and leave prescribed paths exact."""
    scene = Scenario(**prescribed())
    arm, deck = noisy(scene).trackers
    assert (arm.interpolation, deck) == ("held", scene.trackers[1])
    assert heavier(scene, 3.0).trackers[1] == deck
    slow = rescaled(scene, 2.0).trackers[1]
    assert (slow.times, slow.positions[0]) == ((0.0, 1.0, 2.0), (0.0, 0.0, 20.0))
    turned = rotated(scene, Rotation.from_rotvec((0.0, 0.0, 1.0)))
    assert turned.bodies[4] == scene.bodies[4]
    assert "'deck'" not in str(coinciding(scene))


CORNERS = ((0.5, 0.5, 0.5**0.5), (-0.5, 0.5, 0.5**0.5), (-0.5, -0.5, 0.5**0.5), (0.5, -0.5, 0.5**0.5))
CONE = ReachCone(("one", "two", "elbow"), (0.0, 0.0, 1.0), CORNERS, (-1.0, 1.0))
SHORT = (0.0, 0.0, 0.9)
CHAIN = [
    # change of the chain, change of its cone, path, part of the message
    ({"name": ""}, {}, "chains[0].name", "a name of its own"),
    ({"joints": ()}, {}, "chains[0].joints", "at least one"),
    ({"joints": ("one", "two", "wing")}, {}, "chains[0].joints[2]", "unknown joint 'wing'; valid: one, two"),
    ({"joints": ("one", "elbow")}, {}, "chains[0].joints[1]", "does not hang on"),
    ({"joints": ("one", "two", "two")}, {}, "chains[0].joints[2]", "does not hang on"),
    ({"joints": ("two", "elbow")}, {}, "chains[0].cones[0].joints", "three successive joints"),
    ({}, {"joints": ("one", "two", "wing")}, "chains[0].cones[0].joints", "three successive joints"),
    ({}, {"twist": (1.0, -1.0)}, "chains[0].cones[0].twist", "lower < upper"),
    ({}, {"twist": (nan, 1.0)}, "chains[0].cones[0].twist", "lower < upper"),
    ({}, {"center": (0.0, 0.0, -1.0)}, "chains[0].cones[0].center", "opposite"),
    ({}, {"center": SHORT}, "chains[0].cones[0].center", "unit vectors"),
    ({}, {"swing": (*CORNERS, SHORT)}, "chains[0].cones[0].swing", "unit vectors"),
    ({}, {"swing": ()}, "chains[0].cones[0].swing", "unit vectors"),
    ({}, {"swing": CORNERS[::-1]}, "chains[0].cones[0].swing", "not star-shaped"),
    ({}, {"swing": CORNERS[:2]}, "chains[0].cones[0].swing", "not star-shaped"),
    ({}, {"swing": CORNERS * 2}, "chains[0].cones[0].swing", "not star-shaped"),
    ({}, {"swing": (CORNERS[0], *CORNERS[2:0:-1], CORNERS[3])}, "chains[0].cones[0].swing", "star-shaped"),
    ({}, {"center": (1.0, 0.0, 0.0)}, "chains[0].cones[0].swing", "not star-shaped"),
]


def with_ball() -> dict:
    """The sound scenario with a ball joint for an elbow, as a chain."""
    fields = sound()
    upper = fields["bodies"][2]
    between = tuple(replace(upper, name=name, pieces=()) for name in ("between", "beside"))
    joints = (
        Joint("one", "upper", "between", (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        Joint("two", "between", "beside", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
        Joint("elbow", "beside", "lower", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    )
    arm = replace(fields["trackers"][0], joints=("one", "two", "elbow"), angles=((0.0,) * 3,) * 2)
    chain = Chain("arm", arm.joints, (CONE,))
    bodies = fields["bodies"] + between
    return fields | {"bodies": bodies, "joints": joints, "trackers": (arm,), "chains": (chain,)}


def test_a_chain_follows_its_trackers_order() -> None:
    """Tell joints of a chain between which the tracker has others."""
    fields = with_ball()
    arm = replace(fields["trackers"][0], joints=("one", "aside", "two", "elbow"), angles=((0.0,) * 4,) * 2)
    other = replace(fields["bodies"][2], name="other")
    aside = Joint("aside", "between", "other", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    fields |= {"trackers": (arm,), "joints": (*fields["joints"], aside), "bodies": (*fields["bodies"], other)}
    assert "does not follow 'one' in its tracker's order" in faults_of(fields)["chains[0].joints[1]"]


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


def changed(fields: dict, field: str, index: int, change: dict) -> dict:
    """A scenario in which some fields of one of its parts have other values."""
    parts = list(fields[field])
    parts[index] = replace(parts[index], **change)
    return fields | {field: tuple(parts)}


FIRST = {"joints": JOINT, "trackers": TRACKER, "coefficients": PAIR, "expectations": EXPECTATION}
"""Faults of the first of each."""
HINGES = [
    # a ball joint is three hinges that meet in a point, square to each other
    (1, {"position": (0.1, 0.0, 0.0)}, "origin of their parents"),
    (1, {"axis": (0.0, 0.6, 0.8)}, "perpendicular"),
    (2, {"axis": (0.0, 0.0, -1.0)}, "right-handed"),
    (0, {"orientation": (0.5, 0.5, 0.5, 0.5)}, "perpendicular"),
]
BALL = Truth("ball", "arcs", (START,))
SLAB = sound()["bodies"][0].pieces
FAULTS = [
    *((sound() | change, path, message) for change, path, message in TOP),
    *((changed(sound(), "bodies", k, change), path, message) for k, change, path, message in BODY),
    *(
        (changed(sound(), "bodies", 0, {"pieces": (Piece("slab", shape),)}), f"{SHAPED}{field}", message)
        for shape, field, message in SHAPE
    ),
    (changed(sound(), "bodies", 0, {"pieces": SLAB * 2}), "bodies[0].pieces[1].name", "twice"),
    *((changed(sound(), field, 0, row[0]), *row[1:]) for field, rows in FIRST.items() for row in rows),
    (
        sound() | {"trackers": sound()["trackers"] * 2},
        *("bodies[2]", "driven by trackers[0].root and trackers[1].root"),
    ),
    *((changed(prescribed(), "trackers", 1, change), path, message) for change, path, message in PRESCRIBED),
    *(
        (changed(with_ball(), "chains", 0, change | {"cones": (replace(CONE, **cone),)}), path, message)
        for change, cone, path, message in CHAIN
    ),
    (
        with_ball() | {"chains": (*with_ball()["chains"], Chain("leg", ("elbow",)))},
        *("chains[1].joints[0]", "'elbow' is in chains[0] already"),
    ),
    *(
        (changed(with_ball(), "joints", k, change), "chains[0].cones[0].joints", message)
        for k, change, message in HINGES
    ),
    *((sound() | {"truths": (replace(BALL, **change),)}, path, message) for change, path, message in TRUTH),
]
"""Fields of a faulty scenario, path, and part of the message."""


@pytest.mark.parametrize(("fields", "path", "message"), FAULTS)
def test_a_fault_is_reported_at_its_path(fields: dict, path: str, message: str) -> None:
    """Report what is wrong with a scene, a body, a shape, a joint, a tracker, a chain or a truth."""
    assert message in faults_of(fields)[path]


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
