"""The tables of the study `stability` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.results import CONSTRUCTION, Row, rows_of
from touchstone.reports.studies.stability.picture import LOOKS
from touchstone.reports.studies.stability.rows import CONTAINED, LEVELS, OUTCOME
from touchstone.reports.verdict.outcomes import SILENT
from touchstone.reports.views.terminal import print_notes, table_of
from touchstone.scenarios.difficulty.family import families, level_text

NOTES = (
    "the most difficult level before the first failure at the profile's own step, and how that failed;",
    "-: the easiest fails; all: every level survives; =: no body is simulated, the reference poses it.",
)
LISTED = 20
"""Number of silent failures that are listed."""


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print what each column survives per family, counts of classes, and silent failures of the
    reference."""
    survived = frame[frame.metric == LEVELS]
    columns = list(dict.fromkeys(zip(survived.engine, survived.profile)))
    heads = [f"{engine}\n{profile}" for engine, profile in columns]
    table = table_of("stability: the most difficult level survived", ("family", *heads), padding=(0, 1, 0, 0))
    for name, part in survived.groupby("scenario", sort=False):
        cells = {(row.engine, row.profile): _cell(row) for row in rows_of(part)}
        table.add_row(str(name), *(cells.get(column, "") for column in columns))
    out.print(table)
    print_notes((*NOTES, _letters(frame)), out)
    _counts(frame, columns, out)
    for row in rows_of(frame[frame.metric == CONTAINED]):
        out.print(
            f"reference {row.profile} survives all that any engine does in {row.value:.0%} of "
            f"{len(survived.scenario.unique())} families {row.reason}",
            highlight=False,
        )
    failed = frame[(frame.metric == OUTCOME) & (frame.verdict == "fail")]
    for row in rows_of(failed[:LISTED]):
        out.print(f"{row.subject}: {row.reproduce}: {row.reason}", highlight=False, soft_wrap=True)
    if len(failed) > LISTED:
        out.print(f"and {len(failed) - LISTED} more in cells.csv", highlight=False)
    for row in rows_of(frame[frame.metric == "run"]):
        out.print(f"{row.verdict}: {row.reason}", highlight=False)


def _cell(row: Row) -> str:
    posed = " =" if row.basis == CONSTRUCTION else ""
    if row.subject == "all":
        return f"all{posed}"
    return f"{'-' if row.value != row.value else level_text(row.value)} {LOOKS[row.subject][1]}{posed}"


def _letters(frame: pd.DataFrame) -> str:
    seen = set(frame[frame.metric == OUTCOME].subject)
    return "; ".join(f"{letter}: {name}" for name, (letter, _) in _by_letter().items() if name in seen)


def _by_letter() -> dict[str, tuple[str, str]]:
    return {name: (letter, color) for name, (color, letter) in LOOKS.items() if letter}


def _counts(frame: pd.DataFrame, columns: list[tuple[str, str]], out: Console) -> None:
    """Print the number of cells of each class per column."""
    cells = frame[frame.metric == OUTCOME]
    names = [name for name in LOOKS if name in set(cells.subject)]
    letters = [LOOKS[name][1] or name for name in names]
    table = table_of("cells per class, all steps", ("", *letters, "silent"), padding=(0, 1, 0, 0))
    for engine, profile in columns:
        mine = cells[(cells.engine == engine) & (cells.profile == profile)].subject
        silent = int(mine.isin(SILENT).sum())
        counts = [str(int((mine == name).sum()) or "") for name in names]
        table.add_row(f"{engine} {profile}", *counts, str(silent))
    out.print(table)


def family_rows() -> list[dict[str, object]]:
    """Families of hard scenes: quantity, levels, and what they are."""
    return [
        {
            "family": one.name,
            "quantity": one.quantity,
            "unit": one.unit,
            "levels": " ".join(map(level_text, one.levels)),
            "summary": one.summary,
        }
        for one in families().values()
    ]
