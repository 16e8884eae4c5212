"""The study `stability`: how far each engine goes in each kind of difficulty before it fails, and how.

A sweep plays the cells: hard scenes (`scenarios.difficulty`) on every engine, profile and step. Its store
holds what was measured, so that an interrupted study goes on. Independent oracles judge each run
(`reports.verdict.outcomes`). `cells.csv` has one line per cell with the command that plays it; the store
keeps the recordings of failed runs in `output/failed/`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from math import nan
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle

from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import CONSTRUCTION, Row, illustrate, rows_of, write_beside
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.tasks import own_step
from touchstone.reports.studies.stability.play import OUTCOME, Played, Scope, levels_of, play_all, steps_of
from touchstone.reports.studies.stability.sheet import write_sheets
from touchstone.reports.studies.study import Column, failures, kept, missing_rows
from touchstone.reports.verdict.outcomes import HARD_CLASSES, SILENT, SURVIVED
from touchstone.reports.views.pictures import INK, PALE, figure
from touchstone.reports.views.render import Part
from touchstone.scenarios.difficulty.family import Family, hard_names, level_text

STUDY = "stability"
LEVELS, STEP, CONTAINED = (f"{STUDY}.{name}" for name in ("survived", "largest_step", "contained"))
REFERENCE = "reference"
JUDGED = ("balanced", "accurate")
"""Profiles of the reference that must not fail silently."""
SHOWN = ("default", "recommended")
"""Profiles of an engine that are shown, beside its best one."""
LEAST_CONTAINED = 0.8
"""Share of the families in which the reference's envelope must contain that of every engine [1]."""


@dataclass(frozen=True)
class Envelope:
    """Cells of a study with their outcomes."""

    scope: Scope
    played: dict[Cell, Played]

    @cached_property
    def names(self) -> dict[tuple[str, str, str, float], str]:
        """Classes by scene, engine, profile and step."""
        return {(c.scenario, c.engine, c.profile, c.dt): p.outcome.name for c, p in self.played.items()}

    @property
    def columns(self) -> list[Column]:
        """Columns that were played."""
        return list(dict.fromkeys((cell.engine, cell.profile) for cell in self.played))

    @cached_property
    def shown(self) -> dict[Column, str]:
        """Columns that are shown, with their heads."""
        return shown_columns(
            {
                column: sum(
                    self.outcome(family, level, column) in SURVIVED
                    for family in self.scope.families
                    for level in levels_of(family, self.scope.quick)
                )
                for column in self.columns
            }
        )

    def outcome(self, family: Family, level: float, column: Column, dt: float = 0.0) -> str:
        """Class of a cell at a step, or at the profile's own one; empty if it was not played."""
        return self.names.get((family.scene_name(level), *column, dt or own_step(*column)), "")

    def survived(self, family: Family, column: Column) -> tuple[float | None, str]:
        """Last level before the first failure at the profile's own step, None if the easiest fails; and the
        class of that failure, empty if there is none."""
        last: float | None = None
        for level in levels_of(family, self.scope.quick):
            name = self.outcome(family, level, column)
            if name not in SURVIVED:
                return last, name
            last = level
        return last, ""


def shown_columns(survived: Mapping[Column, int]) -> dict[Column, str]:
    """Columns of the table and the picture with their heads: the reference once, of every engine `default`,
    `recommended` and the best of its profiles; all of an engine that plays only some of these.

    Args:
        survived: cells at the profile's own step that are ok, by column, as they were played.
    """
    found: dict[Column, str] = {}
    for engine in dict.fromkeys(engine for engine, _ in survived):
        mine, best = [profile for name, profile in survived if name == engine], ""
        if engine == REFERENCE and mine[0] == JUDGED[0]:
            mine = mine[:1]
        elif set(SHOWN) <= set(mine):
            best = max(mine, key=lambda profile: survived[engine, profile])
            mine = list(dict.fromkeys((*SHOWN, best)))
        found |= {(engine, name): f"best: {name}" if name == best else name for name in mine}
    return found


