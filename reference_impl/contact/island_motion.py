"""Rigid motion and angular momentum of a free island, which touches neither fixed nor driven bodies.

Contact impulses are equal and opposite, so the island keeps its angular momentum about its centre of mass. A
substep conserves it to first order only: the contact point of sliding bodies moves, and separation moves
overlapping bodies. `keep_spin` restores the difference by a rigid rotation of the whole island, which changes
no relative velocity of touching bodies.
"""

from touchstone.reference_impl.continuous.free_rotation import is_isotropic
from touchstone.reference_impl.core.conventions import GUARD_UNVISITED
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import conjugate_by, invert_symmetric, rotate
from touchstone.reference_impl.solver.islands import island_of


@kernel
def is_free(island):
    """Whether an island touches neither fixed nor driven bodies."""
    return island["grounded"] == 0 and island["driven"] == 0


@kernel
def keep_spin(bodies):
    """Restore the angular momentum that free islands had at the start of the substep.

    Sets `turning`, and adds the energy of this correction to the guard's sums.
    """
    for b in range(len(bodies)):
        if _free_island(bodies, b) == b:
            _begin(bodies[b]["guard"])
    for b in range(len(bodies)):
        m = _free_island(bodies, b)
        if m >= 0:
            _add_center(bodies[m]["guard"], bodies[b])
    for b in range(len(bodies)):
        m = _free_island(bodies, b)
        if m >= 0:
            _add_spin(bodies[m]["guard"], bodies[b])
    for b in range(len(bodies)):
        if _free_island(bodies, b) == b:
            _find_turn(bodies[b])
    for b in range(len(bodies)):
        m = _free_island(bodies, b)
        if m >= 0:
            _turn_along(bodies[m]["guard"], bodies[b])


@kernel
def _free_island(bodies, b):
    """Root body of the free island of body b, or -1."""
    if bodies[b]["guard"]["state"] == GUARD_UNVISITED:
        return -1
    m = island_of(bodies, b)
    return m if is_free(bodies[m]["guard"]) else -1


@kernel
def _begin(island):
    for i in range(3):
        island["center"][i] = island["old_center"][i] = 0.0
        island["spin"][i] = island["old_spin"][i] = 0.0
        for j in range(3):
            island["inertia"][i, j] = 0.0


@kernel
def _add_center(island, body):
    share = body["mass"] / island["mass"]
    for i in range(3):
        island["center"][i] += share * body["center"][i]
        island["old_center"][i] += share * body["old_center"][i]


@kernel
def _add_spin(island, body):
    """Add a body's inertia, and its angular momenta before and after the substep, to its island."""
    mass, whole, own, momentum = body["mass"], island["inertia"], body["scratch"], body["momentum"]
    v, w, p, q = body["old_velocity"], body["old_omega"], island["old_spin"], island["spin"]
    x, y, z = _arm(body["old_center"], island["old_center"])
    # bodies with anisotropic inertia store their initial `momentum`
    isotropic = is_isotropic(body["inertia"])
    for i in range(3):
        p[i] += body["inertia"][0, 0] * w[i] if isotropic else momentum[i]
    _add_moment(p, mass, x, y, z, v)
    v, w = body["velocity"], body["omega"]
    x, y, z = _arm(body["center"], island["center"])
    conjugate_by(body["rotation"], body["inertia"], own)
    square = x * x + y * y + z * z
    r = (x, y, z)
    for i in range(3):
        for j in range(3):
            q[i] += own[i, j] * w[j]
            whole[i, j] += own[i, j] + mass * ((square if i == j else 0.0) - r[i] * r[j])
    _add_moment(q, mass, x, y, z, v)


@kernel
def _arm(center, common):
    return center[0] - common[0], center[1] - common[1], center[2] - common[2]


@kernel
def _add_moment(out_spin, mass, x, y, z, v):
    """Add the angular momentum of a mass with velocity v at (x, y, z)."""
    out_spin[0] += mass * (y * v[2] - z * v[1])
    out_spin[1] += mass * (z * v[0] - x * v[2])
    out_spin[2] += mass * (x * v[1] - y * v[0])


@kernel
def _find_turn(root):
    """Compute an island's angular velocities from its sums.

    `turning` belongs to the angular momentum before the substep. `turn` corrects the present one to it.
    """
    island, inverse = root["guard"], root["scratch"]
    before, after, turn = island["old_spin"], island["spin"], island["turn"]
    invert_symmetric(island["inertia"], inverse)
    rotate(inverse, before, island["turning"])
    energy = 0.0
    for i in range(3):
        turn[i] = 0.0
        for j in range(3):
            turn[i] += inverse[i, j] * (before[j] - after[j])
    for i in range(3):
        energy += turn[i] * (before[i] + after[i]) / 2
    island["motion"] += energy
    island["rise"] += energy


@kernel
def _turn_along(island, body):
    """Add the angular velocity `turn` of its island to a body's velocities."""
    x, y, z = _arm(body["center"], island["center"])
    u, v, w = island["turn"], body["velocity"], body["omega"]
    v[0] += u[1] * z - u[2] * y
    v[1] += u[2] * x - u[0] * z
    v[2] += u[0] * y - u[1] * x
    for i in range(3):
        w[i] += u[i]


@kernel
def rigid_velocity(island, point):
    """Velocity at a point of an island that moves as one rigid body; that of what carries it, if it touches a
    body that it does not move."""
    if island["grounded"] == 1:
        return island["carrier"][0], island["carrier"][1], island["carrier"][2]
    x, y, z = _arm(point, island["center"])
    p, w, mass = island["momentum"], island["turning"], island["mass"]
    u, v = p[0] / mass + w[1] * z - w[2] * y, p[1] / mass + w[2] * x - w[0] * z
    return u, v, p[2] / mass + w[0] * y - w[1] * x


@kernel
def rigid_energy(island):
    """Kinetic energy that an island keeps if it moves as one rigid body [J]; of one that is carried, all but
    that of its motion relative to what carries it: v.(p - m v / 2)."""
    if island["grounded"] == 1:
        p, v, m = island["momentum"], island["carrier"], island["mass"]
        return v[0] * (p[0] - m * v[0] / 2) + v[1] * (p[1] - m * v[1] / 2) + v[2] * (p[2] - m * v[2] / 2)
    p, w, spin = island["momentum"], island["turning"], island["old_spin"]
    total = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / island["mass"]
    return (total + w[0] * spin[0] + w[1] * spin[1] + w[2] * spin[2]) / 2
