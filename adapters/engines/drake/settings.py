"""Table of Drake's settings that `--set` changes, named as in MultibodyPlant, SceneGraphConfig and
SimulatorConfig."""

from __future__ import annotations

from touchstone.adapters.engines.drake import ENTRY
from touchstone.adapters.knobs import Choice, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, default, sap, tamsi, cenic."""
_MOST = 1e12


def _everywhere(value: str) -> tuple[str, ...]:
    """The same value in every profile."""
    return (value,) * len(PROFILES)


SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "contact_model",
            {"point": 0, "hydroelastic": 1},
            ("hydroelastic", "point", "point", "point", "hydroelastic"),
            "one point a pair, or surfaces on which pressure fields of both bodies are equal",
        ),
        Choice(
            "integrator",
            {"discrete": 0, "cenic": 1},
            ("discrete", "discrete", "discrete", "discrete", "cenic"),
            "fixed steps, or CENIC's steps with error control within a step",
        ),
        Range(
            "accuracy", 1e-10, 1.0, "", _everywhere("0.001"), "relative error of a step of cenic", whole=False
        ),
        Choice(
            "approximation",
            {"tamsi": 0, "sap": 1, "similar": 2, "lagged": 3},
            ("lagged", "lagged", "sap", "tamsi", "lagged"),
            "discrete contact approximation, and with it the solver",
        ),
        Range(
            "hydroelastic_modulus",
            1.0,
            _MOST,
            "Pa",
            _everywhere("10000000.0"),
            "pressure at the middle of every geometry",
            whole=False,
        ),
        Range(
            "resolution_hint",
            1e-6,
            10.0,
            "m",
            _everywhere("0.02"),
            "length of edges in the meshes of curved geometries",
            whole=False,
        ),
        Range(
            "point_stiffness",
            1.0,
            _MOST,
            "N/m",
            _everywhere("1000000.0"),
            "of every geometry; a contact has that of both in series, whatever the masses",
            whole=False,
        ),
        Range(
            "hunt_crossley_dissipation",
            0.0,
            _MOST,
            "s/m",
            _everywhere("50.0"),
            "a contact loses energy in proportion to force and approach",
            whole=False,
        ),
        Range(
            "relaxation_time",
            0.0,
            1e3,
            "s",
            _everywhere("0.1"),
            "of the linear dissipation, which sap has",
            whole=False,
        ),
        Range(
            "stiction_tolerance",
            1e-12,
            10.0,
            "m/s",
            _everywhere("0.0001"),
            "slip at the edge of the friction cone",
            whole=False,
        ),
        Range(
            "sap_near_rigid_threshold",
            0.0,
            1e3,
            "",
            _everywhere("1.0"),
            "stiffness beyond which a contact of sap is made softer; 0: none is",
            whole=False,
        ),
    ),
    idle={
        "accuracy": ("integrator", "discrete"),
        "approximation": ("integrator", "cenic"),
        "hydroelastic_modulus": ("contact_model", "point"),
        "resolution_hint": ("contact_model", "point"),
        "point_stiffness": ("contact_model", "hydroelastic"),
        "hunt_crossley_dissipation": ("approximation", "sap"),
        "stiction_tolerance": ("approximation", "sap"),
        "relaxation_time": ("approximation", "tamsi", "similar", "lagged"),
        "sap_near_rigid_threshold": ("approximation", "tamsi", "similar", "lagged"),
    },
)
