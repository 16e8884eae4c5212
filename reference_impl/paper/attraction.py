"""Attraction of a driven object's joints to its tracker's (the coach-trainee metaphor)."""

from math import exp

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cones

ATTRACTION_TIME = 0.1
"""Time in which the distance to a tracker at rest falls to 1 / e [s]: visible as a lag, without jumps."""


@kernel
def attract(joints, driver, h):
    """Turn a driven object's joints towards the tracker's angles, within limits, for a frame of length h [s].

    "Even if there is no user motion the joints try to move to the desired angles." The paper leaves open how
    fast: by the same share of the way in equal times. Joints in no chain, as those of a hand, take the
    glove's angles at once. Sets `angle` and `rate`; the links are not posed.
    """
    share = 1 - exp(-h / ATTRACTION_TIME)
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    for k in range(first, end):
        joint = joints[k]
        joint["last_angle"] = joint["angle"]
        if joint["chain"] < 0:
            joint["angle"], joint["rate"] = joint["target_angle"], joint["target_rate"]
            continue
        wanted = joint["angle"] + share * (joint["target_angle"] - joint["angle"])
        joint["angle"] = min(max(wanted, joint["lower"]), joint["upper"])
    keep_in_cones(joints, first, end - 1)
    for k in range(first, end):
        if joints[k]["chain"] >= 0:
            joints[k]["rate"] = (joints[k]["angle"] - joints[k]["last_angle"]) / h
