"""Table of MuJoCo's settings that `--set` changes; names are those of MuJoCo's options and contacts."""

from __future__ import annotations

from touchstone.adapters.engines.mujoco import ENTRY
from touchstone.adapters.knobs import Choice, Numbers, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, equal-step, default, accurate."""
OF_CONTACTS = ("solref", "solimp")
"""Settings of contacts; the others are fields of mjOption."""
_MOST = 1e9
SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "integrator",
            {"Euler": 0, "RK4": 1, "implicit": 2, "implicitfast": 3},
            ("implicitfast", "implicitfast", "Euler", "implicitfast"),
            "numerical integrator (mjtIntegrator)",
        ),
        Choice(
            "solver",
            {"PGS": 0, "CG": 1, "Newton": 2},
            ("Newton",) * 4,
            "solver of the constraints (mjtSolver)",
        ),
        Choice(
            "cone",
            {"pyramidal": 0, "elliptic": 1},
            ("", "", "pyramidal", "elliptic"),
            "friction cone (mjtCone); recommended: elliptic where a scene has friction",
        ),
        Range("iterations", 1, _MOST, "", ("100",) * 4, "largest number of iterations of the solver"),
        Range(
            "tolerance",
            0,
            1,
            "",
            ("1e-08", "1e-08", "1e-08", "1e-10"),
            "improvement of the cost at which the solver stops",
            whole=False,
        ),
        Range(
            "impratio",
            1e-3,
            1e6,
            "",
            ("1.0", "1.0", "1.0", "10.0"),
            "ratio of friction's impedance to that of the normal force",
            whole=False,
        ),
        Range("noslip_iterations", 0, _MOST, "", ("0",) * 4, "iterations of the solver against slip"),
        Range(
            "solref",
            1e-6,
            10,
            "s",
            ("0.02", "0.02", "0.02", ""),
            "time constant of a contact, never below two steps; accurate: as stiff as the step allows",
            whole=False,
        ),
        Numbers(
            "solimp",
            ((1e-4, 0.9999), (1e-4, 0.9999), (1e-15, 10), (0, 1), (1, 100)),
            ("0.9:0.95:0.001:0.5:2",) * 3 + ("0.95:0.95:0.001:0.5:2",),
            "impedance of a contact: least, largest, width [m], midpoint, power",
        ),
    ),
)