def run(
    scope: Scope,
    store: Path,
    out: Path,
    progress: Progress,
    jobs: int | None = None,
    sheet: int = 0,
    seed: int = 0,
) -> pd.DataFrame:
    """Play all cells that the store does not hold, in `jobs` processes (None: one per core), and draw
    `sheet` of them at random; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        found = Envelope(scope, play_all(scope.cells(), store, progress, jobs))
        facts = {"study": STUDY, "quick": scope.quick, "families": [f.name for f in scope.families]}
        frame = kept([*missing_rows(STUDY, scope.columns), *rows_of_envelope(found)], folder, facts)
        cells = table_of_cells(found)
        write_beside(folder / "cells.csv", lambda part: cells.to_csv(part, index=False))
        illustrate(folder / "stability.png", partial(envelope_picture, found))
        if not scope.quick:
            (folder / "steps").mkdir()
            for family in scope.families:
                illustrate(folder / "steps" / f"{family.name}.png", partial(step_picture, found, family))
        if sheet:
            write_sheets(found.played, sheet, seed, folder / "sheet", progress)
    return frame


def rows_of_envelope(found: Envelope) -> list[Row]:
    """All rows: cells, then what each column survives per family, then the containment."""
    rows = [_cell_row(cell, one) for cell, one in found.played.items()]
    for family in found.scope.families:
        for column in found.columns:
            rows += _survival_rows(found, family, column)
    return rows + _contained_rows(found)


def _cell_row(cell: Cell, found: Played) -> Row:
    family, level = hard_names()[cell.scenario]
    verdict = ""
    if cell.engine == REFERENCE and cell.profile in JUDGED:
        verdict = "fail" if found.outcome.name in SILENT else "pass"
    return Row(
        *(STUDY, cell.scenario, cell.engine, cell.profile, cell.dt, OUTCOME, level, family.unit),
        subject=found.outcome.name,
        verdict=verdict,
        basis=_basis(family, cell.engine),
        reason=found.outcome.reason,
        reproduce=found.line,
    )


def _basis(family: Family, engine: str) -> str:
    return CONSTRUCTION if engine == REFERENCE and family.posed else ""


def _survival_rows(found: Envelope, family: Family, column: Column) -> list[Row]:
    key = (STUDY, family.name, *column, own_step(*column))
    last, failure = found.survived(family, column)
    level, text = (
        (nan if last is None else last),
        f"the most difficult {family.quantity} before the first failure",
    )
    levels = Row(
        *key, LEVELS, level, family.unit, failure or "all", basis=_basis(family, column[0]), reason=text
    )
    if found.scope.quick:
        return [levels]
    easiest = family.levels[0]
    steps = [dt for dt in steps_of(*column, False) if found.outcome(family, easiest, column, dt) in SURVIVED]
    text = f"the largest step of those played that survives {family.quantity} {easiest:g}"
    return [levels, Row(*key, STEP, max(steps, default=nan), "s", reason=text)]


def _contained_rows(found: Envelope) -> list[Row]:
    """Per profile of the reference, the share of families in which it survives every level at its own step
    that any engine survives at its own."""
    rows = []
    for profile in JUDGED if any(engine != REFERENCE for engine, _ in found.columns) else ():
        if (REFERENCE, profile) in found.columns:
            missed = [family.name for family in found.scope.families if is_beaten(found, family, profile)]
            share = 1 - len(missed) / len(found.scope.families)
            verdict = "pass" if share >= LEAST_CONTAINED else "fail"
            key = (STUDY, "all", REFERENCE, profile, own_step(REFERENCE, profile), CONTAINED, share, "1")
            reason = f"not in {', '.join(missed)}" if missed else ""
            rows.append(Row(*key, limit=LEAST_CONTAINED, verdict=verdict, reason=reason))
    return rows


def is_beaten(found: Envelope, family: Family, profile: str) -> bool:
    """Whether an engine survives a level of a family, at its own step, that the reference does not."""
    return any(
        found.outcome(family, level, column) in SURVIVED
        and found.outcome(family, level, (REFERENCE, profile)) not in SURVIVED
        for column in found.columns
        if column[0] != REFERENCE
        for level in levels_of(family, found.scope.quick)
    )


def table_of_cells(found: Envelope) -> pd.DataFrame:
    """One line per cell, with its figures and its command."""
    lines = []
    for cell, one in found.played.items():
        family, level = hard_names()[cell.scenario]
        line = {"family": family.name, "quantity": family.quantity, "level": level, "unit": family.unit}
        line |= {"engine": cell.engine, "profile": cell.profile, "dt": cell.dt}
        line |= {"outcome": one.outcome.name, "under": one.outcome.under, "reason": one.outcome.reason}
        line |= {**one.outcome.figures, "seconds": one.seconds, "state_hash": one.state_hash}
        lines.append(line | {"command": one.line})
    return pd.DataFrame(lines)


LOOKS: dict[str, tuple[str, str]] = {
    # class: colour and letter
    "ok": ("#BFE3C8", ""),
    "inaccurate": ("#F6D55C", "i"),
    "jitter": ("#F2A65A", "j"),
    "creep": ("#E8871E", "c"),
    "sink-through": ("#E4572E", "s"),
    "tunnelled": ("#C1292E", "t"),
    "exploded": ("#8F2D56", "x"),
    "auto-reset": ("#5E3A87", "r"),
    "non-finite": ("#1D1D1F", "n"),
    "gave up": ("#4F8FCB", "g"),
    "error": ("#7B5C45", "e"),
    "slow": ("#9AA5B1", "o"),
    "skipped": ("#ECECEC", "-"),
    "": ("#FFFFFF", ""),
}
"""Colour and letter of each class; empty: not played."""
DARK = ("non-finite", "auto-reset", "exploded", "tunnelled", "error", "gave up", "sink-through")
"""Classes whose letters are white."""
CELL = 1.0
RIGHT = 22.0
"""Width of the text on the right [cells]."""
LABEL = 4.9
"""Width of a column's heading [cells]."""
GAP = 0.9
"""Width of a cell, and of the space between columns [cells]."""


