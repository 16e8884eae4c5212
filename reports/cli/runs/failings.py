"""`touchstone failings measure`: how large the known failings are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import BAD_INPUT, stop

failings = typer.Typer(no_args_is_help=True, help="Known failings.")


@failings.callback()
def _group() -> None:
    """Known failings: `touchstone list failings` counts them."""


@failings.command()
def measure(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs.")],
) -> None:
    """Write the sizes of the known failings of runs to the table of failings, and print the difference."""
    from touchstone.reports.compare.stored import RunError, table_of
    from touchstone.reports.results import rows_of
    from touchstone.reports.verdict.failings import FILE, FailingsError, read, write
    from touchstone.reports.verdict.measure import difference, measured

    try:
        old = read(FILE)
        new = measured(old, (row for run in runs for row in rows_of(table_of(run))))
    except (RunError, FailingsError) as error:
        stop(str(error), BAD_INPUT)
    changed = list(difference(old, new))
    if changed:
        write(new.values(), FILE)
    print("\n".join([*changed, f"{FILE}: {len(new)} lines, {len(changed)} changed"]))
