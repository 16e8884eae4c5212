"""Signed distance of two pieces during the motion of their bodies between displayed frames.

A recording holds poses at frames only. Between two frames a body is assumed to move on a straight line and to
turn about a fixed axis (`chord`), or to keep the velocities of a frame (`onward`, `backward`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from math import inf, isfinite
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.vector_products import cross
from touchstone.scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Piece, Shape, Sphere

if TYPE_CHECKING:
    from touchstone.reports.metrics.context import Context

STEPS_PER_THICKNESS = 16
"""Number of samples of a motion through two pieces, per sum of their inner radii [1]."""
MOST_SAMPLES = 100_000
"""Number of samples of a recording after which pairs are sampled at its frames only [1]. The hardest scenes
need 1,100; bodies that spin by thousands of rad/s more, and their path between frames is unknown anyway."""
UNBOUNDED = 1e3
"""Depth from which the oracle's answer is invalid [m]: it returns 1.8e308 for some nested pieces."""


@dataclass(frozen=True, slots=True)
class Sample:
    """The pair at one moment of a motion: `time` in frames, signed distance [m], and the unit normal from
    piece P to piece Q in the axes of one of their bodies."""

    time: float
    distance: float
    normal: Array


@dataclass(frozen=True, slots=True)
class Step:
    """Motion of a body from `frame`: displacement of its mass centre [m] and rotation vector [rad]."""

    frame: int
    way: Array
    turn: Array


@dataclass(frozen=True, slots=True)
class Extent:
    """A piece's centre in its body's frame [m], the radii of its bounding and its inscribed ball about that
    centre [m], and the distance of its farthest point from the body's mass centre [m]."""

    center: Array
    outer: float
    inner: float
    reach: float


class Motions:
    """The motions of all bodies of a recording between its frames."""

    def __init__(self, context: Context) -> None:
        self._recording, self.frame = context.recording, context.frame
        self.bodies = context.scenario.bodies
        self.center = context.mass_centers
        turns = Rotation.from_quat(self._recording.orientation.reshape(-1, 4), scalar_first=True)
        frames, count = self._recording.orientation.shape[:2]
        self.rotation = turns.as_matrix().reshape(frames, count, 3, 3)
        self.samples = 0

    @cached_property
    def turn(self) -> Array:
        """Rotation vectors (f - 1, n, 3) from a frame's orientation to the next, world axes.

        Of the rotations that reach the next orientation, the one nearest to the angular velocity times the
        frame: a body may turn by more than half a revolution.
        """
        least = _least_turns(self._recording.orientation)
        spin = self._recording.angular_velocity
        expected = (spin[1:] + spin[:-1]) / 2 * self.frame
        angle = np.linalg.norm(least, axis=2, keepdims=True)
        pace = np.linalg.norm(expected, axis=2, keepdims=True)
        with np.errstate(divide="ignore", invalid="ignore"):
            axis = np.where(angle > 1e-9, least / angle, np.where(pace > 0, expected / pace, 0.0))
        rounds = np.round((np.sum(axis * expected, axis=2, keepdims=True) - angle) / (2 * np.pi))
        return np.asarray(least + 2 * np.pi * rounds * axis)

    def chord(self, body: int, frame: int) -> Step:
        """The straight step from a frame to the next."""
        way = self.center[frame + 1, body] - self.center[frame, body]
        return Step(frame, way, self.turn[frame, body])

    def onward(self, body: int, frame: int) -> Step:
        """The step of one frame that keeps the velocities of a frame."""
        r = self._recording
        return Step(
            frame, r.linear_velocity[frame, body] * self.frame, r.angular_velocity[frame, body] * self.frame
        )

    def backward(self, body: int, frame: int) -> Step:
        """The step of one frame back in time that keeps the velocities of a frame."""
        ahead = self.onward(body, frame)
        return Step(frame, -ahead.way, -ahead.turn)

    def pose(self, body: int, step: Step, share: float) -> tuple[Array, Array]:
        """Rotation matrix and origin of a body after a share of a step."""
        turned = self.rotation[step.frame, body]
        if step.turn.any():
            turned = Rotation.from_rotvec(share * step.turn).as_matrix() @ turned
        center = self.center[step.frame, body] + share * step.way
        return turned, center - turned @ np.array(self.bodies[body].center_of_mass)

    def spun(self, body: int, frame: int) -> float:
        """How far a body's rotation in a frame is from a steady one [rad]: by the spins at its ends, and by
        its chord, which may have another axis if the body turns by half a revolution or more.
        """
        omega = self._recording.angular_velocity[frame : frame + 2, body] * self.frame
        departures = omega[1] - omega[0], self.turn[frame, body] - omega.mean(axis=0)
        return max(float(np.linalg.norm(departure)) for departure in departures)

    def point_velocity(self, body: int, frame: int, point: Array) -> Array:
        """Velocity at a frame of a body's point, given by its world position at that frame [m/s]."""
        r = self._recording
        arm = point - self.center[frame, body]
        return np.asarray(r.linear_velocity[frame, body] + np.cross(r.angular_velocity[frame, body], arm))


