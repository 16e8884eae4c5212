"""Time of impact of two translating and rotating convex pieces by conservative advancement: never late.

`swept_motion` defines the motion. The signed distance of two convex pieces is the largest gap along any
direction. At a later s' it is therefore at least the gap along the normal n found at s:

    distance(s') >= distance(s) - integral from s to s' of (n . (c_a' - c_b') + reach_a + reach_b),

where reach bounds n . (omega x p) over the points p of a piece, relative to the centre of mass. For a fixed
axis, reach is |n x omega| times the largest distance from that axis. For a rotation vector r, omega = J r',
where J, the mean of the rotations exp(t r) for t in [0, 1], has norm at most 1: reach is |r'| times the
largest distance from the centre. For free rotation it is the bound on |omega| times that distance. The
rounding radius of a piece does not contribute, because rotation moves only the core. An advance ends where
the right-hand side falls to the target (Mirtich 1996; Zhang, Lee & Kim 2006).

Fast rotation makes these advances short; a leap is longer. Along a fixed n, the height of every point is
above its chord minus curl t^2 / 8, where curl bounds its second derivative. The gap along n is thus at least
the smaller of its values at both ends, minus that term. The gap at the end is measured, not bounded, so near
the impact leaps converge like Newton's method. The same holds in the frame of either body, where its piece
is at rest: a face that leans on another body and tips keeps its gap along the normal that turns with it.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from touchstone.reference_impl.continuous.swept_motion import (
    carried_curl,
    center_speed,
    lever_of,
    most_curl,
    most_spin,
    point_speed,
    pose_along,
)
from touchstone.reference_impl.core.conventions import SHARPENING_SHIFT
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.geometry.gjk import add_support, enter_frame
from touchstone.reference_impl.geometry.plane_distance import has_plane, plane_gap
from touchstone.reference_impl.geometry.shapes import place_piece

TIME_OF_IMPACT_STEPS = 500
"""Steps of conservative advancement; 3 are usual for a bullet, 6 to 50 for a spin of several radians."""
LEAP_CUT = 0.5
"""Factor between trial leaps [1]; a trial takes one support query per piece, not a distance query."""


class MovingPair(NamedTuple):
    """Two convex pieces, and the bodies that move them over a substep."""

    body_a: np.void  # BODY, with its motion
    body_b: np.void
    piece_a: np.void  # PIECE
    piece_b: np.void
    vertices: np.ndarray  # VERTEX, rows of all hulls
    pair: np.void  # PAIR; receives the last distance, normal and witness points
    state: np.void  # STATE: scratch of convex depth


@kernel
def time_of_impact(moving, start, until, target, slack):
    """Fraction of the substep at which a pair's distance first falls to the target gap.

    Args:
        moving: MovingPair.
        start, until: ends of the search interval, as fractions [1].
        target: gap to find [m]; a negative one is a depth.
        slack: accepted excess over the target [m], positive.
    Returns:
        (fraction, iterations, converged): `until` if the distance stays above the target. Otherwise the
        distance at the fraction is in [target, target + slack], or lower if it is at `start`. If not
        converged, there is no impact before the fraction. Leaves both bodies at intermediate poses.
    """
    a, b, pair = moving.body_a, moving.body_b, moving.pair
    axial_a, lever_a = lever_of(a, moving.piece_a, moving.vertices)
    axial_b, lever_b = lever_of(b, moving.piece_b, moving.vertices)
    n, s, iterations = pair["normal"], start, 0
    while iterations < TIME_OF_IMPACT_STEPS:
        iterations += 1
        gap = distance_at(moving, s) - target
        # pair["distance"] is an upper bound on the distance, `gap` uses a lower one; both agree if converged
        if pair["distance"] - target <= slack:
            return s, iterations, True
        if gap <= 0:
            break
        # approach along n: exact for the centres, an upper bound for the rotations
        speed_a, bend_a = center_speed(n, a, s)
        speed_b, bend_b = center_speed(n, b, s)
        turns = lever_a * most_spin(n, a, axial_a, s, until)
        turns += lever_b * most_spin(n, b, axial_b, s, until)
        bend = bend_a - bend_b
        advance = _time_to_close(gap, speed_a - speed_b + turns, bend)
        if turns > 0 and s + advance < until:
            curl = 2 * abs(bend) + most_curl(a, lever_a, s, until) + most_curl(b, lever_b, s, until)
            advance = _leap(moving, s, until, gap, target, curl, advance)
        s += advance
        if s >= until:
            return until, iterations, True
    return s, iterations, False


@kernel
def distance_at(moving, s):
    """Signed distance [m] of a pair at fraction s; if it did not converge, a lower bound, with an upper bound
    in `pair["distance"]`."""
    place_pair(moving, s)
    one, two, pair = moving.piece_a, moving.piece_b, moving.pair
    vertices, state = moving.vertices, moving.state
    _, converged = convex_depth(one, two, vertices, state, pair)
    if not converged:
        _sharpen(one, two, vertices, state, pair)
        n = pair["normal"]
        return min(pair["distance"], gap_along(one, two, vertices, n[0], n[1], n[2], state))
    return pair["distance"]


@kernel
def _sharpen(piece_a, piece_b, vertices, state, pair):
    """Recompute the normal with B translated along it.

    Near a round surface, rounding errors tilt the normal of a tiny gap. A shift t along the normal leaves
    t / (R + t) of the tilt, with R the radius of curvature: a step of the proximal point method.
    """
    size_a = size_b = 0.0
    for i in range(3):
        size_a = max(size_a, piece_a["high"][i] - piece_a["low"][i])
        size_b = max(size_b, piece_b["high"][i] - piece_b["low"][i])
    shift = SHARPENING_SHIFT * min(size_a, size_b)
    n, position, distance = pair["normal"], piece_b["world_position"], pair["distance"]
    x, y, z = shift * n[0], shift * n[1], shift * n[2]
    px, py, pz = position[0], position[1], position[2]
    position[0], position[1], position[2] = px + x, py + y, pz + z
    convex_depth(piece_a, piece_b, vertices, state, pair)
    position[0], position[1], position[2] = px, py, pz
    point = pair["point_b"]
    point[0], point[1], point[2] = point[0] - x, point[1] - y, point[2] - z
    pair["distance"] = distance


@kernel
def place_pair(moving, s):
    """Pose both bodies at fraction s of their motion, and place the two pieces."""
    _place(moving.body_a, moving.piece_a, moving.vertices, s)
    _place(moving.body_b, moving.piece_b, moving.vertices, s)


@kernel
def _place(body, piece, vertices, s):
    if body["moves"] == 1:
        pose_along(body, s)
        place_piece(piece, body, vertices, 0.0)


@kernel
def gap_along(piece_a, piece_b, vertices, x, y, z, state):
    """Gap [m] of two placed pieces along a unit vector from A to B: a lower bound on their distance."""
    if has_plane(piece_a, piece_b):
        return plane_gap(piece_a, piece_b, vertices, x, y, z)
    enter_frame(piece_a, piece_b, state)
    m = piece_b["world_rotation"]
    u = m[0, 0] * x + m[1, 0] * y + m[2, 0] * z
    v = m[0, 1] * x + m[1, 1] * y + m[2, 1] * z
    w = m[0, 2] * x + m[1, 2] * y + m[2, 2] * z
    reach = add_support(piece_a, piece_b, vertices, u, v, w, 0, state)
    return -reach - piece_a["radius"] - piece_b["radius"]


@kernel
def _leap(moving, s, until, gap, target, curl, advance):
    """Longer advance, verified by the gap at its end; returns `advance` if it finds none.

    Args:
        gap: distance at s minus the target [m], positive.
        curl: bound on the second derivative of the points' heights along the normal at rest [m].
    """
    a, b, pair = moving.body_a, moving.body_b, moving.pair
    n = pair["normal"]
    curl_a, curl_b = carried_curl(a, b, s, until), carried_curl(b, a, s, until)
    least = min(curl, curl_a, curl_b)
    ax, ay, az = _into(a, n)
    bx, by, bz = _into(b, n)
    # Newton step for the witness points with twice the worst curvature, so that the check below can pass
    closing = point_speed(n, a, pair["point_a"], s)
    closing -= point_speed(n, b, pair["point_b"], s)
    leap = min(_time_to_close(gap, closing, least), until - s)
    # shorten the leap while another point comes too near
    while leap > advance:
        square = leap * leap / 8
        if least * square <= gap:
            place_pair(moving, s + leap)
            if (
                _stays_above(moving, n[0], n[1], n[2], gap, target, curl * square)
                or _stays_above(moving, *_out_of(a, ax, ay, az), gap, target, curl_a * square)
                or _stays_above(moving, *_out_of(b, bx, by, bz), gap, target, curl_b * square)
            ):
                return leap
        leap *= LEAP_CUT
    return advance


@inlined_kernel
def _stays_above(moving, x, y, z, gap, target, dip):
    """Whether the pair stays above the target: the gaps along its normal, `gap` above it at the start of a
    leap and measured along (x, y, z) at the end, exceed the dip between."""
    if dip > gap:
        return False
    then = gap_along(moving.piece_a, moving.piece_b, moving.vertices, x, y, z, moving.state)
    return then - target >= dip


@inlined_kernel
def _into(body, v):
    """A world vector in the frame of a body."""
    m = body["rotation"]
    return (
        m[0, 0] * v[0] + m[1, 0] * v[1] + m[2, 0] * v[2],
        m[0, 1] * v[0] + m[1, 1] * v[1] + m[2, 1] * v[2],
        m[0, 2] * v[0] + m[1, 2] * v[1] + m[2, 2] * v[2],
    )


@inlined_kernel
def _out_of(body, x, y, z):
    """A vector of a body's frame in the world."""
    m = body["rotation"]
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
    )


@kernel
def _time_to_close(gap, speed, bend):
    """Least positive t with speed t + bend t^2 = gap > 0, or infinity."""
    square = speed * speed + 4 * bend * gap
    if square < 0:
        return np.inf
    # this form of the root avoids cancellation; without a positive sum no root is positive
    total = speed + sqrt(square)
    return 2 * gap / total if total > 0 else np.inf
