"""`touchstone bench`: cost of the reference, always as a ratio to others measured in the same run."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

import pandas as pd

from touchstone.reports.progress import Progress
from touchstone.reports.views.render import Part

BENCHES = {
    "geometry": "convex depth: time per query of detectors, on single pairs and on a sliding hand",
    "frame": "compiled frames of all scenes: time of every engine over every other",
    "scaling": "exponents: broad phase, balls at rest, vertices of hulls",
}
"""Name -> measured quantity."""


class Bench(Protocol):
    """A module of this package."""

    steps: Callable[[], int]
    """Steps of progress of a whole run."""
    run: Callable[[Path, Progress], pd.DataFrame]
    """Measure, and store all in a folder that appears complete or not at all."""
    report: Callable[[pd.DataFrame], list[Part]]
    """Tables and remarks."""


def load(name: str) -> Bench:
    """The bench called `name`."""
    bench: Bench = importlib.import_module(f"touchstone.reports.bench.{name}")
    return bench
