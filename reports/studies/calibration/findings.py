"""Findings and page of the study `calibration`: the run's numbers and the mechanisms behind them."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from touchstone.reports.results import rows_of
from touchstone.reports.run.request import step_text
from touchstone.reports.studies.calibration.scenes import HEIGHT, G
from touchstone.reports.studies.calibration.table import NOTES, Values, grids, remarks

DART_BOUNCE = 0.1
"""DART bounces where e v is above this (DART_BOUNCING_VELOCITY_THRESHOLD, ContactSurface.hpp) [m/s]."""
BULLET_MARGIN = 0.02
"""Share of a body's size within which Bullet generates contacts (getContactBreakingThreshold) [1]."""
BULLET_BOUNCE = 0.2
"""Bullet's default restitutionVelocityThreshold [m/s]."""

Finding = Callable[[Values, pd.DataFrame], str]


def findings(frame: pd.DataFrame) -> list[str]:
    """One line per finding whose numbers are all in the frame."""
    values = Values(frame)
    lines = [finding(values, frame) for finding in FINDINGS]
    return [line for line in lines if line and "nan" not in line]


def _reference_lowest(values: Values, frame: pd.DataFrame) -> str:
    rest = 2 * G * values.step("reference")
    return (
        f"reference: bounces from {values.lowest('reference'):.3f} m/s on, by its own law: e fades evenly "
        f"from 4 g h = {2 * rest:.3f} m/s to none at 2 g h = {rest:.3f} m/s, with a quarter of it at "
        f"2.5 g h = {1.25 * rest:.3f} m/s"
    )


def _dart_lowest(values: Values, frame: pd.DataFrame) -> str:
    least = DART_BOUNCE - 1.5 * G * values.step("dart")
    return (
        f"dart: bounces from {values.lowest('dart'):.3f} m/s on: it has no bounce unless e v > "
        f"{DART_BOUNCE:g} m/s, where v has fallen on past the surface, for half a step here, and holds one "
        f"more step of gravity: {DART_BOUNCE:g} - 1.5 g h = {least:.3f} m/s. dartpy has no setter. A bounce "
        "gains about 2 g h / v, for gravity pulls in the step before it, not in its own"
    )


def _dart_cone(values: Values, frame: pd.DataFrame) -> str:
    first, accurate = (values.share(column, "box-box", 45.0) for column in values.both("dart"))
    return (
        f"dart: {first:.3f} of mu at 45 degrees, for each of two directions may have all of mu: sqrt(2) "
        f"together. The cone of its NSGS solver is circular (accurate): {accurate:.3f}"
    )


def _bullet_steps(values: Values, frame: pd.DataFrame) -> str:
    drops = [r for r in rows_of(frame[frame.metric == "restitution.drop"]) if r.engine == "bullet"]
    if not drops:
        return ""
    found = ", ".join(f"{r.value:.2f} at {step_text(r.dt)} s" for r in drops)
    accurate = values(("bullet", "accurate"), "sphere-box", "restitution.achieved", "e=1 v=1")
    return (
        f"bullet: loses restitution as the step shrinks: e = 1 from a fall of 0.5 m returns {found}. "
        "Contacts are found before bodies touch, within "
        f"{BULLET_MARGIN:.0%} of their size ({1e3 * _margin():g} mm here), and brake a body "
        "so that it just arrives at the end of the step; what speed it has left is what bounces. Long steps "
        "jump over that margin; they gain by position correction and by a step "
        "without gravity. contactProcessingThreshold = 0 (accurate) takes the margin away: e = 1 returns "
        f"{accurate:.2f} at 1 m/s. Bodies of shifted pieces (compounds) have no margin to begin with"
    )


def _bullet_lowest(values: Values, frame: pd.DataFrame) -> str:
    braked = _margin() / (1.5 * values.step("bullet"))
    return (
        f"bullet: bounces from {values.lowest('bullet'):.3f} m/s on; below restitutionVelocityThreshold = "
        f"{BULLET_BOUNCE:g} m/s not at all, and below {braked:.3f} m/s it needs more than a step and a half "
        "through the margin and is braked twice"
    )


def _margin() -> float:
    """Bullet's margin round the bodies of the study [m]."""
    return BULLET_MARGIN * HEIGHT


def _bullet_cone(values: Values, frame: pd.DataFrame) -> str:
    column, _ = values.both("bullet")
    sphere, box = (values.share(column, pair, 45.0) for pair in ("sphere-box", "box-box"))
    return (
        f"bullet: {sphere:.3f} of mu at 45 degrees under a sphere, {box:.3f} under a box: each point of a "
        "face is on its cone, but in a direction of its own, and they do not add up"
    )


def _bullet_hulls(values: Values, frame: pd.DataFrame) -> str:
    first, accurate = (1e3 * values(column, "hull-box", "gap.rest") for column in values.both("bullet"))
    bias = values(("bullet", "accurate"), "hull-box", "restitution.bias.max")
    return (
        f"bullet: hulls rest {first:.2f} mm high, {accurate:.2f} mm without collisionMargin (accurate). A "
        "hull that lands flat is found one point a step and begins to spin: its restitution is off by up to "
        f"{bias:.2f} even so"
    )


def _mujoco_spring(values: Values, frame: pd.DataFrame) -> str:
    first, accurate = (
        values(column, "sphere-box", "restitution.achieved", "e=0.3 v=5") for column in values.both("mujoco")
    )
    return (
        f"mujoco: e = 0.3 returns {first:.3f} at 5 m/s: a damped spring that may not pull lets go while "
        f"still compressed. Allowing for that, with a stiff contact (accurate): {accurate:.3f}; slow bodies "
        "return less, for they let go below the surface and climb out against gravity"
    )


def _mujoco_cone(values: Values, frame: pd.DataFrame) -> str:
    column, accurate = values.both("mujoco")
    slowest = f"mu={min(values.frictions, default=0):g} heading=45"
    return (
        f"mujoco: {1 + values(column, 'box-box', 'friction.bias', slowest):.3f} of mu at 45 degrees for the "
        "slowest box: the default cone is a pyramid with its edges over the axes, and its sides are "
        "1 / sqrt(2) = 0.707 from its middle. Faster bodies hop, for friction also lifts them. Elliptic "
        f"cone, friction damped by itself (accurate): "
        f"{values.share(accurate, 'box-box', 45.0):.3f} on average"
    )


FINDINGS: tuple[Finding, ...] = (
    _reference_lowest,
    _dart_lowest,
    _dart_cone,
    _bullet_steps,
    _bullet_lowest,
    _bullet_cone,
    _bullet_hulls,
    _mujoco_spring,
    _mujoco_cone,
)


def report(frame: pd.DataFrame) -> str:
    """The study as a page."""
    parts = ["# touchstone study calibration", ""]
    for grid in grids(frame):
        rule = ["---", *["---:"] * (len(grid.heads) - 1)]
        lines = ["| " + " | ".join(row) + " |" for row in (grid.heads, rule, *grid.rows)]
        parts += [f"## {grid.title[0].upper()}{grid.title[1:]}", "", *lines, ""]
    parts += [*(f"{note}." for note in NOTES), "", "![Asked and achieved](calibration.png)", ""]
    parts += ["## Findings", "", *(f"- {line}." for line in findings(frame)), "", "## Remarks", ""]
    parts += [f"- {line}" for line in remarks(frame)] or ["none"]
    return "\n".join(parts) + "\n"
