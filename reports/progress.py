"""Progress on standard error: a bar on a terminal, plain lines elsewhere, or nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from math import inf
from time import monotonic

Progress = Callable[[str, int], None]
SCENE = "scene "
"""Start of the label that announces a scene."""
STUDY = "study "
"""Start of the label that announces a study of a night."""
ABOUT = "about "
"""Start of the label that says how long a run may take."""
COMPILING = "compiling "
"""Start of the label that says how far an engine's compilation is."""
COMPILING_SECONDS = 15.0
"""Interval between two lines about a compilation [s]."""


class ShownBar:
    """A bar on a terminal, with the current task, elapsed and remaining time; called as a Progress."""

    def __init__(self, total: int) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )
        from rich.progress import Progress as Bar

        columns = (
            TextColumn("{task.description:34}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
        )
        # Without the last option rich would send standard output, the program's own, to this console.
        self.shown = Bar(*columns, console=Console(stderr=True), transient=True, redirect_stdout=False)
        self._task = self.shown.add_task("start", total=total)

    def __call__(self, label: str, frames: int) -> None:
        self.shown.update(self._task, description=label, advance=frames)


@contextmanager
def bar(total: int) -> Iterator[Progress]:
    """A bar over `total` frames."""
    progress = ShownBar(total)
    with progress.shown:
        yield progress


@contextmanager
def stepping_aside(progress: Progress) -> Iterator[None]:
    """Hide a bar meanwhile, so that something else can be printed."""
    if not isinstance(progress, ShownBar):
        yield
        return
    progress.shown.stop()
    try:
        yield
    finally:
        progress.shown.start()


@contextmanager
def lines(by_scene: bool = False) -> Iterator[Progress]:
    """One line per task, or with `by_scene` one per scene and study, an estimate of a long run's time, and
    now and then a line while an engine compiles."""
    seen: set[str] = set()
    compiling = -inf

    def step(label: str, frames: int) -> None:
        nonlocal compiling
        if label.startswith(COMPILING):
            if monotonic() < compiling + COMPILING_SECONDS:
                return
            compiling = monotonic()
        elif by_scene and not label.startswith((SCENE, STUDY, ABOUT)):
            return
        if label not in seen:
            with suppress(OSError):  # results do not depend on who reads this
                print(label, file=sys.stderr, flush=True)
        seen.add(label)

    yield step


def quietly(label: str, frames: int) -> None:
    """No progress."""
