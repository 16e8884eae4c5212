"""Tables of generated pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

NOTICE = "<!-- written by `touchstone docs`; do not edit -->"


def table_text(rows: Sequence[Mapping[str, object]], code: Sequence[str] = ()) -> str:
    """A table in Markdown; columns `code` are set as code."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for row in rows:
        cells = [f"{row[head]}".replace("|", "\\|") for head in heads]
        cells = [f"`{cell}`" if head in code and cell else cell for head, cell in zip(heads, cells)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