def envelope_picture(found: Envelope, path: Path) -> None:
    """Draw one row per family and one block of levels per column, easy levels at the left."""
    columns, rows = list(found.shown.items()), found.scope.families
    block = max(*(len(levels_of(family, found.scope.quick)) * CELL for family in rows), LABEL) + GAP
    size = (0.17 * (10.0 + RIGHT + block * len(columns)), 1.7 + 0.2 * len(rows))
    with figure(path, *size, font=8, layout=None) as drawn:
        axes = drawn.add_axes((0.0, 0.0, 1.0, 1.0))
        left, top = -0.5, -2.6
        for y, family in enumerate(rows):
            levels = levels_of(family, found.scope.quick)
            name = family.name.replace("_", " ") + (" =" if family.posed else "")
            axes.text(left, y + 0.5, name, ha="right", va="center", color=INK)
            text = f"{family.quantity}, {level_text(levels[0])} to {level_text(levels[-1])}"
            text += "" if family.unit == "1" else f" {family.unit}"
            axes.text(block * len(columns), y + 0.5, text, va="center", color="#777777", fontsize=7)
            for k, (column, _) in enumerate(columns):
                for j, level in enumerate(levels):
                    _square(axes, block * k + CELL * j, y, found.outcome(family, level, column))
        for k, ((engine, _), head) in enumerate(columns):
            text = "\n".join((engine, *head.split(" ")))
            axes.text(block * k, -0.35, text, va="bottom", color=INK)
        title = "How far each engine goes before it fails"
        axes.text(-9.5, top - 0.3, title, va="bottom", color=INK, fontsize=12, fontweight="bold")
        axes.set_xlim(-10.0, block * len(columns) + RIGHT)
        axes.set_ylim(len(rows) + 3.4, top - 1.6)
        axes.axis("off")
        axes.legend(
            handles=_handles(found), loc="lower left", ncols=5, frameon=False, fontsize=7.5,
            bbox_to_anchor=(0.02, 0.0), handlelength=1.2, columnspacing=1.4,
        )  # fmt: skip


def step_picture(found: Envelope, family: Family, path: Path) -> None:
    """Draw the map of one family: difficulty from left to right, steps from the smallest up."""
    columns, levels = found.columns, levels_of(family, found.scope.quick)
    steps = sorted({cell.dt for cell in found.played})
    with figure(path, 1.2 + 1.55 * len(columns), 3.0, font=8) as drawn:
        grid = drawn.subplots(1, len(columns), squeeze=False, sharey=True)[0]
        for axes, column in zip(grid, columns):
            for y, dt in enumerate(steps):
                for x, level in enumerate(levels):
                    _square(axes, x, y, found.outcome(family, level, column, dt))
            axes.set_title("\n".join(column), fontsize=8, color=INK, loc="left")
            axes.set_xlim(-0.1, len(levels) + 0.1)
            axes.set_ylim(-0.1, len(steps) + 0.1)
            axes.set_xticks(
                [x + 0.5 for x in range(len(levels))], [level_text(x) for x in levels], rotation=60
            )
            axes.set_yticks([y + 0.5 for y in range(len(steps))], [f"1/{round(1 / dt)} s" for dt in steps])
            axes.tick_params(length=0, labelsize=7, colors=INK)
            for side in axes.spines.values():
                side.set_color(PALE)
        unit = "" if family.unit == "1" else f" [{family.unit}]"
        drawn.supxlabel(f"{family.quantity}{unit}", fontsize=8, color=INK)
        title = f"{family.name.replace('_', ' ')}: {family.summary}"
        drawn.suptitle(title, fontsize=9, color=INK, x=0.01, ha="left")


