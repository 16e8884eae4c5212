"""A scenario in which nothing is wrong, and the faults reported of those that differ from it."""

import pytest

from touchstone.scenarios.scenario import (
    Body,
    Box,
    Expectation,
    Hull,
    Joint,
    PairCoefficients,
    Piece,
    Scenario,
    ScenarioError,
    Sphere,
    Tracker,
)
from touchstone.scenarios.solids import sphere_inertia

CUBE = tuple((float(x), float(y), float(z)) for x in (0, 1) for y in (0, 1) for z in (0, 1))
QUIET = (1.0, 0.0, 0.0, 0.0)
INERTIA = sphere_inertia(1.0, 0.05)


def sound() -> dict:
    """The fields of a sound scenario: ground, ball, and an arm of two links on one hinge."""
    ground = Body("ground", "fixed", "wood", (Piece("slab", Box((1.0, 1.0, 0.1))),))
    ball = Body("ball", "simulated", "wood", (Piece("ball", Sphere(0.05)),), mass=1.0, inertia=INERTIA)
    upper, lower = (
        Body(name, "driven", "human", (Piece(name, Hull(CUBE)),), mass=1.0, inertia=INERTIA)
        for name in ("upper", "lower")
    )
    elbow = Joint("elbow", "upper", "lower", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    arm = Tracker("upper", ("elbow",), (0.0, 1.0), ((0.0, 0.0, 1.0),) * 2, (QUIET, QUIET), ((0.0,), (1.0,)))
    return {
        "name": "sound",
        "summary": "nothing is wrong",
        "tags": (),
        "bodies": (ground, ball, upper, lower),
        "joints": (elbow,),
        "trackers": (arm,),
        "coefficients": (
            PairCoefficients("wood", "wood", 0.3, 0.3),
            PairCoefficients("wood", "human", 0.2, 0.2),
            PairCoefficients("human", "human", 0.1, 0.1),
        ),
        "duration": 1.0,
        "expectations": (Expectation("touch", "ball", "ground", 0.0, 1.0),),
    }


def faults_of(fields: dict) -> dict[str, str]:
    """Path to message of what is wrong."""
    with pytest.raises(ScenarioError) as caught:
        Scenario(**fields)
    for path, message in caught.value.faults:
        assert f"{path}: {message}" in str(caught.value)
    return dict(caught.value.faults)
