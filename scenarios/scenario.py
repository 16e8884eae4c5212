"""Engine-neutral scenario data from which every engine's world is built.

Conventions: SI units, radians, right-handed, z up, unit quaternions wxyz. A body's `position` is its origin
in the world; its `center_of_mass` and pieces are posed in the body frame; its inertia is taken about the
centre of mass along the body axes. A driven body is a tree of links joined by hinges: the link frame has its
origin on the hinge. Every object is plain, frozen data.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sized
from contextvars import ContextVar
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from itertools import combinations
from math import isfinite
from numbers import Real
from typing import Any, Literal, get_args

from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.published import Published

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]
Kind = Literal["fixed", "simulated", "driven", "prescribed"]

TRACKED, UNMOVED = ("driven", "prescribed"), ("fixed", "prescribed")
"""Kinds of bodies that follow a tracker, and of those that no contact moves."""
IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)
ORIGIN: Vector = (0.0, 0.0, 0.0)
EFFECTS = ("gravity", "restitution", "friction", "self_collision")
FRICTION_LAWS = ("static_friction", "rolling_friction", "torsional_friction")
"""Fields of the coefficients of a pair that are effects of their own."""
EVENTS = ("touch", "roll", "leave", "land", "meet", "part")
Law = Literal[
    "arcs",
    "torque_free",
    "coupling",
    "carried",
    "turntable",
    "smooth_contact",
    "rolling_cone",
    "tipping",
    "mechanism",
    "stick_slip",
]
Interpolation = Literal["pchip", "cubic", "linear", "held"]
INTERPOLATIONS = get_args(Interpolation)
UNBOUNDED = 1e30
"""Limit of a joint that it never reaches [rad, m, N or N m]."""
GRAVITY = 9.81
"""Default magnitude of gravity [m/s^2]."""
HOLD_LAST: ContextVar[bool] = ContextVar("HOLD_LAST", default=False)
"""Whether scenarios under construction hold a tracker's last good sample where one is not finite."""


def vector(values: Iterable[float]) -> Vector:
    """Plain tuple of three numbers from an array."""
    x, y, z = (float(value) for value in values)
    return (x, y, z)


class ScenarioError(ValueError):
    """Invalid scenario; `faults` lists (path of the field, what is wrong)."""

    def __init__(self, name: str, faults: list[tuple[str, str]]) -> None:
        self.name, self.faults = name, faults
        lines = "\n".join(f"  {path}: {message}" for path, message in faults)
        super().__init__(f"scenario {name!r} has {len(faults)} fault(s):\n{lines}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name, self.faults)


class ShortRepr:
    """Base of dataclasses that print a few lines: arrays, long texts and collections by their sizes."""

    __slots__ = ()

    def __repr__(self) -> str:
        parts = (f"{field.name}={_short(getattr(self, field.name))}" for field in dataclass_fields(self))  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(parts)})"


def _short(value: Any, longest: int = 60) -> str:
    if hasattr(value, "shape"):
        return f"<array {value.shape}>"
    if isinstance(value, Sized) and (len(value) > longest or len(repr(value)) > longest):
        return f"<{len(value)} {'characters' if isinstance(value, str) else 'items'}>"
    return repr(value)


@dataclass(frozen=True, slots=True)
class Sphere:
    """Ball of `radius` [m] about the piece's origin."""

    radius: float


@dataclass(frozen=True, slots=True)
class Box:
    """Box with `half_extents` [m] along the piece's axes."""

    half_extents: Vector


@dataclass(frozen=True, slots=True)
class Capsule:
    """Points within `radius` [m] of the segment from -`half_length` to `half_length` [m] on the z axis."""

    radius: float
    half_length: float


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Points within `radius` [m] of the z axis and with |z| <= `half_length` [m]."""

    radius: float
    half_length: float


@dataclass(frozen=True, slots=True)
class Cone:
    """Solid cone about the z axis: its base of `radius` [m] at z = -`half_length` [m], its apex at
    `half_length`."""

    radius: float
    half_length: float


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """Ellipsoid with `half_axes` [m] along the piece's axes."""

    half_axes: Vector


