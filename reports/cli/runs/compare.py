"""`touchstone compare`: what changed from one run to another."""

from __future__ import annotations

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    LIMIT_BROKEN,
    Format,
    FormatOption,
    PrintedOutOption,
    QuietOption,
    output_to,
    printed,
    stop,
)

PLACE = ("scenario", "engine", "profile", "metric", "subject")


class Matching(StrEnum):
    """Columns that are compared."""

    exact = "exact"
    profile = "profile"


def compare(
    run_a: Annotated[Path, typer.Argument(help="Folder of the earlier run.")],
    run_b: Annotated[Path, typer.Argument(help="Folder of the later run.")],
    tolerance: Annotated[
        Path | None, typer.Option(help="TOML or JSON file of tolerances per metric, after the default ones.")
    ] = None,
    metric: Annotated[
        list[str] | None, typer.Option(help="Compare these metrics alone; patterns such as 'friction.*'.")
    ] = None,
    match: Annotated[
        Matching,
        typer.Option(
            help="Compare columns of equal profile, settings and step (exact), or of equal profile."
        ),
    ] = Matching.exact,
    allow_gone: Annotated[
        bool,
        typer.Option("--allow-gone", help="Accept that run B lacks scenes, engines or figures of run A."),
    ] = False,
    every: Annotated[
        bool, typer.Option("--all", help="Show changes within limits and new rows too.")
    ] = False,
    out: PrintedOutOption = None,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Show what changed beyond intervals, limits and tolerances; exit 1 if anything is worse or gone."""
    from touchstone.reports.changes import FAILING, KINDS, SHOWN, changes, tolerances
    from touchstone.reports.cli.scenes.chosen import metrics_for
    from touchstone.reports.compare.stored import RunError, table_of
    from touchstone.scenarios.files.read import SceneFileError

    try:
        one, two = table_of(run_a), table_of(run_b)
        if metric:
            wanted = metrics_for(metric)
            one, two = (frame[frame.metric.isin(wanted) | (frame.metric == "run")] for frame in (one, two))
        found = changes(one, two, tolerances(tolerance), match is Matching.profile)
    except (RunError, SceneFileError) as error:
        stop(str(error), BAD_INPUT)
    counts = {kind: int((found.kind == kind).sum()) for kind in KINDS}
    failing = ["worse"] if allow_gone else FAILING
    with output_to(out):
        if not printed(found[SHOWN], output) and not quiet:
            from touchstone.reports.compare.show import show_changes

            show_changes(found if every else found[found.kind.isin([*FAILING, "better"])])
            listed = ", ".join(f"{count} {kind}" for kind, count in counts.items())
            print(f"{len(one)} and {len(two)} rows: {listed}")
    for row in found[found.kind.isin(failing)].to_dict("records") if quiet else ():
        place = " ".join(filter(None, (row[name] for name in PLACE)))
        print(f"{row['kind']}: {place}: {row['reason']}", file=sys.stderr)
    if counts["worse"] or (counts["gone"] and not allow_gone):
        raise typer.Exit(LIMIT_BROKEN)
