"""Reports: parts of a table, notes and lines each, and how terminals and Markdown show them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.measure import Measurement
from rich.table import Column, Table
from rich.text import Text

NARROW = 112
"""Least width of plain output (files, pipes) in characters, which a table needs."""
WIDEST = 10_000
"""Width that no table has [characters]."""


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a report.

    Attributes:
        heads: heads of columns; line breaks count on terminals.
        rows: cells of each row; a row of one cell is the head of those below it, an empty one a gap.
        notes: what explains the table.
        lines: sentences of their own; those that begin with "fail" or "error" are red.
        words: number of columns of words at the left; the others hold numbers.
        last: number of columns of words at the right.
        tight: whether there is no more than a space between columns.
        wrap: whether terminals break the lines; others stay whole, so that commands can be copied.
        picture: file of its picture, which Markdown shows.
        empty: what Markdown says in place of a table without rows; terminals leave such a part out.
    """

    title: str = ""
    heads: Sequence[str] = ()
    rows: Sequence[Sequence[str | Text]] = ()
    notes: Sequence[str] = ()
    lines: Sequence[str | Text] = ()
    words: int = 1
    last: int = 0
    tight: bool = False
    wrap: bool = False
    picture: str = ""
    empty: str = ""

    def is_number(self, column: int) -> bool:
        """Whether a column holds numbers."""
        return self.words <= column < len(self.heads) - self.last


def print_parts(parts: Iterable[Part], out: Console) -> None:
    """Print tables, notes and lines."""
    apart = False
    for part in parts:
        if part.empty and not part.rows:
            continue
        if part.heads:
            out.print(*[""] * apart, _table(part))
        for note in part.notes:
            out.print(note, style="dim", highlight=False)
        for line in part.lines:
            style = "red" if str(line).startswith(("fail", "error")) else ""
            out.print(line, style=style, highlight=False, soft_wrap=not part.wrap)
        apart = bool(part.notes or part.lines) or (apart and not part.heads)


def _table(part: Part) -> Table:
    gap = (0, 0 if part.tight else 1, 0, 0)
    table = Table(title=part.title or None, title_justify="left", box=SIMPLE, padding=gap, pad_edge=False)
    for k, head in enumerate(part.heads):
        justify = "right" if part.is_number(k) else "left"
        wraps = k >= max(part.words, len(part.heads) - part.last)
        table.add_column(Text(head), justify=justify, no_wrap=not wraps)  # type: ignore[arg-type]
    for row in part.rows:
        if len(row) <= 1:
            table.add_section()
        if row:
            style = "bold" if len(row) == 1 else ""
            table.add_row(*(Text(cell, style=style) if isinstance(cell, str) else cell for cell in row))
    return table


def markdown(part: Part, level: int = 2) -> list[str]:
    """Lines of a part in Markdown: title, table, notes, picture, lines."""
    found = ["", f"{'#' * level} {part.title[0].upper()}{part.title[1:]}", ""] if part.title else [""]
    if part.rows or (part.heads and not part.empty):
        heads = [head.replace("-\n", "").replace("\n", " ") for head in part.heads]
        rule = ["---:" if part.is_number(k) else "---" for k in range(len(heads))]
        for row in (heads, rule, *filter(None, part.rows)):
            cells = [str(cell).replace("|", "\\|").replace("\n", " ") for cell in row]
            found.append(f"| {' | '.join([*cells, *[''] * (len(heads) - len(row))])} |")
    elif part.empty:
        found.append(part.empty)
    found += ["", *part.notes] if part.notes else []
    found += ["", f"![{part.title}]({part.picture})"] if part.picture else []
    return [*found, *([""] if part.lines else []), *(f"- {line}" for line in part.lines)]


class FittingConsole(Console):
    """A console that prints tables which are too wide in parts (`fitted`), and texts as they are: names are
    the user's."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print objects; tables fit the width."""
        parts = [part for one in objects for part in (fitted(one, self) if isinstance(one, Table) else [one])]
        super().print(*parts, **options)


def console(**options: bool) -> Console:
    """A console as wide as the terminal; where there is none, as COLUMNS says, or NARROW."""
    probe = FittingConsole(**options)
    if probe.is_terminal or os.environ.get("COLUMNS", "").isdigit():
        return probe
    return FittingConsole(width=NARROW, **options)


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
