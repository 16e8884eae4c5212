"""What a page shows, apart from its form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pandas as pd

from touchstone.reports.results import NOT_RUN, UNJUDGED, Row, rows_of

BAD, WARN, GOOD = "bad", "warn", "good"
Column = tuple[str, str]
"""Engine and profile."""


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
        level: BAD, WARN or GOOD.
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
        times: table of the times of nights that are too few for a chart, its heads first.
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
    times: Sequence[Sequence[str]] = ()
    studies: pd.DataFrame | None = None

    def columns(self) -> list[Column]:
        """The first column of each engine that played: its own profile."""
        found: dict[str, Column] = {}
        for engine, profile in zip(self.frame.engine, self.frame.profile):
            if engine != "all":
                found.setdefault(engine, (engine, profile))
        return list(found.values())


def verdict_of(frame: pd.DataFrame) -> tuple[str, str]:
    """Level and sentence of a run by itself."""
    counts = frame.verdict.value_counts()
    fails, errors = int(counts.get("fail", 0)), int(counts.get("error", 0))
    known, unjudged = int(counts.get("known", 0)), int(counts.get(UNJUDGED, 0))
    met = int(counts.get("pass", 0))
    missing = sorted(set(frame.engine[(frame.metric == "run") & frame.verdict.isin(NOT_RUN[1:])]))
    rest = [counted(known, "known failing")] if known else []
    rest += [f"{unjudged} not judged"] if unjudged else []
    rest += [f"{', '.join(missing)} did not play"] if missing else []
    tail = f" ({', '.join(rest)})" if rest else ""
    if fails or errors:
        broken = frame[frame.verdict.isin(["fail", "error"])]
        who = ", ".join(f"{name} {count}" for name, count in broken.engine.value_counts().items())
        what = [
            f"{counted(fails, 'limit')} broken" if fails else "",
            f"{counted(errors, 'run')} failed" if errors else "",
        ]
        return BAD, f"{' and '.join(filter(None, what))}: {who}; {counted(met, 'limit')} met{tail}."
    if not met:
        return WARN, f"Nothing was judged{tail}."
    return (WARN if unjudged or missing else GOOD), f"All {met} limits met{tail}."


def counted(count: int, word: str) -> str:
    """A number of things, in the plural where it is due."""
    return f"{count} {word}{'' if count == 1 else 's'}"


def rows_by_scene(frame: pd.DataFrame) -> dict[str, list[Row]]:
    """Rows of each scene, in the order of the run."""
    found: dict[str, list[Row]] = {}
    for row in rows_of(frame):
        found.setdefault(row.scenario, []).append(row)
    return found
