"""Names that a user typed: the valid one, or an error that lists the valid ones."""

import difflib
from collections.abc import Iterable

MOST_LISTED = 24
"""Most names of LISTS that an error lists [1]; of more it names the command that does."""
LISTS = {"scenario": "scenarios", "scene": "scenarios", "metric": "metrics"}
"""Kinds of many names, and what `touchstone list` calls them."""


def checked(kind: str, name: str, valid: Iterable[str]) -> str:
    """The name, if valid; raises ValueError with the text of `unknown`."""
    names = list(valid)
    if name not in names:
        raise ValueError(unknown(kind, name, names))
    return name


def unknown(kind: str, name: str, valid: Iterable[str]) -> str:
    """What is said of a name that is not valid: the nearest valid ones, and all of them or the command that
    lists them."""
    names = list(valid)
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    listed = ", ".join(names)
    if kind in LISTS and len(names) > MOST_LISTED:
        listed = f"{len(names)} names: touchstone list {LISTS[kind]}"
    return f"unknown {kind} {name!r}{hint} (valid: {listed})"
