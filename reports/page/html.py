"""Elements of a page, and what it shows. All texts are escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

import pandas as pd

from touchstone.reports.results import Row, rows_of
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import Column, first_columns


@dataclass(frozen=True, slots=True)
class Linked:
    """A text with what a hover says, and the scene whose figures it links to."""

    text: str
    title: str = ""
    scene: str = ""

    @property
    def html(self) -> str:
        """The element."""
        hover = f' title="{escape(self.title)}"' if self.title else ""
        if self.scene:
            return f'<a href="#{scene_anchor(self.scene)}"{hover}>{escape(self.text)}</a>'
        return f"<span{hover}>{escape(self.text)}</span>" if hover else escape(self.text)


Inline = str | Linked | Sequence[str | Linked]
"""A cell of a table: a text, or parts of one."""


def scene_anchor(scene: str) -> str:
    """Name of the element with the figures of a scene, escaped."""
    return f"scene-{escape(scene)}"


def fold(title: str, body: str, name: str = "", opened: bool = False, level: int = 2) -> str:
    """A part that opens and closes."""
    link = f' id="{escape(name)}"' if name else ""
    state = " open" if opened else ""
    head = f"<h{level}>{escape(title)}</h{level}>"
    return f"<details{link}{state}><summary>{head}</summary>{body}</details>"


def figure(title: str, svg: str) -> str:
    """A chart with its caption."""
    return f'<figure class="chart"><figcaption>{escape(title)}</figcaption>{svg}</figure>'


def plain_table(heads: Sequence[str], rows: Iterable[Sequence[Inline]], left: int = 1) -> str:
    """A table; the first `left` columns hold words."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    lines = []
    for row in rows:
        cells = [f"<td{'' if k < left else ' class=number'}>{_html(cell)}</td>" for k, cell in enumerate(row)]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    body = f"<thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody>"
    return f'<div class="wide"><table>{body}</table></div>'


def part_body(part: Part) -> str:
    """A part of a report without its title."""
    rows = [[str(cell) for cell in row] for row in part.rows]
    table = plain_table(part.heads, rows, part.words) if rows else ""
    return table + "".join(f"<p>{escape(str(line))}</p>" for line in (*part.notes, *part.lines))


def _html(cell: Inline) -> str:
    parts = [cell] if isinstance(cell, (str, Linked)) else cell
    return "".join(part.html if isinstance(part, Linked) else escape(part) for part in parts)


def long_table(heads: Sequence[str], rows: Sequence[Sequence[Inline]], shown: int, left: int = 1) -> str:
    """A table whose rows beyond the first `shown` are folded away."""
    first = plain_table(heads, rows[:shown], left)
    rest = rows[shown:]
    return first + (fold(f"{len(rest)} more", plain_table(heads, rest, left), level=3) if rest else "")


@dataclass(frozen=True, slots=True)
class Change:
    """A difference from earlier nights.

    Attributes:
        kind: such as "regression".
        engine: engine and profile.
        metric, subject: what changed.
        moved: value before and after, with its unit.
        text: one sentence.
    """

    kind: str
    scene: str
    engine: str
    metric: str
    subject: str
    moved: str
    text: str


@dataclass(frozen=True, slots=True)
class Content:
    """Content of a page.

    Attributes:
        title: heading.
        level: BAD, WARN or GOOD of `views/matrix.py`.
        verdict: one sentence.
        frame: the long table of results.
        command: the command of the run.
        changes: what changed since the last accepted run, the gravest first.
        identity: (name, value) of the machine, the program and the libraries.
        playback: scene -> packed recordings (`pack_text`).
        forces: scene -> chart of its contact forces, as SVG.
        settings: "scene/engine/profile" -> manifest of the engine.
        summaries: scene -> its sentence.
        history: heading -> chart of nights, as SVG.
        times: times of nights that are too few for a chart.
        published: published values, and what was measured.
        measured: measured motions, and how far engines are from them.
        picture: of that, a PNG in base64; "" without.
        studies: long table of studies beside the scenes; None without.
    """

    title: str
    level: str
    verdict: str
    frame: pd.DataFrame
    command: str = ""
    changes: Sequence[Change] = ()
    identity: Sequence[tuple[str, str]] = ()
    playback: Mapping[str, str] = field(default_factory=dict)
    forces: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    summaries: Mapping[str, str] = field(default_factory=dict)
    history: Mapping[str, str] = field(default_factory=dict)
    times: Part = field(default_factory=Part)
    published: Part = field(default_factory=Part)
    measured: Part = field(default_factory=Part)
    picture: str = ""
    studies: pd.DataFrame | None = None

    def columns(self) -> list[Column]:
        """All columns."""
        found = dict.fromkeys(zip(self.frame.engine, self.frame.profile))
        return [column for column in found if column[0] != "all"]

    def first_columns(self) -> list[Column]:
        """The first column of each engine: its own profile."""
        return first_columns(self.columns())


def rows_by_scene(frame: pd.DataFrame) -> dict[str, list[Row]]:
    """Rows of each scene, in the order of the run."""
    found: dict[str, list[Row]] = {}
    for row in rows_of(frame):
        found.setdefault(row.scenario, []).append(row)
    return found
