"""Cells of the study `stability` drawn at random, played again and shown as pictures, to be judged by eye.

The pictures do not tell the classes: `sheet.csv` does, by number, with the command that plays each cell.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.recording import load
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.reports.cli.progress import Progress
from touchstone.reports.results import write_beside
from touchstone.reports.studies.stability.measure import KEPT, play_all
from touchstone.reports.studies.stability.play import Cell, Played
from touchstone.reports.studies.stability.sheet_picture import Shown, sheet_picture
from touchstone.scenarios.difficulty.family import hard_scene

PER_SHEET = 20
"""Cells of one picture."""
UNSEEN = ("skipped", "error")
"""Classes of cells that have no recording."""


def drawn(played: Mapping[Cell, Played], count: int, seed: int) -> list[Cell]:
    """Cells with a run, each as likely as any other."""
    seen = [cell for cell, found in played.items() if found.outcome.name not in UNSEEN]
    order = np.random.default_rng(seed).permutation(len(seen))
    return [seen[k] for k in order[:count].tolist()]


def write_sheets(
    played: Mapping[Cell, Played], count: int, seed: int, folder: Path, progress: Progress
) -> pd.DataFrame:
    """Play cells drawn at random again, and write `sheet-1.png`, ... and `sheet.csv` into `folder`.

    Returns:
        One row per cell: number, scene, engine, profile, step [s], class, reason and command.
    """
    cells = drawn(played, count, seed)
    shown, rows = [], []
    with scratch_folder() as scratch:
        before = os.environ.get(KEPT)
        os.environ[KEPT] = str(scratch / "recordings")
        try:
            again = play_all(cells, scratch / "store", progress)
        finally:
            os.environ.pop(KEPT)
            if before is not None:
                os.environ[KEPT] = before
        for number, cell in enumerate(cells, 1):
            path = scratch / "recordings" / cell.file
            found, settings = again[cell].outcome, cell.settings
            recording = load(path) if path.exists() else None
            shown.append(Shown(number, cell.scene, settings.dt, hard_scene(cell.scene)[0], recording))
            facts = (number, cell.scene, cell.engine, settings.profile, settings.dt)
            rows.append((*facts, found.name, found.reason, again[cell].line))
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(0, len(shown), PER_SHEET):
        part = shown[k : k + PER_SHEET]
        write_beside(folder / f"sheet-{k // PER_SHEET + 1}.png", partial(sheet_picture, part))
    columns = ["number", "scene", "engine", "profile", "dt", "outcome", "reason", "command"]
    frame = pd.DataFrame(rows, columns=columns)
    write_beside(folder / "sheet.csv", lambda part: frame.to_csv(part, index=False))
    return frame
