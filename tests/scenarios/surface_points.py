"""Points on the surfaces of shapes."""

import numpy as np

from touchstone.scenarios.scenario import Box, Capsule, Cylinder, Hull, Shape, Sphere


def surface_points(shape: Shape) -> np.ndarray:
    """Points of the shape's surface (n, 3), dense where it is smooth."""
    match shape:
        case Box(half):
            return np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
        case Hull(vertices):
            return np.array(vertices)
    u = np.random.default_rng(0).normal(size=(200_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    if isinstance(shape, Capsule):
        return u * shape.radius + np.sign(u) * (0.0, 0.0, shape.half_length)
    if isinstance(shape, Cylinder):
        rim = u[:, :2] / np.linalg.norm(u[:, :2], axis=1)[:, None]
        return np.column_stack([shape.radius * rim, shape.half_length * np.sign(u[:, 2])])
    return u * (shape.radius if isinstance(shape, Sphere) else shape.half_axes)
