"""Energy guard of a substep: contacts that last add no energy to an island, whatever its motion leaves out.

The work of contacts is not positive for the velocities that the solver sees (`contact_solver`). Over a
substep points and normals turn with their bodies, it may end at an event before a contact has come back,
and sunk bodies are lifted (`parting`). What these add is measured, body by body, and taken out of the
motion of the island: all of it where it touches what is fixed; where it does not, what is not the motion of
one rigid body, which keeps its momenta (`island_motion`). Islands that a driver pushes are left alone.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import ENERGY_ROUNDING, SIMULATED, UNPAID_ROUNDING
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.simulated.island_motion import is_free, keep_spin, rigid_energy, rigid_velocity
from touchstone.reference_impl.simulated.separation import kinetic_energy
from touchstone.reference_impl.solver.islands import join_islands, mover_of


@kernel
def note_energy(bodies, state):
    """Remember the energy of each simulated body, before a substep; in no island yet."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            bodies[b]["guard"]["state"] = 0
            bodies[b]["guard"]["before"] = kinetic_energy(bodies[b]) + _height_energy(bodies[b], state)


@kernel
def _height_energy(body, state):
    """Potential energy of a body [J]."""
    g, c = state["gravity"], body["center"]
    return -body["mass"] * (g[0] * c[0] + g[1] * c[1] + g[2] * c[2])


@kernel
def guard_energy(bodies, drivers, pairs, count, parted, state):
    """Take out of the islands of the rows `pairs[:count]` what their energy rose since `note_energy`.

    Args:
        parted: bodies may have been lifted, those that fly apart as well.
    """
    if parted:
        join_islands(bodies, drivers, pairs, count, True)
    free = False
    for k in range(count):
        _reset(bodies, drivers, pairs[k])
    for k in range(count):
        if pairs[k]["island"] >= 0:
            _sum_up(bodies, drivers, pairs[k], state)
    for k in range(count):
        free = free or (pairs[k]["island"] >= 0 and is_free(bodies[pairs[k]["island"]]["guard"]))
    if free:
        keep_spin(bodies)
    for k in range(count):
        if pairs[k]["island"] >= 0:
            island = bodies[pairs[k]["island"]]["guard"]
            if island["driven"] == 0 and island["rise"] > ENERGY_ROUNDING * island["scale"]:
                _slow_down(bodies, pairs[k], island, state)


@kernel
def _reset(bodies, drivers, pair):
    """Begin the sums of a row's movers."""
    for side in range(2):
        m = mover_of(bodies, drivers, pair["body_a"] if side == 0 else pair["body_b"])
        if m >= 0:
            guard = bodies[m]["guard"]
            guard["state"] = guard["grounded"] = guard["driven"] = guard["counted"] = 0
            guard["rise"] = guard["motion"] = guard["scale"] = guard["mass"] = 0.0
            for i in range(3):
                guard["momentum"][i] = guard["turning"][i] = 0.0


@kernel
def _sum_up(bodies, drivers, pair, state):
    """Add a row's bodies, once each, to the sums of their island."""
    island = bodies[pair["island"]]["guard"]
    for side in range(2):
        b = pair["body_a"] if side == 0 else pair["body_b"]
        body = bodies[b]
        if mover_of(bodies, drivers, b) < 0 or body["driver"] >= 0:
            island["grounded"] = 1
            if body["driver"] >= 0:
                island["driven"] = 1
        elif body["guard"]["state"] == 0:
            body["guard"]["state"] = 1
            motion = kinetic_energy(body)
            island["rise"] += motion + _height_energy(body, state) - body["guard"]["before"]
            island["motion"] += motion
            island["scale"] += motion + abs(body["guard"]["before"])
            island["mass"] += body["mass"]
            for i in range(3):
                island["momentum"][i] += body["mass"] * body["velocity"][i]


@kernel
def _slow_down(bodies, pair, island, state):
    """Scale the motion of a row's bodies, once each, so that the island loses what its energy rose, as far as
    it moves."""
    loose = island["motion"] - rigid_energy(island)
    scale = sqrt(max(0.0, 1 - island["rise"] / loose)) if loose > 0 else 0.0
    for side in range(2):
        body = bodies[pair["body_a"] if side == 0 else pair["body_b"]]
        if body["kind"] != SIMULATED or body["guard"]["state"] != 1:
            continue
        body["guard"]["state"] = 2
        v, w = body["velocity"], body["omega"]
        x, y, z = rigid_velocity(island, body["center"])
        p, q, r = island["turning"][0], island["turning"][1], island["turning"][2]
        v[0], v[1], v[2] = x + scale * (v[0] - x), y + scale * (v[1] - y), z + scale * (v[2] - z)
        w[0], w[1], w[2] = p + scale * (w[0] - p), q + scale * (w[1] - q), r + scale * (w[2] - r)
    if island["counted"] == 0:
        island["counted"] = 1
        state["guarded_energy"] += island["rise"]
        if island["rise"] - loose > UNPAID_ROUNDING * island["scale"]:
            state["unpaid_energy"] += island["rise"] - loose
