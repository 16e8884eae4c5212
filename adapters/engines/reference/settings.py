"""Table of the reference's settings, one row each, with the value in every profile (method, section 6).

A setting is a field of the reference's state on which the kernels branch at run time. A profile is a column
of the table and nothing more. The module imports no kernel, so the command line can check `--set KEY=VALUE`
quickly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from touchstone.adapters.contract import Scalar
from touchstone.adapters.knobs import Choice, Range, Setting, Table
from touchstone.reference_impl.core import conventions

PROFILES = ("paper", "balanced", "accurate")
"""Columns of the table."""
EQUAL = "equal-step"
"""`balanced` at a step of its own."""


_TABLE: tuple[Setting, ...] = (
    Choice(
        "friction",
        {"always": conventions.FRICTION_PAPER, "stick": conventions.FRICTION_COULOMB},
        ("always", "stick", "stick"),
        "always mu j (Eq. 10), or at most what stops the sliding",
    ),
    Choice(
        "restitution",
        {"newton": conventions.RESTITUTION_NEWTON, "guarded": conventions.RESTITUTION_GUARDED},
        ("newton", "guarded", "guarded"),
        "Newton's e whatever it does to the energy (Eq. 8), or less for an impact where that would rise",
        field="restitution_law",
    ),
    Choice(
        "impulses",
        {"sequential": conventions.IMPULSES_SEQUENTIAL, "together": conventions.IMPULSES_TOGETHER},
        ("sequential", "together", "together"),
        "contacts that hold one after the other, or all together to a residual; impacts are always in turn",
    ),
    Range(
        "v_rest",
        0,
        1e3,
        "m/s",
        ("1000.0", "0.05", "0.001"),
        "approach speed up to which nothing bounces, where 2 g h of a frame is not less",
        whole=False,
    ),
    Choice(
        "flight",
        {"euler": conventions.FLIGHT_EULER, "exact": conventions.FLIGHT_BALLISTIC},
        ("euler", "exact", "exact"),
        "semi-implicit Euler, or exact for constant forces and free rotation",
    ),
    Choice(
        "detection",
        {
            "discrete": conventions.DETECTION_DISCRETE,
            "sweep_fast": conventions.DETECTION_FAST,
            "sweep": conventions.DETECTION_SWEEP,
        },
        ("discrete", "sweep_fast", "sweep"),
        "overlap at the end of a substep; sweeps too of pairs that move farther than both are thick; of all",
    ),
    Range(
        "impact_gap",
        1e-13,
        5e-7,
        "m",
        ("5e-07", "5e-07", "2e-12"),
        "gap at which an impact is found, free of overlap",
        whole=False,
    ),
    Choice(
        "removal",
        {"eq1": conventions.REMOVAL_EQ1, "least_motion": conventions.REMOVAL_LEAST_MOTION},
        ("eq1", "eq1", "least_motion"),
        "translation out of several overlaps: Eq. 1, or the smallest",
    ),
    Choice(
        "depth",
        {
            "walk": conventions.DEPTH_WALK,
            "certified": conventions.DEPTH_CERTIFIED,
            "exact": conventions.DEPTH_EXACT,
        },
        ("walk", "certified", "certified"),
        "walked from the frame before, only where that is proved to be exact, or computed from scratch",
    ),
    Choice(
        "posture",
        {"ccd": conventions.POSTURE_CCD, "least_turn": conventions.POSTURE_LEAST_TURN},
        ("ccd", "least_turn", "least_turn"),
        "chains come free link by link by inverse kinematics, or by the smallest turns for all links at once",
    ),
    Range(
        "attraction_time",
        0,
        1e3,
        "s",
        ("0.1", "0.0", "0.0"),
        "lag of the attraction: in which the way to a tracker that stands still falls to 1 / e",
        whole=False,
    ),
    Range(
        "attraction_parts",
        1,
        64,
        "",
        ("1", "8", "8"),
        "parts of a frame in which chains go towards the tracker, each with its own overlap removal",
    ),
    Choice(
        "angle",
        {"acos": conventions.ANGLE_ACOS, "atan2": conventions.ANGLE_ATAN2},
        ("acos", "atan2", "atan2"),
        "turn of a joint in inverse kinematics (Eq. 5): arc cosine with the axis' sign, or sine and cosine",
    ),
    Choice(
        "passes",
        {"plain": conventions.PASSES_PLAIN, "extrapolated": conventions.PASSES_EXTRAPOLATED},
        ("plain", "extrapolated", "extrapolated"),
        "passes of inverse kinematics as they are, or carried on to where their series would end",
    ),
    Range(
        "event_rows",
        0,
        1e9,
        "",
        ("512", "512", "16384"),
        "contacts that the substeps of a frame hold in total before it goes on in a few crowded ones",
    ),
)
IDLE: Mapping[str, tuple[str, str]] = {
    "angle": ("posture", "least_turn"),
    "passes": ("posture", "least_turn"),
}
"""Setting -> the other setting and the value with which it does nothing."""
SETTINGS = Table(
    (*PROFILES, EQUAL),
    (replace(row, profiles=(*row.profiles, row.profiles[PROFILES.index("balanced")])) for row in _TABLE),
    IDLE,
)


def configure(state: Any, profile: str, changed: Sequence[str] = ()) -> None:
    """Write a profile and its changes ("key=value") into the state record."""
    column = SETTINGS.column(profile)
    for setting in SETTINGS.values():
        state[setting.field or setting.name] = setting.number(setting.profiles[column])
    for name, number in SETTINGS.numbers(changed).items():
        state[SETTINGS[name].field or name] = number


def describe(state: Any) -> dict[str, Scalar]:
    """Value of every setting in the state record that does something there."""
    values = {name: setting.word(state[setting.field or name]) for name, setting in SETTINGS.items()}
    return {name: value for name, value in values.items() if not SETTINGS.is_idle(name, values)}
