"""Cylinders that roll on their side and on their rim, slide and stand on their cap, in exact contact."""

from math import atan, pi, radians, sin
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.ellipsoid import on_floor, steady_spin
from touchstone.scenarios.families.stack import MASS, weights
from touchstone.scenarios.families.tower import at_rest
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    PairCoefficients,
    Scenario,
    Truth,
    vector,
)
from touchstone.scenarios.solids import cylinder, slab

LYING = Rotation.from_rotvec((-pi / 2, 0.0, 0.0))
"""Rotation that lays the axis of a cylinder along y."""
ROLLER = (0.1, 0.15)
"""Radius and half length of a cylinder that rolls on its side [m]."""
PUCK = (0.05, 0.02)
"""Radius and half length of a flat cylinder that slides and spins on its cap [m]."""
DRUM = (0.05, 0.04)
"""Radius and half length of a cylinder in a stack [m]."""
DRUMS = 5
POST = (0.04, 0.1)
"""Radius and half length of a cylinder that tips at tan(slope) = 0.4 [m]."""


def _scene(
    name: str, summary: str, bodies: list[Body], mu: float, duration: float = 1.0, **fields: Any
) -> Scenario:
    pairs = (PairCoefficients("wood", "wood", 0.0, mu),)
    return Scenario(name, summary, ("probe",), tuple(bodies), duration, pairs, **fields)


@scene
def cylinder_rolls() -> Scenario:
    """On a slope, 2/3 of the weight along it accelerates a solid cylinder that does not slip, which takes
    friction of a third of it: mu of at least tan(slope) / 3 = 0.12."""
    slope, (radius, half_length) = radians(20.0), ROLLER
    tilt = Rotation.from_rotvec((0.0, slope, 0.0))
    up, downhill = tilt.apply((0.0, 0.0, 1.0)), tilt.apply((1.0, 0.0, 0.0))
    start, pace = vector(radius * up), 2 / 3 * GRAVITY * sin(slope)
    arc = Arc(
        0.0,
        start,
        acceleration=vector(pace * downhill),
        angular_acceleration=(0.0, pace / radius, 0.0),
    )
    bodies = [
        slab("slope", "wood", vector(up), quaternion(tilt)),
        cylinder("roller", "wood", radius, half_length, MASS, start, quaternion(tilt * LYING)),
    ]
    summary = "a cylinder rolls down a slope without slip"
    return _scene("cylinder_rolls", summary, bodies, 0.3, 1.5, truths=(Truth("roller", "arcs", (arc,)),))


@scene
def cylinder_slides() -> Scenario:
    """On its cap, friction stops a cylinder that does not turn after v / (mu g)."""
    speed, mu, (radius, half_length) = 1.5, 0.3, PUCK
    place, time = (0.0, 0.0, half_length), speed / (mu * GRAVITY)
    end = (speed * time / 2, 0.0, half_length)
    arcs = (
        Arc(0.0, place, (speed, 0.0, 0.0), (-mu * GRAVITY, 0.0, 0.0)),
        Arc(time, end),
    )
    puck = cylinder("puck", "wood", radius, half_length, MASS, place, velocity=(speed, 0.0, 0.0))
    bodies, summary = [slab("floor", "wood"), puck], "a cylinder slides on its cap to a stop"
    return _scene("cylinder_slides", summary, bodies, mu, truths=(Truth("puck", "arcs", arcs),))


@scene
def cylinder_spins() -> Scenario:
    """Without friction, a cylinder spins on its cap at a constant rate. With friction its rate would depend
    on where the cap bears the weight, which rigid bodies leave open."""
    radius, half_length = PUCK
    place, spin = (0.0, 0.0, half_length), (0.0, 0.0, 10.0)
    puck = cylinder("puck", "wood", radius, half_length, MASS, place, spin=spin)
    bodies, summary = [slab("floor", "wood"), puck], "a cylinder spins on its cap without friction"
    truth = Truth("puck", "arcs", (Arc(0.0, place, angular_velocity=spin),))
    return _scene("cylinder_spins", summary, bodies, 0.0, truths=(truth,))


@scene
def cylinder_stack() -> Scenario:
    """Five cylinders on their caps, each off the one below: none moves; each bears those above it."""
    radius, half_length = DRUM
    places = [
        (0.004 * (-1.0) ** k, 0.003 * (-1.0) ** (k // 2), (2 * k + 1) * half_length) for k in range(DRUMS)
    ]
    bodies = [slab("floor", "wood")]
    bodies += [
        cylinder(f"drum_{k + 1}", "wood", radius, half_length, MASS, at) for k, at in enumerate(places)
    ]
    return _scene(
        "cylinder_stack",
        "five cylinders on their caps stay where they are",
        bodies,
        0.5,
        truths=at_rest(bodies[1:]),
        forces=weights(bodies),
    )


@scene
def cylinder_holds() -> Scenario:
    """A cylinder stands on a slope at 0.9 of that at which its weight passes over the rim."""
    radius, half_length = POST
    slope = 0.9 * atan(radius / half_length)
    tilt = Rotation.from_rotvec((0.0, slope, 0.0))
    up = tilt.apply((0.0, 0.0, 1.0))
    start = vector(half_length * up)
    bodies = [
        slab("slope", "wood", vector(up), quaternion(tilt)),
        cylinder("post", "wood", radius, half_length, MASS, start, quaternion(tilt)),
    ]
    truth = Truth("post", "arcs", (Arc(0.0, start),))
    return _scene("cylinder_holds", "a cylinder holds on a slope, by its width", bodies, 1.0, truths=(truth,))


DISC = (0.1, 0.01)
"""Radius and half length of a disc on its rim [m]."""
DISC_TILT = radians(60.0)
"""Angle between its axis and the vertical [rad]."""


@scene
def rim_rolls() -> Scenario:
    """A disc with a sharp rim rolls in a circle with a steady tilt."""
    turn = Rotation.from_rotvec((0.0, DISC_TILT, 0.0))
    radius, half_length = DISC
    arm = turn.apply((radius, 0.0, -half_length))
    spin = steady_spin(cylinder("disc", "rubber", radius, half_length, MASS), turn, arm)
    body = cylinder(
        "disc",
        "rubber",
        radius,
        half_length,
        MASS,
        (0.0, 0.0, -float(arm[2])),
        quaternion(turn),
        velocity=vector(np.cross(arm, spin)),
        spin=vector(spin),
    )
    summary = "a disc with a sharp rim rolls in a steady circle without slip"
    return on_floor("rim_rolls", summary, body, 1.0, 3.0, ("curved", "conservative"))
