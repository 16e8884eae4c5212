"""Structured types of joints, posture constraints and drivers."""

from touchstone.reference_impl.core.conventions import (
    CHAIN_JOINTS,
    CONFIGURATION,
    HINGE_CAPACITY,
    POSTURE_CONSTRAINTS,
)
from touchstone.reference_impl.core.dtypes import MATRIX, QUATERNION, VECTOR, record

CONE_CORNERS = 12
"""Most corners of a reach cone."""
CHAIN_CAPACITY = 8
"""Most chains of a driver."""
JOINT = record(
    parent="i8",
    child="i8",
    inner="i8",  # joint whose child is its parent, or -1
    chain="i8",  # index of the driver's chain that contains it, or -1
    coordinate="i8",  # its place among the hinges of the driver's chains, or -1
    position=VECTOR,  # of the hinge, parent frame
    axis=VECTOR,  # parent frame
    rest=MATRIX,  # rotation of the child in the parent frame at angle 0
    lower="f8",
    upper="f8",
    angle="f8",
    posed_angle="f8",  # angle of the child's pose, `cosine` and `sine`; NaN if these may be outdated
    rate="f8",
    shown_angle="f8",  # at the start of a frame
    free_angle="f8",  # in the last free pose
    entry_angle="f8",  # at the start of overlap removal
    target_angle="f8",  # of the tracker at the end of the frame
    goal_angle="f8",  # goal of the frame's attraction
    last_target_angle="f8",  # of the tracker at the start of the frame
    target_rate="f8",  # of the tracker, or of a motor
    # of a chain: deviation from its path without contact that forces of simulated bodies caused, and its rate
    offset="f8",
    offset_rate="f8",
    old_offset="f8",  # at the start of a substep
    old_offset_rate="f8",
    old_angle="f8",
    old_rate="f8",
    lead_rate="f8",  # the solver's rate less that at the end of the substep
    # of a driver that moves in the simulated loop (`hinge_motion`)
    path_start="f8",  # angle without that deviation, at the frame's start and end
    path_end="f8",
    end_angle="f8",  # angle, deviation and its rate that the driven loop left
    end_offset="f8",
    end_offset_rate="f8",
    touched="i8",  # of a chain's first hinge, 1: contacts act on the chain
    servo="f8",  # stiffness of its servo [N m/rad]
    coupling=("f8", (CHAIN_JOINTS,)),  # inertia with the hinges of its chain up to itself, the root held
    modes=("f8", (CHAIN_JOINTS,)),  # its rate per rate of each mode of its chain (`hinge_modes`)
    # of a chain's k-th hinge, for its k-th mode
    pace="f8",  # stiffness of the mode [1/s^2]; 0: not known yet
    share="f8",  # response of the mode over a substep, over that to an impulse [1]
    motion=("f8", (6,)),  # over `motion_time` in a substep of `motion_length` (`hinge_motion`)
    motion_time="f8",
    motion_length="f8",
    amplitude="f8",
    amplitude_rate="f8",
    twist="f8",  # change of that rate by the impulses of the law of velocities, at one instant
    shift_twist="f8",  # that of the law of positions
    limited="i8",  # 1 or -1: its lower or upper limit is a row of the solver
    limit_floor="f8",  # least rate away from that limit, as the solver asks it [rad/s]
    limit_free="f8",  # that rate without impulses
    limit_impulse="f8",  # [N m s]
    shift_limit_impulse="f8",  # of the law of positions [N m s]
    spare_impulse="f8",  # that of an impact whose energy is guarded [N m s]
    # what it moves, about the centre of mass of its driver: mass, first moment, inertia, and the momentum of
    # all that per rate
    moved_mass="f8",
    moved_moment=VECTOR,
    moved_inertia=MATRIX,
    arm=VECTOR,  # velocity of that centre per rate, if it moved with the hinge's child [m]
    push=VECTOR,  # momentum per rate, and angular momentum [kg m], [kg m^2]
    spin=VECTOR,
    recoil=VECTOR,  # velocities of the root that take up these momenta, per rate [m], [1]
    recoil_turn=VECTOR,
    link="i8",  # index of its child in the solver
    # first of a ball joint's three hinges: its reach cone, in the hinges' axes at angles 0
    cone_count="i8",  # number of corners; 0 if no ball joint starts here
    cone_center=VECTOR,
    cone_mark=VECTOR,  # direction of twist 0 if the bone points to the centre
    cone=("f8", (CONE_CORNERS, 3)),
    cone_cap="f8",  # cosine of the angle around the centre within which the bone is inside
    twist_lower="f8",
    twist_upper="f8",
    # scratch of inverse kinematics: of the hinge, then of the ball joint
    world_axis=VECTOR,
    cosine="f8",  # of the angle
    sine="f8",
    last_angle="f8",  # before the hinge rotated
    pass_turn="f8",
    bone=VECTOR,
    mark=VECTOR,
    nearest=VECTOR,
    corner=VECTOR,
    next_corner=VECTOR,
    normal=VECTOR,  # of the plane through both corners
    foot=VECTOR,
    zero=VECTOR,  # mark at twist 0
    # of a joint between bodies (`kinematics/mechanism.py`); `parent` is -1 of one with the world
    type="i8",  # JOINT_*
    width="i8",  # number of its rates
    place="i8",  # its place among the positions of the mechanism
    parent_anchor=VECTOR,  # from the bodies' centres of mass, in their axes; from the origin of the world
    child_anchor=VECTOR,
    held="i8",  # 1: its spring and damper are too fast for the substep, and their force is even over it
    mobility="f8",  # rate per impulse along it at the start of the substep, if it has either
    answer="f8",  # inertia of the rate by which its spring and damper answer a force over a substep
    child_axis=VECTOR,  # `axis` in the child's axes, of a hinge
    rest_turn=QUATERNION,  # orientation of the child in the parent's axes at position 0
    stiffness="f8",
    damping="f8",
    target="f8",
    largest_force="f8",
    mimics="i8",  # joint whose position times `ratio` is its own, or -1
    ratio="f8",
    columns=("f8", (6, 6)),  # velocity at the mechanism's `center` and angular velocity per rate
    articulated=("f8", (6, 6)),  # inertia about that centre of all that it moves, whose joints give way
    bias=("f8", (6,)),  # force and torque about it that they need without acceleration
    carried=("f8", (6, 6)),  # of that inertia, the momentum per rate
    weights=("f8", (6,)),  # and its part along the rate; force along it
    pushes=("f8", (6,)),
    pull=VECTOR,  # force on what it moves, and torque about that centre [N, N m]
    torque=VECTOR,
    turned=QUATERNION,  # scratch
    drift=VECTOR,  # acceleration of the child without change of the rates, and angular acceleration
    spin_drift=VECTOR,
)
POSTURE_CONSTRAINT = record(
    piece_a="i8",  # of the pair
    piece_b="i8",
    is_touching="i8",  # 1: the pair touched at the last detection
    body="i8",  # a link of a chain
    other="i8",  # the body in contact with it
    first=("i8", (2,)),  # hinges that move `body` and `other`
    last=("i8", (2,)),
    point=VECTOR,  # contact point of the link, link frame
    other_point=VECTOR,  # contact point of the other body, its frame
    normal=VECTOR,  # out of the other body
    bound="f8",  # least height of the link's point above the other point, along the normal [m]
    world_point=VECTOR,
    depth="f8",
    jacobian=("f8", (2, CHAIN_JOINTS)),  # change of depth per rotation of these hinges [m]
    multiplier="f8",  # Lagrange multiplier [1/m]
    warm_multiplier="f8",  # multiplier of the last QP with the tracker's pull
    factor=("f8", (POSTURE_CONSTRAINTS,)),  # row of the Cholesky factor in Newton's method
    step="f8",  # solution of that factor [1/m]
)
DRIVER = record(
    root="i8",
    first_joint="i8",
    joint_count="i8",
    chain_count="i8",
    chains=("i8", (CHAIN_CAPACITY, 2)),  # first and last joint of each, root to tip
    order=("i8", (CHAIN_CAPACITY,)),  # order of chain overlap removal in this frame
    mass="f8",
    lead="f8",  # of the law of velocities over the substep [1]
    inverse_mass="f8",  # in contacts; zero if it has chains and does not move in the simulated loop
    stiffness="f8",
    damping="f8",
    hinge_frequency="f8",  # of the servo of its chains in contact with simulated bodies [rad/s]
    hinge_count="i8",  # hinges of its chains
    hinge_factor=("f8", (HINGE_CAPACITY, HINGE_CAPACITY)),  # Cholesky factor of their inertia, root free
    mode_terms=("f8", (CHAIN_JOINTS, CHAIN_JOINTS)),  # scratch of `hinge_modes`
    mode_vectors=("f8", (CHAIN_JOINTS, CHAIN_JOINTS)),
    hinge_mover="i8",  # index of their first block in the solver
    is_solved="i8",  # 1: an island with its hinges has been solved
    hinge_response=("f8", (HINGE_CAPACITY,)),  # scratch
    position=VECTOR,  # coupling state: the root's origin
    orientation=QUATERNION,
    velocity=VECTOR,
    omega=VECTOR,
    old_position=VECTOR,  # at the start of a substep
    old_orientation=QUATERNION,
    old_velocity=VECTOR,
    old_omega=VECTOR,
    center=VECTOR,  # centre of mass of all links, world
    inertia=MATRIX,  # of all links about `center`, world axes
    inverse_inertia=MATRIX,
    prescribed="i8",  # 1: it follows its tracker exactly, and no contact moves it
    # tracker's pose and velocities at the frame's start and end; contiguous, because one copy transfers them
    old_target_position=VECTOR,
    old_target_orientation=QUATERNION,
    old_target_velocity=VECTOR,
    old_target_omega=VECTOR,
    target_position=VECTOR,
    target_orientation=QUATERNION,
    target_velocity=VECTOR,
    target_omega=VECTOR,
    coupled_position=VECTOR,  # after the coupling, before overlap removal
    coupled_orientation=QUATERNION,
    # of a driver that moves in the simulated loop (`driver_motion`)
    loops="i8",  # 1: it moves in the simulated loop of this frame
    leads="i8",  # 1: contacts on it follow its path by the law of positions, unless it is an exact parabola
    pressed="i8",  # PRESSED: it touched a simulated body in this frame, and stops at fixed and driven bodies
    clock="f8",  # time since the start of the frame [s], now and at the start of the substep
    old_clock="f8",
    goal_start=VECTOR,  # where the spring pulls, at the frame's start and end
    goal_end=VECTOR,
    goal_start_orientation=QUATERNION,
    goal_end_orientation=QUATERNION,
    stop_velocity=VECTOR,  # change of velocity at the frame's end
    end_position=VECTOR,  # pose and velocities that the driven loop left
    end_orientation=QUATERNION,
    end_velocity=VECTOR,
    end_omega=VECTOR,
    lasting="i8",  # 1: `inverse_mass` and `inverse_inertia` are those of a force over a substep
    turn_share="f8",  # its `inverse_inertia` over that of an impulse [1]
    push=VECTOR,  # impulse of the law of velocities [N s]
    twist=VECTOR,  # inverse inertia times its angular impulse [rad/s]
    shift_push=VECTOR,  # those of the law of positions
    shift_twist=VECTOR,
    free_position=VECTOR,  # last free pose
    free_orientation=QUATERNION,
    has_free="i8",
    is_free="i8",  # 1: free of overlap after this frame's removal
    stride="f8",  # largest rotation of a hinge by attraction in this frame [rad]
    constraint_count="i8",  # constraints of the posture QP: contacts of its chains
    constraints=(POSTURE_CONSTRAINT, (POSTURE_CONSTRAINTS,)),
    entry_position=VECTOR,  # pose at the start of overlap removal
    entry_orientation=QUATERNION,
    scratch=("f8", (3, 3)),
    sums=MATRIX,  # sums of Eq. 1 in profile `paper`
    # of a mechanism, which is a row too: bodies that joints connect, moved by contact, gravity and joints
    # alone; the first `joint_count` joints are those of its tree, those that close loops follow
    mechanism="i8",  # 1: it is one
    loop_count="i8",
    mimic_count="i8",  # joints of the tree that mimic others
    constrained="i8",  # 1: it has either
    gravity=VECTOR,
    stiffened="i8",  # 1: its inertia includes what springs and dampers answer, `answer`
    step_error="f8",  # of a step, in positions and in rates times its length [m or rad]
    position_count="i8",
    positions=("f8", (CONFIGURATION,)),
    rates=("f8", (HINGE_CAPACITY,)),
    start_positions=("f8", (CONFIGURATION,)),  # at the start of a substep
    start_rates=("f8", (HINGE_CAPACITY,)),
    gains=(
        "f8",
        (HINGE_CAPACITY,),
    ),  # changes of rates by impulses over it: law of velocities, and of positions
    has_path="i8",  # 1: the law of positions was solved
    path_gains=("f8", (HINGE_CAPACITY,)),
    force=("f8", (HINGE_CAPACITY,)),  # scratch: generalised forces
    loop_rows="i8",  # independent constraints of its couplings and loops: as many as rates, or fewer
    loop_basis=(
        "f8",
        (HINGE_CAPACITY, HINGE_CAPACITY),
    ),  # their orthonormal directions, in coordinates of unit mass
    loop_factor=("f8", (HINGE_CAPACITY, HINGE_CAPACITY)),
    loop_row=("i8", (HINGE_CAPACITY,)),  # which constraint each is
    loop_error=("f8", (HINGE_CAPACITY,)),
    loop_direction=("f8", (6,)),
    slopes=("f8", (7, CONFIGURATION + HINGE_CAPACITY + 1)),  # of Runge and Kutta, and power as in `work`
    stage_start=("f8", (CONFIGURATION + HINGE_CAPACITY + 1,)),
    solved_force=("f8", (HINGE_CAPACITY,)),  # generalised forces of the impulses that cause `gains`
    known_force=("f8", (HINGE_CAPACITY,)),  # those under which it moves, and the changes of rates by them
    known_gains=("f8", (HINGE_CAPACITY,)),
    known_path=("f8", (HINGE_CAPACITY,)),  # the latter as the law of positions takes them
    end_positions=("f8", (CONFIGURATION,)),  # at the end of a substep under these
    end_rates=("f8", (HINGE_CAPACITY,)),  # there, less `known_gains`
    work="f8",  # of dampers, motors, and all forces of joints that close loops over a substep [J]
    end_work="f8",
    limited="i8",  # 1: a limit was a row of the substep that ended
    touches="i8",  # 1: rows of contact act on its bodies
    holds="i8",  # 1: they, or limits, do so in the motion to `end_*`, so joints that are too fast are held
    held="i8",  # 1: a joint is
    held_time="f8",  # time over which held joints answer impacts as they do forces [s]
    held_force=("f8", (HINGE_CAPACITY,)),  # even force of held joints along each rate
    lacks=("f8", (HINGE_CAPACITY,)),  # scratch: force at the end, less that
    end_time="f8",  # its length, or -1 [s]
    lost="i8",  # 1: its motion takes more steps than are allowed, so `end_*` are those of a part of it
    at_middle="i8",  # 1: columns and inertia are those at its middle
)
