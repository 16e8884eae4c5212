"""The earliest impact of a substep whose end overlaps (the discrete profile of section 5)."""

from reference_impl.contact_patch import is_polyhedral
from reference_impl.conventions import (
    COUNT_EVENTS,
    IMPACT_SLACK,
    IMPACT_STEPS,
    IMPACT_TARGET,
    LANDING_CAP,
    LANDING_DEPTH,
    OVERLAP_TOLERANCE,
    SIMULATED,
)
from reference_impl.convex_depth import convex_depth
from reference_impl.detection import place_pieces
from reference_impl.integrate import pose_at
from reference_impl.kernel import kernel


@kernel
def earliest_impact(bodies, pieces, vertices, pairs, touching, end, state, h):
    """Fraction of the substep at which the first new contact closes to IMPACT_TARGET, or the first touching
    pair of polyhedra sinks by LANDING_DEPTH: one more of its points has landed.

    Args:
        pairs: `pairs[:touching]` touched at the start and are held; `pairs[touching:end]` touch or overlap
            at the end.
        h: length of the substep [s].
    Returns:
        (fraction, drifted): 1 where there is no new contact; whether a held contact may overlap
        there. Bodies are left posed at that fraction.
    """
    first, drifted = 1.0, False
    for k in range(touching, end):
        pair = pairs[k]
        if pair["distance"] >= -OVERLAP_TOLERANCE:
            continue
        target, slack = IMPACT_TARGET, IMPACT_SLACK
        if _touched(pairs, touching, pair):
            # only a polyhedron may land with one more point; what keeps sinking has used up its events
            patient = state["counters"][COUNT_EVENTS] < LANDING_CAP
            if not (patient and is_polyhedral(pieces[pair["piece_a"]], pieces[pair["piece_b"]])):
                drifted = True
                continue
            target, slack = (
                _gap(bodies, pieces, vertices, pair, state, h, 0.0, LANDING_DEPTH),
                LANDING_DEPTH / 2,
            )
            drifted = drifted or target < -OVERLAP_TOLERANCE
        # a pair that is clear at the earliest impact so far comes later
        if first < 1.0 and _gap(bodies, pieces, vertices, pair, state, h, first, target) >= 0:
            continue
        first = _closing(bodies, pieces, vertices, pair, state, h, first, target, slack)
    pose_at(bodies, h, first, state["flight"])
    return first, drifted


@kernel
def _touched(pairs, touching, pair):
    for k in range(touching):
        if pairs[k]["piece_a"] == pair["piece_a"] and pairs[k]["piece_b"] == pair["piece_b"]:
            return True
    return False


@kernel
def _gap(bodies, pieces, vertices, pair, state, h, s, target):
    """Distance of a pair at fraction s, above `target` [m]."""
    pose_at(bodies, h, s, state["flight"])
    place_pieces(bodies, pieces, vertices, SIMULATED)
    convex_depth(pieces[pair["piece_a"]], pieces[pair["piece_b"]], vertices, state, pair)
    return pair["distance"] - target


@kernel
def _closing(bodies, pieces, vertices, pair, state, h, late, target, slack):
    """Root of the gap between 0 and `late`, to `slack`, by the Illinois rule: a secant that cannot leave its
    bracket."""
    early, gap_early = 0.0, _gap(bodies, pieces, vertices, pair, state, h, 0.0, target)
    gap_late = _gap(bodies, pieces, vertices, pair, state, h, late, target)
    if gap_early <= 0:
        return 0.0
    side = 0
    for _ in range(IMPACT_STEPS):
        s = (early * gap_late - late * gap_early) / (gap_late - gap_early)
        gap = _gap(bodies, pieces, vertices, pair, state, h, s, target)
        if abs(gap) <= slack:
            return s
        if gap > 0:
            early, gap_early = s, gap
            if side == 1:
                gap_late /= 2
            side = 1
        else:
            late, gap_late = s, gap
            if side == -1:
                gap_early /= 2
            side = -1
    return early
