"""The truth of scenes without a closed form: the band that converged solutions of independent codes span."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from touchstone.adapters.contract import Array

SPREAD = 0.05
"""Share of the way of the bodies within which codes agree, and by which half the step may change one [1]:
what a first-order engine at a fitting step may be off (`verdict/limits.py`)."""


@dataclass(frozen=True, slots=True)
class Code:
    """Paths (f, n, 3) [m] of an engine at its finest step, `finer`, and at twice that step."""

    fine: Array
    finer: Array


@dataclass(frozen=True, slots=True)
class Band:
    """Positions per frame and body between those of the codes that agree, per coordinate.

    Attributes:
        codes: those that agree; fewer than two: there is no band, and `low` and `high` are empty.
        low, high: least and largest coordinates (f, n, 3) [m].
        width: largest distance of two of them [m].
        within: distance up to which codes agree and converge [m].
        change: what half the step changes of each code [m].
        outliers: distance from the band [m] of the other converged codes; without a band, from the nearest.
    """

    codes: tuple[str, ...]
    low: Array
    high: Array
    width: float = 0.0
    within: float = 0.0
    outliers: Mapping[str, float] = field(default_factory=dict)
    change: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """One line: who agrees, to what, who is off, who has not converged."""
        off = [f"{name} is {1e3 * far:.3g} mm off" for name, far in self.outliers.items()]
        open_codes = [name for name in self.change if name not in (*self.codes, *self.outliers)]
        said = [
            f"{name} changes by {1e3 * self.change[name]:.3g} mm with half the step" for name in open_codes
        ]
        if self.codes:
            head = f"{', '.join(self.codes)} agree to {1e3 * self.width:.3g} mm"
        elif len(self.outliers) > 1:
            head = f"codes converge to different models, more than {1e3 * self.within:.3g} mm apart"
            off = [f"{name} is {1e3 * far:.3g} mm from the nearest" for name, far in self.outliers.items()]
        else:
            head = f"fewer than two codes converge to {1e3 * self.within:.3g} mm"
            off = []
        return "; ".join([head, *off, *said])


def distance(one: Array, other: Array, horizon: int) -> float:
    """Largest distance of two paths over bodies and frames up to the horizon [m]."""
    return outside(one, other, other, horizon)


def outside(path: Array, low: Array, high: Array, horizon: int) -> float:
    """Largest distance of a path from a band over bodies and frames up to the horizon [m]."""
    last = min(len(path), len(low), horizon + 1)
    beyond = path[:last] - np.clip(path[:last], low[:last], high[:last])
    return float(np.linalg.norm(beyond, axis=-1).max())


def band_of(codes: Mapping[str, Code], horizon: int, least: float, closed: Array | None = None) -> Band:
    """The band of the largest group of converged codes that agree pairwise, of equally large ones the
    narrowest. There is none where as many others agree on something else.

    Args:
        horizon: frame up to which paths are compared.
        least: distance within which codes agree in any case [m].
        closed: the closed form (f, n, 3) [m], which is the band: codes agree if they are near it.
    """
    starts = {name: np.broadcast_to(one.finer[:1], one.finer.shape) for name, one in codes.items()}
    way = float(np.median([distance(one.finer, starts[name], horizon) for name, one in codes.items()]))
    within = max(least, SPREAD * way)
    change = {name: distance(one.fine, one.finer, horizon) for name, one in codes.items()}
    paths = {name: one.finer for name, one in codes.items() if change[name] <= within}
    apart = {
        frozenset((one, other)): distance(paths[one], paths[other], horizon)
        for one, other in combinations(paths, 2)
    }
    if closed is not None:
        group = tuple(name for name in paths if distance(paths[name], closed, horizon) <= within)
        low = high = closed
    else:
        group = _agreeing(tuple(paths), apart, within)
        if not group:
            far = {name: min((apart[p] for p in apart if name in p), default=np.inf) for name in paths}
            nothing = np.zeros((0, 0, 3))
            return Band((), nothing, nothing, 0.0, within, far, change)
        low, high = (bound([paths[name] for name in group], axis=0) for bound in (np.min, np.max))
    outliers = {name: outside(paths[name], low, high, horizon) for name in paths if name not in group}
    return Band(group, low, high, _width(group, apart), within, outliers, change)


def _width(group: Sequence[str], apart: Mapping[frozenset[str], float]) -> float:
    return max((apart[frozenset(pair)] for pair in combinations(group, 2)), default=0.0)


def _agreeing(names: Sequence[str], apart: Mapping[frozenset[str], float], within: float) -> tuple[str, ...]:
    """The largest group of two or more within a distance; empty if there is none, or a rival one."""
    for size in range(len(names), 1, -1):
        found = [group for group in combinations(names, size) if _width(group, apart) <= within]
        if found:
            best = min(found, key=lambda group: _width(group, apart))
            return () if any(not set(best) & set(group) for group in found) else best
    return ()
