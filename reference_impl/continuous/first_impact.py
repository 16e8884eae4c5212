"""Earliest impact of a substep: by time of impact, or among pairs that overlap at its end."""

from touchstone.reference_impl.broad_phase.detection import is_marked
from touchstone.reference_impl.continuous.swept_motion import is_fast_pair
from touchstone.reference_impl.continuous.time_of_impact import MovingPair, distance_at, time_of_impact
from touchstone.reference_impl.core.conventions import (
    DETECTION_SWEEP,
    DRIVEN,
    IMPACT_SHARE,
    OVERLAP_TOLERANCE,
    SINKING_DEPTH,
    SINKING_SHARE,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.counters import CAP_CLOSING, COUNT_EVENTS, COUNT_UNCONVERGED
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.geometry.contact_manifold import is_polyhedral

CLOSING_EXTRA = 8
"""Most steps of the search for a time of impact after its slack is reached."""
CLOSING_SHARE = 1e-3
"""Share of the slack at which the search for a time of impact ends [1]: both ways of searching then find
nearly the same time."""
IMPACT_STEPS = 90
"""Bracketing steps for the time of an impact; about 6 are usual."""
LANDING_DEPTH, DENSE_LANDING = 1e-7, 4e-7
"""Sinking of a touching pair at which another of its points has landed [m]: a tenth of OVERLAP_TOLERANCE; and
in dense substeps: there, leaning bodies sink by 3e-7 m without landing."""
LANDING_EVENTS = 128
"""Events of a frame after which touching pairs of polyhedra may sink by SINKING_DEPTH."""
LANDING_MIN = 1e-9
"""Fraction of a substep within which a landing is ignored: the next substep would find the same one [1]."""
AGREEING_SHARE = 0.5
"""Share of a substep to which a contact shortens it that agrees at its end alone, and sinks there [1]."""
SINKING_SLACK = 2.5e-7
"""Accepted deviation from OVERLAP_TOLERANCE in the time-of-impact search for a sinking pair [m]."""


@inlined_kernel
def earliest_impact(world, touching, end, until, fast, sought):
    """Fraction of the substep at which the first new contact closes to `impact_gap`, or the first touching
    pair sinks because another of its points has landed.

    Args:
        pairs: marked pairs (`mark_pairs`) are resting contacts: they touch at the start, or nearly. The
            search covers `pairs[touching:end]`: pairs that touch or overlap at the end or, with
            DETECTION_SWEEP or `fast`, all whose swept boxes overlap.
        until: the search ends at this fraction.
        fast: compute the time of impact of pairs that move farther than the sum of their widths; test the
            others at the end, and at the event that is found.
        sought: pieces of the pair that met along ways less exact than these, or -1: it may not overlap.
    Returns:
        (fraction, drifted, met): `until` if there is no event; whether a resting contact may overlap there;
        and the row of the pair that meets, or -1. Leaves bodies at arbitrary poses.
    """
    bodies, pieces, pairs, state = world.bodies, world.pieces, world.pairs, world.state
    first, drifted, met, state["halves"] = until, False, -1, 0
    sweeps = state["detection"] == DETECTION_SWEEP
    gap, slack = state["impact_gap"], IMPACT_SHARE * state["impact_gap"]
    for k in range(touching, end):
        pair = pairs[k]
        a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
        one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
        moving = MovingPair(a, b, one, two, world.vertices, pair, state)
        marked = is_marked(bodies, pieces, pairs, pair)
        if fast:
            sweeps = is_fast_pair(bodies, pieces, pair, 1.0)
        # what a driver carries, and curved contacts, agree at the end of a substep, not within; what moves
        # farther than its width may be on the other side there
        agrees = _agrees_at_end(a, world.drivers) or _agrees_at_end(b, world.drivers)
        swept = sweeps and not (marked and agrees and not is_fast_pair(bodies, pieces, pair, 1.0))
        if (fast or sweeps) and not swept:
            distance_at(moving, until)
        meets = pair["piece_a"] == sought[0] and pair["piece_b"] == sought[1]
        if not swept and pair["distance"] >= (0.0 if meets else -OVERLAP_TOLERANCE):
            continue
        before = first
        if marked:
            fraction, sank = _sinking(moving, first, swept)
            swings = _swings(a, world.drivers) or _swings(b, world.drivers)
            if agrees and swings and fraction < first and state["may_halve"] == 1:
                # it may sink within a substep at whose end it agrees: when it does says nothing
                state["halves"], fraction = 1, max(fraction, AGREEING_SHARE * first)
            first, drifted = min(first, fraction), drifted or sank
        elif swept:
            first = _swept(moving, first, gap, CLOSING_SHARE * slack)
        else:
            first = _closing(moving, first, gap, slack)
        met = k if first < before and state["halves"] == 0 else met
    # a pair that grazes within the substep does not touch at its end, but may at the event of another pair
    again = fast and first < until
    while again:
        again = False
        for k in range(touching, end):
            pair = pairs[k]
            if is_fast_pair(bodies, pieces, pair, 1.0) or is_marked(bodies, pieces, pairs, pair):
                continue
            a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
            one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
            moving = MovingPair(a, b, one, two, world.vertices, pair, state)
            if distance_at(moving, first) < -OVERLAP_TOLERANCE:
                before, first = first, _closing(moving, first, gap, slack)
                if first < before:
                    met, again = k, True
    return first, drifted, met


@kernel
def _agrees_at_end(body, drivers):
    """Whether contacts on a body agree at the end of a substep alone: by the law of positions."""
    if body["kind"] == DRIVEN and body["moves"] == 1 and drivers[body["driver"]]["leads"] == 1:
        return True
    return body["led"] == 1


@kernel
def _swings(body, drivers):
    """Whether a body is a driver on a coupling of its own: hinges of chains are damped critically."""
    if body["kind"] != DRIVEN:
        return False
    return drivers[body["driver"]]["prescribed"] == 0 and drivers[body["driver"]]["chain_count"] == 0


@kernel
def _sinking(moving, first, sweeps):
    """Fraction, at most `first`, at which a resting contact has sunk so far that it must be detected again.

    Returns:
        (fraction, drifted): `drifted` is whether the pair may overlap there.
    """
    state = moving.state
    start = distance_at(moving, 0.0)
    polyhedral = is_polyhedral(moving.piece_a, moving.piece_b)
    late, depth = first, DENSE_LANDING if state["dense_substep"] == 1 else LANDING_DEPTH
    if sweeps:
        target = min(start, 0.0) - OVERLAP_TOLERANCE
        late = _swept(moving, first, target, SINKING_SLACK)
        if late == first:
            distance = distance_at(moving, first)
            # a pair that sinks later has landed before, whether `first` is from a pair before or after it
            landed = first < 1 and distance < start - depth
            if not (landed and _swept(moving, 1.0, target, SINKING_SLACK) < 1):
                return first, start < 0 and distance < -OVERLAP_TOLERANCE
    # separation corrects the sinking of round pieces in dense substeps, and of all after LANDING_EVENTS
    few = state["counters"][COUNT_EVENTS] < LANDING_EVENTS
    if few and (state["dense_substep"] == 0 or polyhedral):
        if not polyhedral:
            if not sweeps:
                target = min(start, 0.0) - OVERLAP_TOLERANCE
                late = _closing(moving, first, target, SINKING_SLACK)
            return late, True
        if start > TOUCH_DISTANCE:
            gap = state["impact_gap"]
            return _closing(moving, late, gap, IMPACT_SHARE * gap), False
        target = start - depth
        landed = _closing(moving, late, target, depth / 2)
        # detection immediately after the start would find the same contact
        if landed >= LANDING_MIN:
            return landed, target < -OVERLAP_TOLERANCE
    # limit the depth: from deep overlap, the shortest way out may lead to the far side; and a body that
    # contacts accelerate may rotate more than its dense substep allows for
    depth = min(SINKING_DEPTH, SINKING_SHARE * min(moving.piece_a["width"], moving.piece_b["width"]))
    target = min(start, 0.0) - depth
    if sweeps:
        first = _swept(moving, first, target, depth / 2)
    else:
        first = _closing(moving, first, target, depth / 2)
    return first, True


@kernel
def _swept(moving, until, target, slack):
    """Fraction, at most `until`, at which a pair's distance falls to `target`; an earlier one, counted, if
    the time of impact did not converge."""
    fraction, _, converged = time_of_impact(moving, 0.0, until, target, slack)
    if not converged:
        moving.state["counters"][COUNT_UNCONVERGED] += 1
    return fraction


@kernel
def _closing(moving, late, target, slack):
    """Fraction at which a pair's distance is `target` within `slack`; `late` if the distance is not below
    `target` there. The last fraction found above the target, counted, if IMPACT_STEPS did not suffice.

    By the Illinois method (a bracketed secant). Where a nearly constant distance begins to fall steeply, as
    when the other end of a tilting box lands, such secants shorten the bracket by a ten-thousandth: after two
    on one side, the secant through the last two points below the target leads back to where it fell, or else
    the bracket is halved.

    Within the slack, up to CLOSING_EXTRA steps go on to a thousandth of it, and a last secant step follows
    without a test. Otherwise, rounding that changes the number of steps would change the result by the slack.
    """
    gap_late = distance_at(moving, late) - target
    if gap_late >= 0:
        return late
    early, gap_early = 0.0, distance_at(moving, 0.0) - target
    if gap_early <= 0:
        return 0.0
    side, repeats, extra, last, gap_last = 0, 0, 0, late, gap_late
    below, beyond, gap_below, gap_beyond, steep = late, late, gap_late, gap_late, False
    for _ in range(IMPACT_STEPS):
        s = (early * gap_late - late * gap_early) / (gap_late - gap_early)
        if steep or repeats > 1:
            s, steep = (early + late) / 2, False
            if gap_beyond < gap_below:
                back = below - gap_below * (beyond - below) / (gap_beyond - gap_below)
                if early < back < late:
                    s, steep = back, True
        gap = distance_at(moving, s) - target
        if abs(gap) <= slack:
            extra += 1
            if extra > CLOSING_EXTRA or abs(gap) <= CLOSING_SHARE * slack:
                # rounding dominates gaps that no longer fall
                falls = abs(gap) < abs(gap_last) / 2
                polished = s - gap * (s - last) / (gap - gap_last) if falls else s
                return min(late, max(early, polished))
        last, gap_last = s, gap
        repeats = repeats + 1 if side == (1 if gap > 0 else -1) else 0
        if gap > 0:
            early, gap_early, steep = s, gap, False
            if side == 1:
                gap_late /= 2
            side = 1
        else:
            beyond, below, gap_beyond, gap_below = below, s, gap_below, gap
            late, gap_late = s, gap
            if side == -1:
                gap_early /= 2
            side = -1
    moving.state["counters"][CAP_CLOSING] += 1
    return early
