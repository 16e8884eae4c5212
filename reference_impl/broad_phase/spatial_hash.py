"""Hierarchical spatial hash: columns of pieces parallel to x, each sorted along x for sweep and prune.

Pieces of fixed, simulated and driven bodies form three groups. A small group is one column. In a large group,
a column holds the pieces whose boxes have their low corner in the same square cell of the y-z plane. A cell
is at least as wide as the boxes in it, so overlapping boxes lie in neighbouring cells. Boxes too wide for the
smallest cells (level 0) use cells twice as wide, and so on. A hash maps cells to columns (Teschner et al.
2003, Optimized spatial hashing). The order along x persists from frame to frame.

The cost is linear in the number of pieces. A single list along x would test each piece of a cloud of n pieces
against n^(2/3) others.
"""

from math import floor, frexp, inf, ldexp

from touchstone.reference_impl.core.conventions import COLUMN_LEVELS, DRIVEN, FIXED, SIMULATED
from touchstone.reference_impl.core.kernel import kernel

SPATIAL_HASH_PIECE_COUNT = 64
"""Largest group of pieces that forms a single column: sweeping a larger one along x costs more."""
COLUMN_SHARE = 0.9
"""Fraction of the pieces that fit the smallest cells [1]: smaller cells would hold less than one piece."""
COLUMN_SLACK = 1.05
"""Width of the smallest cells over the widest box that must fit [1]: allows pieces to rotate a little."""
COLUMN_WIDTH = 2.0**-16
"""Least width of a cell [m]: far below any piece."""
COLUMN_FAR = 2.0**30
"""Largest cell index, on either side of the origin; cells beyond it share one index."""

HASH_Y, HASH_Z, HASH_LEVEL = 73856093, 19349663, 83492791
"""Primes of the hash function (Teschner et al. 2003)."""


@kernel
def list_pieces(bodies, pieces, state):
    """List the pieces by kind of body, and sort the fixed ones once; these must already be placed."""
    groups = state["groups"]
    k = 0
    for kind in range(len(groups)):
        first = k
        for p in range(len(pieces)):
            body = bodies[pieces[p]["body"]]
            if body["kind"] == kind:
                # pieces of one body never pair; those of one driver pair only with self-collision enabled
                alone = body["driver"] < 0 or kind == SIMULATED
                alone = alone or (state["self_collision"] == 1 and body["hinge"] >= 0)
                pieces[p]["filter_group"] = pieces[p]["body"] if alone else len(bodies) + body["driver"]
                pieces[k]["order"] = p
                pieces[k]["slot"]["piece"] = p
                k += 1
        _one_column(pieces, groups[kind], first, k)
    # with few moving pieces, sweeping a single list of fixed pieces is fastest
    if groups[SIMULATED]["single_column"] == 1 and groups[DRIVEN]["single_column"] == 1:
        groups[FIXED]["single_column"] = 1
    arrange(pieces, groups[FIXED])


@kernel
def _one_column(pieces, group, first, end):
    """Put all pieces of a group into one unbounded column."""
    group["first"], group["end"] = first, end
    group["single_column"] = 1 if end - first <= SPATIAL_HASH_PIECE_COUNT else 0
    group["columns"] = 1 if end > first else 0
    group["filter_groups"] = 0
    for k in range(first, end):
        if (
            k == first
            or pieces[pieces[k]["order"]]["filter_group"] != pieces[pieces[k - 1]["order"]]["filter_group"]
        ):
            group["filter_groups"] += 1
    if end > first:
        strip = pieces[first]["column"]
        strip["first"], strip["end"] = first, end
        for i in range(2):
            strip["low"][i], strip["high"][i] = -inf, inf


@kernel
def arrange(pieces, group):
    """Assign the placed pieces of a group to columns, and sort each column by the boxes' low x."""
    if group["single_column"] == 1:
        _sort(pieces, group["first"], group["end"])
        return
    _choose_width(pieces, group)
    _assign(pieces, group)
    for s in range(group["first"], group["first"] + group["columns"]):
        strip = pieces[s]["column"]
        _sort(pieces, strip["first"], strip["end"])
        bound_column(pieces, strip)


@kernel
def cell_index(x, width):
    """Index of the cell that contains a coordinate, clamped to +-COLUMN_FAR; NaN counts as -COLUMN_FAR."""
    t = x / width
    if not t > -COLUMN_FAR:
        t = -COLUMN_FAR
    if t > COLUMN_FAR:
        t = COLUMN_FAR
    return floor(t)


@kernel
def find_column(pieces, bucket, level, y, z):
    """Index of the column at cell (y, z) of a level, or -1; `bucket` is that of the cell."""
    s = pieces[bucket]["column"]["bucket"]
    while s >= 0:
        strip = pieces[s]["column"]
        if strip["y"] == y and strip["z"] == z and strip["level"] == level:
            break
        s = strip["next"]
    return s


@kernel
def bucket_of(group, level, y, z):
    """Row that holds the first column of the bucket of a cell."""
    hashed = y * HASH_Y + z * HASH_Z + level * HASH_LEVEL
    return group["first"] + hashed % (group["end"] - group["first"])


