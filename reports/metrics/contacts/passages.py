"""Passages: a piece is apart from another, or touches it, on one side and later again on the other side.

Passages are computed from the poses of the frames, not from the engine's contacts. A body that ends inside
another has not passed it; nor has one that bounces within a frame, grazes, or goes round an edge. Where the
deep part lies between two frames, the path is unknown; it counts as a passage only if

- the bodies are too slow to have gone round, or
- the velocities before lead in on one side and the velocities after lead back in on the other, each as deep
  as a passage, or
- only the velocities before lead in so deep, and the engine reports no contact.

Reported contacts hide no passage that the first two conditions prove. The last two prove nothing if the spin
of a piece that is no ball changed within the frame: it tumbles or was struck, so its orientation on the way
is unknown. Nor do they if a body moved otherwise than one change of its velocity explains: others struck it.
Nothing is proved of a driver whose coupling swings by more than a radian within the frame.

Signed distance of two pieces during the motion of their bodies between displayed frames.

A recording holds poses at frames only. Between two frames a body is assumed to move on a straight line and to
turn about a fixed axis (`chord`), or to keep the velocities of a frame (`onward`, `backward`).

Culls pairs of pieces that cannot overlap deeply between two frames, by boxes and balls, without the
oracle.

A pair remains where the bounding balls of both pieces overlap by a required depth on their chords, and where
the extents of each cut as deep into the other's box.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from math import ceil, floor, hypot, inf, isfinite

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.vector_products import cross
from touchstone.reports.metrics.context import Context, judging
from touchstone.scenarios.extents import extents
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Piece,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
)

STEPS_PER_THICKNESS = 16
"""Number of samples of a motion through two pieces, per sum of their inner radii [1]."""
MOST_SAMPLES = 100_000
"""Number of samples of a recording after which pairs are sampled at its frames only [1]. The hardest scenes
need 1,100; bodies that spin by thousands of rad/s more, and their path between frames is unknown anyway."""
UNBOUNDED = 1e3
"""Depth from which the oracle's answer is invalid [m]: it returns 1.8e308 for some nested pieces."""


LARGE_TURN = 1.0
"""Turn within a frame from which a ball bounds a piece [rad]: extents at the turn's ends are not enough."""


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
        self._scenario, self.bodies = context.scenario, context.scenario.bodies
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

    @cached_property
    def swinging(self) -> frozenset[int]:
        """Links of the drivers whose coupling, sqrt(K / m), turns by more than LARGE_TURN in a frame."""
        found: set[int] = set()
        for tracker in self._scenario.trackers:
            links = self._scenario.links(tracker)
            stiffest = tracker.stiffness * self.frame**2
            if stiffest > LARGE_TURN**2 * sum(self.bodies[k].mass for k in links):
                found.update(() if self._scenario.prescribes(tracker) else links)
        return frozenset(found)

    def chord(self, body: int, frame: int) -> Step:
        """The straight step from a frame to the next."""
        way = self.center[frame + 1, body] - self.center[frame, body]
        return Step(frame, way, self.turn[frame, body])

    def onward(self, body: int, frame: int) -> Step:
        """The step of one frame that keeps the velocities of a frame."""
        r, at = self._recording, (frame, body)
        return Step(frame, r.linear_velocity[at] * self.frame, r.angular_velocity[at] * self.frame)

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
        both = zip(poses, self._own)
        placed = [(turned @ own, origin + turned @ place) for (turned, origin), (own, place) in both]
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
        case Cylinder(radius, half_length):
            return np.zeros(3), float(np.hypot(radius, half_length)), min(radius, half_length)
        case Cone(radius, half_length):
            # the inscribed ball touches the base and the side
            slant = float(np.hypot(radius, 2 * half_length))
            inner = 2 * half_length * radius / (radius + slant)
            center = np.array((0.0, 0.0, inner - half_length))
            return center, max(2 * half_length - inner, float(np.hypot(radius, inner))), inner
        case Ellipsoid(half):
            return np.zeros(3), max(half), min(half)
        case Hull(vertices):
            points = np.array(vertices)
            center = points.mean(axis=0)
            planes = ConvexHull(points).equations
            inner = float(-(planes[:, :3] @ center + planes[:, 3]).max())
            return center, float(np.linalg.norm(points - center, axis=1).max()), inner
        case RoundedBox() | RoundedHull():
            core = Box(shape.half_extents) if isinstance(shape, RoundedBox) else Hull(shape.vertices)
            center, outer, inner = _size(core)
            return center, outer + shape.radius, inner + shape.radius
        case HalfSpace():
            return np.zeros(3), inf, inf
    raise TypeError(f"no size of {type(shape).__name__}")


@cache
def _oracle_shape(shape: Shape) -> object:
    from touchstone.adapters.oracles.overlap import coal_shape

    return coal_shape(shape)


