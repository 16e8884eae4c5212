"""What a run costs, before it costs it: memory of its recordings, and time by its first frames."""

from __future__ import annotations

import os
from collections.abc import Sequence
from time import monotonic

from touchstone.reports.cli.progress import Progress
from touchstone.scenarios.scenario import Scenario

NUMBERS_OF_A_BODY = 13
"""Numbers per body and frame in a recording [1]: pose and velocities."""
FIRST_SECONDS = 10.0
"""Time of the first frames, by which the whole run is estimated [s]."""
LONGEST = 3600.0
"""Time of a run above which it must be asked for [s]: the catalogue takes minutes."""
STUDY_LONGEST = 12 * 3600.0
"""The same of a study, a sweep or a bench [s]: a night."""
UNITS = (("years", 365 * 86400.0), ("days", 86400.0), ("hours", 3600.0), ("seconds", 1.0))


class TooLargeError(ValueError):
    """A run takes more time or memory than was asked for; the message says how much."""


def check_memory(scenarios: Sequence[Scenario], columns: int) -> None:
    """Raise TooLargeError if the recordings of a scene do not fit into this machine's memory.

    Args:
        columns: number of engines and profiles that play at a time.
    """
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for scenario in scenarios:
        needed = 8 * NUMBERS_OF_A_BODY * len(scenario.bodies) * scenario.frame_count * columns
        if needed > memory:
            raise TooLargeError(
                f"{scenario.name}: {columns} recordings of {scenario.frame_count} frames take "
                f"{needed / 1e9:.3g} GB, and this machine has {memory / 1e9:.3g} GB; shorten its duration"
            )


def limited(progress: Progress, total: int, longest: float | None = None, unit: str = "frames") -> Progress:
    """A progress over `total` frames, or other units; raises TooLargeError where these take more than
    `longest` [s] (LONGEST)."""
    most = LONGEST if longest is None else longest
    began, done, judged = 0.0, 0, False

    def step(label: str, frames: int) -> None:
        nonlocal began, done, judged
        progress(label, frames)
        if judged or not frames:
            return
        if not began:  # the first frames compile kernels
            began = monotonic()
            return
        done += frames
        elapsed = monotonic() - began
        if elapsed >= FIRST_SECONDS:
            judged = True
            left = elapsed / done * (total - done)
            if left > most:
                raise TooLargeError(f"{total} {unit} would take about {_words(left)}; --yes plays them")

    return step


def _words(seconds: float) -> str:
    unit, size = next((one for one in UNITS if seconds >= one[1]), UNITS[-1])
    return f"{seconds / size:.3g} {unit}"
