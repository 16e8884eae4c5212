"""Rows of the arrays of joints and drivers."""

from touchstone.reference_impl.core.conventions import CHAIN_JOINTS, POSTURE_CONSTRAINTS
from touchstone.reference_impl.core.dtypes import MATRIX, QUATERNION, VECTOR, record

CONE_CORNERS = 12
"""Corners a reach cone may have."""
CHAIN_CAPACITY = 8
"""Chains a driver may have."""
JOINT = record(
    parent="i8",
    child="i8",
    chain="i8",  # of its driver's chains the one it is in, or -1
    position=VECTOR,  # of the hinge, parent frame
    axis=VECTOR,  # parent frame
    rest=MATRIX,  # child in parent at angle 0
    lower="f8",
    upper="f8",
    angle="f8",
    posed_angle="f8",  # at which its child is posed, cosine and sine included; NaN where it may not be
    rate="f8",
    shown_angle="f8",  # at the start of a frame
    free_angle="f8",  # in the last free pose
    entry_angle="f8",  # when removal began
    target_angle="f8",  # at the end of the frame
    goal_angle="f8",  # of the frame's attraction
    last_target_angle="f8",  # at its start
    target_rate="f8",
    # first of a ball joint's three hinges: its reach cone, in the hinges' axes at angles 0
    cone_count="i8",  # corners; 0 where no ball joint starts
    cone_axes=MATRIX,  # as columns, in the frame of the parent
    cone_center=VECTOR,
    cone_mark=VECTOR,  # direction of twist 0 where the bone points to the centre
    cone=("f8", (CONE_CORNERS, 3)),
    cone_cap="f8",  # cosine of the angle round the centre within which the bone is inside
    twist_lower="f8",
    twist_upper="f8",
    # scratch of inverse kinematics: the hinge's, then the ball joint's
    world_axis=VECTOR,
    end_effector=VECTOR,  # in the child's frame
    cosine="f8",  # of the angle
    sine="f8",
    last_angle="f8",  # before the hinge was turned
    pass_angle="f8",  # before the pass
    pass_turn="f8",
    best_angle="f8",
    column=VECTOR,  # velocity of the end effector at rate 1
    bone=VECTOR,
    mark=VECTOR,
    outward=VECTOR,  # across the edge of the cone that the bone was put on; zero on none
    nearest=VECTOR,
    corner=VECTOR,
    next_corner=VECTOR,
    normal=VECTOR,  # of the plane through both
    foot=VECTOR,
    zero=VECTOR,  # the mark of twist 0
)
POSTURE_CONSTRAINT = record(
    piece_a="i8",  # of the pair
    piece_b="i8",
    is_touching="i8",  # whether that touched when pairs were last looked at
    body="i8",  # a link of a chain
    other="i8",  # the body it meets
    first=("i8", (2,)),  # hinges that move the one and the other
    last=("i8", (2,)),
    point=VECTOR,  # of the link, its frame
    other_point=VECTOR,  # of the other, its frame
    normal=VECTOR,  # out of the other
    bound="f8",  # that the one point is to be at above the other, along the normal [m]
    world_point=VECTOR,
    depth="f8",
    jacobian=("f8", (2, CHAIN_JOINTS)),  # of the depth per turn of these hinges [m]
    multiplier="f8",  # multiplier [1/m]
    warm_multiplier="f8",  # that of the last pulled turn
)
DRIVER = record(
    root="i8",
    first_joint="i8",
    joint_count="i8",
    chain_count="i8",
    chains=("i8", (CHAIN_CAPACITY, 2)),  # first and last joint of each, root to tip
    order=("i8", (CHAIN_CAPACITY,)),  # in which this frame frees the chains
    rank=("i8", (CHAIN_CAPACITY,)),  # of each chain in that order
    mass="f8",
    inverse_mass="f8",  # in contacts; zero where it has chains
    stiffness="f8",
    damping="f8",
    position=VECTOR,  # coupling state: the root's origin
    orientation=QUATERNION,
    velocity=VECTOR,
    omega=VECTOR,
    old_velocity=VECTOR,  # at the start of a substep
    old_omega=VECTOR,
    center=VECTOR,  # centre of mass of the whole, world
    inertia=MATRIX,  # of the whole about `center`, world axes
    inverse_inertia=MATRIX,
    # tracker at the frame's start and end; side by side, as they are handed over in one copy
    old_target_position=VECTOR,
    old_target_orientation=QUATERNION,
    target_position=VECTOR,
    target_orientation=QUATERNION,
    free_position=VECTOR,  # last free pose
    free_orientation=QUATERNION,
    has_free="i8",
    is_free="i8",  # of overlap, after this frame's removal
    stride="f8",  # by which attraction turns a hinge in this frame at most [rad]
    constraint_count="i8",  # what its chains touch: rows of the least turn
    constraints=(POSTURE_CONSTRAINT, (POSTURE_CONSTRAINTS,)),
    entry_position=VECTOR,  # pose when removal began
    entry_orientation=QUATERNION,
    scratch=("f8", (3, 3)),
)
