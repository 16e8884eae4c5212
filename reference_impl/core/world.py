"""The structured arrays a scene lives in: the border between Python and the compiled step.

Eight arrays hold everything: bodies, pieces, joints, drivers, vertices, pairs, contacts (the log of a
frame) and one record of `state` with settings, clocks, counters and scratch. Units as in `conventions.py`.
"""

from typing import NamedTuple

import numpy as np

from touchstone.reference_impl.core.conventions import SPIN_TERMS
from touchstone.reference_impl.core.dtypes import MATRIX, QUATERNION, VECTOR, record

GUARD = record(
    state="i8",  # of a body while the guard runs: 0 not seen, 1 summed up, 2 done
    before="f8",  # kinetic and potential energy at the start of a substep [J]
    # of an island, at the mover that stands for it
    rise="f8",  # of its energy over the substep [J]
    motion="f8",  # kinetic energy [J]
    scale="f8",  # of the energies whose rounding is no rise [J]
    mass="f8",
    momentum=VECTOR,
    grounded="i8",  # 1: it touches what does not move by impulses
    driven="i8",  # 1: a driver takes part
    counted="i8",  # 1: what is taken out of it is counted
    # of one that touches nothing but itself (`island_motion`), before the substep and after
    old_center=VECTOR,
    old_spin=VECTOR,  # angular momentum about its centre of mass
    center=VECTOR,
    spin=VECTOR,
    inertia=MATRIX,
    turning=VECTOR,  # angular velocity as one rigid body [rad/s]
    turn=VECTOR,  # what it lacks of that
)
BODY = record(
    # first, and in few cache lines, what sweeps over contacts read
    kind="i8",
    driver="i8",  # index of the driver that moves it, or -1
    inverse_mass="f8",  # zero where impulses do not move it by itself
    velocity=VECTOR,  # of the centre of mass, world
    omega=VECTOR,
    center=VECTOR,  # centre of mass, world
    inverse_inertia=MATRIX,  # world axes
    chain="i8",  # of its driver's chains the one that moves it, or -1
    hinge="i8",  # of that chain the joint that it is fixed beyond, or -1
    above="i8",  # the nearest link with pieces that it hangs on, or -1: they never meet
    material="i8",
    mass="f8",
    center_of_mass=VECTOR,  # body frame
    axis=VECTOR,  # of the least moment of inertia, body frame
    inertia=MATRIX,  # about the centre of mass, body axes
    position=VECTOR,  # of the origin, world
    orientation=QUATERNION,
    rotation=MATRIX,  # of `orientation`
    old_center=VECTOR,  # at the start of a substep
    old_orientation=QUATERNION,
    old_velocity=VECTOR,
    old_omega=VECTOR,
    moved="i8",  # of a link: whether it was posed anew
    shown_center=VECTOR,  # of a link, at the start of a frame
    shown_orientation=QUATERNION,
    # its way over a substep (`motion`)
    moves="i8",  # 0: it stays, whatever is written below
    travel=VECTOR,  # of the centre of mass: at fraction s, s travel + s^2 travel_bend [m]
    travel_bend=VECTOR,
    turn=VECTOR,  # world rotation vector [rad]
    turn_bend=VECTOR,
    spin_steps="i8",  # of the free rotation; 0: by the rotation vector; -1: that too, with momentum kept
    spin_step="i8",  # the one that is expanded
    spin_span="f8",  # of a step [s]
    spin_start=QUATERNION,  # orientation at its start
    spin_terms="i8",
    turn_series=("f8", (SPIN_TERMS, 4)),  # quaternion turned since then
    momentum_series=("f8", (SPIN_TERMS, 3)),  # body axes
    omega_series=("f8", (SPIN_TERMS, 3)),
    spin_rate=VECTOR,  # angular velocity where it was last posed [rad/s]
    spin_most="f8",  # bound on |omega| [rad per substep]
    spin_bend="f8",  # bound on |omega'| [rad per substep^2]
    # of a mover (`islands`): the one that stands for its island, that one's first row, index in the solver
    island="i8",
    first_row="i8",
    mover="i8",
    guard=GUARD,
    memory="i8",  # first contact point it remembers, counted from 1, or 0
    momentum=VECTOR,  # angular, about the centre of mass, world
    # what tells whether its motion is too long for tests at the end of it (`motion.set_path`)
    width="f8",  # least one of its pieces [m]
    reach="f8",  # largest distance of its pieces' cores from its centre of mass [m]
    path="f8",  # bound on how far its points go in a substep; 0 where impulses do not move it [m]
    free_center=VECTOR,  # of a link, in the last free pose
    # its room (`rooms`): of a simulated body's centre; of a link, where it was, and how far it may go
    # from there and turn
    isolated="i8",  # of a link: 1 while it can meet nothing
    fat_low=VECTOR,
    fat_high=VECTOR,
    fat_position=VECTOR,
    fat_rotation=MATRIX,
    fat_reach="f8",
    fat_margin="f8",
    scratch=MATRIX,
)
SLOT = record(
    low=VECTOR,  # bounding box of the piece
    high=VECTOR,
    piece="i8",
    filter_group="i8",
)
COLUMN = record(
    y="i8",  # its square of the y-z plane, in units of its level's width
    z="i8",
    level="i8",
    first="i8",  # slots first to end - 1
    end="i8",
    next="i8",  # strip with the same hash, or -1
    bucket="i8",  # first strip with the hash of this place, or -1
    low=("f8", (2,)),  # bounds of its boxes along y and z
    high=("f8", (2,)),
)
PIECE = record(
    body="i8",
    kind="i8",
    first_vertex="u4",
    vertex_count="u4",
    cells="u4",  # a hull's table of directions has so many along a side; 0: none
    size=VECTOR,  # half extents, half axes, or (0, 0, half length)
    radius="f8",  # round a core: of a sphere its centre, of a capsule a segment
    center=VECTOR,  # a point well inside the core, piece frame
    width="f8",  # smallest distance between two parallel planes that enclose it, or less [m]
    reach="f8",  # largest distance of its core from its origin [m]
    position=VECTOR,  # body frame
    rotation=MATRIX,
    world_position=VECTOR,
    world_rotation=MATRIX,
    low=VECTOR,  # bounding box, world
    high=VECTOR,
    fat_low=VECTOR,  # what it keeps to while its body's `clear`, and those of all others, hold
    fat_high=VECTOR,
    marked="i8",  # first marked row of `pairs` at it, counted from 1, or 0
    filter_group="i8",  # pieces of one owner never meet: its body, or -1 - its driver
    # scratch of the broad phase: row k holds slot k and strip k, whatever piece k is
    slot=SLOT,
    order="i8",  # piece that this slot is to hold
    column_of="i8",  # strip of the piece that this slot held
    column=COLUMN,
)
VERTEX = np.dtype(
    {"names": ["position", "lists"], "formats": [VECTOR, ("u2", (4, 4))], "offsets": [0, 0], "itemsize": 32}
)
"""A row is either a vertex of a hull by its position, piece frame, or four lists of the hull's table of
directions: see shapes.corner_of_hull. So dense, the tables of a scene's hulls stay in cache."""
PAIR = record(
    # first what sweeps over contacts read
    body_a="i8",
    body_b="i8",
    friction="f8",
    normal=VECTOR,
    point=VECTOR,  # contact point of its impulses
    level="f8",  # of that between the witness on A, 0, and on B, 1: on the face that clips the other [1]
    floor="f8",  # speed along the normal that a contact solve leaves at least [m/s]
    resting_impulse=VECTOR,  # impulse on B while the contact holds [N s]
    island="i8",  # mover that stands for its island, or -1
    next_row="i8",  # next row of its island, or -1
    next_point="i8",  # next row of the patch, or -1
    key="f8",  # approach speed in the priority queue [m/s]
    speculative_speed="f8",  # speed at which a near pair may still close its gap [m/s]
    piece_a="i8",
    piece_b="i8",
    restitution="f8",
    distance="f8",
    point_a=VECTOR,  # witnesses, world
    point_b=VECTOR,
    next_marked="i8",  # next marked row at the same piece, counted from 1, or 0
    manifold="i8",  # first row of the pair's patch, or -1
    free_slip="f8",  # speed of sliding after forces alone, along the direction before them [m/s]
    spare=VECTOR,  # another answer, while the energy guard compares the two [N s]
    before_a=VECTOR,  # surface velocities at the start of the hold [m/s]
    before_b=VECTOR,
)
CONTACT = record(
    time="f8",  # since the start of the frame
    body_a="i8",
    body_b="i8",
    position=VECTOR,
    normal=VECTOR,
    distance="f8",
    impulse=VECTOR,
    velocity_a_before=VECTOR,
    velocity_b_before=VECTOR,
    velocity_a_after=VECTOR,
    velocity_b_after=VECTOR,
)


class World(NamedTuple):
    """All arrays of a scene, in the order the compiled step takes them."""

    bodies: np.ndarray  # BODY
    pieces: np.ndarray  # PIECE
    joints: np.ndarray  # JOINT
    drivers: np.ndarray  # DRIVER
    vertices: np.ndarray  # VERTEX, rows of all hulls
    pairs: np.ndarray  # PAIR, capacity
    contacts: np.ndarray  # CONTACT, capacity
    state: np.ndarray  # STATE, one record
