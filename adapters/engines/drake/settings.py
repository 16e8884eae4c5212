"""Table of Drake's settings that `--set` changes, named as in MultibodyPlant and SceneGraphConfig."""

from __future__ import annotations

from touchstone.adapters.engines.drake import ENTRY
from touchstone.adapters.knobs import Choice, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: point, sap, tamsi."""
_MOST = 1e12
SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "approximation",
            {"tamsi": 0, "sap": 1, "similar": 2, "lagged": 3},
            ("lagged", "sap", "tamsi"),
            "discrete contact approximation, and with it the solver",
        ),
        Range(
            "point_stiffness",
            1.0,
            _MOST,
            "N/m",
            ("1000000.0",) * 3,
            "of every geometry; a contact has that of both in series, whatever the masses",
            whole=False,
        ),
        Range(
            "hunt_crossley_dissipation",
            0.0,
            _MOST,
            "s/m",
            ("50.0",) * 3,
            "a contact loses energy in proportion to force and approach",
            whole=False,
        ),
        Range(
            "relaxation_time",
            0.0,
            1e3,
            "s",
            ("0.1",) * 3,
            "of the linear dissipation, which sap has",
            whole=False,
        ),
        Range(
            "stiction_tolerance",
            1e-12,
            10.0,
            "m/s",
            ("0.001",) * 3,
            "slip at the edge of the friction cone",
            whole=False,
        ),
        Range(
            "sap_near_rigid_threshold",
            0.0,
            1e3,
            "",
            ("1.0",) * 3,
            "stiffness beyond which a contact of sap is made softer; 0: none is",
            whole=False,
        ),
    ),
    idle={
        "hunt_crossley_dissipation": ("approximation", "sap"),
        "stiction_tolerance": ("approximation", "sap"),
        "relaxation_time": ("approximation", "tamsi", "similar", "lagged"),
        "sap_near_rigid_threshold": ("approximation", "tamsi", "similar", "lagged"),
    },
)
