"""Table of documented failings, each with its cause and the command that shows it. Failings are strict.

Their upper bounds are in `bounds.csv`.
"""

from __future__ import annotations

from touchstone.reports.known_failures import bullet as known_bullet
from touchstone.reports.known_failures import dart as known_dart
from touchstone.reports.known_failures import drake as known_drake
from touchstone.reports.known_failures import mujoco as known_mujoco
from touchstone.reports.known_failures import reference as known_reference
from touchstone.reports.known_failures.cause import Cause, Known

CALIBRATION = tuple(
    Known(
        metric,
        "reference",
        known_reference.SEQUENTIAL,
        pair,
        "paper",
        reproduce="touchstone study calibration --engine reference",
        chaotic=True,
    )
    for metric in ("friction.bias.max", "restitution.bias.max")
    for pair in ("all", "box-box", "hull-box")
)
CAUSES: tuple[Cause, ...] = (
    *known_reference.CAUSES,
    *known_dart.CAUSES,
    *known_bullet.CAUSES,
    *known_mujoco.CAUSES,
    *known_drake.CAUSES,
)
KNOWN: tuple[Known, ...] = (*CALIBRATION, *(known for cause in CAUSES for known in cause.known()))
