"""`touchstone bench`: cost of the reference, always as a ratio to others measured in the same run."""

from __future__ import annotations

import importlib
from typing import Any

BENCHES = {
    "geometry": "convex depth: time per query of detectors, on single pairs and on a sliding hand",
    "frame": "compiled frames of all scenes: time of every engine over every other",
    "scaling": "exponents: broad phase, balls at rest, vertices of hulls",
}


def load(name: str) -> Any:
    """The module of a bench: `steps()` of progress, `run(folder, progress)`, which measures into a
    folder that appears complete or not at all, and `report(frame)`, its tables and remarks."""
    return importlib.import_module(f"touchstone.reports.bench.{name}")
