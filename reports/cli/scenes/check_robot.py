"""`touchstone check-robot`: what is wrong with a robot's file, one line each with the remedy."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    ENGINE_MISSING,
    LIMIT_BROKEN,
    Format,
    FormatOption,
    PrintedOutOption,
    QuietOption,
    output_to,
    require_judge,
    stop,
)
from touchstone.reports.cli.scenes.chosen import AllowPathsOption


def check_robot(
    robot: Annotated[Path, typer.Argument(help="File of a robot: URDF or MJCF.")],
    allow_paths: AllowPathsOption = False,
    out: PrintedOutOption = None,
    output: FormatOption = Format.table,
    quiet: QuietOption = False,
) -> None:
    """Name what is wrong with a robot: hulls, overlap, inertia, limits, drives, grip; exit 1 on a fault.

    A line each, with what was measured and the remedy. `--quiet` prints faults only.
    """
    from touchstone.adapters.registry import installed, missing_reason

    if not installed("mujoco"):
        stop(f"check-robot needs MuJoCo: {missing_reason('mujoco')}", ENGINE_MISSING)
    require_judge()
    from touchstone.adapters.robots.checks.check import CHECKS, findings
    from touchstone.adapters.robots.checks.finding import FAULT
    from touchstone.adapters.robots.robot_error import RobotError
    from touchstone.reports.cli.listing import show_rows

    try:
        found = list(findings(robot, allow_paths))
    except RobotError as error:
        stop(str(error), BAD_INPUT)
    faults = [one for one in found if one.verdict == FAULT]
    if quiet:
        for one in faults:
            print(f"fault: {one.check}: {one.line}", file=sys.stderr)
    else:
        with output_to(out):
            if output is Format.table:
                for one in found:
                    print(f"{one.verdict:6}{one.check:9}{one.line}")
                for check in CHECKS:
                    if all(one.check != check for one in found):
                        print(f"{'ok':6}{check}")
            else:
                names = ("verdict", "check", "subject", "text", "remedy")
                show_rows([{name: getattr(one, name) for name in names} for one in found], output)
    if faults:
        raise typer.Exit(LIMIT_BROKEN)
