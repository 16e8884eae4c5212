"""Simulated bodies that sank into each other or into others while their contacts held are parted again."""

from reference_impl.conventions import (
    COUNT_GAVE_UP,
    COUNT_ROUNDS,
    OVERLAP_TOLERANCE,
    PART_SWEEPS,
    REMOVAL_ROUNDS,
    SIMULATED,
)
from reference_impl.detection import detect, is_free, place_listed
from reference_impl.kernel import kernel
from reference_impl.skeleton import place


@kernel
def part_simulated(bodies, pieces, vertices, pairs, first, state):
    """Part simulated bodies that sank into each other or into fixed ones while their contact held.

    Args:
        first: row of `pairs` from which on they may be written.
    Returns:
        Whether they came free; giving up is counted.
    """
    for _ in range(REMOVAL_ROUNDS):
        end, deepest = detect(bodies, pieces, vertices, pairs, state, SIMULATED, first)
        if is_free(deepest):
            return True
        state["counters"][COUNT_ROUNDS] += 1
        _push_apart(bodies, pairs, first, end, state)
    place_listed(bodies, pieces, vertices, SIMULATED, state)
    state["counters"][COUNT_GAVE_UP] += 1
    return False


@kernel
def _push_apart(bodies, pairs, first, end, state):
    """Move simulated bodies until no depth is left along the normals found: one pair after the other, by
    all of its depth against fixed and driven bodies, by inverse mass against their like (Gauss-Seidel)."""
    for b in range(len(bodies)):
        bodies[b]["scratch"][0, :] = 0.0
    for _ in range(PART_SWEEPS):
        deepest = 0.0
        for k in range(first, end):
            a, b, n = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]], pairs[k]["normal"]
            p, q = a["scratch"][0], b["scratch"][0]
            depth = -pairs[k]["distance"]
            depth -= n[0] * (q[0] - p[0]) + n[1] * (q[1] - p[1]) + n[2] * (q[2] - p[2])
            if depth <= 0:
                continue
            deepest = max(deepest, depth)
            total = a["inverse_mass"] + b["inverse_mass"]
            for i in range(3):
                p[i] -= a["inverse_mass"] / total * depth * n[i]
                q[i] += b["inverse_mass"] / total * depth * n[i]
        if deepest <= OVERLAP_TOLERANCE / 2:
            break
    _displace(bodies, state)


@kernel
def _displace(bodies, state):
    """Move simulated bodies by what `scratch` holds; counts the potential energy this adds."""
    g = state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED:
            continue
        for i in range(3):
            body["position"][i] += body["scratch"][0, i]
            state["parted_energy"] -= body["mass"] * g[i] * body["scratch"][0, i]
        place(body)


@kernel
def kinetic_energy(body):
    """Kinetic energy of a simulated body [J]."""
    v, w, rotation, inertia = body["velocity"], body["omega"], body["rotation"], body["inertia"]
    total = body["mass"] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    for i in range(3):
        for j in range(3):
            along_i = rotation[0, i] * w[0] + rotation[1, i] * w[1] + rotation[2, i] * w[2]
            along_j = rotation[0, j] * w[0] + rotation[1, j] * w[1] + rotation[2, j] * w[2]
            total += inertia[i, j] * along_i * along_j
    return total / 2