class Pair:
    """Two pieces P and Q of bodies `a` and `b`."""

    def __init__(self, motions: Motions, a: int, one: Piece, b: int, two: Piece) -> None:
        self.motions, self.bodies, self.pieces = motions, (a, b), (one, two)
        self.extents = (extent(motions, a, one), extent(motions, b, two))
        self.thickness = self.extents[0].inner + self.extents[1].inner
        self._shapes = [_oracle_shape(piece.shape) for piece in self.pieces]
        self._own = [
            (Rotation.from_quat(piece.orientation, scalar_first=True).as_matrix(), np.array(piece.position))
            for piece in self.pieces
        ]
        self._at_frames: dict[int, Sample] = {}

    @cached_property
    def sided(self) -> list[int]:
        """The bodies whose piece is no ball."""
        return [body for body, piece in zip(self.bodies, self.pieces) if not isinstance(piece.shape, Sphere)]

    @cached_property
    def _axes(self) -> int | None:
        """The body in whose axes normals are given: the one that turns less and is no ball; None: world
        axes."""
        turned = {body: np.linalg.norm(self.motions.turn[:, body], axis=1).sum() for body in self.sided}
        return min(self.sided, key=lambda body: turned[body], default=None)

    def sample(self, steps: tuple[Step, Step], share: float, time: float) -> tuple[Sample, Array]:
        """The pair after a share of both bodies' steps, and the midpoint of the witnesses [m, world]."""
        from touchstone.adapters.oracles.overlap import signed_distance

        poses = [self.motions.pose(body, step, share) for body, step in zip(self.bodies, steps)]
        placed = [
            (turned @ own, origin + turned @ place)
            for (turned, origin), (own, place) in zip(poses, self._own)
        ]
        distance, normal, middle = signed_distance(self._shapes[0], placed[0], self._shapes[1], placed[1])
        if not isfinite(distance) or abs(distance) > UNBOUNDED:
            distance, normal, middle = -self.thickness, np.zeros(3), placed[0][1]
        if self._axes is not None:
            normal = poses[self.bodies.index(self._axes)][0].T @ normal
        return Sample(time, distance, normal), middle

    def at_frame(self, frame: int) -> Sample:
        """The pair at a displayed frame."""
        if frame not in self._at_frames:
            still = tuple(Step(frame, np.zeros(3), np.zeros(3)) for _ in self.bodies)
            self._at_frames[frame] = self.sample((still[0], still[1]), 0.0, float(frame))[0]
        return self._at_frames[frame]

    def chords(self, frame: int) -> tuple[Step, Step]:
        """The straight steps of both bodies from a frame to the next."""
        a, b = self.bodies
        return self.motions.chord(a, frame), self.motions.chord(b, frame)

    def samples(self, steps: tuple[Step, Step], level: float, start: float = 0.0) -> Iterator[Sample]:
        """Samples of the pair along both steps, dense enough to find every crossing of a signed distance
        `level`, except those that go less far beyond it than a step of STEPS_PER_THICKNESS."""
        way = float(np.linalg.norm(steps[0].way - steps[1].way))
        way += sum(float(np.linalg.norm(s.turn)) * e.reach for s, e in zip(steps, self.extents))
        share = 0.0
        while share < 1.0:
            found, _ = self.sample(steps, share, start + share)
            yield found
            self.motions.samples += 1
            if self.motions.samples > MOST_SAMPLES:
                return
            least = max(abs(found.distance - level), self.thickness / STEPS_PER_THICKNESS)
            share += least / way if way > 0 else inf


def _least_turns(orientation: Array) -> Array:
    """Shortest rotation vectors (f - 1, n, 3) between successive unit quaternions wxyz (f, n, 4)."""
    start, end = orientation[:-1], orientation[1:]
    w0, w1, v0, v1 = start[..., :1], end[..., :1], start[..., 1:], end[..., 1:]
    axis = w0 * v1 - w1 * v0 - cross(v1, v0)
    cosine = np.einsum("fni,fni->fn", start, end)[..., None]
    sine = np.sqrt(np.einsum("fni,fni->fn", axis, axis))[..., None]
    half = np.arctan2(sine, np.abs(cosine))
    # The vector part is its own limit where the angle vanishes.
    factor = np.where(sine > 0, 2 * half / np.where(sine > 0, sine, 1.0), 2.0)
    return np.asarray(np.where(cosine < 0, -factor, factor) * axis)


def extent(motions: Motions, body: int, piece: Piece) -> Extent:
    """The extent of a piece."""
    local, outer, inner = _size(piece.shape)
    turned = Rotation.from_quat(piece.orientation, scalar_first=True).apply(local)
    center = np.array(piece.position) + turned
    offset = float(np.linalg.norm(center - np.array(motions.bodies[body].center_of_mass)))
    return Extent(center, outer, inner, offset + outer)


@cache
def _size(shape: Shape) -> tuple[Array, float, float]:
    """Centre [m, piece frame], radius of the bounding ball and of the inscribed ball [m]."""
    match shape:
        case Sphere(radius):
            return np.zeros(3), radius, radius
        case Box(half):
            return np.zeros(3), float(np.linalg.norm(half)), min(half)
        case Capsule(radius, half_length):
            return np.zeros(3), radius + half_length, radius
        case Ellipsoid(half):
            return np.zeros(3), max(half), min(half)
        case Hull(vertices):
            points = np.array(vertices)
            center = points.mean(axis=0)
            planes = ConvexHull(points).equations
            inner = float(-(planes[:, :3] @ center + planes[:, 3]).max())
            return center, float(np.linalg.norm(points - center, axis=1).max()), inner
    raise TypeError(f"no size of {type(shape).__name__}")


@cache
def _oracle_shape(shape: Shape) -> object:
    from touchstone.adapters.oracles.overlap import coal_shape

    return coal_shape(shape)
