"""What a page shows, and its templates, which escape all texts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pandas as pd
from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import Column, first_columns


@dataclass(frozen=True, slots=True)
class Linked:
    """A text with what a hover says, and the scene whose figures it links to."""

    text: str
    title: str = ""
    scene: str = ""


Inline = str | Linked | Sequence[str | Linked]
"""A cell of a table: a text, or parts of one."""


TEMPLATES = Environment(loader=PackageLoader(__package__, "assets"), autoescape=True)
PARTS: Any = TEMPLATES.get_template("parts.html").module
"""Elements of a page: macros that return `Markup`."""


def part_body(part: Part) -> Markup:
    """A part of a report without its title."""
    rows = [[str(cell) for cell in row] for row in part.rows]
    table = PARTS.table(part.heads, rows, part.words) if rows else ""
    return Markup(table) + PARTS.paragraphs([str(line) for line in (*part.notes, *part.lines)])


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
