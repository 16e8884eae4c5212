"""Progress on standard error: a bar on a terminal, plain lines elsewhere, or nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[str, int], None]


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
def lines(total: int) -> Iterator[Progress]:
    """One line whenever the task changes."""
    seen: set[str] = set()

    def step(label: str, frames: int) -> None:
        if label not in seen:
            seen.add(label)
            print(_first_time(label), file=sys.stderr, flush=True)

    yield step


@contextmanager
def silence() -> Iterator[Progress]:
    """No progress."""
    yield lambda label, frames: None


def _first_time(label: str) -> str:
    compiling = label.startswith("reference") and label.endswith("warm up")
    return f"{label} (compiles once)" if compiling else label
