"""Names that a user typed: the valid one, or an error that lists the valid ones."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def checked(kind: str, name: str, valid: Iterable[str]) -> str:
    """The name, if valid; raises ValueError with the nearest valid names and all of them."""
    names = list(valid)
    if name in names:
        return name
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    raise ValueError(f"unknown {kind} {name!r}{hint} (valid: {', '.join(names)})")
