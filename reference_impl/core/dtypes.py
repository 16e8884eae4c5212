"""Building blocks of the structured array types."""

import numpy as np

VECTOR = ("f8", (3,))
QUATERNION = ("f8", (4,))
MATRIX = ("f8", (3, 3))


def record(**fields):
    """Structured dtype with the given fields, each a dtype or (dtype, shape)."""
    return np.dtype(
        [(name, *(kind if isinstance(kind, tuple) else (kind,))) for name, kind in fields.items()]
    )
