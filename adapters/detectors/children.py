"""Child processes of the detectors, one each, so that a crash affects one row; the parent times one at a
time.

A child's standard output and error go to a file. Commands: `load`, `prepare` (pairs, and number of pairs per
frame), `time` (passes), `answers`. The first failing command ends the child; `failure` holds its name and
reason.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.detectors import Batch, Detector, Follower, Pair, load
from touchstone.adapters.workers.process import PATIENCE, ChildProcess

CROSSINGS = 8
"""Queries of the crossing pair per pass: several, because the first one finds cold caches."""

Loader = Callable[[str], Detector]


class Times(NamedTuple):
    """Times per pass and query (p, n), and of the crossings per repeat, apart and touching (p * CROSSINGS, 2)
    [s]; the latter are zero if a batch is one call."""

    query: Array
    crossing: Array


class Child(ChildProcess):
    """Parent's end of one detector's process."""

    def __init__(self, name: str, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        super().__init__(_Server, (name, loader), output, patience)
        self.name = name


class _Server:
    """Child's end: a detector and its current batches."""

    def __init__(self, name: str, loader: Loader) -> None:
        self._name, self._loader = name, loader
        self.batch: Batch | None = None
        self.crossing: Batch | None = None

    def handle(self, command: str, argument: Any) -> object:
        """Execute one command; the commands come in the order below."""
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
        """Replace the prepared pairs; with `frame` they are a motion of `frame` pairs per frame."""
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
        """Warm up, then time every query once per pass."""
        assert self.batch is not None
        self.batch.ask()
        query = np.array([self.batch.ask() for _ in range(passes)])
        if self.crossing is None:
            return Times(query, np.zeros((passes * CROSSINGS, 2)))
        self.crossing.ask()
        return Times(query, np.concatenate([self.crossing.ask().reshape(-1, 2) for _ in range(passes)]))
