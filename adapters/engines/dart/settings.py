"""Table of DART's settings that `--set` changes.

dartpy binds no setter of DART's contact error reduction (0.01, at most 1 mm/s); its only position correction
that can be chosen is `split_impulse`.
"""

from __future__ import annotations

from touchstone.adapters.engines.dart import ENTRY
from touchstone.adapters.engines.entry import ACCURATE, SLEEPING
from touchstone.adapters.knobs import Choice, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, equal-step, default, accurate, sleeping."""
_SWITCH = {"off": 0, "on": 1}


def _all(value: str, **others: str) -> tuple[str, ...]:
    """One value for all profiles but `others`."""
    return tuple(others.get(profile, value) for profile in PROFILES)


SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "solver",
            {"dantzig": 0, "pgs": 1, "nsgs": 2, "fbf": 3},
            _all("dantzig", **{ACCURATE: "nsgs"}),
            "solver of contacts: boxed directions (dantzig, pgs) or circular cones (nsgs, fbf)",
        ),
        Choice(
            "detector",
            {"fcl": 0, "bullet": 1, "dart": 2, "ode": 3},
            _all(""),
            "collision detector; recommended: dart for spheres and boxes, ode or bullet for primitives",
        ),
        Range(
            "iterations",
            1,
            1e7,
            "",
            _all(""),
            "largest number of sweeps: pgs 30, nsgs 100, fbf by default; dantzig has none",
        ),
        Range(
            "tolerance",
            0,
            1,
            "",
            _all(""),
            "change at which pgs (1e-6), nsgs (1e-5) or fbf stops; dantzig has none",
            whole=False,
        ),
        Choice(
            "split_impulse",
            _SWITCH,
            _all("off"),
            "whether the error reduction of overlap leaves velocities as they are",
        ),
        Choice(
            "matrix_free",
            _SWITCH,
            _all("off"),
            "sweeps without the matrix in groups of 193 rows or more (MatrixFreeContactSolverOptions)",
        ),
        Choice(
            "sleep",
            _SWITCH,
            _all("off", **{SLEEPING: "on"}),
            "bodies at rest are not simulated (DeactivationOptions)",
        ),
    ),
)
