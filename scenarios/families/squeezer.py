"""Andrews' squeezing mechanism: seven links in three loops, with its published motion.

Lengths are ten times, masses a hundred times and times a hundred times those of the source; forces are then a
tenth and torques the same. Its x and y are our x and z, its angles turn from x to z.
"""

from math import cos, hypot, sin
from typing import Any

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.mechanisms import direction, mechanism
from touchstone.scenarios.scenario import Body, BodyJoint, Capsule, Piece, Scenario, Vector, vector
from touchstone.scenarios.truths.published import Published

SIZE, WEIGHT, SLOWED = 10.0, 100.0, 100.0
"""Factors on lengths, masses and times [1]."""
SCHIEHLEN = (
    "Schiehlen (1990), Multibody Systems Handbook; Hairer & Wanner (1996), Solving ODEs II, VII.7; angles at "
    "0.03 s: Mazzia & Magherini (2008), Test Set for IVP Solvers; the tolerance is ours"
)
MASSES = (0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498)
"""Masses of K1 to K7 [kg]."""
MOMENTS = (2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
"""Moments of inertia of K1 to K7 [kg m2]."""
A, B, C = np.array((-0.06934, -0.00227)), np.array((-0.03635, 0.03273)), np.array((0.014, 0.072))
"""Anchors of K5 and K7, of K3 and of the spring; that of K1 is the origin [m]."""
RR, RA, D, DA, E, EA, ZF, FA, SS = 0.007, 0.00092, 0.028, 0.0115, 0.02, 0.01421, 0.02, 0.01421, 0.035
SA, SB, SC, SD, ZT, TA, TB, U, UA, UB = (
    *(0.01874, 0.01043, 0.018, 0.02),
    *(0.04, 0.02308, 0.00916, 0.04, 0.01228, 0.00449),
)
"""Lengths of the links, and places of their centres of mass and of the spring's end on K3 [m]."""
SPRING, REST, TORQUE = 4530.0, 0.07785, 0.033
"""Stiffness [N/m] and length [m] of the spring, and torque on K1 [N m]."""
START = {
    "beta": -0.0617138900142764496358948458001,
    "theta": 0.0,
    "gamma": 0.455279819163070380255912382449,
    "phi": 0.222668390165885884674473185609,
    "delta": 0.487364979543842550225598953530,
    "omega": -0.222668390165885884674473185609,
    "epsilon": 1.23054744454982119249735015568,
}
"""Consistent angles at the start [rad]."""
END = {
    "beta": 15.81077119629904,
    "theta": -15.75637105984298,
    "gamma": 0.04082224013073101,
    "phi": -0.5347301163226948,
    "delta": 0.5244099658805304,
    "omega": 0.5347301163226948,
    "epsilon": 1.048080741042263,
}
"""Published angles after 0.03 s [rad]."""
STRUT = 1e-3
"""Mass of each half of the spring's strut [kg]: 0.04 % of that of K3; the source's spring has none."""
LINK = 0.01
"""Radius of the links as drawn [m], after scaling."""


def places(angle: dict[str, float]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Joints and centres of mass in the plane of the source at some angles [m]."""

    def ray(turn: float) -> Array:
        return np.array((cos(turn), sin(turn)))

    def across(turn: float) -> Array:
        return np.array((sin(turn), -cos(turn)))

    beta, gamma, delta, epsilon = (angle[name] for name in ("beta", "gamma", "delta", "epsilon"))
    back = ray(beta + angle["theta"])
    p = RR * ray(beta)
    e = p - D * back
    f, h = A + ZT * ray(delta), A + U * across(epsilon)
    joints = {"o": np.zeros(2), "p": p, "e": e, "f": f, "h": h, "a": A, "b": B}
    joints["d"] = B + SD * ray(gamma) + SC * across(gamma)
    centres = {
        "K1": RA * ray(beta),
        "K2": p - DA * back,
        "K3": B + SA * across(gamma) + SB * ray(gamma),
        "K4": f + (E - EA) * across(angle["phi"] + delta),
        "K5": A + TA * ray(delta) - TB * across(delta),
        "K6": h + (ZF - FA) * ray(angle["omega"] + epsilon),
        "K7": A + UA * across(epsilon) - UB * ray(epsilon),
    }
    return joints, centres


def squeezer(strut: float = STRUT) -> Scenario:
    """The mechanism with a strut of two bodies of some mass [kg], between which the spring acts."""
    at, centres = places(START)
    bodies = [
        _link(name, k, centre, at[ends[0]], at[ends[1]], WEIGHT * MASSES[k], WEIGHT * SIZE**2 * MOMENTS[k])
        for k, ((name, centre), ends) in enumerate(
            zip(centres.items(), ("op", "pe", "be", "ef", "fa", "eh", "ha"))
        )
    ]
    length = hypot(*(at["d"] - C))
    thirds = [C + share * (at["d"] - C) for share in (0.0, 0.4, 0.6, 1.0)]
    for k, name in enumerate(("strut_1", "strut_2")):
        first, last = thirds[2 * k : 2 * k + 2]
        moment = strut * (SIZE * length / 4) ** 2
        bodies.append(_link(name, 7 + k, (first + last) / 2, first, last, strut, moment))
    hinges = [
        *(("", "K1", at["o"]), ("K1", "K2", at["p"]), ("K2", "K3", at["e"]), ("K2", "K4", at["e"])),
        *(("K2", "K6", at["e"]), ("", "K3", at["b"]), ("K4", "K5", at["f"]), ("", "K5", at["a"])),
        *(("K6", "K7", at["h"]), ("", "K7", at["a"]), ("", "strut_1", C), ("K3", "strut_2", at["d"])),
    ]
    force = TORQUE * WEIGHT * (SIZE / SLOWED) ** 2
    motor: dict[str, Any] = {"damping": 1.0, "target_rate": 100.0, "largest_force": force}
    joints = [
        BodyJoint(
            f"{parent or 'ground'}_{child}", "hinge", parent, child, _world(place), (0.0, -1.0, 0.0),
            **(motor if child == "K1" else {}),
        )
        for parent, child, place in hinges
    ]  # fmt: skip
    spring = SPRING * WEIGHT / SLOWED**2
    along = _world((at["d"] - C) / (SIZE * length))
    joints.append(
        BodyJoint(
            "spring", "slider", "strut_1", "strut_2", _world(C), along,
            stiffness=spring, target=SIZE * (REST - length),
        )
    )  # fmt: skip
    ends = places(END)[1]
    published = []
    for name in ("K1", "K3", "K5", "K7"):
        way = SIZE * hypot(*(ends[name] - centres[name]))
        published.append(Published(name, name, "distance", way, 0.01 * way, SCHIEHLEN, 0.0, 3.0))
    return mechanism(
        "squeezer",
        "Andrews' squeezing mechanism, slowed a hundredfold",
        bodies,
        joints,
        3.0,
        ("literature",),
        gravity=(0.0, 0.0, 0.0),
        published=tuple(published),
    )


def _world(place: Array) -> Vector:
    return (SIZE * float(place[0]), 0.0, SIZE * float(place[1]))


def _link(
    name: str, plane: int, centre: Array, first: Array, last: Array, mass: float, moment: float
) -> Body:
    """A link about its centre of mass, in a plane of its own."""
    x, _, z = _world(centre)
    ends = _world(first - centre), _world(last - centre)
    half = float(np.linalg.norm(np.subtract(*ends))) / 2
    middle = vector(np.add(*ends) / 2)
    piece = Piece(name, Capsule(LINK, max(half - LINK, LINK)), middle, direction(*ends))
    inertia = ((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, moment))
    place = (x, 3 * LINK * plane, z)
    return Body(name, "simulated", "steel", (piece,), mass, inertia=inertia, position=place)


@scene
def andrews() -> Scenario:
    """A constant torque turns the crank two and a half times; the loops swing to and fro on the spring."""
    return squeezer()
