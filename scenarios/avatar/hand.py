"""Articulated hand: a tracked palm and five fingers of three elliptic parts on hinges.

The palm frame has x along the fingers, y to the thumb, z out of the back of the hand. Flexion rotates about
+y. The palm has mass and no shape: only the fifteen parts can touch. Lengths are those of
a medium adult hand, rounded to millimetres.
"""

from math import cos, pi, sin

from touchstone.scenarios.scenario import Body, Hull, Joint, Piece, Quaternion, Vector
from touchstone.scenarios.solids import box_inertia, ellipsoid_inertia, elliptic_hull

HAND_MASS = 0.4
"""Mass of the whole hand [kg]: critically damped under Eq. 6 with K = 1000, R = 40."""
TISSUE_DENSITY = 1100.0
"""Density of the fifteen parts [kg/m^3]: soft tissue and bone."""
PALM_HALF_EXTENTS: Vector = (0.045, 0.040, 0.014)
"""Half extents of the box whose inertia the palm has [m]."""
FLEXION: tuple[float, float] = (-0.4, 1.9)
"""Limits of every finger hinge [rad]."""

FINGERS: dict[str, tuple[Vector, float, tuple[float, float, float], float]] = {
    # Base in the palm frame [m], heading about z [rad], lengths of the three parts [m], thickness [m].
    "thumb": ((-0.020, 0.034, -0.008), 0.7, (0.044, 0.034, 0.026), 0.010),
    "index": ((0.044, 0.026, 0.000), 0.0, (0.044, 0.026, 0.022), 0.008),
    "middle": ((0.047, 0.004, 0.000), 0.0, (0.048, 0.030, 0.023), 0.008),
    "ring": ((0.043, -0.018, 0.000), 0.0, (0.044, 0.028, 0.022), 0.008),
    "little": ((0.035, -0.039, 0.000), 0.0, (0.035, 0.021, 0.019), 0.007),
}
PHALANGES = ("proximal", "middle", "distal")


def hand_parts() -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Bodies (palm first, then each finger from its base) and hinges of the hand, by finger and phalanx."""
    parts: list[Body] = []
    joints: list[Joint] = []
    for finger, (base, heading, lengths, thickness) in FINGERS.items():
        parent, position = "palm", base
        turn: Quaternion = (cos(heading / 2), 0.0, 0.0, sin(heading / 2))
        axis: Vector = (-sin(heading), cos(heading), 0.0)
        for phalanx, length in zip(PHALANGES, lengths):
            name = f"{finger}_{phalanx}"
            parts.append(_part(name, length, thickness))
            joints.append(Joint(name, parent, name, position, axis, turn, lower=FLEXION[0], upper=FLEXION[1]))
            parent, position, turn, axis = name, (length, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    palm_mass = HAND_MASS - sum(part.mass for part in parts)
    palm = Body(
        "palm", "driven", "human", (), mass=palm_mass, inertia=box_inertia(palm_mass, PALM_HALF_EXTENTS)
    )
    return (palm, *parts), tuple(joints)


def _part(name: str, length: float, thickness: float) -> Body:
    half_axes: Vector = (0.54 * length, thickness, thickness)
    center: Vector = (length / 2, 0.0, 0.0)
    mass = TISSUE_DENSITY * 4 / 3 * pi * half_axes[0] * half_axes[1] * half_axes[2]
    return Body(
        name,
        "driven",
        "human",
        (Piece(name, Hull(elliptic_hull(half_axes)), position=center),),
        mass=mass,
        center_of_mass=center,
        inertia=ellipsoid_inertia(mass, half_axes),
    )
