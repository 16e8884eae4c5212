"""Rows of the study `stability`: the outcome of each cell, what each column survives, and whose envelope
contains whose."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan

import pandas as pd

from touchstone.reports.results import CONSTRUCTION, Row
from touchstone.reports.studies.stability.cells import Plan, levels_of, own_step, steps_of
from touchstone.reports.studies.stability.play import Cell, Played
from touchstone.reports.verdict.outcomes import GROSS, SILENT, SURVIVED
from touchstone.scenarios.difficulty.family import Family, hard_names, level_text

STUDY = "stability"
OUTCOME, LEVELS, STEP, CONTAINED = (
    f"{STUDY}.{name}" for name in ("outcome", "survived", "largest_step", "contained")
)
METRICS = (OUTCOME, LEVELS, STEP, CONTAINED)
"""Metrics of the study's rows."""
REFERENCE = "reference"
JUDGED = ("balanced", "accurate")
"""Profiles of the reference that must not fail silently."""
LEAST_CONTAINED = 0.8
"""Share of the families in which the reference's envelope must contain that of every engine [1]."""


@dataclass(frozen=True, slots=True)
class Results:
    """Cells of a plan with their outcomes; `names` are classes by scene, engine, profile and step."""

    plan: Plan
    played: dict[Cell, Played]
    names: dict[tuple[str, str, str, float], str]

    def outcome(self, family: Family, level: float, engine: str, profile: str, dt: float) -> str:
        """Class of a cell; empty if it was not played."""
        return self.names.get((family.scene_name(level), engine, profile, dt), "")

    def survived(self, family: Family, engine: str, profile: str, dt: float) -> tuple[float | None, str]:
        """Last level before the first failure at a step, None if the easiest fails; and the class of that
        failure, empty if there is none."""
        last: float | None = None
        for level in levels_of(family, self.plan.quick):
            name = self.outcome(family, level, engine, profile, dt)
            if name not in SURVIVED:
                return last, name
            last = level
        return last, ""


def results_of(plan: Plan, played: dict[Cell, Played]) -> Results:
    """Results of a plan's cells."""
    names = {
        (cell.scene, cell.engine, cell.settings.profile, cell.settings.dt): found.outcome.name
        for cell, found in played.items()
    }
    return Results(plan, played, names)


def rows_of(results: Results) -> list[Row]:
    """All rows: cells, then what each column survives per family, then the containment."""
    rows = [_cell_row(cell, found) for cell, found in results.played.items()]
    for family in results.plan.families:
        for engine, profile in _columns(results):
            rows += _survival_rows(results, family, engine, profile)
    return rows + _contained_rows(results)


def _cell_row(cell: Cell, found: Played) -> Row:
    family, level = hard_names()[cell.scene]
    outcome, judged = found.outcome, cell.engine == REFERENCE and cell.settings.profile in JUDGED
    verdict = ""
    if judged:
        verdict = "fail" if outcome.name in SILENT else "pass"
    return Row(
        STUDY,
        cell.scene,
        cell.engine,
        cell.settings.profile,
        cell.settings.dt,
        OUTCOME,
        level,
        family.unit,
        subject=outcome.name,
        verdict=verdict,
        basis=_basis(family, cell.engine),
        reason=outcome.reason,
        reproduce=found.line,
    )


def _basis(family: Family, engine: str) -> str:
    return CONSTRUCTION if engine == REFERENCE and family.posed else ""


def _survival_rows(results: Results, family: Family, engine: str, profile: str) -> list[Row]:
    own = own_step(engine, profile)
    base = Row(STUDY, family.name, engine, profile, own, LEVELS)
    last, failure = results.survived(family, engine, profile, own)
    rows = [
        Row(
            *(base.study, base.scenario, base.engine, base.profile, base.dt, LEVELS),
            value=nan if last is None else last,
            unit=family.unit,
            subject=failure or "all",
            basis=_basis(family, engine),
            reason=f"the most difficult {family.quantity} before the first failure",
        )
    ]
    easiest = family.levels[0]
    steps = [
        dt
        for dt in steps_of(engine, profile, results.plan.quick)
        if results.outcome(family, easiest, engine, profile, dt) in SURVIVED
    ]
    if not results.plan.quick:
        rows.append(
            Row(
                *(base.study, base.scenario, base.engine, base.profile, base.dt, STEP),
                value=max(steps, default=nan),
                unit="s",
                reason=f"the largest step of those played that survives {family.quantity} {easiest:g}",
            )
        )
    return rows


def _contained_rows(results: Results) -> list[Row]:
    """Per profile of the reference, the share of families in which it survives every level at its own step
    that any engine survives at its own."""
    others = [column for column in _columns(results) if column[0] != REFERENCE]
    rows = []
    for profile in JUDGED if others else ():
        if (REFERENCE, profile) not in _columns(results):
            continue
        missed = [f.name for f in results.plan.families if beaten_by(results, f, profile)]
        count = len(results.plan.families)
        share = 1 - len(missed) / count
        verdict = "pass" if share >= LEAST_CONTAINED else "fail"
        rows.append(
            Row(
                *(STUDY, "all", REFERENCE, profile, own_step(REFERENCE, profile), CONTAINED),
                value=share,
                unit="1",
                limit=LEAST_CONTAINED,
                verdict=verdict,
                reason=f"not in {', '.join(missed)}" if missed else "",
            )
        )
    return rows


def beaten_by(results: Results, family: Family, profile: str) -> list[str]:
    """Engines that survive a level of a family, at their own steps, which the reference does not survive."""
    found = []
    for engine, other in _columns(results):
        if engine == REFERENCE:
            continue
        for level in levels_of(family, results.plan.quick):
            theirs = results.outcome(family, level, engine, other, own_step(engine, other))
            ours = results.outcome(family, level, REFERENCE, profile, own_step(REFERENCE, profile))
            if theirs in SURVIVED and ours not in SURVIVED:
                found.append(f"{engine} {other} at {level_text(level)}")
                break
    return found


def silent_lines(results: Results) -> list[tuple[str, str, str]]:
    """Silent failures of the reference's judged profiles: class, reason and the command that plays each; the
    gross ones first."""
    found = [
        (played.outcome.name, played.outcome.reason, played.line)
        for cell, played in results.played.items()
        if cell.engine == REFERENCE and cell.settings.profile in JUDGED and played.outcome.name in SILENT
    ]
    return sorted(found, key=lambda one: one[0] not in GROSS)


def table_of_cells(results: Results) -> pd.DataFrame:
    """One line per cell, with its figures and its command."""
    lines = []
    for cell, found in results.played.items():
        family, level = hard_names()[cell.scene]
        lines.append(
            {
                "family": family.name,
                "quantity": family.quantity,
                "level": level,
                "unit": family.unit,
                "engine": cell.engine,
                "profile": cell.settings.profile,
                "dt": cell.settings.dt,
                "outcome": found.outcome.name,
                "under": found.outcome.under,
                "reason": found.outcome.reason,
                **found.outcome.figures,
                "seconds": found.seconds,
                "state_hash": found.state_hash,
                "command": found.line,
            }
        )
    return pd.DataFrame(lines)


def _columns(results: Results) -> list[tuple[str, str]]:
    """Columns that were played."""
    return list(dict.fromkeys((cell.engine, cell.settings.profile) for cell in results.played))
