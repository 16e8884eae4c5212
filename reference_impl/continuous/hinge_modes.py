"""Modes of a driver's chains.

With M the inertia of a chain's hinges, its root held, and K the diagonal matrix of their servos, V with
V'M V = 1 and V'K V diagonal, by Jacobi's rotations of K^-1/2 M K^-1/2, which keep small eigenvalues exact
(Demmel & Veselic 1992).
"""

from math import sqrt

from touchstone.reference_impl.core.kernel import kernel

JACOBI_SWEEPS = 16
"""Most sweeps; up to 8 are usual."""
NOT_KNOWN = -1.0
"""Time of a motion that is not known [s]."""
UNCOUPLED = 1e-15
"""Coupling of two modes over the root of their own terms that is none [1]: a few roundings."""


@kernel
def weigh_chains(joints, driver):
    """Find the modes of the chains on which contacts or limits act, from their `coupling` at the present
    posture. Others keep theirs."""
    for i in range(driver["chain_count"]):
        first, end = driver["chains"][i, 0], driver["chains"][i, 1] + 1
        acts = joints[first]["touched"] == 1
        for k in range(first, end):
            acts = acts or joints[k]["limited"] != 0
        if acts:
            find_modes(joints, driver, first, end)


@kernel
def find_modes(joints, driver, first, end):
    """Find the modes of a chain from its inertia M, the lower half of `coupling`."""
    b, v, n = driver["mode_terms"], driver["mode_vectors"], end - first
    for i in range(n):
        for j in range(i + 1):
            size = sqrt(joints[first + i]["servo"] * joints[first + j]["servo"])
            b[i, j] = b[j, i] = joints[first + i]["coupling"][j] / size
            v[i, j] = v[j, i] = 1.0 if i == j else 0.0
    for _ in range(JACOBI_SWEEPS):
        turned = False
        for p in range(1, n):
            for q in range(p):
                turned = _rotate(b, v, n, p, q) or turned
        if not turned:
            break
    for i in range(n):
        mode = joints[first + i]
        mode["pace"], mode["motion_time"] = 1 / b[i, i], NOT_KNOWN
        for k in range(n):
            joints[first + k]["modes"][i] = v[i, k] / sqrt(b[i, i] * joints[first + k]["servo"])


@kernel
def _rotate(b, v, n, p, q):
    """Turn modes p and q, rows of v, so that their term in b vanishes; returns whether there was one."""
    term = b[p, q]
    if abs(term) <= UNCOUPLED * sqrt(b[p, p] * b[q, q]):
        return False
    half = (b[q, q] - b[p, p]) / (2 * term)
    tangent = (1.0 if half >= 0 else -1.0) / (abs(half) + sqrt(half * half + 1))
    cosine = 1 / sqrt(tangent * tangent + 1)
    sine = cosine * tangent
    for k in range(n):
        x, y = v[p, k], v[q, k]
        v[p, k], v[q, k] = cosine * x - sine * y, sine * x + cosine * y
        if k != p and k != q:
            x, y = b[p, k], b[q, k]
            b[p, k] = b[k, p] = cosine * x - sine * y
            b[q, k] = b[k, q] = sine * x + cosine * y
    b[p, p] -= tangent * term
    b[q, q] += tangent * term
    b[p, q] = b[q, p] = 0.0
    return True
