"""Table of MuJoCo's settings that `--set` changes; names are those of options, flags and contacts."""

from __future__ import annotations

from touchstone.adapters.engines.entry import ACCURATE, DEFAULT, SLEEPING
from touchstone.adapters.engines.mujoco import ENTRY
from touchstone.adapters.knobs import Choice, Numbers, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, equal-step, default, accurate, sleeping."""
OF_CONTACTS = ("solref", "solimp", "solreffriction", "bounce")
"""Settings of contacts; the others are fields of mjOption and flags."""
FLAGS = {"speculative": "mjENBL_SPECULATIVE", "sleep": "mjENBL_SLEEP"}
"""Settings that are bits of mjOption.enableflags."""
_MOST = 1e9
_SWITCH = {"off": 0, "on": 1}


def _all(value: str, **others: str) -> tuple[str, ...]:
    """One value for all profiles but `others`."""
    return tuple(others.get(profile, value) for profile in PROFILES)


SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "integrator",
            {"Euler": 0, "RK4": 1, "implicit": 2, "implicitfast": 3, "discrete": 4},
            _all("implicitfast", **{DEFAULT: "Euler"}),
            "numerical integrator (mjtIntegrator); discrete: from 3.13 on, implicit in its own contacts",
        ),
        Choice(
            "solver",
            {"PGS": 0, "CG": 1, "Newton": 2},
            _all("Newton"),
            "solver of the constraints (mjtSolver)",
        ),
        Choice(
            "cone",
            {"pyramidal": 0, "elliptic": 1},
            _all("", **{DEFAULT: "pyramidal", ACCURATE: "elliptic"}),
            "friction cone (mjtCone); recommended: elliptic where a scene has friction",
        ),
        Range("iterations", 1, _MOST, "", _all("100"), "largest number of iterations of the solver"),
        Range(
            "tolerance",
            0,
            1,
            "",
            _all("1e-08", **{ACCURATE: "1e-10"}),
            "improvement of the cost at which the solver stops",
            whole=False,
        ),
        Range(
            "impratio",
            1e-3,
            1e6,
            "",
            _all("1.0", **{ACCURATE: "10.0"}),
            "ratio of friction's impedance to that of the normal force",
            whole=False,
        ),
        Range("noslip_iterations", 0, _MOST, "", _all("0"), "iterations of the solver against slip"),
        Range(
            "solref",
            1e-6,
            10,
            "s",
            _all("", **{DEFAULT: "0.02", "equal-step": "0.02"}),
            "time constant of a contact, never below two steps; 2.6 steps where none is set",
            whole=False,
        ),
        Numbers(
            "solimp",
            ((1e-4, 0.9999), (1e-4, 0.9999), (1e-15, 10), (0, 1), (1, 100)),
            _all(
                "0.99:0.99:0.001:0.5:2",
                **dict.fromkeys((DEFAULT, "equal-step"), "0.9:0.95:0.001:0.5:2"),
                **{ACCURATE: "0.95:0.95:0.001:0.5:2"},
            ),
            "impedance of a contact: least, largest, width [m], midpoint, power",
        ),
        Range(
            "solreffriction",
            1e-6,
            10,
            "s",
            _all("", **{ACCURATE: "0.02"}),
            "time constant of friction in explicit pairs; by default that of the normal force",
            whole=False,
        ),
        Range(
            "bounce",
            1e-3,
            1,
            "rad",
            _all("0.4", **{ACCURATE: "0.2"}),
            "largest frequency of a bounce times the step; equal-step, default: fixed by solref",
            whole=False,
        ),
        Choice("speculative", _SWITCH, _all("off"), "contacts ahead of what moves farther than it is thick"),
        Choice("sleep", _SWITCH, _all("off", **{SLEEPING: "on"}), "islands at rest are not simulated"),
    ),
)
