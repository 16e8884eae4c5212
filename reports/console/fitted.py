"""Tables that are wider than the terminal: words wrap, and columns of numbers continue in further tables."""

from __future__ import annotations

from copy import copy

from rich.console import Console
from rich.measure import Measurement
from rich.table import Column, Table

WIDEST = 10_000
"""Width that no table has [characters]."""


def fitted(table: Table, out: Console) -> list[Table]:
    """The table, or several with some of its columns each, so that no number is cut off.

    Columns that are justified to the right hold numbers; the others hold words, which each table repeats and
    which wrap where they must.
    """
    if _widths(table, out).maximum <= out.width:
        return [table]
    numbers = [column for column in table.columns if column.justify == "right"]
    words = [column for column in table.columns if column.justify != "right"]
    blocks: list[list[Column]] = []
    for column in numbers:
        if blocks and _fits(table, [*words, *blocks[-1], column], out):
            blocks[-1].append(column)
        else:
            blocks.append([column])
    if not blocks:
        return [_part(table, words)]
    parts = [_part(table, [c for c in table.columns if c in words or c in block]) for block in blocks]
    for part in parts[1:]:
        part.title = None
    return parts


def _fits(table: Table, columns: list[Column], out: Console) -> bool:
    """Whether the columns fit when words wrap.

    rich takes the longest word of a cell for its least width, also where nothing may wrap.
    """
    numbers = [column for column in columns if column.justify == "right"]
    words = [column for column in columns if column.justify != "right"]
    least = _widths(_part(table, numbers), out).maximum
    least += _widths(_part(table, words), out).minimum if words else 0
    return least <= out.width


def _widths(table: Table, out: Console) -> Measurement:
    """Least and largest width of a table on a screen of any width."""
    return Measurement.get(out, out.options.update(width=WIDEST), table)


def _part(table: Table, columns: list[Column]) -> Table:
    """A table with some of the columns; words wrap, numbers do not."""
    found = copy(table)
    found.columns = []
    for k, column in enumerate(columns):
        mine = copy(column)
        mine._index = k
        mine.no_wrap = column.justify == "right"
        if not mine.no_wrap:
            mine.overflow = "fold"
        found.columns.append(mine)
    return found