@kernel
def _choose_width(pieces, group):
    """Choose the width of the smallest cells so that COLUMN_SHARE of the boxes fit; the last width stays
    unless it is too small or more than COLUMN_SLACK^2 too large."""
    tally, widest = group["tally"], group["widest"]
    for k in range(COLUMN_LEVELS):
        tally[k], widest[k] = 0, 0.0
    # histogram of box extents by powers of two
    for k in range(group["first"], group["end"]):
        extent = _extent(pieces[pieces[k]["order"]])
        _, power = frexp(extent)
        power = min(max(power + COLUMN_LEVELS // 2, 0), COLUMN_LEVELS - 1)
        tally[power] += 1
        widest[power] = max(widest[power], extent)
    wanted, seen = COLUMN_WIDTH, 0
    for k in range(COLUMN_LEVELS):
        if seen < COLUMN_SHARE * (group["end"] - group["first"]):
            seen += tally[k]
            wanted = max(wanted, widest[k])
    if not wanted <= group["width"] <= COLUMN_SLACK**2 * wanted:
        group["width"] = COLUMN_SLACK * wanted


@kernel
def _extent(piece):
    """The larger of a box's sides along y and z [m]."""
    low, high = piece["low"], piece["high"]
    return max(high[1] - low[1], high[2] - low[2])


@kernel
def _assign(pieces, group):
    """Assign every piece to a column, and write the pieces to `order` column by column (counting sort)."""
    first, end = group["first"], group["end"]
    group["columns"], group["levels"] = 0, 0
    for k in range(COLUMN_LEVELS):
        group["tally"][k] = 0
    for k in range(first, end):
        pieces[k]["column"]["bucket"] = -1
    # count the pieces of each column, in the order of the last frame
    s = first
    for k in range(first, end):
        s = _column_of(pieces, group, pieces[pieces[k]["slot"]["piece"]], s)
        pieces[s]["column"]["end"] += 1
        pieces[k]["column_of"] = s
    # columns are contiguous
    place = first
    for s in range(first, first + group["columns"]):
        strip = pieces[s]["column"]
        count = strip["end"]
        strip["first"], strip["end"] = place, place
        place += count
    for k in range(first, end):
        strip = pieces[pieces[k]["column_of"]]["column"]
        pieces[strip["end"]]["order"] = pieces[k]["slot"]["piece"]
        strip["end"] += 1


@kernel
def _column_of(pieces, group, piece, s):
    """Index of the column of a piece, created if it does not exist; `s` is the first guess."""
    extent, width = _extent(piece), group["width"]
    level = 0
    if extent > width:
        _, level = frexp(extent / width)
        level = min(max(level, 0), COLUMN_LEVELS - 1)
        width = ldexp(width, level)
    y, z = cell_index(piece["low"][1], width), cell_index(piece["low"][2], width)
    strip = pieces[s]["column"]
    if group["columns"] > 0 and strip["y"] == y and strip["z"] == z and strip["level"] == level:
        return s
    bucket = bucket_of(group, level, y, z)
    s = find_column(pieces, bucket, level, y, z)
    if s < 0:
        s = group["first"] + group["columns"]
        strip, head = pieces[s]["column"], pieces[bucket]["column"]
        strip["y"], strip["z"], strip["level"], strip["end"] = y, z, level, 0
        strip["next"], head["bucket"] = head["bucket"], s
        group["columns"] += 1
        group["levels"] = max(group["levels"], level + 1)
        group["tally"][level] += 1
    return s


@kernel
def _sort(pieces, first, end):
    """Insertion sort of slots by the boxes' low x, nearly linear for coherent motion.

    A slot holds a copy of its piece's box, so that a sweep reads memory in order.
    """
    for k in range(first, end):
        p = pieces[k]["order"]
        piece = pieces[p]
        low, high = piece["low"], piece["high"]
        place = k
        # ties in low x are sorted by piece index, independent of the previous order
        while place > first and (
            pieces[place - 1]["slot"]["low"][0] > low[0]
            or (pieces[place - 1]["slot"]["low"][0] == low[0] and pieces[place - 1]["order"] > p)
        ):
            pieces[place]["slot"] = pieces[place - 1]["slot"]
            pieces[place]["order"] = pieces[place - 1]["order"]
            place -= 1
        pieces[place]["order"] = p
        slot = pieces[place]["slot"]
        slot["piece"], slot["filter_group"] = p, piece["filter_group"]
        for i in range(3):
            slot["low"][i], slot["high"][i] = low[i], high[i]


@kernel
def bound_column(pieces, strip):
    """Compute the bounds of a column's boxes along y and z."""
    low, high = strip["low"], strip["high"]
    for i in range(2):
        least, greatest = inf, -inf
        for k in range(strip["first"], strip["end"]):
            slot = pieces[k]["slot"]
            least, greatest = min(least, slot["low"][i + 1]), max(greatest, slot["high"][i + 1])
        low[i], high[i] = least, greatest
