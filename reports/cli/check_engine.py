"""`touchstone check-engine`: whether an adapter meets the contract, fault by fault in words."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    LIMIT_BROKEN,
    Format,
    FormatOption,
    PrintedOutOption,
    QuietOption,
    engine_installed,
    output_to,
    stop,
)


def check_engine(
    name: Annotated[str, typer.Argument(help="An engine, or module:Class of one that is not installed.")],
    profile: Annotated[str, typer.Option(help="Profile (default: the first of the engine).")] = "",
    out: PrintedOutOption = None,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Play small scenes with known outcomes on an engine; say what its adapter does wrong."""
    from touchstone.reports.cli.listing import show_rows

    engine = engine_installed(name)
    rows: list[dict[str, object]] = []
    at_once = output is Format.table and not quiet
    with output_to(out):
        _check(engine, profile, rows, at_once)
        if output is not Format.table:
            show_rows(rows, output)
    faults = [row for row in rows if row["verdict"] == "fault"]
    for row in faults if quiet else ():
        print(f"fault: {row['check']}: {row['finding']}", file=sys.stderr)
    if faults:
        raise typer.Exit(LIMIT_BROKEN)


def _check(engine: str, profile: str, rows: list[dict[str, object]], at_once: bool) -> None:
    """Append the findings of all checks to `rows`, and print each as soon as it is known."""
    from touchstone.adapters.conformance.check import check
    from touchstone.adapters.contract import AdapterError

    try:
        for report in check(engine, profile):
            lines = [("fault", fault) for fault in report.faults]
            lines += [("not checked", report.skipped)] if report.skipped else []
            for verdict, text in lines or [("ok", "")]:
                rows.append({"check": report.check, "verdict": verdict, "finding": text})
                if at_once:
                    print(f"{verdict:12}{report.check:16}{text}".rstrip(), flush=True)
    except AdapterError as error:
        stop(str(error), BAD_INPUT)
