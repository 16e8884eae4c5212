"""Poses of a driver: at entry to overlap removal, the last free one, and those between."""

from touchstone.reference_impl.core.conventions import PART_WHOLE
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector, rotation_between, turn
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cones
from touchstone.reference_impl.kinematics.skeleton import pose_links


@kernel
def store_entry(joints, driver):
    """Store the current pose as the pose at entry."""
    copy_vector(driver["position"], driver["entry_position"])
    copy_quaternion(driver["orientation"], driver["entry_orientation"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["entry_angle"] = joints[k]["angle"]


@kernel
def restore_entry(joints, driver):
    """Restore the pose at entry; does not pose the links."""
    copy_vector(driver["entry_position"], driver["position"])
    copy_quaternion(driver["entry_orientation"], driver["orientation"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["angle"] = joints[k]["entry_angle"]


@kernel
def store_free_pose(bodies, joints, driver):
    """Store the current pose, at which the links are posed, as the last free pose."""
    copy_vector(bodies[driver["root"]]["center"], bodies[driver["root"]]["free_center"])
    copy_vector(driver["position"], driver["free_position"])
    copy_quaternion(driver["orientation"], driver["free_orientation"])
    driver["has_free"] = 1
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["free_angle"] = joints[k]["angle"]
        copy_vector(bodies[joints[k]["child"]]["center"], bodies[joints[k]["child"]]["free_center"])


@kernel
def interpolate(bodies, joints, driver, part, t):
    """Interpolate a part of the driver between its last free pose (t = 0) and its pose at entry (1), and pose
    the links: linear, orientation by slerp, within reach cones."""
    if part < 0:
        turned = driver["scratch"][0]
        for i in range(3):
            driver["position"][i] = (1 - t) * driver["free_position"][i] + t * driver["entry_position"][i]
        rotation_between(driver["free_orientation"], driver["entry_orientation"], turned)
        turn(driver["free_orientation"], t * turned[0], t * turned[1], t * turned[2], driver["orientation"])
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    for k in range(first, end):
        joint = joints[k]
        joint["last_angle"] = joint["angle"]
        if part == PART_WHOLE or joint["chain"] == part:
            joint["last_angle"] = joint["free_angle"]
            joint["angle"] = (1 - t) * joint["free_angle"] + t * joint["entry_angle"]
    if driver["chain_count"] > 0:
        keep_in_cones(joints, first, end - 1)
    pose_links(bodies, joints, driver)
