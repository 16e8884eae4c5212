"""The tables of the study `calibration`: achieved and requested values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan, nan

import numpy as np
import pandas as pd

from touchstone.adapters.registry import ACCURATE, DEFAULT
from touchstone.reports.results import rows_of
from touchstone.reports.run.request import step_text
from touchstone.reports.studies.calibration.rows import ALL, subject_of
from touchstone.reports.studies.calibration.scenes import SHAPES

SHOWN_SPEED = 1.0
"""Approach speed of the restitutions in the table [m/s]."""
NOTES = (
    f"asked: what a sphere at {SHOWN_SPEED:g} m/s returned; bias: largest |achieved - asked| from 1 m/s on",
    "lowest: speed from which on a quarter of e = 1 is returned, or the least one tried",
    "friction: mean over the coefficients asked; bias: the largest of a single one",
)


@dataclass(frozen=True, slots=True)
class Grid:
    """A table as text: title, headings and rows; the first column is left-aligned."""

    title: str
    heads: list[str]
    rows: list[list[str]]


class Values:
    """The values of a calibration's rows, by (engine, profile, scenario, metric, subject)."""

    def __init__(self, frame: pd.DataFrame) -> None:
        rows = rows_of(frame[frame.metric != "run"])
        self.steps = {(r.engine, r.profile): r.dt for r in reversed(rows) if r.metric != "restitution.drop"}
        self.columns = [
            key for key in dict.fromkeys((r.engine, r.profile) for r in rows) if key in self.steps
        ]
        self._rows = {(r.engine, r.profile, r.scenario, r.metric, r.subject): r.value for r in rows}
        subjects = [r.subject for r in rows]
        self.restitutions = asked(subjects, "e")
        self.frictions, self.headings = asked(subjects, "mu"), asked(subjects, "heading")

    def __call__(self, column: tuple[str, str], pair: str, metric: str, subject: str = "") -> float:
        return self._rows.get((*column, pair, metric, subject), nan)

    def first(self, engine: str) -> str:
        """The engine's default profile, else its first, or ""."""
        own = [profile for name, profile in self.columns if name == engine]
        return DEFAULT if DEFAULT in own else next(iter(own), "")

    def both(self, engine: str) -> tuple[tuple[str, str], tuple[str, str]]:
        """The columns of an engine's default and of its accurate profile."""
        return (engine, self.first(engine)), (engine, ACCURATE)

    def step(self, engine: str) -> float:
        """Native step of an engine in its default profile [s]."""
        return self.steps.get((engine, self.first(engine)), nan)

    def lowest(self, engine: str) -> float:
        """Lowest speed that bounces under an engine's first profile [m/s]."""
        return self((engine, self.first(engine)), "sphere-box", "restitution.lowest", "e=1")

    def share(self, column: tuple[str, str], pair: str, heading: float) -> float:
        """Achieved over requested friction along a heading, mean over the coefficients."""
        found = [
            self(column, pair, "friction.bias", subject_of("friction", mu, heading)) for mu in self.frictions
        ]
        known = [1 + bias for bias in found if not isnan(bias)]
        return float(np.mean(known)) if known else nan


def asked(subjects: Sequence[str], name: str) -> list[float]:
    """The values of a name in the subjects, ascending."""
    words = [word for subject in subjects for word in subject.split()]
    return sorted({float(word.partition("=")[2]) for word in words if word.startswith(f"{name}=")})


def grids(frame: pd.DataFrame) -> list[Grid]:
    """Restitution, friction, and a fall under several steps."""
    values = Values(frame)
    return [_restitution(values), _friction(values), _drops(frame)]


def _restitution(values: Values) -> Grid:
    pairs = [pair.partition("-")[0] for pair in SHAPES]
    heads = [
        "",
        *(f"asked {e:g}" for e in values.restitutions),
        *(f"{p} bias" for p in pairs),
        "lowest [m/s]",
    ]
    rows = []
    for column in values.columns:
        subjects = [subject_of("restitution", e, SHOWN_SPEED) for e in values.restitutions]
        achieved = [values(column, "sphere-box", "restitution.achieved", subject) for subject in subjects]
        biases = [values(column, pair, "restitution.bias.max") for pair in SHAPES]
        lowest = values(column, "sphere-box", "restitution.lowest", "e=1")
        rows.append([_name(values, column), *map(_text, [*achieved, *biases, lowest])])
    return Grid("restitution, asked and achieved", heads, rows)


def _friction(values: Values) -> Grid:
    pairs = [pair.partition("-")[0] for pair in SHAPES]
    heads = ["", *(f"{pair} {heading:g}°" for pair in pairs for heading in values.headings), "bias"]
    rows = []
    for column in values.columns:
        shares = [values.share(column, pair, heading) for pair in SHAPES for heading in values.headings]
        rows.append([_name(values, column), *map(_text, [*shares, values(column, ALL, "friction.bias.max")])])
    return Grid("friction, achieved over asked, per heading", heads, rows)


def _drops(frame: pd.DataFrame) -> Grid:
    rows = rows_of(frame[frame.metric == "restitution.drop"])
    steps = sorted({row.dt for row in rows}, reverse=True)
    heads = ["", *(f"{step_text(dt)} s" for dt in steps)]
    lines = []
    for engine in dict.fromkeys(row.engine for row in rows):
        cells = {
            r.dt: f"{_text(r.value)} ({_text(r.low)} to {_text(r.high)})" for r in rows if r.engine == engine
        }
        lines.append([engine, *(cells.get(dt, "-") for dt in steps)])
    return Grid(
        "e = 1 from a fall of half a metre, and its range over where within a step bodies land", heads, lines
    )


def _name(values: Values, column: tuple[str, str]) -> str:
    return f"{column[0]} {column[1]} {step_text(values.steps[column])} s"


def _text(value: float) -> str:
    """Three decimals: coefficients are of order 1."""
    return "-" if isnan(value) else f"{value:.3f}"


def remarks(frame: pd.DataFrame) -> list[str]:
    """Broken limits, failures, and runs that are skipped as a whole."""
    lines = []
    for row in rows_of(frame[frame.verdict.isin(["fail", "known", "error"]) & (frame.metric != "run")]):
        where = f"{row.engine} {row.profile} {row.scenario}"
        lines.append(
            f"{row.verdict}: {where}: {row.metric} {row.value:.2e}, limit {row.limit:.2e}: {row.reason}"
        )
    for row in rows_of(frame[frame.metric == "run"]):
        what = f" {row.scenario} {row.subject}" if row.subject else ""
        lines.append(f"{row.verdict}: {row.engine} {row.profile}{what}: {row.reason}")
    return lines
