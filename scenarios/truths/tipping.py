"""A prism that tips from edge to edge on a fixed slope, or rocks on a level one, integrated to rounding.

Conventions: d points down the slope (where it is level, along its x axis), n is its normal, k = n x d the
axis of the prism; the body turns about k by the angle phi. Corners r_i are those of the prism's cross-section
from the centre of mass, at phi = 0.

While it turns about the corner i, (I + m r_i^2) phi'' is the torque of gravity about it. Where the next
corner j, or the one before, meets the slope (e = 0, no slip), the angular momentum about j is kept, and i
lifts off: the rate is multiplied by (I + m r_i . r_j) / (I + m r_j^2).

Sources: McGeer (1990), *Passive dynamic walking*, for the rimless wheel; Housner (1963), *The behavior of
inverted pendulum structures during earthquakes*, for the rocking block.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.integrate import OdeSolution
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import Report
from touchstone.scenarios.scenario import Body, Box, Hull, Scenario
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.integration import integrated

LEVEL = 1e-9
"""Height over the size of the prism below which a corner lies on the slope, and slope below which it is level
[1]: rounding of poses."""


@dataclass(frozen=True, slots=True)
class Phase:
    """Turn about one corner from `start` [s]: its angle and rate over time."""

    start: float
    corner: Array  # (2,) from the centre of mass along d and n at phi = 0 [m]
    pivot: Array  # (2,) from the centre of mass at the start of the scene [m]
    solution: OdeSolution


@dataclass(frozen=True, slots=True)
class Slope:
    """Directions of a slope."""

    d: Array
    n: Array
    k: Array

    @classmethod
    def of(cls, scenario: Scenario) -> Slope:
        """That of the scene's fixed box."""
        fixed = next(one for one in scenario.bodies if one.kind == "fixed")
        level, n = Rotation.from_quat(fixed.orientation, scalar_first=True).as_matrix().T[[0, 2]]
        gravity = np.array(scenario.acting_gravity)
        down = gravity - (n @ gravity) * n
        if np.linalg.norm(down) < LEVEL * np.linalg.norm(gravity):
            down = level
        d = down / np.linalg.norm(down)
        return cls(d, n, np.cross(n, d))

    def along(self, vectors: Array) -> Array:
        """Components of vectors along d and n (..., 2)."""
        return np.stack([vectors @ self.d, vectors @ self.n], axis=-1)


@lru_cache(maxsize=32)
def phases(scenario: Scenario, body: Body) -> tuple[Phase, ...]:
    """Phases of the motion to one frame after the end of the scene."""
    return tuple(_phases(scenario, body))


def _phases(scenario: Scenario, body: Body) -> Iterator[Phase]:
    slope, end = Slope.of(scenario), scenario.duration + 1 / scenario.frame_rate
    corners = _corners(body, slope)
    pull = slope.along(np.array(scenario.acting_gravity))
    turn = Rotation.from_quat(body.orientation, scalar_first=True).as_matrix()
    inertia = float(slope.k @ (turn @ body.inertia @ turn.T) @ slope.k)
    lowest = corners[:, 1] < corners[:, 1].min() + LEVEL * np.ptp(corners)
    first = int(np.argmax(np.where(lowest, corners[:, 0], -np.inf)))
    corners = np.roll(corners, -first, axis=0)
    time, state, pivot = 0.0, np.array([0.0, slope.k @ body.angular_velocity]), corners[0]
    while time < end:
        here = corners[0]

        def rate(_: float, y: Array, r: Array = here) -> Array:
            x, z = -_turned(r, y[0])
            return np.array([y[1], body.mass * (z * pull[0] - x * pull[1]) / (inertia + body.mass * r @ r)])

        # the other ends of two edges come down on the slope
        run = integrated(rate, (time, end), state, [_height(corners[side] - here) for side in (1, -1)])
        yield Phase(time, here, pivot, run.sol)
        time, (phi, omega) = float(run.t[-1]), run.y[:, -1]
        side = 1 if len(run.t_events[0]) else -1
        after = corners[side]
        pivot = pivot + _turned(after - here, phi)
        kept = (inertia + body.mass * here @ after) / (inertia + body.mass * after @ after)
        state, corners = np.array([phi, omega * kept]), np.roll(corners, -side, axis=0)


def tipping(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a prism that tips down a slope."""
    slope, played = Slope.of(scenario), phases(scenario, body)
    index = np.searchsorted([phase.start for phase in played], times, side="right") - 1
    place, pace, turn = np.empty((len(times), 2)), np.empty((len(times), 2)), np.empty((len(times), 2))
    for k, phase in enumerate(played):
        if (mine := index == k).any():
            turn[mine] = phase.solution(times[mine]).T
            arm = _turned(phase.corner, turn[mine, 0]).T
            place[mine] = phase.pivot - arm
            # v = w k x (centre - pivot), with k x d = -n and k x n = d
            pace[mine] = turn[mine, 1:] * np.stack([-arm[:, 1], arm[:, 0]], axis=-1)
    start = Rotation.from_quat(body.orientation, scalar_first=True)
    plane = np.stack([slope.d, slope.n])
    return Motion(
        body.position + start.apply(body.center_of_mass) + place @ plane,
        pace @ plane,
        (Rotation.from_rotvec(np.outer(turn[:, 0], slope.k)) * start).as_quat(scalar_first=True),
        np.outer(turn[:, 1], slope.k),
    )


def check_tipping(scenario: Scenario, body: Body, path: str, report: Report) -> None:
    """Report what the law does not cover: other supports, other shapes."""
    fixed = [one.pieces[0].shape for one in scenario.bodies if one.kind == "fixed"]
    if len(fixed) != 1 or not isinstance(fixed[0], Box) or not any(scenario.acting_gravity):
        report(path, "expected one fixed box, whose upper face is the slope, and gravity")
    elif len(body.pieces) != 1 or not isinstance(body.pieces[0].shape, Hull):
        report(path, "expected a body of one hull, the prism")


def _corners(body: Body, slope: Slope) -> Array:
    """Corners of the cross-section in the order in which they meet the slope (n, 2)."""
    piece = body.pieces[0]
    assert isinstance(piece.shape, Hull)
    turn = Rotation.from_quat(piece.orientation, scalar_first=True)
    local = turn.apply(piece.shape.vertices) + piece.position - body.center_of_mass
    world = slope.along(Rotation.from_quat(body.orientation, scalar_first=True).apply(local))
    # both ends of the prism have the same corners
    size = LEVEL * np.ptp(world)
    _, kept = np.unique(np.round(world / size), axis=0, return_index=True)
    found = world[kept]
    return np.asarray(found[np.argsort(np.arctan2(found[:, 1], found[:, 0]))])


def _height(edge: Array) -> Callable[[Array], float]:
    return lambda y: float(_turned(edge, y[0])[1])


def _turned(r: Array, phi: Array | float) -> Array:
    """A vector along d and n after a turn about k by phi (2, ...)."""
    c, s = np.cos(phi), np.sin(phi)
    return np.array([c * r[0] + s * r[1], c * r[1] - s * r[0]])
