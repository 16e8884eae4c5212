"""Interface of narrow phases (Detector, Batch, Query, Answers), and the registry of detectors.

Conventions: a pair is two convex pieces with world poses. Distance is signed, negative in overlap [m]; the
unit normal points from A to B. NaN means that a detector reports no contact. Shapes and poses are passed to
the engine before a query is timed; what an engine repeats inside its own call counts.
"""

import importlib
import importlib.util
import shlex
from abc import ABC, abstractmethod
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
"""Separated spheres [m]: a detector with a closed form for them spends little more than the call overhead."""
FRAME_STEP = 0.01
"""Motion of B since the previous frame, for warm starts: translation relative to the smaller piece's size
[1], and rotation [rad]; half a millimetre for a part of the hand."""
UNSUPPORTED, THREW, UNCONVERGED = FAILURES = ("unsupported", "threw", "unconverged")
"""Reasons of failed queries: the detector cannot represent a piece, raised an exception, or reports that its
answer did not converge (the answer still counts)."""


class Failure(NamedTuple):
    """Reason why a query has no answer or a bad one: one of FAILURES, and the message."""

    kind: str
    reason: str


@dataclass(frozen=True, slots=True)
class Answers:
    """Results of a batch of n queries.

    Distance (n,) [m] and normal (n, 3) are NaN if nothing is reported; `failures` maps a query's index to its
    failure. For a motion, `held` (n,) marks queries whose moved previous answer was certified.
    """

    distance: Array
    normal: Array
    failures: Mapping[int, Failure]
    held: NDArray[np.bool_] | None = None


class Batch(Protocol):
    """Prepared queries."""

    def ask(self) -> Array:
        """Run every query once, in order; returns the time of each (n,) [s], NaN if it failed."""

    def answers(self) -> Answers:
        """Results of the last `ask`."""

    def close(self) -> None:
        """Release the queries' resources."""


class Detector(Protocol):
    """A narrow phase. `crossings` are two pairs, one apart and one touching, whose queries measure the call
    overhead from Python, results included; None if a whole batch is one call."""

    crossings: tuple[Pair, Pair] | None

    def prepare(self, pairs: Sequence[Pair]) -> Batch:
        """Pass pairs to the engine."""

    def describe(self) -> Mapping[str, Scalar]:
        """Version and settings, read back if the engine reports them."""


@runtime_checkable
class Follower(Detector, Protocol):
    """A detector that uses the previous frame's answers (warm start)."""

    def follow(self, pairs: Sequence[Pair], frame: int) -> Batch:
        """Pass a motion to the engine: each run of `frame` pairs is one frame, with the same order in
        each."""


class Query(NamedTuple):
    """`ask` is the engine's own call; `read` converts its result to (distance, normal), or None if it reports
    nothing."""

    ask: Callable[[], Any]
    read: Callable[[Any], tuple[float, Array] | None]


class PythonBatch:
    """Queries called one by one from Python."""

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
            elif not isinstance(query, Failure) and (answer := query.read(found)) is not None:
                distance[k], normal[k] = answer
        return Answers(distance, normal, failures)

    def close(self) -> None:
        self._queries, self._found = [], []
        self._close()


class PythonDetector(ABC):
    """Base of detectors whose queries are called one by one; they define `_query`."""

    crossings: tuple[Pair, Pair] | None = (APART, TOUCHING)

    def prepare(self, pairs: Sequence[Pair]) -> PythonBatch:
        """Build all queries."""
        return PythonBatch(self._query, pairs, self._release)

    @abstractmethod
    def _query(self, pair: Pair) -> Query:
        """Build the query of a pair."""

    def _release(self) -> None:
        """Release what the queries of a batch hold in the engine: by default nothing."""
        return


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
    """Vector normalized to length 1; zeros stay zeros."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else vector


@dataclass(frozen=True, slots=True)
class Entry:
    """A detector's "module:Class", the class's arguments, the required package and what pip installs to get
    it ("": it has the name of the package); `profile` is "exact", "default" or "tight"."""

    implementation: str
    package: str
    requirement: str = ""
    profile: str = "default"
    options: tuple[Scalar, ...] = ()


REFERENCE = "reference.exact"
DETECTORS: dict[str, Entry] = {
    REFERENCE: Entry("touchstone.adapters.detectors.reference:ReferenceDetector", "numba", profile="exact"),
    "reference.walk": Entry("touchstone.adapters.detectors.reference:WalkDetector", "numba", profile="exact"),
    "python-fcl": Entry("touchstone.adapters.detectors.fcl:FclCollide", "fcl", "python-fcl"),
    "python-fcl.distance": Entry("touchstone.adapters.detectors.fcl:FclDistance", "fcl", "python-fcl"),
    "coal": Entry("touchstone.adapters.detectors.coal:CoalDetector", "coal"),
    "coal.warm": Entry("touchstone.adapters.detectors.coal:WarmCoal", "coal"),
    "coal.tight": Entry("touchstone.adapters.detectors.coal:CoalDetector", "coal", "", "tight", (True,)),
    "mujoco": Entry("touchstone.adapters.detectors.mujoco:MujocoDetector", "mujoco"),
    "mujoco.tight": Entry(
        "touchstone.adapters.detectors.mujoco:MujocoDetector", "mujoco", "", "tight", (True,)
    ),
    "bullet": Entry("touchstone.adapters.detectors.bullet:BulletDetector", "pybullet"),
    "bullet.tight": Entry(
        "touchstone.adapters.detectors.bullet:BulletDetector", "pybullet", "", "tight", (True,)
    ),
    "dart.fcl": Entry(
        "touchstone.adapters.detectors.dart:DartDetector", "dartpy", "dartpy<7", options=("fcl",)
    ),
    "dart.bullet": Entry(
        "touchstone.adapters.detectors.dart:DartDetector", "dartpy", "dartpy<7", options=("bullet",)
    ),
    "dart.dart": Entry(
        "touchstone.adapters.detectors.dart:DartDetector", "dartpy", "dartpy<7", options=("dart",)
    ),
}


def missing_reason(name: str) -> str:
    """Why a detector is skipped, or "" if its package can be found; imports nothing."""
    entry = DETECTORS[name]
    if importlib.util.find_spec(entry.package) is not None:
        return ""
    return f"not installed (pip install {shlex.quote(entry.requirement or entry.package)})"


def load(name: str) -> Detector:
    """Load the detector called `name`; raises AdapterError if its package is missing."""
    if reason := missing_reason(name):
        raise AdapterError(f"{name}: {reason}")
    entry = DETECTORS[name]
    module, _, attribute = entry.implementation.partition(":")
    detector: Detector = getattr(importlib.import_module(module), attribute)(*entry.options)
    return detector