class SweptPairs:
    """The pieces of a scene over a recording, with the bounds of their motions."""

    def __init__(self, context: Context, motions: Motions) -> None:
        self._motions = motions
        bodies = context.scenario.bodies
        # nothing passes through a half-space: it has no other side
        pieces = ((k, piece) for k, body in enumerate(bodies) for piece in body.pieces)
        self.pieces = [(k, piece) for k, piece in pieces if not isinstance(piece.shape, HalfSpace)]
        self._body = np.array([k for k, _ in self.pieces], dtype=int)
        extents = [extent(motions, k, piece) for k, piece in self.pieces]
        self._outer = np.array([e.outer for e in extents])
        self._inner = np.array([e.inner for e in extents])
        offset = np.array([e.reach - e.outer for e in extents])
        local = np.array([e.center for e in extents]).reshape(-1, 3)
        mass_center = np.array([bodies[k].center_of_mass for k in self._body]).reshape(-1, 3)
        turned = motions.rotation[:, self._body]
        self._center = motions.center[:, self._body] + np.einsum("fmij,mj->fmi", turned, local - mass_center)
        self._angle = np.linalg.norm(motions.turn, axis=2)[:, self._body]
        # A centre off the mass centre moves on an arc; this is the arc's distance from the chord.
        self._bulge = offset * _bulge(self._angle)
        self._may_touch = np.zeros((len(bodies), len(bodies)), dtype=bool)
        for a, b in context.scenario.touching_pairs():
            self._may_touch[a, b] = self._may_touch[b, a] = True
        self._moving = np.array([body.kind != "fixed" for body in bodies])[self._body]
        self._places: dict[int, tuple[Array, Array]] = {}

    def pairs(self, depth_share: float) -> Iterator[tuple[Pair, NDArray[np.int64]]]:
        """Pairs, the first body first, and the steps from frame to frame in which they can overlap by
        `depth_share` of the sum of their inner radii."""
        order = np.arange(len(self.pieces))
        for p in np.flatnonzero(self._moving).tolist():
            partner = self._may_touch[self._body[p], self._body] & (~self._moving | (order > p))
            others = np.flatnonzero(partner)
            if not len(others):
                continue
            near = self._nearest(p, others) <= 0
            for q in others[near.any(axis=0)].tolist():
                steps = np.flatnonzero(self._deep(p, q, depth_share))
                if len(steps):
                    low, high = sorted((p, q), key=lambda k: (self._body[k], k))
                    (a, one), (b, two) = self.pieces[low], self.pieces[high]
                    yield Pair(self._motions, a, one, b, two), steps

    def _nearest(self, p: int, others: NDArray[np.int64]) -> Array:
        """Distance between the bounding balls of pieces on chords, per step and other piece (f - 1, o)
        [m]."""
        apart = self._center[:, others] - self._center[:, [p]]
        start, way = apart[:-1], np.diff(apart, axis=0)
        square = np.einsum("foi,foi->fo", way, way)
        share = -np.einsum("foi,foi->fo", start, way) / np.where(square > 0, square, 1.0)
        nearest = np.linalg.norm(start + np.clip(share, 0.0, 1.0)[..., None] * way, axis=2)
        reach = self._outer[p] + self._outer[others] + self._bulge[:, [p]] + self._bulge[:, others]
        return np.asarray(nearest - reach)

    def _deep(self, p: int, q: int, depth_share: float) -> NDArray[np.bool_]:
        """Mask of the steps in which neither piece's box bounds the depth below the required one (f - 1,)."""
        depth = depth_share * (self._inner[p] + self._inner[q])
        found = self._nearest(p, np.array([q]))[:, 0] <= -depth
        for one, two in ((p, q), (q, p)):
            if found.any() and isinstance(self.pieces[one][1].shape, Box | Hull):
                found &= self._crosses_box(one, two, depth)
        return found

    def _crosses_box(self, one: int, two: int, depth: float) -> NDArray[np.bool_]:
        """Whether the chord of `two` cuts to `depth` [m] into the box of `one`, in `one`'s axes (f - 1,)."""
        (low,), (high,) = extents(self.pieces[one][1].shape, np.eye(3)[None])
        lows, highs = self._extent_in(one, two)
        middle, half = (lows + highs) / 2, (highs - lows) / 2
        turn = self._angle[:, one] + self._angle[:, two]
        far = np.linalg.norm(middle - (low + high) / 2, axis=1)
        far = np.maximum(far[:-1], far[1:])
        grown = np.maximum(half[:-1], half[1:])
        grown = np.where((turn > LARGE_TURN)[:, None], np.maximum(grown, self._outer[two]), grown)
        grown += (self._outer[two] * np.minimum(turn, LARGE_TURN))[:, None]
        # In the axes of a turning piece the chord is an arc; its middle is that far from the mass centre's
        # chord.
        slack = far * _bulge(self._angle[:, one]) + self._bulge[:, one] + self._bulge[:, two]
        reach = (high - low) / 2 + grown + slack[:, None] - depth
        start, end = middle[:-1] - (low + high) / 2, middle[1:] - (low + high) / 2
        return _segment_meets_box(start, end - start, reach)

    def _extent_in(self, one: int, two: int) -> tuple[Array, Array]:
        """Lowest and highest coordinates of piece `two` at every frame in the axes of piece `one` (f, 3)."""
        turn_one, origin_one = self._placed(one)
        turn_two, origin_two = self._placed(two)
        lows, highs = extents(self.pieces[two][1].shape, turn_one.swapaxes(1, 2) @ turn_two)
        origin = np.einsum("fji,fj->fi", turn_one, origin_two - origin_one)
        return origin + lows, origin + highs

    def _placed(self, k: int) -> tuple[Array, Array]:
        """Rotation matrix and origin of a piece in every frame."""
        if k not in self._places:
            body, piece = self.pieces[k]
            turned = self._motions.rotation[:, body]
            own = Rotation.from_quat(piece.orientation, scalar_first=True).as_matrix()
            arm = np.array(piece.position) - np.array(self._motions.bodies[body].center_of_mass)
            self._places[k] = (turned @ own, self._motions.center[:, body] + turned @ arm)
        return self._places[k]


