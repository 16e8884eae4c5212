"""Changes between two runs, as a table per kind on the terminal."""

from __future__ import annotations

import pandas as pd

COLOR = {"worse": "red", "better": "green", "changed": "yellow", "new": "blue", "gone": "red"}
WIDEST = 90
"""Widest remark [characters]."""


def show_changes(frame: pd.DataFrame) -> None:
    """Print the rows of `changes`: scene, engine, metric, both values and the reason."""
    from rich.table import Table
    from rich.text import Text

    from touchstone.reports.views.render import console

    out = console()
    for kind, rows in frame.groupby("kind", sort=False):
        table = Table(title=f"{kind}: {len(rows)}", title_justify="left", title_style=COLOR[str(kind)])
        for head in ("scene", "engine", "metric", "A", "B", "remark"):
            table.add_column(head, justify="right" if head in "AB" else "left", overflow="fold")
        for row in rows.to_dict("records"):
            metric = f"{row['metric']} {row['subject'] or ''}".strip()
            values = ("" if row[side] != row[side] else f"{row[side]:.4g}" for side in "ab")
            engine = f"{row['engine']} {row['profile']}"
            texts = (row["scenario"], engine, metric, *values, str(row["reason"])[:WIDEST])
            table.add_row(*map(Text, texts))  # no markup: names are the user's
        out.print(table)
