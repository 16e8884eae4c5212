"""`touchstone compare`: what changed from one run to another."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import BAD_INPUT, LIMIT_BROKEN, Format, FormatOption, printed, stop


def compare(
    run_a: Annotated[Path, typer.Argument(help="Folder of the earlier run.")],
    run_b: Annotated[Path, typer.Argument(help="Folder of the later run.")],
    tolerance: Annotated[
        Path | None, typer.Option(help="TOML or JSON file of tolerances per metric, after the default ones.")
    ] = None,
    metric: Annotated[
        list[str] | None, typer.Option(help="Compare these metrics alone; patterns such as 'friction.*'.")
    ] = None,
    every: Annotated[
        bool, typer.Option("--all", help="Show changes within limits, new and gone rows too.")
    ] = False,
    output: FormatOption = Format.table,
) -> None:
    """Show what changed beyond intervals, limits and tolerances; exit 1 if anything is worse."""
    from touchstone.reports.cli.scenes.chosen import metrics_for
    from touchstone.reports.compare.changes import KINDS, changes
    from touchstone.reports.compare.stored import RunError, table_of
    from touchstone.reports.compare.tolerances import tolerances
    from touchstone.scenarios.files.read import SceneFileError

    try:
        one, two = table_of(run_a), table_of(run_b)
        allowed = tolerances(tolerance)
    except (RunError, SceneFileError) as error:
        stop(str(error), BAD_INPUT)
    if metric:
        wanted = metrics_for(metric)
        one, two = one[one.metric.isin(wanted)], two[two.metric.isin(wanted)]
    found = changes(one, two, allowed)
    counts = {kind: int((found.kind == kind).sum()) for kind in KINDS}
    if not printed(found, output):
        from touchstone.reports.compare.show import show_changes

        show_changes(found if every else found[found.kind.isin(["worse", "better"])])
        listed = ", ".join(f"{count} {kind}" for kind, count in counts.items())
        print(f"{len(one)} and {len(two)} rows: {listed}")
    if counts["worse"]:
        raise typer.Exit(LIMIT_BROKEN)
