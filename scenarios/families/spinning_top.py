"""Tops on a ball-shaped tip: one precesses and nutates without slip, a tippe top turns over by sliding."""

from dataclasses import replace
from math import cos, radians

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.ellipsoid import on_floor
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import (
    Body,
    Box,
    PairCoefficients,
    Piece,
    Scenario,
    Sphere,
    Vector,
    vector,
)
from touchstone.scenarios.solids import box_inertia, slab, sphere_inertia
from touchstone.scenarios.truths.published import Published

HEAD: Vector = (0.05, 0.05, 0.01)
"""Half extents of the head [m]; its two level moments of inertia are equal."""
TIP, LEG = 0.02, 0.06
"""Radius of the tip, and distance of its centre from the head's [m]."""


@scene
def top_precesses() -> Scenario:
    """Released with a tilt and a spin about its axis, it rolls on its tip, precesses and nutates."""
    turn = Rotation.from_rotvec((0.0, radians(20.0), 0.0))
    axis = turn.apply((0.0, 0.0, 1.0))
    arm, spin = _arm(-LEG, TIP, axis), 100.0 * axis
    body = Body(
        "top",
        "simulated",
        "rubber",
        (Piece("tip", Sphere(TIP), (0.0, 0.0, -LEG)), Piece("head", Box(HEAD))),
        mass=0.2,
        inertia=box_inertia(0.2, HEAD),
        position=(0.0, 0.0, -float(arm[2])),
        orientation=quaternion(turn),
        linear_velocity=vector(np.cross(arm, spin)),
        angular_velocity=vector(spin),
    )
    summary = "a top rolls on its tip, precesses and nutates"
    return on_floor("top_precesses", summary, body, 1.0, 2.0, ("curved", "conservative"))


RADIUS, RISE, LEAN = 0.05, 0.01, 0.1
"""Radius of the tippe top, height of its centre above the centre of mass while it stands upright [m], and
first tilt [rad]."""
JELLETT = (
    "Jellett (1872), Treatise on the Theory of Friction; Cohen (1977), Am. J. Phys. 45, 12: the angular "
    "momentum along the arm from the contact to the centre of mass is kept, here over I R"
)


@scene
def tippe_top() -> Scenario:
    """Sliding friction raises the centre of mass until the top stands on its head; Jellett's constant, the
    angular momentum along the arm from the contact to the centre of mass, is kept."""
    turn = Rotation.from_rotvec((0.0, LEAN, 0.0))
    body = Body(
        "top",
        "simulated",
        "rubber",
        (Piece("top", Sphere(RADIUS), (0.0, 0.0, RISE)),),
        mass=0.5,
        inertia=sphere_inertia(0.5, RADIUS),
        position=(0.0, 0.0, -float(_arm(RISE, RADIUS, turn.apply((0.0, 0.0, 1.0)))[2])),
        orientation=quaternion(turn),
        angular_velocity=(0.0, 0.0, 60.0),
    )
    tags, ratio = ("curved", "literature"), RISE / RADIUS
    plain = on_floor("tippe_top", "a tippe top slides and turns over", body, 0.1, 3.0, tags)
    value = body.angular_velocity[2] * (1 - ratio * cos(LEAN))
    along, along_body = (0.0, 0.0, 1.0), (0.0, 0.0, -ratio)
    constant = Published("Jellett", "top", "spin", value, 0.01 * value, JELLETT, 3.0, 3.0, along, along_body)
    return replace(plain, published=(constant,))


LEINE = (
    "Jellett (1872): the angular momentum along the arm is kept until the stem touches, whatever rubs at "
    "a point. Top of Leine & Glocker (2003), Eur. J. Mech. A 22, 193, as in Siconos' tippe_top.py; theirs "
    "turns over by drilling friction on 0.5 mm, on a point it goes on rolling at 2 degrees (integrated)"
)
SMALL = 6e-3
"""Mass of their top [kg]."""
ACROSS, ALONG = 8e-7, 7e-7
"""Its moments of inertia across and along its axis [kg m2]."""
BALLS = ((1.5e-2, 3e-3), (5e-3, 1.6e-2))
"""Radii of its head and of its stem, and how high their centres lie above the centre of mass [m]."""
SPUN = 180.0
"""Its first spin about its axis [rad/s]."""


@scene
def tippe_top_small() -> Scenario:
    """A top of 6 g, as wide as a thumb, whose engines need steps well below a turn of 35 ms."""
    turn, (radius, rise) = Rotation.from_rotvec((0.0, LEAN, 0.0)), BALLS[0]
    axis = turn.apply((0.0, 0.0, 1.0))
    body = Body(
        "top",
        "simulated",
        "rubber",
        tuple(Piece(name, Sphere(r), (0.0, 0.0, a)) for name, (r, a) in zip(("head", "stem"), BALLS)),
        mass=SMALL,
        inertia=((ACROSS, 0.0, 0.0), (0.0, ACROSS, 0.0), (0.0, 0.0, ALONG)),
        position=(0.0, 0.0, -float(_arm(rise, radius, axis)[2])),
        orientation=quaternion(turn),
        angular_velocity=vector(SPUN * axis),
    )
    value = ALONG * SPUN * (cos(LEAN) - rise / radius)
    constant = Published(
        "Jellett", "top", "momentum", value, 0.01 * value, LEINE, 1.0, 1.0, (0.0, 0.0, 1.0),
        (0.0, 0.0, -rise / radius),
    )  # fmt: skip
    return Scenario(
        name="tippe_top_small",
        summary="a tippe top of 6 g spins at 180 rad/s",
        tags=("literature",),
        bodies=(slab("floor", "rubber"), body),
        coefficients=(PairCoefficients("rubber", "rubber", 0.0, 0.3),),
        duration=1.0,
        published=(constant,),
    )


def _arm(offset: float, radius: float, axis: np.ndarray) -> np.ndarray:
    """The lowest point of a ball whose centre lies `offset` along the axis, from the centre of mass [m]."""
    return np.asarray(offset * axis - radius * np.array((0.0, 0.0, 1.0)))
