"""The narrow-phase contract: Detector, Batch, Query, Answers, and the registry of detectors.

Conventions: two convex pieces with poses in the world. Distance is signed, negative in overlap [m]; the unit
normal points from A to B. A detector that reports nothing says so with NaN: it sees no contact. Shapes and
poses are handed over before a query is timed; what an engine does again inside its own call counts.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import AdapterError, Array, Scalar, Unsupported
from touchstone.scenarios.scenario import Piece, Sphere

Pair = tuple[Piece, Piece]
"""Pieces A and B, posed in the world: boxes, spheres and hulls."""

TOUCHING = (Piece("a", Sphere(0.5)), Piece("b", Sphere(0.5), (0.9, 0.0, 0.0)))
APART = (Piece("a", Sphere(0.5)), Piece("b", Sphere(0.5), (1.5, 0.0, 0.0)))
"""Spheres [m]: where a detector has a closed form for them, a query costs little but its crossing."""
UNSUPPORTED, THREW, UNCONVERGED = FAILURES = ("unsupported", "threw", "unconverged")
"""How a query may fail: the detector cannot represent a piece, raised an exception, or says itself that its
answer did not converge (the answer counts all the same)."""


class Failure(NamedTuple):
    """Why a query has no answer or no good one: one of FAILURES, and the message."""

    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class Answers:
    """What a batch of n queries gave: distance (n,) [m] and normal (n, 3), NaN where nothing is reported;
    `failures` by the number of the query; `held` (n,) where a motion is followed: whether the answer of the
    frame before, posed anew, was proved to be this frame's."""

    distance: Array
    normal: Array
    failures: Mapping[int, Failure]
    held: NDArray[np.bool_] | None = None


class Batch(Protocol):
    """Prepared queries."""

    def ask(self) -> Array:
        """Ask every query once, in order; seconds of each (n,), NaN where it failed."""

    def answers(self) -> Answers:
        """What the last `ask` gave."""

    def close(self) -> None:
        """Free what the queries hold."""


class Detector(Protocol):
    """A narrow phase. `crossings` are two pairs whose queries cost little but the crossing from Python,
    results handed back included: one apart, one touching; None where a whole batch crosses once."""

    crossings: tuple[Pair, Pair] | None

    def prepare(self, pairs: Sequence[Pair]) -> Batch:
        """Hand pairs over to the engine."""

    def describe(self) -> Mapping[str, Scalar]:
        """Version and settings, read back where the engine tells them."""


@runtime_checkable
class Follower(Detector, Protocol):
    """A detector that gains from the answers of the frame before."""

    def follow(self, pairs: Sequence[Pair], frame: int) -> Batch:
        """Hand a motion over: every `frame` pairs are those of one frame, in the same order in each."""


class Query(NamedTuple):
    """`ask` is the engine's own call; `read` turns what it returned into (distance, normal), or None where
    it reports nothing."""

    ask: Callable[[], Any]
    read: Callable[[Any], tuple[float, Array] | None]


class PythonBatch:
    """Queries asked one by one from Python."""

    def __init__(self, build: Callable[[Pair], Query], pairs: Sequence[Pair], close: Callable[[], Any]):
        self._queries = [_guarded(build, pair) for pair in pairs]
        self._found: list[Any] = []
        self._close = close

    def ask(self) -> Array:
        seconds = np.full(len(self._queries), np.nan)
        self._found = []
        for k, query in enumerate(self._queries):
            if isinstance(query, Failure):
                self._found.append(query)
                continue
            ask = query.ask
            try:
                start = perf_counter()
                found = ask()
                seconds[k] = perf_counter() - start
            except Exception as error:
                found = Failure(THREW, _first_line(error))
            self._found.append(found)
        return seconds

    def answers(self) -> Answers:
        distance, normal = np.full(len(self._found), np.nan), np.full((len(self._found), 3), np.nan)
        failures = {}
        for k, (query, found) in enumerate(zip(self._queries, self._found)):
            if isinstance(found, Failure):
                failures[k] = found
            elif not isinstance(query, Failure) and (told := query.read(found)) is not None:
                distance[k], normal[k] = told
        return Answers(distance, normal, failures)

    def close(self) -> None:
        self._queries, self._found = [], []
        self._close()


def _guarded(build: Callable[[Pair], Query], pair: Pair) -> Query | Failure:
    try:
        return build(pair)
    except Unsupported as error:
        return Failure(UNSUPPORTED, str(error))
    except Exception as error:
        return Failure(THREW, _first_line(error))


def _first_line(error: Exception) -> str:
    return next(iter(f"{type(error).__name__}: {error}".splitlines()))


def unit(vector: Array) -> Array:
    """The vector at length 1; zeros stay zeros."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else vector


@dataclass(frozen=True, slots=True)
class Entry:
    """A detector's "module:Class", the arguments of the class, the package it needs and the extra that
    brings it ("": the project itself does); `profile` is "exact", "default" or "tight"."""

    implementation: str
    package: str
    extra: str = ""
    profile: str = "default"
    options: tuple[Scalar, ...] = ()


REFERENCE = "reference.exact"
DETECTORS: dict[str, Entry] = {
    REFERENCE: Entry("touchstone.adapters.detectors.reference:ReferenceDetector", "numba", profile="exact"),
    "reference.walk": Entry("touchstone.adapters.detectors.reference:WalkDetector", "numba", profile="exact"),
    "python-fcl": Entry("touchstone.adapters.detectors.fcl:FclCollide", "fcl"),
    "python-fcl.distance": Entry("touchstone.adapters.detectors.fcl:FclDistance", "fcl"),
    "coal": Entry("touchstone.adapters.detectors.coal:CoalDetector", "coal"),
    "coal.tight": Entry("touchstone.adapters.detectors.coal:CoalDetector", "coal", "", "tight", (True,)),
    "mujoco": Entry("touchstone.adapters.detectors.mujoco:MujocoDetector", "mujoco", "mujoco"),
    "mujoco.tight": Entry(
        "touchstone.adapters.detectors.mujoco:MujocoDetector", "mujoco", "mujoco", "tight", (True,)
    ),
    "bullet": Entry("touchstone.adapters.detectors.bullet:BulletDetector", "pybullet", "bullet"),
    "bullet.tight": Entry(
        "touchstone.adapters.detectors.bullet:BulletDetector", "pybullet", "bullet", "tight", (True,)
    ),
    "dart.fcl": Entry("touchstone.adapters.detectors.dart:DartDetector", "dartpy", "dart", options=("fcl",)),
    "dart.bullet": Entry(
        "touchstone.adapters.detectors.dart:DartDetector", "dartpy", "dart", options=("bullet",)
    ),
    "dart.dart": Entry(
        "touchstone.adapters.detectors.dart:DartDetector", "dartpy", "dart", options=("dart",)
    ),
}


def missing_reason(name: str) -> str:
    """Why a detector is skipped, or "" when its package can be found; imports nothing."""
    entry = DETECTORS[name]
    if importlib.util.find_spec(entry.package) is not None:
        return ""
    wanted = f"'touchstone[{entry.extra}]'" if entry.extra else "touchstone"
    return f"not installed (pip install {wanted})"


def load(name: str) -> Detector:
    """The detector called `name`; raises AdapterError where its package is missing."""
    if reason := missing_reason(name):
        raise AdapterError(f"{name}: {reason}")
    entry = DETECTORS[name]
    module, _, attribute = entry.implementation.partition(":")
    detector: Detector = getattr(importlib.import_module(module), attribute)(*entry.options)
    return detector