def _bulge(angle: Array) -> Array:
    """Largest distance of an arc of radius 1 from its chord, by the arc's angle [rad]."""
    return np.where(angle < np.pi, 1 - np.cos(np.minimum(angle, np.pi) / 2), 2.0)


def _segment_meets_box(start: Array, way: Array, half: Array) -> NDArray[np.bool_]:
    """Whether segments from `start` along `way` (n, 3) meet boxes of half sides (n, 3) at the origin."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (-half - start) / way, (half - start) / way
    inside = np.abs(start) <= half
    enter = np.where(way == 0, np.where(inside, -np.inf, np.inf), np.minimum(one, two))
    leave = np.where(way == 0, np.where(inside, np.inf, -np.inf), np.maximum(one, two))
    fits = (half > 0).all(axis=1)
    met = np.maximum(enter.max(axis=1), 0.0) <= np.minimum(leave.min(axis=1), 1.0)
    return np.asarray(fits & met)


THROUGH = 0.5
"""Least depth of a passage over the sum of both pieces' inner radii [1]; shallower contact is a graze. A ball
that passes another's centre within half the sum of their radii reaches this depth."""
ENTERED = 0.25
"""Depth over the same sum at which the sides of entry and exit are determined [1]."""
TOUCHING = 1 / 64
"""Depth over the same sum up to which pieces count as apart [1]: a body on a table touches it."""
LANDING = 1 / 64
"""Tolerance of a sample at ENTERED, over the same sum [1]: sampling reaches that level up to rounding."""
SPARE = 1.001
"""Factor by which rounding may lengthen a path [1]."""


@dataclass(frozen=True, slots=True)
class Passage:
    """A body (by index) that passed through another, and the time of the middle of the passage [s]."""

    a: int
    b: int
    time: float


def passages(context: Context) -> list[Passage]:
    """All passages of a recording in order of time; pieces of two bodies that pass together count once.

    Raises JudgeMissing where the overlap oracle cannot be imported.
    """
    with judging():
        import touchstone.adapters.oracles.overlap  # noqa: F401
    motions = Motions(context)
    found: list[tuple[float, float, Passage]] = []
    for pair, steps in SweptPairs(context, motions).pairs(THROUGH):
        for start, end, middle in _through(context, pair, set(steps.tolist())):
            found.append((start, end, Passage(*pair.bodies, middle * context.frame)))
    kept: list[tuple[float, float, Passage]] = []
    for start, end, passage in sorted(found, key=lambda row: row[2].time):
        same = (k for k in kept if (k[2].a, k[2].b) == (passage.a, passage.b))
        if not any(start <= k[1] and k[0] <= end for k in same):
            kept.append((start, end, passage))
    return [passage for _, _, passage in kept]


def _through(context: Context, pair: Pair, steps: set[int]) -> Iterator[tuple[float, float, float]]:
    """Start, end and middle [frames] of every passage of a pair that can be deep in those steps."""
    level = -ENTERED * pair.thickness
    for samples in _encounters(pair, steps, level):
        inside = [sample for sample in samples if sample.distance <= level + LANDING * pair.thickness]
        deepest = min(samples, key=lambda sample: sample.distance)
        if not inside or deepest.distance > -THROUGH * pair.thickness:
            continue
        if inside[0].normal @ inside[-1].normal >= 0:
            continue
        recorded = any(sample.time == floor(sample.time) for sample in inside)
        if recorded or _sure(context, pair, floor(deepest.time), deepest):
            yield samples[0].time, samples[-1].time, deepest.time


