"""Ellipsoids that roll without slip on a level floor: to and fro, in space, and in a steady circle."""

from dataclasses import replace
from math import radians

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import Body, PairCoefficients, Scenario, Truth, Vector, vector
from touchstone.scenarios.solids import ellipsoid, slab

MASS = 1.0
FRICTION = 1.0
"""Coefficient of friction: twice what the ellipsoids need to roll, or more."""


def rolling_scene(
    name: str, summary: str, half_axes: Vector, turn: Rotation, spin: Vector, duration: float = 3.0
) -> Scenario:
    """An ellipsoid that touches the floor and rolls from the start, with the angular velocity `spin` [rad/s]
    in the world."""
    arm = contact_arm(half_axes, turn)
    body = ellipsoid(
        "ellipsoid",
        "rubber",
        half_axes,
        MASS,
        (0.0, 0.0, -float(arm[2])),
        quaternion(turn),
        velocity=vector(np.cross(arm, spin)),
        spin=spin,
    )
    return on_floor(name, summary, body, FRICTION, duration, ("curved", "conservative"))


def on_floor(
    name: str, summary: str, body: Body, mu: float, duration: float, tags: tuple[str, ...]
) -> Scenario:
    """A scene of a body that touches a level floor with one smooth piece."""
    return Scenario(
        name=name,
        summary=summary,
        tags=tags,
        bodies=(slab("floor", "rubber"), body),
        coefficients=(PairCoefficients("rubber", "rubber", 0.0, mu),),
        duration=duration,
        truths=(Truth(body.name, "smooth_contact"),),
    )


def contact_arm(half_axes: Vector, turn: Rotation) -> np.ndarray:
    """The lowest point of an ellipsoid from its centre [m], world."""
    up = turn.inv().apply((0.0, 0.0, 1.0))
    scaled = np.array(half_axes) * up
    return np.asarray(turn.apply(-np.array(half_axes) * scaled / np.linalg.norm(scaled)))


@scene
def ellipsoid_rocks() -> Scenario:
    """Released with its long axis tilted, it rocks about its short one: a plane motion."""
    turn = Rotation.from_rotvec((0.0, radians(20.0), 0.0))
    summary = "an ellipsoid rocks to and fro without slip"
    return rolling_scene("ellipsoid_rocks", summary, (0.2, 0.12, 0.1), turn, (0.0, 0.0, 0.0))


@scene
def ellipsoid_rolls() -> Scenario:
    """Three different axes, none of them level, and a spin about all of them."""
    turn = Rotation.from_rotvec((0.2, 0.3, 0.4))
    summary = "an ellipsoid of three different axes rolls in space without slip"
    return rolling_scene("ellipsoid_rolls", summary, (0.15, 0.12, 0.1), turn, (1.0, 6.0, 2.0))


@scene
def rattleback() -> Scenario:
    """Its principal axes of inertia are turned against those of its shape: it spins, rattles, spins back."""
    half_axes = (0.2, 0.06, 0.05)
    turn, skew = Rotation.from_rotvec((0.0, 0.02, 0.0)), Rotation.from_rotvec((0.0, 0.0, 0.15)).as_matrix()
    summary = "a rattleback spins, rattles and spins back, without slip"
    plain = rolling_scene("rattleback", summary, half_axes, turn, (0.0, 0.0, -5.0), 2.5)
    inertia = skew @ plain.bodies[1].inertia @ skew.T
    x, y, z = (vector(row) for row in (inertia + inertia.T) / 2)
    return replace(plain, bodies=(plain.bodies[0], replace(plain.bodies[1], inertia=(x, y, z))))


DISC: Vector = (0.1, 0.1, 0.02)
"""Half axes of a disc with a round rim [m]: an ellipsoid of revolution about z."""
DISC_TILT = radians(70.0)
"""Angle between its axis and the vertical [rad]."""
PRECESSION = 2.0
"""Angular velocity of its steady circle about the vertical [rad/s]."""


@scene
def disc_rolls() -> Scenario:
    """A disc that rolls in a circle with a steady tilt."""
    turn = Rotation.from_rotvec((0.0, DISC_TILT, 0.0))
    spin = steady_spin(ellipsoid("disc", "rubber", DISC, MASS), turn, contact_arm(DISC, turn))
    summary = "a disc with a round rim rolls in a steady circle without slip"
    return rolling_scene("disc_rolls", summary, DISC, turn, vector(spin))


def steady_spin(body: Body, turn: Rotation, arm: np.ndarray) -> np.ndarray:
    """Angular velocity [rad/s] of a body of revolution in a steady circle of PRECESSION; `arm` leads from its
    centre to the point that touches the floor [m].

    The torque of the contact force about the centre, r x m (a + g z) with a = W z x v, turns the angular
    momentum at the rate W z x L. Their difference is level and linear in the spin.
    """
    inertia = turn.as_matrix() @ body.inertia @ turn.as_matrix().T
    axis = turn.apply((0.0, 0.0, 1.0))
    circling = np.array((0.0, 0.0, PRECESSION))

    def excess(spin: float) -> float:
        w = circling + spin * axis
        force = body.mass * (np.cross(circling, np.cross(arm, w)) + np.array((0.0, 0.0, 9.81)))
        level = np.cross((0.0, 0.0, 1.0), axis)
        return float(level @ (np.cross(circling, inertia @ w) - np.cross(arm, force)))

    return circling + excess(0.0) / (excess(0.0) - excess(1.0)) * axis
