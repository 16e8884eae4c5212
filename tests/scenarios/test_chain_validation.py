"""Every kind of fault in a chain or in its reach cones is reported with the path of its field."""

from dataclasses import replace
from math import nan

import pytest
from sound_scenario import faults_of, sound

from touchstone.scenarios.scenario import Chain, Joint, ReachCone, Scenario

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


@pytest.mark.parametrize(("change", "cone", "path", "message"), CHAIN)
def test_faults_of_a_chain(change: dict, cone: dict, path: str, message: str) -> None:
    """Tell what is wrong with a chain or with a reach cone in it."""
    fields = with_ball()
    assert Scenario(**fields).chains
    chain = replace(fields["chains"][0], cones=(replace(CONE, **cone),), **change)
    assert message in faults_of(fields | {"chains": (chain,)})[path]


def test_a_joint_is_in_one_chain() -> None:
    """Tell a joint that two chains turn."""
    fields = with_ball()
    leg = Chain("leg", ("elbow",))
    found = faults_of(fields | {"chains": (*fields["chains"], leg)})
    assert found["chains[1].joints[0]"] == "'elbow' is in chains[0] already"


@pytest.mark.parametrize(
    ("joint", "change", "message"),
    [
        (1, {"position": (0.1, 0.0, 0.0)}, "origin of their parents"),
        (1, {"axis": (0.0, 0.6, 0.8)}, "perpendicular"),
        (2, {"axis": (0.0, 0.0, -1.0)}, "right-handed"),
        (0, {"orientation": (0.5, 0.5, 0.5, 0.5)}, "perpendicular"),
    ],
)
def test_a_ball_joint_is_three_hinges_square_to_each_other(joint: int, change: dict, message: str) -> None:
    """Tell hinges that do not meet in a point at right angles."""
    fields = with_ball()
    joints = list(fields["joints"])
    joints[joint] = replace(joints[joint], **change)
    assert message in faults_of(fields | {"joints": tuple(joints)})["chains[0].cones[0].joints"]


def test_a_chain_follows_its_trackers_order() -> None:
    """Tell joints of a chain between which the tracker has others."""
    fields = with_ball()
    arm = replace(fields["trackers"][0], joints=("one", "aside", "two", "elbow"), angles=((0.0,) * 4,) * 2)
    other = replace(fields["bodies"][2], name="other")
    aside = Joint("aside", "between", "other", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    fields |= {"trackers": (arm,), "joints": (*fields["joints"], aside), "bodies": (*fields["bodies"], other)}
    assert "does not follow 'one' in its tracker's order" in faults_of(fields)["chains[0].joints[1]"]
