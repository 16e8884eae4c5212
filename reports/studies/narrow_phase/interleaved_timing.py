"""Interleaved timing of detectors: each runs in a process of its own, and all answer the same queries in
turn.

Variations of the machine's speed therefore affect all detectors equally.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from touchstone.adapters.contract import MISSING, Array
from touchstone.adapters.detectors import Failure, Pair, missing_reason
from touchstone.adapters.detectors import load as load_detector
from touchstone.adapters.detectors.children import Child, Loader, Times
from touchstone.reports.progress import Progress


class Stretch(NamedTuple):
    """Queries `first` to `end` - 1, passed together: frames of `frame` queries each, or unrelated ones
    (0)."""

    first: int
    end: int
    frame: int = 0


@dataclass(slots=True)
class Answered:
    """Results of a detector: distance (n,) [m] and normal (n, 3), NaN where it reports none; seconds of each
    query (n,) and of the crossings, apart and touching (c, 2); failures by pair; version and settings.
    `ended`: verdict and reason of a detector that stopped. `held` (n,): whether the answer in a motion was
    certified from the previous frame's, NaN where this was not requested."""

    distance: Array
    normal: Array
    seconds: Array
    crossing: list[Array] = field(default_factory=list)
    failures: dict[int, Failure] = field(default_factory=dict)
    facts: Mapping[str, object] = field(default_factory=dict)
    ended: tuple[str, str] | None = None
    held: Array = field(default_factory=lambda: np.zeros(0))

    def net(self, distance: Array) -> Array:
        """Seconds per query without the crossing. The crossing depends on the true `distance` (n,): results
        of an overlap cost more to return."""
        apart, touching = np.median(np.concatenate(self.crossing), axis=0)
        contact = np.isfinite(self.distance) & (distance < 0)
        return np.asarray(self.seconds - np.where(contact, touching, apart))


def measure(
    names: Iterable[str],
    pairs: Sequence[Pair],
    stretches: Iterable[Stretch],
    turns: int,
    passes: int,
    output: Path,
    progress: Progress,
    loader: Loader = load_detector,
) -> dict[str, Answered]:
    """Run every query on every detector `turns` times `passes` times; a query's time is the median of all.

    Args:
        output: folder of the output of the detectors' processes.
        progress: receives the detector and its number of finished queries.
    """
    n = len(pairs)
    nothing = np.full(n, np.nan)
    measured = {
        name: Answered(nothing.copy(), np.full((n, 3), np.nan), nothing.copy(), held=nothing.copy())
        for name in names
    }
    children = []
    for name, mine in measured.items():
        if reason := missing_reason(name):
            mine.ended = (MISSING, reason)
            progress(name, n)
        else:
            children.append(Child(name, output / f"{name}.txt", loader))
    try:
        for child in children:
            child.send("load")
        for child in children:
            progress(f"{child.name}: load", 0)
            measured[child.name].facts = child.receive() or {}
        for stretch in stretches:
            _stretch(children, pairs, stretch, turns, passes, measured, progress)
        for child in children:
            measured[child.name].ended = child.failure
    finally:
        for child in children:
            child.stop()
    return measured


def _stretch(
    children: Sequence[Child],
    pairs: Sequence[Pair],
    stretch: Stretch,
    turns: int,
    passes: int,
    measured: dict[str, Answered],
    progress: Progress,
) -> None:
    part = slice(stretch.first, stretch.end)
    for child in children:
        child.send("prepare", (pairs[part], stretch.frame))
    for child in children:
        child.receive()
    times: dict[str, list[Times]] = {child.name: [] for child in children}
    for _ in range(turns):
        for child in children:
            if (taken := child.ask("time", passes)) is not None:
                times[child.name].append(taken)
    for child in children:
        mine, answers = measured[child.name], child.ask("answers")
        progress(child.name, stretch.end - stretch.first)
        if answers is None:
            continue
        mine.distance[part], mine.normal[part] = answers.distance, answers.normal
        if answers.held is not None:
            mine.held[part] = answers.held
        mine.failures.update({part.start + k: failure for k, failure in answers.failures.items()})
        mine.seconds[part] = np.median(np.concatenate([taken.query for taken in times[child.name]]), axis=0)
        mine.crossing += [taken.crossing for taken in times[child.name]]
