"""`touchstone tolerances`: how far apart the times of runs of one program are."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    Format,
    FormatOption,
    QuietOption,
    printed,
    require_new,
    stop,
    write_file,
)


def tolerances(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs of one program on one machine.")],
    out: Annotated[
        Path | None, typer.Option(help="TOML file to write for `compare --tolerance` (default: none).")
    ] = None,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Measure how far apart times are between runs of one program: the tolerances of `compare` here."""
    from touchstone.reports.cli.listing import show_rows
    from touchstone.reports.compare.measured_times import differences, toml_of
    from touchstone.reports.compare.stored import RunError, table_of

    names = [str(run) for run in dict.fromkeys(runs)]
    if len(names) < 2:
        stop(f"{names[0]}: name two runs or more", BAD_INPUT)
    if out is not None:
        require_new(out)
    try:
        found = differences({name: table_of(Path(name)) for name in names})
    except RunError as error:
        stop(str(error), BAD_INPUT)
    if out is not None:
        write_file(out, lambda part: part.write_text(toml_of(found, names), "utf-8"))
    if not printed(found, output) and not quiet:
        show_rows([_shown(row) for row in found.to_dict("records")], "table")
        if out is not None:
            print(out)


def _shown(row: Mapping[Hashable, Any]) -> dict[str, object]:
    """A row with its shares in per cent."""
    texts = {
        name: f"{100 * row[name]:.3g} %" if isfinite(row[name]) else "not judged"
        for name in ("median", "largest", "tolerance")
    }
    return {"metric": row["metric"], "rows": row["rows"], **texts}
