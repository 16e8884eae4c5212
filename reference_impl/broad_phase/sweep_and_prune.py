"""Sweep and prune along x: pairs of pieces with overlapping boxes, column by column (`spatial_hash.py`)."""

from math import ldexp

from touchstone.reference_impl.broad_phase.spatial_hash import (
    arrange,
    bound_column,
    bucket_of,
    cell_index,
    find_column,
)
from touchstone.reference_impl.core.conventions import DRIVEN, SIMULATED
from touchstone.reference_impl.core.kernel import kernel


@kernel
def find_pairs(pieces, kind, first, pairs, state):
    """Find the pairs of overlapping boxes that contain a body of `kind`, and write them from `pairs[first]`.

    Pieces with the same filter group and pieces of two fixed bodies never pair. The boxes and their order in
    the last frame determine the order of the pairs: columns in order of creation, the boxes of a column by
    low x; pairs within the column first, then those with fixed, simulated and driven pieces.

    Returns:
        (end, lost): index after the last pair, and the number of pairs dropped because `pairs` was full.
    """
    groups = state["groups"]
    arrange(pieces, groups[SIMULATED])
    arrange(pieces, groups[DRIVEN])
    group, end = groups[kind], first
    for s in range(group["first"], group["first"] + group["columns"]):
        strip = pieces[s]["column"]
        if group["filter_groups"] > 1:
            end = _sweep(pieces, strip, strip, pairs, end)
        for k in range(len(groups)):
            other = groups[k]
            if other["single_column"] == 0:
                if group["single_column"] == 1:
                    bound_column(pieces, strip)
                end = _sweep_neighbours(pieces, strip, other, k == kind, pairs, end)
            elif k != kind and other["columns"] > 0:
                end = _sweep(pieces, strip, pieces[other["first"]]["column"], pairs, end)
    lost = max(0, end - len(pairs))
    return end - lost, lost


@kernel
def _sweep_neighbours(pieces, strip, group, own, pairs, end):
    """Sweep a column against all columns of a group that it may overlap.

    In its `own` group these are the columns of higher levels, and those of its level that follow by (z, y).
    """
    low, high = strip["low"], strip["high"]
    for level in range(strip["level"] if own else 0, group["levels"]):
        if group["tally"][level] == 0:
            continue
        # a box extends at most one cell width beyond its low corner
        width = ldexp(group["width"], level)
        y, last_y = cell_index(low[0] - width, width), cell_index(high[0], width)
        z, last_z = cell_index(low[1] - width, width), cell_index(high[1], width)
        half = own and level == strip["level"]
        # iterate over all columns if there are fewer columns than cells
        if float(last_y - y + 1) * float(last_z - z + 1) > group["columns"]:
            end = _sweep_level(pieces, strip, group, level, half, pairs, end)
            continue
        for k in range(strip["z"] if half else z, last_z + 1):
            for j in range(strip["y"] + 1 if half and k == strip["z"] else y, last_y + 1):
                s = find_column(pieces, bucket_of(group, level, j, k), level, j, k)
                if s >= 0:
                    end = _sweep(pieces, strip, pieces[s]["column"], pairs, end)
    return end


@kernel
def _sweep_level(pieces, strip, group, level, half, pairs, end):
    """Sweep a column against every column of a level whose bounds overlap its own."""
    for s in range(group["first"], group["first"] + group["columns"]):
        other = pieces[s]["column"]
        if other["level"] != level or _apart(strip, other):
            continue
        if half and (other["z"], other["y"]) <= (strip["z"], strip["y"]):
            continue
        end = _sweep(pieces, strip, other, pairs, end)
    return end


@kernel
def _apart(one, two):
    for i in range(2):
        if one["low"][i] > two["high"][i] or two["low"][i] > one["high"][i]:
            return True
    return False


@kernel
def _sweep(pieces, one, two, pairs, end):
    """Find the overlapping pairs between two columns, or within one.

    Sweeps both sorted lists and tests each interval against those that start before it ends. Pairs that
    exceed the capacity of `pairs` are counted but not stored.
    """
    i, last_i, j, last_j = one["first"], one["end"], two["first"], two["end"]
    within = i == j
    if within:
        j += 1
    while i < last_i and j < last_j:
        if pieces[i]["slot"]["low"][0] <= pieces[j]["slot"]["low"][0]:
            opens, k, stop = i, j, last_j
            i += 1
            if within:
                j += 1
        else:
            opens, k, stop = j, i, last_i
            j += 1
        slot = pieces[opens]["slot"]
        low, high, owner = slot["low"], slot["high"], slot["filter_group"]
        while k < stop and pieces[k]["slot"]["low"][0] <= high[0]:
            other = pieces[k]["slot"]
            # one combined condition: separate branches would be mispredicted
            if (
                (other["low"][1] <= high[1])
                & (other["high"][1] >= low[1])
                & (other["low"][2] <= high[2])
                & (other["high"][2] >= low[2])
                & (other["filter_group"] != owner)
            ):
                end = _add(pieces, slot["piece"], other["piece"], pairs, end)
            k += 1
    return end


@kernel
def _add(pieces, p, q, pairs, end):
    if end < len(pairs):
        pair, a, b = pairs[end], min(p, q), max(p, q)
        pair["piece_a"], pair["piece_b"] = a, b
        pair["body_a"], pair["body_b"] = pieces[a]["body"], pieces[b]["body"]
    return end + 1
