"""Reach cones of ball joints: limits of joints that are collections of planar joints (Wilhelms & Van Gelder).

A ball joint is three hinges whose axes share a centre. A spherical polygon bounds the direction of its limb,
and an interval its twist. "Perform a projection of a limb that has left a reach cone back to the nearest
location inside of the reach cone": `kinematics/reach_cone.py`, `keep_in_cone`.
"""

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cone
from touchstone.reference_impl.kinematics.skeleton import measure_angle


@kernel
def keep_in_reach_cones(joints, first, last):
    """Project every ball joint among hinges `first` to `last` into its reach cone; their `last_angle` must be
    inside."""
    for k in range(first, last + 1):
        measure_angle(joints[k])
    for k in range(first, last + 1):
        if joints[k]["cone_count"] > 0:
            keep_in_cone(joints, k)
