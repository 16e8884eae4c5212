"""Table of Bullet's settings that `--set` changes; names are pybullet's."""

from __future__ import annotations

from touchstone.adapters.engines.bullet import ENTRY
from touchstone.adapters.knobs import Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, equal-step, default, accurate, maximal."""


def _all(value: str, accurate: str = "") -> tuple[str, ...]:
    """One value for all profiles, or another for `accurate`."""
    return tuple(accurate or value if profile == "accurate" else value for profile in PROFILES)


SETTINGS = Table(
    PROFILES,
    (
        Range("numSolverIterations", 1, 1e6, "", _all("50"), "sweeps of the sequential impulse solver"),
        Range(
            "solverResidualThreshold",
            0,
            1,
            "",
            _all("1e-07"),
            "residual of a sweep at which the solver stops",
            whole=False,
        ),
        Range(
            "numSubSteps", 0, 1000, "", _all("0"), "parts of a step, each with its own contacts; 0 and 1: one"
        ),
        Range("erp", 0, 1, "", _all("0.2"), "share of a joint's error corrected in a step", whole=False),
        Range(
            "contactERP",
            0,
            1,
            "",
            _all("0.08", accurate="0.02"),
            "share of a contact's overlap corrected in a step",
            whole=False,
        ),
        Range(
            "frictionERP", 0, 1, "", _all("0.2"), "share of friction's error corrected in a step", whole=False
        ),
        Range("contactSlop", 0, 1, "m", _all("1e-05"), "overlap that is not corrected", whole=False),
        Range("globalCFM", 0, 1, "", _all("0.0"), "softness of all constraints", whole=False),
        Range("warmStartingFactor", 0, 1, "", _all("0.1"), "share of the last step's impulses", whole=False),
        Range(
            "restitutionVelocityThreshold",
            0,
            1e3,
            "m/s",
            _all("0.2", accurate="0.02"),
            "approach speed below which nothing bounces",
            whole=False,
        ),
    ),
)
