"""Series over the frames of a scene, with their contacts, plateaus and first contacts.

Frame 1, which fills caches, is left out: index 0 of a series is the second displayed frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.scenarios.scenario import Scenario

COLLISION, REMOVAL = "collision", "removal"
"""Stages: detection in both loops; overlap removal with inverse kinematics, without detection."""
PASSES, JOINTS, PAIRS, TESTED = "ccd.passes", "ik.joints", "pairs.contacting", "pairs"
SKIPPED = 1
"""Frames at the start without a figure: they fill caches [1]."""
RISE = 1.25
"""Least ratio of two levels of a curve that differ [1]: a quarter is seen in a plot."""
LONG, BRIEF = 0.5, 1.0
"""Least duration of a plateau, and largest one of a break between two [s]."""
FIRST, SETTLED = 0.1, 0.3
"""A first contact lasts until FIRST; the frames from then to SETTLED are those after it [s]."""
FLICKER = 3
"""Gaps of contact of so many frames or fewer are none [1]: a twentieth of a second is not seen."""
Run = tuple[int, int]
"""First index of a stretch, and the one after its last."""


@dataclass(frozen=True, slots=True)
class Series:
    """A scene over its frames: their ends [s], their seconds and those of each stage (medians over the
    plays), and counters. `recording` is of one play, all frames included."""

    scenario: Scenario
    recording: Recording
    time: Array
    frame: Array
    stages: Mapping[str, Array]
    counts: Mapping[str, Array]

    @property
    def contacts(self) -> list[Run]:
        """Stretches in which pairs of the driven body are in contact."""
        return runs(self.counts[PAIRS] > 0)

    @property
    def total(self) -> Array:
        """Seconds of all stages per frame."""
        return np.sum(list(self.stages.values()), axis=0)

    def share(self, stage: str, chosen: NDArray[np.bool_] | None = None) -> float:
        """Share of a stage in the time of all stages, over all or the chosen frames [1]."""
        where = slice(None) if chosen is None else chosen
        return float(self.stages[stage][where].sum() / self.total[where].sum())


def series_of(scenario: Scenario, plays: Sequence[Recording]) -> Series:
    """The series of several recordings of one scene in one process."""
    one = plays[0]
    frame = np.median([play.time_frame for play in plays], axis=0)
    stages = np.median([play.stage_seconds for play in plays], axis=0)
    return Series(
        scenario,
        one,
        one.time[1 + SKIPPED :],
        frame[SKIPPED:],
        {str(name): stages[SKIPPED:, k] for k, name in enumerate(one.stage_names)},
        {str(name): one.work[SKIPPED:, k] for k, name in enumerate(one.work_names)},
    )


def runs(flags: NDArray[np.bool_], gap: int = FLICKER) -> list[Run]:
    """Stretches of true frames, joined over gaps of up to `gap` frames."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    found: list[Run] = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist()):
        if found and first - found[-1][1] <= gap:
            first = found.pop()[0]
        found.append((first, end))
    return found


def is_plateau(part: Array, free: float) -> bool:
    """Whether a curve rises over its `free` level and stays: three quarters of the frames are RISE times as
    high, and the medians of both halves differ by less than RISE."""
    first, second = halves(part)
    return bool(np.quantile(part, 0.25) >= RISE * free and max(first, second) < RISE * min(first, second))


def halves(part: Array) -> tuple[float, float]:
    """Medians of both halves of a curve."""
    middle = len(part) // 2
    return float(np.median(part[:middle])), float(np.median(part[middle:]))


def plateaus(curve: Array, contacts: Sequence[Run], rate: int) -> list[Run]:
    """Stretches of contact that last LONG and are plateaus of a curve of `rate` frames per second, over its
    median before all contact."""
    if not contacts or contacts[0][0] == 0:
        return []
    free = float(np.median(curve[: contacts[0][0]]))
    return [(a, b) for a, b in contacts if b - a >= LONG * rate and is_plateau(curve[a:b], free)]


def first_contact(curve: Array, first: int, rate: int) -> tuple[float, float]:
    """Peak of a curve within FIRST of a contact, and its median from there to SETTLED."""
    early, late = first + round(FIRST * rate), first + round(SETTLED * rate)
    return float(curve[first:early].max()), float(np.median(curve[early:late])) if early < len(curve) else 0.0


def thirds(work: Array, answer: Array) -> tuple[list[float], list[float]]:
    """Medians of `work` and of `answer` in the thirds of the frames in the order of their work."""
    order = np.argsort(work, kind="stable")
    low, high = (
        [float(np.median(part)) for part in np.array_split(values[order], 3)] for values in (work, answer)
    )
    return low, high
