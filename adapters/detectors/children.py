"""One spawned child per detector, so that a crash is one row; its parent lets one of them be timed at a time.

A child's standard output and error go to a file of its own. Commands: `load`, `prepare` (pairs, and how many
of them make a frame), `time` (passes), `answers`. The first that fails ends the child; what it was and why
stands in `failure`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.detectors import Batch, Detector, Follower, Pair, load
from touchstone.adapters.workers.process import PATIENCE, ChildProcess

CROSSINGS = 8
"""Queries of the crossing pair per pass: some, for the first of them pays for cold caches."""

Loader = Callable[[str], Detector]


class Times(NamedTuple):
    """Seconds per pass and query (p, n), and of the crossings per repeat, apart and touching
    (p * CROSSINGS, 2), zeros where a batch crosses once."""

    query: Array
    crossing: Array


class Child(ChildProcess):
    """The parent's end of one detector's process."""

    def __init__(self, name: str, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        super().__init__(_Server, (name, loader), output, patience)
        self.name = name


class _Server:
    """The child's end: a detector and its current batches."""

    def __init__(self, name: str, loader: Loader) -> None:
        self._name, self._loader = name, loader
        self.batch: Batch | None = None
        self.crossing: Batch | None = None

    def handle(self, command: str, argument: Any) -> object:
        """Obey one command; they come in the order below."""
        match command:
            case "load":
                self.detector = self._loader(self._name)
                return dict(self.detector.describe())
            case "prepare":
                self.prepare(*argument)
                return None
            case "time":
                return self.time(argument)
        assert self.batch is not None
        return self.batch.answers()

    def prepare(self, pairs: Sequence[Pair], frame: int) -> None:
        """Hand pairs over, in place of the last ones: a motion where `frame` of them make a frame."""
        for batch in (self.batch, self.crossing):
            if batch is not None:
                batch.close()
        if frame > 0 and isinstance(self.detector, Follower):
            self.batch = self.detector.follow(pairs, frame)
        else:
            self.batch = self.detector.prepare(pairs)
        crossings = self.detector.crossings
        self.crossing = self.detector.prepare(crossings * CROSSINGS) if crossings else None

    def time(self, passes: int) -> Times:
        """Warm up, then time every query once a pass."""
        assert self.batch is not None
        self.batch.ask()
        query = np.array([self.batch.ask() for _ in range(passes)])
        if self.crossing is None:
            return Times(query, np.zeros((passes * CROSSINGS, 2)))
        self.crossing.ask()
        return Times(query, np.concatenate([self.crossing.ask().reshape(-1, 2) for _ in range(passes)]))
