"""Table of the reference's settings, one row each, with the value in every profile.

A setting is a field of the reference's state on which the kernels branch at run time. A profile is a column
of the table and nothing more, but for `paper`, which is a frame of its own without settings. The module
imports no kernel, so the command line can check `--set KEY=VALUE` quickly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from touchstone.adapters.contract import Scalar
from touchstone.adapters.knobs import Choice, Range, Setting, Table
from touchstone.reference_impl.core import conventions

PAPER = "paper"
"""The pipeline as printed (`reference_impl/paper`)."""
COLUMNS = ("balanced", "accurate")
"""Profiles of our own frame: columns of the table."""
PROFILES = (PAPER, *COLUMNS)
EQUAL = "equal-step"
"""`balanced` at a step of its own."""


_TABLE: tuple[Setting, ...] = (
    Range(
        "v_rest",
        0,
        1e3,
        "m/s",
        ("0.009", "0.001"),
        "approach speed up to which nothing bounces, where 2 g h of a frame is not less",
        whole=False,
    ),
    Choice(
        "detection",
        {
            "discrete": conventions.DETECTION_DISCRETE,
            "sweep_fast": conventions.DETECTION_FAST,
            "sweep": conventions.DETECTION_SWEEP,
        },
        ("sweep_fast", "sweep"),
        "overlap at the end of a substep; sweeps too of pairs that move farther than both are thick; of all",
    ),
    Range(
        "impact_gap",
        1e-13,
        5e-7,
        "m",
        ("5e-07", "2e-12"),
        "gap at which an impact is found, free of overlap",
        whole=False,
    ),
    Range(
        "contact_turn",
        1e-3,
        0.5,
        "rad",
        ("0.03", "0.005"),
        "largest turn of a curved contact within half a substep",
        whole=False,
    ),
    Range(
        "joint_error",
        1e-14,
        1e-3,
        "",
        ("1e-09", "1e-12"),
        "error of a step of bodies that joints connect, in positions of joints [m or rad]",
        whole=False,
    ),
    Choice(
        "removal",
        {"eq1": conventions.REMOVAL_EQ1, "least_motion": conventions.REMOVAL_LEAST_MOTION},
        ("eq1", "least_motion"),
        "translation out of several overlaps: Eq. 1, or the smallest",
    ),
    Choice(
        "depth",
        {"certified": conventions.DEPTH_CERTIFIED, "exact": conventions.DEPTH_EXACT},
        ("certified", "certified"),
        "walked from the frame before where that is proved to be exact, or computed from scratch",
    ),
    Range(
        "attraction_parts",
        1,
        64,
        "",
        ("8", "8"),
        "parts of a frame in which chains go towards the tracker, each with its own overlap removal",
    ),
    Range(
        "event_rows",
        0,
        1e9,
        "",
        ("512", "16384"),
        "contacts of moving bodies that the substeps of a frame hold in total before a few crowded ones",
    ),
    Range(
        "factor_work",
        0,
        1e12,
        "",
        ("1500000", "100000000"),
        "multiplications of a factorisation up to which an island is solved to rounding; beyond, by sweeps",
    ),
    Range(
        "frame_work",
        0,
        1e15,
        "",
        ("600000000", "1500000000"),
        "multiplications of factorisations in a frame after which solves that fail are not tried again",
    ),
)
SETTINGS = Table(
    (*COLUMNS, EQUAL),
    (replace(row, profiles=(*row.profiles, row.profiles[COLUMNS.index("balanced")])) for row in _TABLE),
    bare={
        PAPER: "it has the numbers of the scene alone, K (stiffness) and R (damping) of a tracker, "
        "e (restitution) and mu (friction) of a pair of materials"
    },
)


def configure(state: Any, profile: str, changed: Sequence[str] = ()) -> None:
    """Write a profile and its changes ("key=value") into the state record; nothing for `paper`."""
    if SETTINGS.is_bare(profile):
        return
    column = SETTINGS.column(profile)
    for setting in SETTINGS.values():
        state[setting.name] = setting.number(setting.profiles[column])
    for name, number in SETTINGS.numbers(changed).items():
        state[name] = number


def describe(state: Any) -> dict[str, Scalar]:
    """Value of every setting in the state record."""
    return {name: setting.word(state[name]) for name, setting in SETTINGS.items()}
