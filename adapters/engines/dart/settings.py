"""Table of DART's settings that `--set` changes.

dartpy binds no setter of DART's contact error reduction (0.01, at most 1 mm/s); its only position correction
that can be chosen is `split_impulse`.
"""

from __future__ import annotations

from touchstone.adapters.engines.dart import ENTRY
from touchstone.adapters.knobs import Choice, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, equal-step, default, accurate."""
SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "solver",
            {"dantzig": 0, "pgs": 1, "nsgs": 2, "fbf": 3},
            ("dantzig", "dantzig", "dantzig", "nsgs"),
            "solver of contacts: boxed directions (dantzig, pgs) or circular cones (nsgs, fbf)",
        ),
        Choice(
            "detector",
            {"fcl": 0, "bullet": 1, "dart": 2, "ode": 3},
            ("",) * len(PROFILES),
            "collision detector; by default fcl, or bullet where fcl is wrong or only primitives meet",
        ),
        Range(
            "iterations",
            1,
            1e7,
            "",
            ("",) * len(PROFILES),
            "largest number of sweeps: pgs 30, nsgs 100, fbf by default; dantzig has none",
        ),
        Range(
            "tolerance",
            0,
            1,
            "",
            ("",) * len(PROFILES),
            "change at which pgs (1e-6), nsgs (1e-5) or fbf stops; dantzig has none",
            whole=False,
        ),
        Choice(
            "split_impulse",
            {"off": 0, "on": 1},
            ("off",) * len(PROFILES),
            "whether the error reduction of overlap leaves velocities as they are",
        ),
    ),
)
