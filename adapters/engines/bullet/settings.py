"""Table of Bullet's settings that `--set` changes; names are pybullet's, but `coordinates` and `sleep`."""

from __future__ import annotations

from touchstone.adapters.engines.bullet import ENTRY
from touchstone.adapters.engines.entry import ACCURATE, DEFAULT, MAXIMAL, SLEEPING
from touchstone.adapters.knobs import Choice, Range, Table

PROFILES = tuple(ENTRY.profiles)
"""Columns of the table: recommended, equal-step, default, accurate, maximal, sleeping."""
OF_BODIES = ("contactProcessingThreshold", "collisionMargin", "frictionAnchor", "coordinates", "sleep")
"""Settings of bodies; the others are arguments of setPhysicsEngineParameter."""
_SWITCH = {"off": 0, "on": 1}


def _all(value: str, **others: str) -> tuple[str, ...]:
    """One value for all profiles but `others`."""
    return tuple(others.get(profile, value) for profile in PROFILES)


def _real(
    name: str, most: float, unit: str, profiles: tuple[str, ...], summary: str, least: float = 0
) -> Range:
    return Range(name, least, most, unit, profiles, summary, whole=False)


SETTINGS = Table(
    PROFILES,
    (
        Choice(
            "constraintSolverType",
            {"si": 1, "pgs": 2, "dantzig": 3},
            _all("si"),
            "sequential impulses, or a complementarity solver: projected Gauss-Seidel or Dantzig's, direct",
        ),
        Choice(
            "coordinates",
            {"multibody": 0, "maximal": 1},
            _all("multibody", **{MAXIMAL: "maximal"}),
            "of free balls and boxes: Featherstone's, or maximal (useMaximalCoordinates)",
        ),
        Range("numSolverIterations", 1, 1e6, "", _all("50"), "sweeps of the sequential impulse solver"),
        _real(
            "solverResidualThreshold", 1, "", _all("1e-07"), "residual of a sweep at which the solver stops"
        ),
        Range(
            "numSubSteps", 0, 1000, "", _all("0"), "parts of a step, each with its own contacts; 0 and 1: one"
        ),
        _real("erp", 1, "", _all("0.2"), "share of a joint's error corrected in a step"),
        _real(
            "contactERP",
            1,
            "",
            _all("0.08", **{ACCURATE: "0.02"}),
            "share of a contact's overlap corrected in a step",
        ),
        _real("frictionERP", 1, "", _all("0.2"), "share of friction's error corrected in a step"),
        _real("contactSlop", 1, "m", _all("1e-05"), "overlap that is not corrected"),
        _real("globalCFM", 1, "", _all("0.0"), "softness of all constraints"),
        _real("warmStartingFactor", 1, "", _all("0.1"), "share of the last step's impulses"),
        Choice("useSplitImpulse", _SWITCH, _all("on"), "deep overlap is corrected without adding velocity"),
        _real(
            "splitImpulsePenetrationThreshold",
            1,
            "m",
            _all("-0.04"),
            "distance below which overlap counts as deep",
            least=-1,
        ),
        Choice("enableConeFriction", _SWITCH, _all("on"), "whether friction is bounded by a circular cone"),
        _real(
            "restitutionVelocityThreshold",
            1e3,
            "m/s",
            _all("0.2", **{ACCURATE: "0.02"}),
            "approach speed below which nothing bounces",
        ),
        _real(
            "contactBreakingThreshold", 1, "m", _all("0.02"), "distance at which a contact point is dropped"
        ),
        _real(
            "contactProcessingThreshold",
            1e30,
            "m",
            _all("", **{ACCURATE: "0.0"}),
            "distance up to which contacts are solved ahead; Bullet's default: any",
        ),
        _real(
            "collisionMargin",
            1,
            "m",
            _all("0.0", **{DEFAULT: "", MAXIMAL: ""}),
            "margin round hulls, not those of links; Bullet's default: 1 mm",
        ),
        Choice(
            "frictionAnchor",
            _SWITCH,
            _all("", **{DEFAULT: "off", MAXIMAL: "off", ACCURATE: "off"}),
            "whether friction corrects the drift of points that stick; recommended: by body",
        ),
        Choice("sleep", _SWITCH, _all("off", **{SLEEPING: "on"}), "bodies at rest are not simulated"),
    ),
)
