"""The tables of the study `relations` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.results import rows_of
from touchstone.reports.studies.relations.picture import scaled
from touchstone.reports.studies.relations.play import NAMES, SPLIT
from touchstone.reports.studies.relations.study import HELD
from touchstone.reports.views.terminal import print_notes, table_of
from touchstone.scenarios.relations.table import RELATIONS

NOTES = (
    "scenes in which a relation holds to 1e-9 of their size times their amplification, of those to which it",
    "applies; then the median and the largest deviation over size and amplification [1].",
)
LISTED = 12


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print per relation and column in how many scenes it holds and by how much it does not."""
    rows = scaled(frame)
    columns = list(dict.fromkeys(zip(rows.engine, rows.profile)))
    heads = [f"{engine} {profile}" for engine, profile in columns]
    table = table_of("relations: changed scenes", ("relation", *heads), padding=(0, 2, 0, 0))
    for name in NAMES:
        cells = []
        for engine, profile in columns:
            mask = (rows.relation == name) & (rows.engine == engine) & (rows.profile == profile)
            part = rows[mask].scaled
            cells.append(
                f"{int((part <= HELD).sum())} of {len(part)}  {part.median():.0e} {part.max():.0e}"
                if len(part)
                else ""
            )
        table.add_row(name, *cells)
    out.print(table)
    print_notes((*NOTES, *_meanings()), out)
    for row in rows_of(frame[frame.verdict.isin(["fail", "error"])][:LISTED]):
        out.print(
            f"{row.verdict}: {row.engine} {row.profile} {row.scenario} {row.metric} {row.value:.1e}, "
            f"limit {row.limit:.1e} {row.reason}",
            highlight=False,
        )


def _meanings() -> list[str]:
    summaries = [f"{one.name}: {one.summary}" for one in RELATIONS.values()]
    return [*summaries, f"{SPLIT}: a run in two parts, the second from the state in the middle"]
