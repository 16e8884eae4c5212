"""Interleaved timing of detectors: each in a process of its own, all on the same queries in turn.

So they share the machine's ups and downs.
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
from touchstone.reports.cli.progress import Progress


class Stretch(NamedTuple):
    """Queries `first` to `end` - 1, handed over together; frame after frame of a motion, each of `frame` of
    them, or unrelated (0)."""

    first: int
    end: int
    frame: int = 0


@dataclass(slots=True)
class Measured:
    """What a detector gave: distance (n,) [m] and normal (n, 3), NaN where nothing is reported; seconds of
    each query (n,) and of the crossings, apart and touching (c, 2); failures by pair; version and settings.
    `ended`: verdict and reason of one that is out; `held` (n,): whether a followed motion's answer was proved
    from that of the frame before, NaN where it was not asked."""

    distance: Array
    normal: Array
    seconds: Array
    crossing: list[Array]
    failures: dict[int, Failure]
    facts: Mapping[str, object]
    ended: tuple[str, str] | None = None
    held: Array = field(default_factory=lambda: np.zeros(0))

    def net(self, distance: Array) -> Array:
        """Seconds per query without the crossing; results of an overlap, by the true `distance` (n,), cost
        more to hand back."""
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
) -> dict[str, Measured]:
    """Ask every detector every query `turns` times `passes` times; a query's time is the median of all.

    Args:
        output: folder of what the detectors' processes print.
        progress: told the detector and how many queries it was done with.
    """
    n = len(pairs)
    measured = {
        name: Measured(
            np.full(n, np.nan),
            np.full((n, 3), np.nan),
            np.full(n, np.nan),
            [],
            {},
            {},
            None,
            np.full(n, np.nan),
        )
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
    measured: dict[str, Measured],
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
            if (told := child.ask("time", passes)) is not None:
                times[child.name].append(told)
    for child in children:
        mine, answers = measured[child.name], child.ask("answers")
        progress(child.name, stretch.end - stretch.first)
        if answers is None:
            continue
        mine.distance[part], mine.normal[part] = answers.distance, answers.normal
        if answers.held is not None:
            mine.held[part] = answers.held
        mine.failures.update({part.start + k: failure for k, failure in answers.failures.items()})
        mine.seconds[part] = np.median(np.concatenate([told.query for told in times[child.name]]), axis=0)
        mine.crossing += [told.crossing for told in times[child.name]]
