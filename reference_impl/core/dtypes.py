"""What the structured arrays are made of."""

import numpy as np

VECTOR = ("f8", (3,))
QUATERNION = ("f8", (4,))
MATRIX = ("f8", (3, 3))


def record(**fields):
    """Structured type with these fields, each a kind or (kind, shape)."""
    return np.dtype(
        [(name, *(kind if isinstance(kind, tuple) else (kind,))) for name, kind in fields.items()]
    )
