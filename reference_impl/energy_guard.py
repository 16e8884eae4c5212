"""Energy guard of a substep: contacts that last add no energy to an island, whatever its motion leaves out.

The work of contacts is not positive for the velocities that the solver sees (`contact_solver`). Over a
substep points and normals turn with their bodies, it may end at an event before a contact has come back,
and sunk bodies are lifted (`parting`). What these add is measured, body by body, and taken out of the
motion of the island: all of it where it touches what is fixed, that about its centre of mass where it does
not. Islands that a driver pushes are left alone.
"""

from math import sqrt

from reference_impl.conventions import ENERGY_ROUNDING, SIMULATED, UNPAID_ROUNDING
from reference_impl.islands import mover_of
from reference_impl.kernel import kernel
from reference_impl.parting import kinetic_energy


@kernel
def note_energy(bodies, state):
    """Remember the energy of each simulated body, before a substep."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            bodies[b]["guard"]["before"] = kinetic_energy(bodies[b]) + _height_energy(bodies[b], state)


@kernel
def _height_energy(body, state):
    """Potential energy of a body [J]."""
    g, c = state["gravity"], body["center"]
    return -body["mass"] * (g[0] * c[0] + g[1] * c[1] + g[2] * c[2])


@kernel
def guard_energy(bodies, drivers, pairs, count, state):
    """Take out of the islands of the rows `pairs[:count]` what their energy rose since `note_energy`."""
    for k in range(count):
        _reset(bodies, drivers, pairs[k])
    for k in range(count):
        if pairs[k]["island"] >= 0:
            _sum_up(bodies, drivers, pairs[k], state)
    for k in range(count):
        if pairs[k]["island"] >= 0:
            island = bodies[pairs[k]["island"]]["guard"]
            if island["driven"] == 0 and island["rise"] > ENERGY_ROUNDING * island["scale"]:
                for side in range(2):
                    b = pairs[k]["body_a"] if side == 0 else pairs[k]["body_b"]
                    if bodies[b]["kind"] == SIMULATED and bodies[b]["guard"]["state"] == 1:
                        bodies[b]["guard"]["state"] = 2
                        _slow_down(bodies[b], island)
                if island["counted"] == 0:
                    island["counted"] = 1
                    state["guarded_energy"] += island["rise"]
                    unpaid = island["rise"] - _loose_motion(island)
                    if unpaid > UNPAID_ROUNDING * island["scale"]:
                        state["parted_energy"] += unpaid


@kernel
def _reset(bodies, drivers, pair):
    """Begin the sums of a row's movers."""
    for side in range(2):
        m = mover_of(bodies, drivers, pair["body_a"] if side == 0 else pair["body_b"])
        if m >= 0:
            guard = bodies[m]["guard"]
            guard["state"] = guard["grounded"] = guard["driven"] = guard["counted"] = 0
            guard["rise"] = guard["motion"] = guard["scale"] = guard["mass"] = 0.0
            guard["momentum"][:] = 0.0


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
def _common_share(island):
    """One over the mass of an island whose centre of mass keeps its velocity, or 0 [1/kg]."""
    return 0.0 if island["grounded"] == 1 else 1 / island["mass"]


@kernel
def _loose_motion(island):
    """Kinetic energy of an island that may be taken out [J]."""
    p = island["momentum"]
    return island["motion"] - _common_share(island) * (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / 2


@kernel
def _slow_down(body, island):
    """Scale a body's motion so that its island loses what its energy rose, as far as it moves."""
    common, motion = _common_share(island), _loose_motion(island)
    p = island["momentum"]
    scale = sqrt(max(0.0, 1 - island["rise"] / motion)) if motion > 0 else 0.0
    for i in range(3):
        v = common * p[i]
        body["velocity"][i] = v + scale * (body["velocity"][i] - v)
        body["omega"][i] *= scale
