"""Minimum-norm translation that resolves all depths of a mover at once.

In three dimensions at most three constraints n_i . x >= d_i are active. A dual active-set method adds the
most violated constraint to the active set. It finds the smallest x that satisfies these at most four by
trying the seven subsets of at most three that contain the new one. |x| grows with every constraint added, so
no active set recurs and the method terminates.
"""

from math import inf, sqrt

from touchstone.reference_impl.core.conventions import PARALLEL_SINE
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.posture.global_depth import side_of

MIN_NORM_PLANES = 100
"""Planes tried before normals count as opposing; about 3 are usual."""
PLANE_TOLERANCE = 1e-14
"""Depth left, over the sum of the largest depth and |x|, that counts as resolved [1]: some 50 roundings."""


@kernel
def min_norm_translation(bodies, pairs, first, end, mover, planes, out_shift):
    """The smallest x with n_i . x >= d_i over the mover's overlapping pairs, normals towards the mover.

    Args:
        pairs: `pairs[first:end]` are used; of equally violated ones the first is added.
        mover: Mover.
        planes: scratch (4, 4), rows (n, d).
        out_shift: x, the translation of the mover (3,) [m].
    Returns:
        (deepest, size): the mover's largest depth and |x| [m]; (depth, 0) if opposing normals are infeasible.
    """
    deepest = size = 0.0
    count = 0
    out_shift[:] = 0.0
    for _ in range(MIN_NORM_PLANES):
        # find the most violated constraint
        worst, found = PLANE_TOLERANCE * (deepest + size), -1
        for k in range(first, end):
            depth = pairs[k]["depth"]
            sign = side_of(bodies, pairs[k], mover)
            if depth <= 0 or sign == 0.0:
                continue
            deepest = max(deepest, depth)
            n = pairs[k]["normal"]
            short = depth - sign * (n[0] * out_shift[0] + n[1] * out_shift[1] + n[2] * out_shift[2])
            if short > worst:
                worst, found = short, k
        if found < 0:
            return deepest, size
        sign = side_of(bodies, pairs[found], mover)
        for i in range(3):
            planes[count, i] = sign * pairs[found]["normal"][i]
        planes[count, 3] = pairs[found]["depth"]
        count, size = _hold(planes, count, deepest, out_shift)
        if count == 0:
            break
    out_shift[:] = 0.0
    return deepest, 0.0


@kernel
def _hold(planes, last, deepest, out_shift):
    """Find the smallest x on plane `last` that satisfies the planes before it; move active ones to the front.

    Returns:
        (count, size): number of active planes, and |x| [m]; count 0 if infeasible.
    """
    size, p, q = inf, -1, -1
    for j in range(-1, last):
        for k in range(-1, max(j, 0)):
            meet, x, y, z = _nearest_on(planes, last, j, k)
            length = sqrt(x * x + y * y + z * z)
            if not meet or length >= size:
                continue
            slack = PLANE_TOLERANCE * (deepest + length)
            for i in range(last):
                if planes[i, 3] - planes[i, 0] * x - planes[i, 1] * y - planes[i, 2] * z > slack:
                    meet = False
            if meet:
                size, p, q = length, k, j
                out_shift[0], out_shift[1], out_shift[2] = x, y, z
    if size == inf:
        return 0, 0.0
    count = 0
    for k in (p, q, last):
        if k >= 0:
            for i in range(4):
                planes[count, i] = planes[k, i]
            count += 1
    return count, size


@kernel
def _nearest_on(planes, i, j, k):
    """Point nearest to the origin on planes i, j and k; -1 omits j, k or both.

    An orthonormal basis from cross products (Gram-Schmidt) keeps x on every plane to rounding of |x|, however
    small the angle between two normals.

    Returns:
        (meet, x, y, z): whether the normals are independent, and the point.
    """
    p, q, r = planes[i], planes[j], planes[k]
    x, y, z = p[3] * p[0], p[3] * p[1], p[3] * p[2]
    if j >= 0:
        # g is perpendicular to both normals, f to n_i and g
        gx, gy, gz = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
        size = sqrt(gx * gx + gy * gy + gz * gz)
        if size < PARALLEL_SINE:
            return False, x, y, z
        gx, gy, gz = gx / size, gy / size, gz / size
        fx, fy, fz = gy * p[2] - gz * p[1], gz * p[0] - gx * p[2], gx * p[1] - gy * p[0]
        along = (q[3] - q[0] * x - q[1] * y - q[2] * z) / (q[0] * fx + q[1] * fy + q[2] * fz)
        x, y, z = x + along * fx, y + along * fy, z + along * fz
        if k >= 0:
            slope = r[0] * gx + r[1] * gy + r[2] * gz
            if abs(slope) < PARALLEL_SINE:
                return False, x, y, z
            along = (r[3] - r[0] * x - r[1] * y - r[2] * z) / slope
            x, y, z = x + along * gx, y + along * gy, z + along * gz
    return True, x, y, z
