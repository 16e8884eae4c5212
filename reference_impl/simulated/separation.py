"""Simulated bodies that sank into each other or into others while their contacts held are parted again."""

from touchstone.reference_impl.broad_phase.detection import detect, is_free, place_listed
from touchstone.reference_impl.continuous.free_rotation import is_isotropic
from touchstone.reference_impl.core.conventions import (
    COUNT_GAVE_UP,
    COUNT_ROUNDS,
    IMPULSES_TOGETHER,
    OVERLAP_TOLERANCE,
    REMOVAL_ROUNDS,
    SEPARATION_DEPTH,
    SEPARATION_SWEEPS,
    SIMULATED,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.driven.skeleton import place


@kernel
def separate_simulated(bodies, pieces, vertices, pairs, first, state):
    """Part simulated bodies that sank into each other or into fixed ones while their contact held.

    Args:
        first: row of `pairs` from which on they may be written.
    Returns:
        Whether they came free; giving up is counted.
    """
    left = SEPARATION_DEPTH if state["impulses"] == IMPULSES_TOGETHER else 0.0
    converged = True
    for _ in range(REMOVAL_ROUNDS):
        end, deepest = detect(bodies, pieces, vertices, pairs, state, SIMULATED, first)
        if is_free(deepest):
            return True
        state["counters"][COUNT_ROUNDS] += 1
        converged = _push_apart(bodies, pairs, first, end, left, not converged)
    place_listed(bodies, pieces, vertices, SIMULATED, state)
    state["counters"][COUNT_GAVE_UP] += 1
    return False


@kernel
def _push_apart(bodies, pairs, first, end, left, evenly):
    """Move simulated bodies until no depth over `left` remains along the normals found: one pair after the
    other, all of it against what is fixed or driven, else by inverse mass (Gauss-Seidel).

    Args:
        evenly: both by half. A light body between the ground and a heavy one needs as many sweeps as these
            differ in mass.
    Returns:
        Whether SEPARATION_SWEEPS were enough.
    """
    for b in range(len(bodies)):
        bodies[b]["scratch"][0, :] = 0.0
    converged = False
    for _ in range(SEPARATION_SWEEPS):
        deepest = 0.0
        for k in range(first, end):
            a, b, n = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]], pairs[k]["normal"]
            p, q = a["scratch"][0], b["scratch"][0]
            depth = -pairs[k]["distance"] - left
            depth -= n[0] * (q[0] - p[0]) + n[1] * (q[1] - p[1]) + n[2] * (q[2] - p[2])
            if depth <= 0:
                continue
            deepest = max(deepest, depth)
            share = b["inverse_mass"] / (a["inverse_mass"] + b["inverse_mass"])
            if evenly and 0 < share < 1:
                share = 0.5
            for i in range(3):
                p[i] -= (1 - share) * depth * n[i]
                q[i] += share * depth * n[i]
        converged = deepest <= (OVERLAP_TOLERANCE - left) / 2
        if converged:
            break
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            for i in range(3):
                bodies[b]["position"][i] += bodies[b]["scratch"][0, i]
            place(bodies[b])
    return converged


@kernel
def kinetic_energy(body):
    """Kinetic energy of a simulated body [J]."""
    v, w, rotation, inertia = body["velocity"], body["omega"], body["rotation"], body["inertia"]
    total = body["mass"] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if is_isotropic(inertia):
        return (total + inertia[0, 0] * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2])) / 2
    for i in range(3):
        for j in range(3):
            along_i = rotation[0, i] * w[0] + rotation[1, i] * w[1] + rotation[2, i] * w[2]
            along_j = rotation[0, j] * w[0] + rotation[1, j] * w[1] + rotation[2, j] * w[2]
            total += inertia[i, j] * along_i * along_j
    return total / 2
