"""`touchstone judge`: recordings of a run, judged again."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    Format,
    FormatOption,
    QuietOption,
    exit_for,
    folder_of_now,
    printed,
    progress_for,
    stop,
    tell_failures,
)
from touchstone.reports.cli.scenes.chosen import LimitsOption, limits_for, metrics_for


def judge(
    run: Annotated[Path, typer.Argument(help="Folder of a run, with its recordings.")],
    metric: Annotated[
        list[str] | None, typer.Option(help="Report these metrics alone; patterns such as 'friction.*'.")
    ] = None,
    limits: LimitsOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder of results (default: runs/judged-<time>).")] = None,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Judge the recordings of an earlier run with today's metrics and limits."""
    from touchstone.reports.compare.judge_again import judge as judge_again
    from touchstone.reports.compare.stored import RunError
    from touchstone.reports.metrics.oracles import judge_faults
    from touchstone.reports.output_folder import OutputError

    folder = out or folder_of_now("judged-")
    chosen, of_file = metrics_for(metric or []), limits_for(limits, ())
    count = len(list((run / "recordings").glob("*.npz")))
    command = " ".join(["touchstone", *sys.argv[1:]])
    try:
        with progress_for(count, quiet) as progress:
            results = judge_again(run, folder, progress, chosen, of_file, command)
    except (RunError, OutputError) as error:
        stop(str(error), BAD_INPUT)
    for line in [] if quiet else judge_faults():
        print(line, file=sys.stderr)
    if not printed(results.frame, output) and not quiet:
        from touchstone.reports.views.terminal import console, show

        show(results.frame, console())
        print(f"results: {folder}")
    if quiet:
        tell_failures(results.frame)
    exit_for(results.frame.verdict, by_name=False)
