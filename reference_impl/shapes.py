"""Convex pieces: pose in the world, bounding box, and support function of the core.

A piece is a core plus a `radius` round it: a sphere is a point with a radius. The other kinds have none.
"""

from math import sqrt

from reference_impl.conventions import BOX, ELLIPSOID, HULL
from reference_impl.kernel import kernel
from reference_impl.rotation import multiply, rotate


@kernel
def place_piece(piece, body, vertices, margin):
    """World pose and bounding box of a piece from its body's pose; the box is widened by `margin` [m]."""
    multiply(body["rotation"], piece["rotation"], piece["world_rotation"])
    rotate(body["rotation"], piece["position"], piece["world_position"])
    position, rotation = piece["world_position"], piece["world_rotation"]
    low, high, size = piece["low"], piece["high"], piece["size"]
    for i in range(3):
        position[i] += body["position"][i]
    if piece["kind"] == HULL:
        first = piece["first_vertex"]
        for i in range(3):
            x, y, z = rotation[i, 0], rotation[i, 1], rotation[i, 2]
            least = greatest = 0.0
            for k in range(first, first + piece["vertex_count"]):
                along = x * vertices[k, 0] + y * vertices[k, 1] + z * vertices[k, 2]
                if k == first:
                    least = greatest = along
                least, greatest = min(least, along), max(greatest, along)
            low[i], high[i] = position[i] + least - margin, position[i] + greatest + margin
    else:
        for i in range(3):
            x, y, z = rotation[i, 0] * size[0], rotation[i, 1] * size[1], rotation[i, 2] * size[2]
            reach = abs(x) + abs(y) + abs(z) if piece["kind"] == BOX else sqrt(x * x + y * y + z * z)
            reach += piece["radius"] + margin
            low[i], high[i] = position[i] - reach, position[i] + reach


@kernel
def support(piece, vertices, x, y, z, out_point):
    """Point of the core farthest along (x, y, z), relative to the piece's origin, world axes [m].

    Returns:
        Which corner it is: the hull's vertex, the box' octant (bits: x, y, z not negative), 0 for a point,
        -1 on a smooth core.
    """
    rotation = piece["world_rotation"]
    kind, size = piece["kind"], piece["size"]
    # direction in the piece's frame
    u = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
    v = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
    w = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
    if kind == HULL:
        first = piece["first_vertex"]
        best = first
        most = u * vertices[first, 0] + v * vertices[first, 1] + w * vertices[first, 2]
        for k in range(first + 1, first + piece["vertex_count"]):
            along = u * vertices[k, 0] + v * vertices[k, 1] + w * vertices[k, 2]
            if along > most:
                most, best = along, k
        u, v, w = vertices[best, 0], vertices[best, 1], vertices[best, 2]
        corner = best - first
    elif kind == BOX:
        corner = (1 if u >= 0 else 0) + (2 if v >= 0 else 0) + (4 if w >= 0 else 0)
        u = size[0] if u >= 0 else -size[0]
        v = size[1] if v >= 0 else -size[1]
        w = size[2] if w >= 0 else -size[2]
    elif kind == ELLIPSOID:
        u, v, w = u * size[0], v * size[1], w * size[2]
        length = sqrt(u * u + v * v + w * w)
        scale = 1 / length if length > 0 else 0.0
        corner = -1
        u, v, w = u * size[0] * scale, v * size[1] * scale, w * size[2] * scale
    else:
        u = v = w = 0.0
        corner = 0
    for i in range(3):
        out_point[i] = rotation[i, 0] * u + rotation[i, 1] * v + rotation[i, 2] * w
    return corner
