"""Begin and end of a driver's frame in the simulated loop (`driver_motion`)."""

from touchstone.reference_impl.continuous.driver_motion import return_to_start, weigh_for_impacts
from touchstone.reference_impl.continuous.hinge_motion import enter_hinges, leave_hinges
from touchstone.reference_impl.continuous.prescribed_path import is_parabola
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector, rotation_between
from touchstone.reference_impl.kinematics.skeleton import link_of, move_from_shown, move_links, pose_links


@kernel
def enter_loop(bodies, joints, driver, dt):
    """Return a driver to where the frame of length dt began; the pose that it leaves becomes its goal where
    overlap removal moved it.

    Removal moved it by a shift from the pose of Eq. 6. Along the shift the goal moves evenly from the start
    to the pose found; across it the goal is the tracker.
    """
    driver["loops"], driver["clock"], driver["old_clock"] = 1, 0.0, 0.0
    driver["leads"] = 0 if driver["prescribed"] == 1 and is_parabola(driver, dt) else 1
    copy_vector(driver["position"], driver["end_position"])
    copy_quaternion(driver["orientation"], driver["end_orientation"])
    copy_vector(driver["velocity"], driver["end_velocity"])
    copy_vector(driver["omega"], driver["end_omega"])
    _set_moving(bodies, joints, driver, 1)
    shift, start, end = driver["stop_velocity"], driver["goal_start"], driver["goal_end"]
    square = 0.0
    for i in range(3):
        shift[i] = driver["position"][i] - driver["coupled_position"][i]
        square += shift[i] * shift[i]
    v = driver["old_velocity"]
    if square > 0:
        back = ahead = speed = last = 0.0
        for i in range(3):
            back += shift[i] * (driver["old_position"][i] - start[i]) / square
            ahead += shift[i] * (driver["position"][i] - end[i]) / square
            pace = (driver["position"][i] - driver["old_position"][i]) / dt
            speed += shift[i] * (pace - v[i]) / square
            last += shift[i] * (driver["velocity"][i] - pace) / square
        for i in range(3):
            start[i] += back * shift[i]
            end[i] += ahead * shift[i]
            v[i] += speed * shift[i]
            shift[i] *= last
    turned = 0.0
    for i in range(4):
        turned += abs(driver["orientation"][i] - driver["coupled_orientation"][i])
    if turned > 0:
        copy_quaternion(driver["old_orientation"], driver["goal_start_orientation"])
        copy_quaternion(driver["orientation"], driver["goal_end_orientation"])
        arc = driver["scratch"][0]
        rotation_between(driver["old_orientation"], driver["orientation"], arc)
        for i in range(3):
            driver["old_omega"][i] = arc[i] / dt
    else:
        copy_quaternion(driver["old_target_orientation"], driver["goal_start_orientation"])
        copy_quaternion(driver["target_orientation"], driver["goal_end_orientation"])
    enter_hinges(joints, driver, dt)
    weigh_for_impacts(driver)
    return_to_start(bodies, joints, driver)


@kernel
def leave_loop(bodies, joints, driver, dt):
    """End a driver's frame: along the shift of overlap removal it keeps the velocity that removal left.
    Without contact it ends where the driven loop left it, to the bit."""
    pressed = driver["pressed"] > 0
    if not pressed:
        copy_vector(driver["end_position"], driver["position"])
        copy_quaternion(driver["end_orientation"], driver["orientation"])
        copy_vector(driver["end_velocity"], driver["velocity"])
        copy_vector(driver["end_omega"], driver["omega"])
    else:
        for i in range(3):
            driver["velocity"][i] += driver["stop_velocity"][i]
    driver["loops"] = 0
    _set_moving(bodies, joints, driver, 0)
    leave_hinges(joints, driver, pressed)
    pose_links(bodies, joints, driver)
    if driver["chain_count"] > 0:
        driver["inverse_mass"] = 0.0
    if driver["chain_count"] > 0 and not pressed:
        move_from_shown(bodies, joints, driver, dt)
    else:
        move_links(bodies, joints, driver)


@kernel
def _set_moving(bodies, joints, driver, moves):
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        link["moves"], link["prescribed"] = moves, moves * driver["prescribed"]
        # links outside the loop stand still within a frame
        link["curve"][:] = link["curve_turn"][:] = 0.0