@dataclass(frozen=True, slots=True, repr=False)
class Hull(ShortRepr):
    """Convex hull of `vertices` [m, piece frame], each of which must be a corner of it."""

    vertices: tuple[Vector, ...]


@dataclass(frozen=True, slots=True)
class RoundedBox:
    """All points within `radius` [m] of a box with `half_extents` [m] along the piece's axes."""

    half_extents: Vector
    radius: float


@dataclass(frozen=True, slots=True, repr=False)
class RoundedHull(ShortRepr):
    """All points within `radius` [m] of the convex hull of `vertices` [m], each of which must be a corner."""

    vertices: tuple[Vector, ...]
    radius: float


@dataclass(frozen=True, slots=True)
class HalfSpace:
    """All points with z <= 0 in the piece's frame: what is below a plane; of fixed bodies only."""


Shape = Sphere | Box | Capsule | Cylinder | Cone | Ellipsoid | Hull | RoundedBox | RoundedHull | HalfSpace

HALF_SPACE_REACH = 1e9
"""Distance from its origin at which bounding boxes end a half-space [m]: beyond any scene."""


def shape_name(kind: type) -> str:
    """Name of a shape's type in files: `half_space` of HalfSpace."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", kind.__name__).lower()


@dataclass(frozen=True, slots=True, repr=False)
class Piece(ShortRepr):
    """Convex piece, posed in the frame of its body. The material of its surface moves relative to the body at
    `surface_velocity` [m/s] and `surface_angular_velocity` [rad/s] about the piece's origin (piece frame), as
    that of belts and rollers; friction opposes slip relative to the part of it along the contact plane."""

    name: str
    shape: Shape
    position: Vector = ORIGIN
    orientation: Quaternion = IDENTITY
    surface_velocity: Vector = ORIGIN
    surface_angular_velocity: Vector = ORIGIN


@dataclass(frozen=True, slots=True, repr=False)
class Body(ShortRepr):
    """Rigid body, or one link of a driven body.

    `position` to `angular_velocity` [m, wxyz, m/s of the centre of mass, rad/s; world] are the initial state;
    a driven link or a prescribed body takes its state from its tracker and keeps their defaults. Fixed and
    prescribed bodies need no mass.
    """

    name: str
    kind: Kind
    material: str
    pieces: tuple[Piece, ...]
    mass: float = 0.0
    center_of_mass: Vector = ORIGIN
    inertia: Matrix = (ORIGIN, ORIGIN, ORIGIN)
    position: Vector = ORIGIN
    orientation: Quaternion = IDENTITY
    linear_velocity: Vector = ORIGIN
    angular_velocity: Vector = ORIGIN


@dataclass(frozen=True, slots=True)
class Joint:
    """Hinge. At angle q the child frame is at `position` in the parent frame, with orientation
    rotation(`axis`, q) * `orientation`; the axis is given in the parent frame."""

    name: str
    parent: str
    child: str
    position: Vector
    axis: Vector
    orientation: Quaternion = IDENTITY
    lower: float = -3.141592653589793
    upper: float = 3.141592653589793


@dataclass(frozen=True, slots=True, repr=False)
class BodyJoint(ShortRepr):
    """Joint between two bodies, of which contact moves `child` at least; `parent` is a simulated, fixed or
    prescribed body, or "" for the world.

    `anchor` [m] and the unit vector `axis` are given in the world at the start, where the joint's position q
    is 0: of a hinge the angle [rad] by which the child has turned about the axis relative to the parent, of a
    slider its travel [m] along the axis. A ball joint turns about the anchor, a fixed one not at all; they
    have neither limits nor springs. q stays between `lower` and `upper`. The joint exerts the force [N] or
    torque [N m] `stiffness` (`target` - q) + `damping` (`target_rate` - dq/dt), at most `largest_force`:
    a spring, a damper or a motor; in a ball joint -`damping` times the relative angular velocity.

    A hinge or slider that `mimics` another, by its name, is coupled with it: q is `ratio` times the position
    of that one, and the forces of the coupling act on both.
    """

    name: str
    type: Literal["hinge", "slider", "ball", "fixed"]
    parent: str
    child: str
    anchor: Vector
    axis: Vector = (0.0, 0.0, 1.0)
    lower: float = -UNBOUNDED
    upper: float = UNBOUNDED
    stiffness: float = 0.0
    damping: float = 0.0
    target: float = 0.0
    target_rate: float = 0.0
    largest_force: float = UNBOUNDED
    mimics: str = ""
    ratio: float = 1.0


@dataclass(frozen=True, slots=True, repr=False)
class ReachCone(ShortRepr):
    """Joint limits of a ball joint, whose three `joints` turn about right-handed perpendicular axes through
    one point; the third axis is the bone's.

    `swing` holds the corners of a spherical polygon of allowed bone directions, counterclockwise about
    `center` and star-shaped from it [unit vectors, frame of the first hinge's parent at angles 0]. `twist`
    [rad] bounds the rotation about the bone that remains after the shortest rotations from its rest to
    `center` and from there to its direction.
    """

    joints: tuple[str, str, str]
    center: Vector
    swing: tuple[Vector, ...]
    twist: tuple[float, float]


@dataclass(frozen=True, slots=True, repr=False)
class Chain(ShortRepr):
    """Hinges, consecutive in their tracker, that inverse kinematics turns together, from root to tip."""

    name: str
    joints: tuple[str, ...]
    cones: tuple[ReachCone, ...] = ()


@dataclass(frozen=True, slots=True, repr=False)
class Tracker(ShortRepr):
    """Path that a driven body follows: keyframes of its root's pose and of its hinges' angles.

    `stiffness` K [N/m] and `damping` R [N s/m] couple the root in translation (Eq. 6). In rotation the
    coupling is critically damped at sqrt(K / m). Hinges follow `angles` by a critically damped servo of
    `hinge_frequency` [rad/s]; those outside chains the reference sets exactly. `held` counts keyframes that
    repeat the last good sample. `interpolation`: pchip stays between keyframes; cubic, a spline, may leave
    them; linear; or held: each time takes the next keyframe. A prescribed body follows its path exactly.
    """

    root: str
    joints: tuple[str, ...]
    times: tuple[float, ...]
    positions: tuple[Vector, ...]
    orientations: tuple[Quaternion, ...]
    angles: tuple[tuple[float, ...], ...]
    stiffness: float = 1000.0
    damping: float = 40.0
    hinge_frequency: float = 70.0
    held: int = 0
    interpolation: Interpolation = "pchip"

    def hold_last(self) -> Tracker:
        """Copy in which non-finite keyframes repeat the last good one, counted in `held`. Those before the
        first good one do not change."""
        samples = list(zip(self.positions, self.orientations, self.angles))
        if not 0 < len(self.positions) == len(self.orientations) == len(self.angles):
            return self
        held, good = self.held, -1
        for k, sample in enumerate(samples):
            if all(isinstance(x, Real) and isfinite(x) for row in sample for x in row):
                good = k
            elif good >= 0:
                samples[k] = samples[good]
                held += 1
        positions, orientations, angles = zip(*samples)
        return replace(self, positions=positions, orientations=orientations, angles=angles, held=held)


@dataclass(frozen=True, slots=True)
class PairCoefficients:
    """Restitution e and Coulomb friction mu of a pair of materials, and what its friction has beyond that.

    A contact that presses with the force N resists rolling with a moment of up to `rolling_friction` N across
    its normal, and spinning with one of up to `torsional_friction` N along it: lengths [m]. All of it opposes
    the angular velocity of one body relative to the other; what does not turn is held. A contact that sticks
    bears up to `static_friction` N; 0: as much as one that slides, `friction` N.
    """

    material_a: str
    material_b: str
    restitution: float
    friction: float
    static_friction: float = 0.0
    rolling_friction: float = 0.0
    torsional_friction: float = 0.0


@dataclass(frozen=True, slots=True)
class FrictionLaw:
    """What the friction of two bodies has beyond mu: coefficient of what sticks [1], 0 or at least mu, and
    lengths of rolling and torsional friction [m]."""

    static: float = 0.0
    rolling: float = 0.0
    torsional: float = 0.0


@dataclass(frozen=True, slots=True)
class Expectation:
    """Event that must happen to `body` and `other` between `earliest` and `latest` [s].

    touch: their gap closes. roll: their contact stops slipping. leave: their gap opens for good. land: their
    gap closes for the first time after the last `leave`. meet: it closes for the first time in the window, at
    whose start it is open. part: it opens in the window, not before, for a tenth of a second or more.
    Repeated events need repeated expectations, in order.
    """

    event: Literal["touch", "roll", "leave", "land", "meet", "part"]
    body: str
    other: str
    earliest: float
    latest: float


@dataclass(frozen=True, slots=True)
class MetricLimit:
    """A scene's own limit: the largest allowed absolute value [SI unit] of a metric, for an engine, profile
    and subject ("" = every one). The most specific limit wins; among equals the last."""

    metric: str
    largest: float
    reason: str = ""
    engine: str = ""
    profile: str = ""
    subject: str = ""


@dataclass(frozen=True, slots=True)
class Arc:
    """Motion from `start` [s] to the next arc; world frame.

    Position [m] and velocity [m/s] of the centre of mass and angular velocity [rad/s] are those at the start;
    acceleration and angular acceleration (along the angular velocity) are constant.
    """

    start: float
    position: Vector
    velocity: Vector = ORIGIN
    acceleration: Vector = ORIGIN
    angular_velocity: Vector = ORIGIN
    angular_acceleration: Vector = ORIGIN


@dataclass(frozen=True, slots=True, repr=False)
class Truth(ShortRepr):
    """Motion of `body` in closed form or integrated to rounding; `closed_form.py` evaluates it.

    arcs: piecewise motion by `arcs`, the first from 0 s. torque_free: motion from the initial state under
    gravity, with three different moments of inertia. coupling: Eq. 6 with a tracker that moves linearly
    within a frame. carried: a body that sticks to or slides on the level top of the scene's prescribed body,
    which moves in a vertical plane without turning. turntable: a ball that rolls on a prescribed body, which
    turns about the vertical at a constant rate. smooth_contact: a ball, an ellipsoid or the rim of a cylinder
    on fixed boxes or half-spaces, or a ball on fixed balls. rolling_cone: a cone that rolls on its side about
    its apex on a fixed plane. tipping: a prism that tips from edge to edge down a fixed slope, e = 0.
    mechanism: bodies that joints without limits connect, without contact. stick_slip: a body that a spring
    holds on a moving surface.
    """

    body: str
    law: Law
    arcs: tuple[Arc, ...] = ()


CHECKS: list[Callable[[Scenario], list[tuple[str, str]]]] = []
"""Functions that list the faults of a scenario; `validation` adds its own when the package is imported."""


@dataclass(frozen=True, slots=True, repr=False)
class Scenario(ShortRepr):
    """Scene with its truth. Construction validates it: `ScenarioError` names every fault at once. Under
    `HOLD_LAST` its trackers first hold their last good samples. No two bodies of one group of
    `contact_exclusions` touch each other."""

    name: str
    summary: str
    tags: tuple[str, ...]
    bodies: tuple[Body, ...]
    duration: float
    coefficients: tuple[PairCoefficients, ...]
    joints: tuple[Joint, ...] = ()
    trackers: tuple[Tracker, ...] = ()
    chains: tuple[Chain, ...] = ()
    gravity: Vector = (0.0, 0.0, -GRAVITY)
    frame_rate: int = 60
    effects: tuple[str, ...] = ("gravity", "restitution", "friction")
    expectations: tuple[Expectation, ...] = ()
    truths: tuple[Truth, ...] = ()
    forces: tuple[ForceTruth, ...] = ()
    published: tuple[Published, ...] = ()
    limits: tuple[MetricLimit, ...] = ()
    body_joints: tuple[BodyJoint, ...] = ()
    contact_exclusions: tuple[tuple[str, ...], ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        if HOLD_LAST.get():
            object.__setattr__(self, "trackers", tuple(map(Tracker.hold_last, self.trackers)))
        found = [fault for check in CHECKS for fault in check(self)]
        if found:
            raise ScenarioError(self.name, found)

    def reduced(self, **fields: object) -> Scenario:
        """Copy with some `bodies`, `effects` or `chains` removed, or with bodies in another order. It is not
        validated again: part of a valid scenario is valid, except that bodies may lack pieces."""
        copy = object.__new__(Scenario)
        for field in dataclass_fields(self):
            object.__setattr__(copy, field.name, fields.get(field.name, getattr(self, field.name)))
        return copy

    @property
    def frame_count(self) -> int:
        """Number of displayed frames after the initial one."""
        return round(self.duration * self.frame_rate)

    @property
    def acting_gravity(self) -> Vector:
        """Gravity [m/s^2]; zero if the effect is off."""
        return self.gravity if "gravity" in self.effects else ORIGIN

    def body_index(self, name: str) -> int:
        return next(i for i, body in enumerate(self.bodies) if body.name == name)

    def links(self, tracker: Tracker) -> tuple[int, ...]:
        """Body indices of a driven body, root first, then the children of its joints in order."""
        children = {joint.name: joint.child for joint in self.joints}
        return tuple(self.body_index(name) for name in (tracker.root, *(children[j] for j in tracker.joints)))

    def prescribes(self, tracker: Tracker) -> bool:
        """Whether a tracker is the path of a prescribed body."""
        return any(body.kind == "prescribed" for body in self.bodies if body.name == tracker.root)

    def groups(self) -> tuple[int, ...]:
        """Per body the index of the tracker that drives it, or -1."""
        drivers = {link: k for k, tracker in enumerate(self.trackers) for link in self.links(tracker)}
        return tuple(drivers.get(k, -1) for k in range(len(self.bodies)))

    def touching_pairs(self) -> Iterator[tuple[int, int]]:
        """Body pairs (a < b) that may touch: both have pieces and contact moves at least one. Links of one
        driven body may touch only with `self_collision` and if they are not adjacent, where links without
        pieces are skipped. Neither bodies of one joint touch each other nor those of one exclusion."""
        group = self.groups()
        above = {joint.child: joint.parent for joint in self.joints}
        bare = {body.name for body in self.bodies if not body.pieces}
        adjacent = set()
        for child, parent in above.items():
            while parent in bare and parent in above:
                parent = above[parent]
            adjacent.add(frozenset((child, parent)))
        joined = {frozenset((joint.parent, joint.child)) for joint in self.body_joints}
        for excluded in self.contact_exclusions:
            joined |= set(map(frozenset, combinations(excluded, 2)))
        for a, b in combinations(range(len(self.bodies)), 2):
            first, second = self.bodies[a], self.bodies[b]
            if not (first.pieces and second.pieces) or {first.kind, second.kind} <= {*UNMOVED}:
                continue
            if group[a] == group[b] >= 0 and (
                "self_collision" not in self.effects or frozenset((first.name, second.name)) in adjacent
            ):
                continue
            if frozenset((first.name, second.name)) in joined:
                continue
            yield a, b

    def pair_coefficients(self, a: int, b: int) -> tuple[float, float]:
        """Restitution and friction of the bodies with index a and b; zero if the effect is off."""
        pair = self._coefficients(a, b)
        e, mu = pair.restitution, pair.friction
        return (e if "restitution" in self.effects else 0.0, mu if "friction" in self.effects else 0.0)

    def friction_law(self, a: int, b: int) -> FrictionLaw:
        """What the friction of the bodies with index a and b has beyond mu; nothing if the effect is off."""
        if "friction" not in self.effects:
            return FrictionLaw()
        pair = self._coefficients(a, b)
        static = pair.static_friction if pair.static_friction > pair.friction else 0.0
        return FrictionLaw(static, pair.rolling_friction, pair.torsional_friction)

    def _coefficients(self, a: int, b: int) -> PairCoefficients:
        wanted = {self.bodies[a].material, self.bodies[b].material}
        return next(c for c in self.coefficients if {c.material_a, c.material_b} == wanted)
