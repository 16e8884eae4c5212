"""Studies of a night: hard cases that rotate, and studies whose period is over.

A night's identity names the studies that it holds, with the time that each took (`studies`). It says when a
study ran last on this machine, and whether it fits into the time that is left. Studies that measure times by
their own rules are no part of nights.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from touchstone.adapters.registry import ENGINES, installed
from touchstone.reports.cli.progress import Progress
from touchstone.reports.nightly.store import Night
from touchstone.reports.results import Row, rows_of, table
from touchstone.reports.run.request import columns_of, step_text
from touchstone.reports.verdict.outcomes import HARD_CLASSES, SURVIVED
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.difficulty.family import families

HARD = "stability"
OUTCOME = "stability.outcome"
"""Metric of a hard case: how its class ranks among HARD_CLASSES; the reason begins with the class."""
MOST = 2
"""Studies of a night beside the hard cases [1]."""
FAMILIES, QUICK_FAMILIES = 12, 2
"""Families of hard cases of a night, and of a quick one [1]: all have their turn in 4 and 23 nights."""
QUICK_SECONDS = 270.0
"""Time beyond which no study of a quick night may last [s]: the night must end within 5 minutes."""
Measure = Callable[[Path, Path, Progress], pd.DataFrame]
"""Measures into a new folder, with a scratch folder; returns the long table."""


@dataclass(frozen=True, slots=True)
class Study:
    """A study of nights: its period [nights], how long it takes on two cores [s], until a night says how long
    it took here; and what measures it."""

    name: str
    period: int
    seconds: float
    measure: Measure


def studies(turn: int, quick: bool) -> list[Study]:
    """All studies of nights.

    Args:
        turn: number of nights before this one: it chooses the families of hard cases.
    """
    every = list(families())
    count = QUICK_FAMILIES if quick else FAMILIES
    mine = [every[k % len(every)] for k in range(turn * count, (turn + 1) * count)]
    return [
        Study(HARD, 1, 9.0 * count, lambda out, scratch, progress: _hard(mine, out, scratch, progress)),
        Study("robustness", 3, 60.0, _robustness),
        Study("relations", 7, 90.0, _relations),
        Study("calibration", 7, 90.0, _calibration),
        Study("predictability", 14, 240.0, _predictability),
    ]


def due(
    every: Sequence[Study], nights: Sequence[Night], fingerprint: str, left: float = float("inf")
) -> list[Study]:
    """The studies that are due and fit into the time that is left [s]: the hard cases, then at most MOST
    others, the longest overdue first."""
    mine = [night for night in nights if night.identity.get("fingerprint") == fingerprint]
    age, cost = {}, {}
    for study in every:
        ran = [k for k, night in enumerate(mine) if study.name in _held(night)]
        age[study.name] = len(mine) - ran[-1] if ran else float("inf")
        cost[study.name] = float(_held(mine[ran[-1]])[study.name]) if ran else study.seconds
    waiting = [study for study in every if age[study.name] >= study.period]
    waiting.sort(key=lambda study: (study.name != HARD, -age[study.name] / study.period))
    found: list[Study] = []
    for study in waiting:
        fits = cost[study.name] <= left
        if fits and (study.name == HARD or sum(one.name != HARD for one in found) < MOST):
            found.append(study)
            left -= cost[study.name]
    return found


def _held(night: Night) -> Mapping[str, Any]:
    found = night.identity.get("studies")
    return found if isinstance(found, Mapping) else {}


def rows_for_nights(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of a study as nights keep them: without times; the step is part of the subject where several
    steps share a figure; the class of a hard case is a number."""
    found = []
    rows = [row for row in rows_of(frame) if not ("time" in row.metric or row.unit in ("us", "s/s"))]
    steps: dict[tuple[str, ...], set[float]] = {}
    for row in rows:
        steps.setdefault(_key(row), set()).add(row.dt)
    for row in rows:
        if row.study == HARD:
            found += [_class_row(row)] if row.metric == OUTCOME else []
        elif len(steps[_key(row)]) > 1:
            found.append(replace(row, subject=f"{row.subject} at {step_text(row.dt)} s".strip()))
        else:
            found.append(row)
    return table(found)


def _key(row: Row) -> tuple[str, ...]:
    return row.study, row.scenario, row.engine, row.profile, row.metric, row.subject


def _class_row(row: Row) -> Row:
    """A hard case: `pass` where it was survived; the class as a number, and in the reason."""
    verdict = row.verdict if row.verdict == "fail" else "pass" if row.subject in SURVIVED else ""
    reason = f"{row.subject}: {row.reason}".removesuffix(": ")
    value = float(HARD_CLASSES.index(row.subject))
    return replace(row, subject="", value=value, unit="1", verdict=verdict, reason=reason)


def described(value: float) -> str:
    """The class of a hard case by its number."""
    return HARD_CLASSES[int(value)] if 0 <= value < len(HARD_CLASSES) else "-"


def _columns(*profiles: str) -> tuple[tuple[str, str], ...]:
    return tuple(column for column in columns_of(ENGINES, profiles) if installed(column[0]))


def _hard(names: Sequence[str], out: Path, scratch: Path, progress: Progress) -> pd.DataFrame:
    """Outcomes of hard cases at three levels of difficulty."""
    from touchstone.reports.studies.stability.play import QUICK, Scope, chosen
    from touchstone.reports.studies.stability.study import run

    return run(Scope(_columns(*QUICK), chosen(names), quick=True), scratch / "store", out, progress)


def _robustness(out: Path, scratch: Path, progress: Progress) -> pd.DataFrame:
    """Random scenes on the reference: energy, overlap, residual."""
    from touchstone.reports.studies.robustness.study import run, tasks

    columns = (("reference", "balanced"), ("reference", "accurate"))
    return run(columns, tasks(columns, 30, 0, None, 0.0), out, progress)


def _relations(out: Path, scratch: Path, progress: Progress) -> pd.DataFrame:
    """Turned, mirrored, moved and scaled scenes."""
    from touchstone.reports.studies.relations import QUICK, run

    return run(_columns("balanced", "recommended"), [catalogue()[name] for name in QUICK], out, progress)


def _calibration(out: Path, scratch: Path, progress: Progress) -> pd.DataFrame:
    """Restitution and friction that engines achieve."""
    from touchstone.reports.studies.calibration.study import run

    return run(_columns("balanced", "recommended"), out, progress)


def _predictability(out: Path, scratch: Path, progress: Progress) -> pd.DataFrame:
    """Growth of small differences."""
    from touchstone.reports.studies.predictability import SCENES, run

    return run([catalogue()[name] for name in SCENES], 0, out, progress)