def _square(axes: Axes, x: float, y: float, name: str) -> None:
    color, letter = LOOKS[name]
    axes.add_patch(Rectangle((x + 0.05, y + 0.08), 0.9, 0.84, facecolor=color, edgecolor="none"))
    if letter:
        ink = "white" if name in DARK else INK
        axes.text(x + 0.5, y + 0.5, letter, ha="center", va="center", fontsize=6.5, color=ink)


def _handles(found: Envelope) -> list[Patch]:
    seen = {one.outcome.name for one in found.played.values()}
    looks = [(name, *LOOKS[name]) for name in reversed(HARD_CLASSES) if name in seen]
    return [Patch(color=color, label=f"{letter} {name}".strip()) for name, color, letter in looks]


NOTES = (
    "the most difficult level before the first failure at the profile's own step, and how that failed;",
    "-: the easiest fails; all: every level survives; =: no body is simulated, the reference poses it.",
    "best: the profile of an engine with most cells that are ok; counts below are of all that were played.",
)
LISTED = 20
"""Number of silent failures that are listed."""


def report(frame: pd.DataFrame) -> list[Part]:
    """What each column survives per family, counts of classes, and silent failures of the reference."""
    survived, rows = frame[frame.metric == LEVELS], []
    columns = list(dict.fromkeys(zip(survived.engine, survived.profile)))
    shown = shown_columns({column: _ok(frame, column) for column in columns})
    heads = ["\n".join((engine, *head.split(" "))) for (engine, _), head in shown.items()]
    for name, part in survived.groupby("scenario", sort=False):
        cells = {(row.engine, row.profile): _cell(row) for row in rows_of(part)}
        rows.append([str(name), *(cells.get(column, "") for column in shown)])
    lines = [
        f"reference {row.profile} survives all that any engine does in {row.value:.0%} of "
        f"{len(survived.scenario.unique())} families {row.reason}"
        for row in rows_of(frame[frame.metric == CONTAINED])
    ]
    failed = frame[(frame.metric == OUTCOME) & (frame.verdict == "fail")]
    lines += [f"{row.subject}: {row.reproduce}: {row.reason}" for row in rows_of(failed[:LISTED])]
    lines += [f"and {len(failed) - LISTED} more in cells.csv"] if len(failed) > LISTED else []
    title = "stability: the most difficult level survived"
    return [
        Part(title, ["family", *heads], rows, (*NOTES, _letters(frame))),
        _counts(frame, columns),
        Part(lines=lines),
        failures(frame[frame.metric == "run"]),
    ]


def _ok(frame: pd.DataFrame, column: Column) -> int:
    """Cells of a column at its own step that are ok."""
    mine = frame[(frame.metric == OUTCOME) & (frame.engine == column[0]) & (frame.profile == column[1])]
    return int((mine.subject.isin(SURVIVED) & np.isclose(mine["dt"], own_step(*column))).sum())


def _cell(row: Row) -> str:
    posed = " =" if row.basis == CONSTRUCTION else ""
    if row.subject == "all":
        return f"all{posed}"
    return f"{'-' if row.value != row.value else level_text(row.value)} {LOOKS[row.subject][1]}{posed}"


def _letters(frame: pd.DataFrame) -> str:
    seen = set(frame[frame.metric == OUTCOME].subject)
    return "; ".join(f"{letter}: {name}" for name, (_, letter) in LOOKS.items() if letter and name in seen)


def _counts(frame: pd.DataFrame, columns: list[tuple[str, str]]) -> Part:
    """The number of cells of each class per column."""
    cells = frame[frame.metric == OUTCOME]
    names = [name for name in LOOKS if name in set(cells.subject)]
    letters = [LOOKS[name][1] or name for name in names]
    rows = []
    for engine, profile in columns:
        mine = cells[(cells.engine == engine) & (cells.profile == profile)].subject
        silent = int(mine.isin(SILENT).sum())
        counts = [str(int((mine == name).sum()) or "") for name in names]
        rows.append([f"{engine} {profile}", *counts, str(silent)])
    return Part("cells per class, all steps", ["", *letters, "silent"], rows)
