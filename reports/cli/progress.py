"""Progress on standard error: a bar on a terminal, plain lines elsewhere, or nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, int], None]
SCENE = "scene "
"""Start of the label that announces a scene."""


@contextmanager
def bar(total: int) -> Iterator[Progress]:
    """A bar over `total` frames, with the current task and the elapsed time."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description:34}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("start", total=total)

        def step(label: str, frames: int) -> None:
            progress.update(task, description=_first_time(label), advance=frames)

        yield step


@contextmanager
def lines(by_scene: bool = False) -> Iterator[Progress]:
    """One line per task, or with `by_scene` one per scene and one while the reference compiles."""
    seen: set[str] = set()

    def step(label: str, frames: int) -> None:
        text = _first_time(label)
        if label not in seen and not (by_scene and text == label and not label.startswith(SCENE)):
            print(text, file=sys.stderr, flush=True)
        seen.add(label)

    yield step


@contextmanager
def silence() -> Iterator[Progress]:
    """No progress."""
    yield lambda label, frames: None


def _first_time(label: str) -> str:
    compiling = label.startswith("reference") and label.endswith("warm up")
    return f"{label} (compiles once)" if compiling else label
