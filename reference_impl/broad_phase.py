"""Sweep and prune along x over the pieces' bounding boxes; the order is kept from frame to frame."""

from reference_impl.kernel import kernel


@kernel
def find_pairs(bodies, pieces, kind, first, pairs):
    """Write the pairs of overlapping boxes in which a body of `kind` takes part from `pairs[first]` on.

    Pieces of one body, of one driven body and of two fixed bodies never pair.

    Returns:
        (end, lost): index after the last pair, and how many found no room.
    """
    _sort(pieces)
    end, lost = first, 0
    for i in range(len(pieces)):
        one = pieces[pieces[i]["order"]]
        limit = one["high"][0]
        for j in range(i + 1, len(pieces)):
            two = pieces[pieces[j]["order"]]
            if two["low"][0] > limit:
                break
            if one["body"] == two["body"] or not _meet(one, two):
                continue
            if not _wanted(bodies[one["body"]], bodies[two["body"]], kind):
                continue
            if end == len(pairs):
                lost += 1
                continue
            p, q = pieces[i]["order"], pieces[j]["order"]
            pair = pairs[end]
            pair["piece_a"], pair["piece_b"] = min(p, q), max(p, q)
            pair["body_a"], pair["body_b"] = pieces[min(p, q)]["body"], pieces[max(p, q)]["body"]
            end += 1
    return end, lost


@kernel
def _sort(pieces):
    """Insertion sort of the order by the boxes' low x: nearly linear while the motion is coherent."""
    for i in range(1, len(pieces)):
        moving = pieces[i]["order"]
        low = pieces[moving]["low"][0]
        j = i
        while j > 0 and pieces[pieces[j - 1]["order"]]["low"][0] > low:
            pieces[j]["order"] = pieces[j - 1]["order"]
            j -= 1
        pieces[j]["order"] = moving


@kernel
def _meet(one, two):
    for i in range(1, 3):
        if one["low"][i] > two["high"][i] or two["low"][i] > one["high"][i]:
            return False
    return True


@kernel
def _wanted(one, two, kind):
    if one["kind"] != kind and two["kind"] != kind:
        return False
    if one["driver"] >= 0:
        return one["driver"] != two["driver"]
    return True
