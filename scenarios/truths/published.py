"""A value that others published of a scene, and its measure on the motion of an engine or a closed form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.truths.body_motion import Array, Motion

Vector = tuple[float, float, float]
Quantity = Literal["distance", "velocity", "spin", "tilt", "precession", "turning", "radius"]
UNITS: dict[str, str] = {
    "distance": "m",
    "velocity": "m/s",
    "spin": "rad/s",
    "tilt": "rad",
    "precession": "rad/s",
    "turning": "rad/s",
    "radius": "m",
}
MOMENT = 1e-9
"""Rounding of a frame's time [s]."""


@dataclass(frozen=True, slots=True)
class Published:
    """A published `value` [`unit`] of `body`'s motion from `start` to `end` [s], known to `tolerance`.

    `source`: author, year, place and equation; where sources disagree, it says how. Quantities:
    distance: between the centres of mass at start and end; velocity and spin: the component along `along`
    (world), to which the spin adds the one along `along_body` (body frame), where it is largest in size;
    tilt: the largest angle between the body's z axis and the vertical; precession: mean rate at which the
    body's z axis turns about the vertical; turning: that of the velocity; radius: speed over spin at the end.
    The first two are relative to `other` where it is given.
    """

    name: str
    body: str
    quantity: Quantity
    value: float
    tolerance: float
    source: str
    start: float
    end: float
    along: Vector = (1.0, 0.0, 0.0)
    along_body: Vector = (0.0, 0.0, 0.0)
    other: str = ""

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return UNITS[self.quantity]

    def measured(self, times: Array, motion: Motion, other: Motion | None = None) -> float:
        """The quantity of a motion at `times` (n,) [s], which include `start` and `end`; of `other` that
        of the body called so."""
        chosen = (times >= self.start - MOMENT) & (times <= self.end + MOMENT)
        place, velocity = motion.position[chosen], motion.velocity[chosen]
        if other is not None:
            place, velocity = place - other.position[chosen], velocity - other.velocity[chosen]
        spin = motion.angular_velocity[chosen]
        turned = Rotation.from_quat(motion.orientation[chosen], scalar_first=True)
        axis, length, along = turned.apply((0.0, 0.0, 1.0)), self.end - self.start, np.array(self.along)
        moving = along + turned.apply(self.along_body)
        measures: dict[str, Callable[[], float]] = {
            "distance": lambda: float(np.linalg.norm(place[-1] - place[0])),
            "velocity": lambda: _largest(velocity @ along),
            "spin": lambda: _largest((spin * moving).sum(axis=1)),
            "tilt": lambda: float(np.arctan2(np.hypot(axis[:, 0], axis[:, 1]), axis[:, 2]).max()),
            "precession": lambda: _turned(axis) / length,
            "turning": lambda: _turned(velocity) / length,
            "radius": lambda: float(np.linalg.norm(velocity[-1]) / np.linalg.norm(spin[-1])),
        }
        return measures[self.quantity]()


def check_published(
    published: tuple[Published, ...], names: list[str], duration: float, report: Callable[[str, str], None]
) -> None:
    """Report faults of the published values of a scene with bodies of these names."""
    for i, one in enumerate(published):
        path = f"published[{i}]"
        if one.quantity not in get_args(Quantity):
            report(
                f"{path}.quantity",
                f"unknown quantity {one.quantity!r}; valid: {', '.join(get_args(Quantity))}",
            )
        for field in ("body", "other"):
            name = getattr(one, field)
            if name not in names and (name or field == "body"):
                report(f"{path}.{field}", f"unknown body {name!r}; valid: {', '.join(names)}")
        if not np.isfinite(one.value) or not 0 < one.tolerance < np.inf:
            report(f"{path}.value", f"found {one.value:g} to {one.tolerance:g}, expected two numbers")
        if not 0 <= one.start <= one.end <= duration + MOMENT:
            report(f"{path}.start", f"expected 0 <= start <= end <= {duration}")
        if not one.source:
            report(f"{path}.source", "found none, expected author and year")
        if one.name in [other.name for other in published[:i]]:
            report(f"{path}.name", f"{one.name!r} is used twice")


def _largest(values: Array) -> float:
    return float(values[np.argmax(np.abs(values))])


def _turned(vectors: Array) -> float:
    """Angle by which vectors (n, 3) turn about the vertical, less than half a turn from one to the next."""
    angles = np.unwrap(np.arctan2(vectors[:, 1], vectors[:, 0]))
    return float(angles[-1] - angles[0])
