"""Hard mechanisms: chains with heavy ends, long chains, and stiff servos on a foot."""

from math import sqrt

from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.families.mechanisms import ACROSS, SMOOTH, chain
from touchstone.scenarios.families.tower import at_rest
from touchstone.scenarios.scenario import BodyJoint
from touchstone.scenarios.solids import ball, block, slab

LINK = 0.1
"""Length of a link [m]."""
RATIOS = (1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
LINKS = 10
"""Number of links that hold a load."""
LOAD = 0.1
"""Radius of a load [m]."""
LEAN = 0.03
"""Distance of a trunk's centre of mass from above its ankle [m]."""


@family("mass ratio", "1", RATIOS)
def joint_ratio(level: float) -> Case:
    """Ten links hang from one place and hold a heavy ball: nothing moves."""
    links, joints = chain([(0.0, 0.0, -LINK * k) for k in range(LINKS + 1)], "ball", LINK / 10)
    load = ball("load", "steel", LOAD, level, (0.0, 0.0, -LINK * LINKS - LOAD))
    joints.append(BodyJoint("hook", "ball", links[-1].name, "load", (0.0, 0.0, -LINK * LINKS)))
    bodies = (*links, load)
    return Case(
        f"ten links of 1 kg hold a ball of {level:g} kg",
        bodies,
        Checks(rest_from=1.0),
        duration=2.0,
        truths=at_rest(bodies),
        fields={"body_joints": tuple(joints), "coefficients": SMOOTH},
    )


@family("number of links", "1", (2.0, 5.0, 10.0, 20.0, 50.0, 100.0))
def joint_links(level: float) -> Case:
    """A chain of links falls from the horizontal over a floor and swings about its hinges: it keeps its
    energy."""
    places = [(LINK * k, 0.0, LINK * level + 1.0) for k in range(int(level) + 1)]
    links, joints = chain(places, "hinge", LINK / 10)
    return Case(
        f"a chain of {level:g} links swings down from the horizontal",
        (slab("floor", "steel"), *links),
        Checks(energy_loss=0.05),
        duration=1.5,
        fields={"body_joints": tuple(joints), "coefficients": SMOOTH},
    )


@family("stiffness", "N m/rad", (50.0, 1e3, 1e4, 1e5, 1e6, 1e8))
def servo_foot(level: float) -> Case:
    """A trunk stands on a light foot by a stiff servo of its ankle, critically damped."""
    foot = block("foot", "wood", (0.15, 0.1, 0.02), 0.2, (0.0, 0.0, 0.02))
    trunk = block("trunk", "wood", (0.1, 0.1, 0.1), 5.0, (LEAN, 0.0, 0.4))
    arm = trunk.position[2] - 0.04
    damping = 2 * sqrt(level * trunk.mass * arm * arm)
    place = (0.0, 0.0, 0.04)
    ankle = BodyJoint("ankle", "hinge", "foot", "trunk", place, ACROSS, stiffness=level, damping=damping)
    return Case(
        f"a trunk of 5 kg stands on a foot of 0.2 kg by a servo of {level:g} N m/rad",
        (slab("floor", "wood"), foot, trunk),
        Checks(rest_from=1.5),
        duration=2.0,
        fields={"body_joints": (ankle,)},
    )
