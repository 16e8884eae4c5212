"""A value that others published of a scene, and its measure on the motion of an engine or a closed form."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import known
from touchstone.scenarios.truths.body_motion import Motion

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Quantity = Literal[
    "distance",
    "velocity",
    "spin",
    "tilt",
    "precession",
    "turning",
    "radius",
    "momentum",
    "wave",
    "reach",
    "force",
]
UNITS: dict[str, str] = {
    "distance": "m",
    "velocity": "m/s",
    "spin": "rad/s",
    "tilt": "rad",
    "precession": "rad/s",
    "turning": "rad/s",
    "radius": "m",
    "momentum": "kg m2/s",
    "wave": "m/s",
    "reach": "m",
    "force": "N",
}
MOMENT = 1e-9
"""Rounding of a frame's time [s]."""
TOPPLED = 0.15
"""Tilt at which a wave has passed a body [rad]: it is larger than that of bodies that stand and shake."""
FRONT = 0.95
"""Share of bodies behind the front of a heap [1]: single ones roll on."""
EVERY = "*"
"""End of a name that stands for all bodies whose names begin so."""


@dataclass(frozen=True, slots=True)
class Published:
    """A published `value` [`unit`] of `body`'s motion from `start` to `end` [s], known to `tolerance`.

    `source`: author, year, place and equation; where sources disagree, it says how. Quantities:
    distance: between the centres of mass at start and end; velocity and spin: the component along `along`
    (world), to which the spin adds the one along `along_body` (body frame), where it is largest in size;
    tilt: the largest angle between the body's z axis and the vertical; precession: mean rate at which the
    body's z axis turns about the vertical; turning: that of the velocity; radius: speed over spin at the end;
    momentum: that about the centre of mass along `along` and `along_body`, at the end; wave: distance of
    the first places of `body` and `other` over the time from the one's tilt to the other's; reach: how much
    farther along `along` the front of the bodies `body*` is at the end, ahead of which one of twenty lies
    (FRONT); force: mean normal force between `body` and `other`, each of which may be `name*`. The first
    two are relative to `other` where it is given.

    `outcomes` names the values of laws that disagree, or of what else may happen: what is measured belongs to
    the nearest.
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
    outcomes: tuple[tuple[str, float], ...] = ()

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return UNITS[self.quantity]

    def outcome(self, value: float) -> str:
        """Name of the outcome nearest to a measured value; none where none is named."""
        return min(self.outcomes, key=lambda one: abs(one[1] - value), default=("", 0.0))[0]

    def measured(
        self, times: Array, motion: Motion, other: Motion | None = None, inertia: Matrix | None = None
    ) -> float:
        """The quantity of one body, or of two, at `times` (n,) [s], which include `start` and `end`; a
        reach and a force, which many bodies have, are measured elsewhere.

        Args:
            motion: of `body`.
            other: of the body called so.
            inertia: of `body` about its centre of mass [kg m2, body frame]; only a momentum needs it.
        """
        chosen = (times >= self.start - MOMENT) & (times <= self.end + MOMENT)
        place, velocity = motion.position[chosen], motion.velocity[chosen]
        if other is not None and self.quantity in ("distance", "velocity"):
            place, velocity = place - other.position[chosen], velocity - other.velocity[chosen]
        spin = motion.angular_velocity[chosen]
        turned = Rotation.from_quat(motion.orientation[chosen], scalar_first=True)
        axis, length, along = turned.apply((0.0, 0.0, 1.0)), self.end - self.start, np.array(self.along)
        moving = along + turned.apply(self.along_body)
        measures: dict[str, Callable[[], float]] = {
            "distance": lambda: float(np.linalg.norm(place[-1] - place[0])),
            "velocity": lambda: _largest(velocity @ along),
            "spin": lambda: _largest((spin * moving).sum(axis=1)),
            "tilt": lambda: float(_tilts(motion.orientation[chosen]).max()),
            "precession": lambda: _turned(axis) / length,
            "turning": lambda: _turned(velocity) / length,
            "radius": lambda: float(np.linalg.norm(velocity[-1]) / np.linalg.norm(spin[-1])),
            "momentum": lambda: float(
                turned[-1].apply(np.array(inertia) @ turned[-1].inv().apply(spin[-1])) @ moving[-1]
            ),
            "wave": lambda: _wave(times, motion, other),
        }
        return measures[self.quantity]()


def members(name: str, names: Sequence[str]) -> list[int]:
    """Places in `names` of the body of a name, or of all whose names begin as `name*`."""
    begins = name.removesuffix(EVERY)
    return [k for k, one in enumerate(names) if one == name or (begins != name and one.startswith(begins))]


def check_published(
    published: tuple[Published, ...], names: list[str], duration: float, report: Callable[[str, str], None]
) -> None:
    """Report faults of the published values of a scene with bodies of these names."""
    for i, one in enumerate(published):
        path = f"published[{i}]"
        known("quantity", one.quantity, get_args(Quantity), f"{path}.quantity", report)
        for field in ("body", "other"):
            name = getattr(one, field)
            if not members(name, names) and (name or field == "body"):
                report(f"{path}.{field}", f"unknown body {name!r}; valid: {', '.join(names)}")
        if one.quantity in ("wave", "force") and not one.other:
            report(f"{path}.other", f"a {one.quantity} is between two bodies; valid: {', '.join(names)}")
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


def _tilts(orientation: Array) -> Array:
    """Angles between the z axes of orientations (n, 4) and the vertical [rad]."""
    x, y, z = Rotation.from_quat(orientation, scalar_first=True).apply((0.0, 0.0, 1.0)).T
    return np.asarray(np.arctan2(np.hypot(x, y), z))


def _wave(times: Array, first: Motion, second: Motion | None) -> float:
    """Distance of two first places over the time between the moments at which the bodies are TOPPLED."""
    assert second is not None
    passed = []
    for one in (first, second):
        tilt = _tilts(one.orientation)
        if tilt.max() <= TOPPLED:
            return 0.0
        k = int(np.argmax(tilt > TOPPLED))
        passed.append(float(np.interp(TOPPLED, tilt[k - 1 : k + 1], times[k - 1 : k + 1])))
    return float(np.linalg.norm(second.position[0] - first.position[0]) / (passed[1] - passed[0]))
