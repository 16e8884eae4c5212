"""Plain lists for `touchstone list` and `show`."""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Mapping, Sequence


def show_rows(rows: Sequence[Mapping[str, object]], output: str) -> None:
    """Print rows as a table, JSON or CSV."""
    heads = list(rows[0]) if rows else []
    if output == "json":
        print(json.dumps(list(rows), indent=1))
    elif output == "csv":
        writer = csv.DictWriter(sys.stdout, fieldnames=heads, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    else:
        widths = {head: max(len(head), *(len(str(row[head])) for row in rows)) for head in heads}
        for row in ({head: head for head in heads}, *rows):
            print("  ".join(f"{row[head]!s:{widths[head]}}" for head in heads).rstrip())