def _encounters(pair: Pair, steps: set[int], level: float) -> Iterator[list[Sample]]:
    """Samples of a pair between two successive moments of separation, where a step in between can be deep."""
    last, touching = len(pair.motions.rotation) - 1, -TOUCHING * pair.thickness
    done = 0
    for step in sorted(steps):
        if step < done:
            continue
        first, done = step, step + 1
        while first > 0 and pair.at_frame(first).distance <= touching:
            first -= 1
        while done < last and pair.at_frame(done).distance <= touching:
            done += 1
        samples: list[Sample] = []
        for k in range(first, done):
            samples += pair.samples(pair.chords(k), level, float(k)) if k in steps else [pair.at_frame(k)]
        samples.append(pair.at_frame(done))
        apart = [k for k, sample in enumerate(samples) if sample.distance > touching]
        for one, two in pairwise(apart):
            if two > one + 1:
                yield samples[one : two + 1]


def _sure(context: Context, pair: Pair, frame: int, deepest: Sample) -> bool:
    """Whether the bodies certainly passed through each other between two frames in which they are apart."""
    if not pair.motions.swinging.isdisjoint(pair.bodies):
        return False
    if _cannot_go_round(context, pair, frame, deepest):
        return True
    motions, (a, b) = pair.motions, pair.bodies
    if any(motions.spun(body, frame) > LARGE_TURN for body in pair.sided):
        return False
    if any(_struck_often(context, pair, body, frame) for body in pair.bodies):
        return False
    before = _entry(pair, (motions.onward(a, frame), motions.onward(b, frame)))
    if before is None:
        return False
    after = _entry(pair, (motions.backward(a, frame + 1), motions.backward(b, frame + 1)))
    if after is not None:
        return bool(before.normal @ after.normal < 0)
    rows = context.recording.contacts
    reported = (rows["body_a"] == a) & (rows["body_b"] == b) & (context.contact_frame == frame)
    return not reported.any()


def _struck_often(context: Context, pair: Pair, body: int, frame: int) -> bool:
    """Whether no single change of a body's velocity in a frame explains its displacement, within half of both
    pieces and the fall of a frame: its path is unknown."""
    motions = pair.motions
    way, before = motions.chord(body, frame).way, motions.onward(body, frame).way
    change = motions.onward(body, frame + 1).way - before
    square = float(change @ change)
    share = float(np.clip((way - before) @ change / square, 0.0, 1.0)) if square > 0 else 0.0
    fall = float(np.linalg.norm(context.gravity)) * context.frame**2
    return float(np.linalg.norm(way - before - share * change)) > THROUGH * pair.thickness + fall


def _entry(pair: Pair, steps: tuple[Step, Step]) -> Sample | None:
    """The sample at which the pair enters, along steps of both bodies; None if they graze at most."""
    level = -ENTERED * pair.thickness
    inside = [sample for sample in pair.samples(steps, level) if sample.distance <= level]
    deepest = min((sample.distance for sample in inside), default=0.0)
    return inside[0] if deepest <= -THROUGH * pair.thickness else None


def _cannot_go_round(context: Context, pair: Pair, frame: int, deepest: Sample) -> bool:
    """Whether a path round the obstacle is longer than the bodies' speeds allow.

    Such a path passes the deepest point of the chord at a distance of at least the depth there. Paths are
    those of A's material at that point, relative to B. Where contacts change the spin of a piece within the
    frame, its chord says little of the path.
    """
    motions, steps, share = pair.motions, pair.chords(frame), deepest.time - frame
    if any(motions.spun(body, frame) > LARGE_TURN for body in pair.sided):
        return False
    _, point = pair.sample(steps, share, deepest.time)
    locals_ = []
    for body, step in zip(pair.bodies, steps):
        turned, origin = motions.pose(body, step, share)
        locals_.append(turned.T @ (point - origin))
    seen, speeds = [], []
    for moment in (0.0, share, 1.0):
        (turn_a, origin_a), (turn_b, origin_b) = (
            motions.pose(body, step, moment) for body, step in zip(pair.bodies, steps)
        )
        place = turn_a @ locals_[0] + origin_a
        seen.append(turn_b.T @ (place - origin_b))
        if moment in (0.0, 1.0):
            at = frame + ceil(moment)
            one, two = (motions.point_velocity(body, at, place) for body in pair.bodies)
            speeds.append(float(np.linalg.norm(one - two)))
    ahead, rest = (float(np.linalg.norm(y - x)) for x, y in pairwise(seen))
    fastest = max(speeds) + float(np.linalg.norm(context.gravity)) * context.frame
    budget = max(fastest * context.frame, ahead + rest) * SPARE
    return hypot(ahead, deepest.distance) + hypot(rest, deepest.distance) > budget
