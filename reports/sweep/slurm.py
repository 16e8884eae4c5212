"""Script of a Slurm array job whose tasks play a part of a sweep's cells each, into one store."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

from touchstone.reports.sweep.cells import Cell

TASKS_MOST = 64
"""Largest number of tasks of an array."""


class PartError(ValueError):
    """A part that is none; the message says what is valid."""


def script(arguments: Sequence[str], cells: int) -> str:
    """Text of the script.

    Args:
        arguments: of `touchstone sweep`, without those of the script itself.
        cells: number of cells of the sweep.
    """
    tasks = max(1, min(cells, TASKS_MOST))
    command = shlex.join(["touchstone", "sweep", *arguments])
    return "\n".join(
        [
            "#!/bin/bash",
            f"# {cells} cells in {tasks} tasks; finished cells are skipped, so the job may be sent again.",
            "#SBATCH --job-name=touchstone-sweep",
            f"#SBATCH --array=0-{tasks - 1}",
            "#SBATCH --ntasks=1",
            "#SBATCH --cpus-per-task=1",
            "#SBATCH --output=touchstone-sweep-%A_%a.txt",
            "set -euo pipefail",
            f'exec {command} --jobs 1 --quiet --part "$SLURM_ARRAY_TASK_ID/{tasks}"',
            "",
        ]
    )


def part_of(cells: Sequence[Cell], text: str) -> list[Cell]:
    """Every n-th cell from the k-th on, for "k/n"; raises PartError."""
    try:
        number, _, count = text.partition("/")
        k, n = (int(number), int(count)) if text.isascii() else (-1, 0)
    except ValueError:
        k, n = -1, 0
    if not 0 <= k < n:
        raise PartError(f"--part {text}: expected K/N with K from 0 to N - 1")
    return list(cells[k::n])
