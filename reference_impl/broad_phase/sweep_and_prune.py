"""Sweep and prune: pairs of pieces whose boxes overlap, strip by strip along x (see `strips.py`)."""

from math import ldexp

from touchstone.reference_impl.broad_phase.spatial_hash import arrange, bound_column, cell_index, find_column
from touchstone.reference_impl.core.conventions import DRIVEN, SIMULATED
from touchstone.reference_impl.core.kernel import kernel


@kernel
def find_pairs(pieces, kind, first, pairs, state):
    """Write the pairs of overlapping boxes in which a body of `kind` takes part from `pairs[first]` on.

    Pieces of one body, of one driver and of two fixed bodies never pair. The order of the pairs follows from
    the boxes and the order they had in the last frame: strips in the order in which they were met, in each
    the boxes by low x; first with their like, then with fixed, simulated and driven ones.

    Returns:
        (end, lost): index after the last pair, and how many found no room.
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
    """Sweep a strip past all others of a group that it may meet; of its `own` group past wider ones and the
    half of its like that comes later by (z, y)."""
    low, high = strip["low"], strip["high"]
    for level in range(strip["level"] if own else 0, group["levels"]):
        if group["tally"][level] == 0:
            continue
        # a box reaches up to its square's width beyond its low corner
        width = ldexp(group["width"], level)
        y, last_y = cell_index(low[0] - width, width), cell_index(high[0], width)
        z, last_z = cell_index(low[1] - width, width), cell_index(high[1], width)
        half = own and level == strip["level"]
        # look through all strips where they are fewer than the squares
        if float(last_y - y + 1) * float(last_z - z + 1) > group["columns"]:
            end = _sweep_level(pieces, strip, group, level, half, pairs, end)
            continue
        for k in range(strip["z"] if half else z, last_z + 1):
            for j in range(strip["y"] + 1 if half and k == strip["z"] else y, last_y + 1):
                s = find_column(pieces, group, level, j, k)
                if s >= 0:
                    end = _sweep(pieces, strip, pieces[s]["column"], pairs, end)
    return end


@kernel
def _sweep_level(pieces, strip, group, level, half, pairs, end):
    """Sweep a strip past every strip of a level whose bounds it meets."""
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
    """Pairs between two strips, or within one: whichever box opens first is held against those of the other
    strip that open before it closes. Pairs beyond the room in `pairs` are counted alone."""
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
            # all of it at once: a branch for each would be guessed wrong
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
