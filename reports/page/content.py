"""What a page shows, apart from its form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from touchstone.reports.results import Row, rows_of
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import Column


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
    studies: pd.DataFrame | None = None

    def columns(self) -> list[Column]:
        """The first column of each engine that played: its own profile."""
        found: dict[str, Column] = {}
        for engine, profile in zip(self.frame.engine, self.frame.profile):
            if engine != "all":
                found.setdefault(engine, (engine, profile))
        return list(found.values())


def rows_by_scene(frame: pd.DataFrame) -> dict[str, list[Row]]:
    """Rows of each scene, in the order of the run."""
    found: dict[str, list[Row]] = {}
    for row in rows_of(frame):
        found.setdefault(row.scenario, []).append(row)
    return found
