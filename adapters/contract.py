"""Interface of every engine: Engine, World, Settings, State, Manifest, Unsupported.

Conventions: SI units, radians, z up, quaternions wxyz. A body's position is its origin in the world frame;
its linear velocity is that of its *centre of mass*; its angular velocity is along the world axes. In a
contact, A comes before B in the scenario and the normal points from A to B. The distance is negative in
overlap. The impulse acts on B during this step, in world axes, friction included. A body drawn from a driven
hand is one link. Contacts carry the geometry at the *start* of the step they acted in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import prod
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchstone.scenarios.avatar.noisy_tracker import TRACKERS
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario, ShortRepr

Array = NDArray[np.float64]
Scalar = str | int | float | bool

CONTACT_CAPACITY = 65_536
"""Least capacity for contact points per step; overflow raises an error instead of dropping points."""
CONTACTS_PER_BODY = 512
"""Capacity for contact points per body and step in large scenes: the reference logs all substeps."""

DRIVES = ("native", "torque", "posed")
"""Ways to drive driven bodies: by an implicit coupling of the root and the engine's own position servos
(default), by explicit forces and torques held constant over a step (the reference does not), or not at all
because links are kinematic (`posed_drive.py`)."""

MOMENT_WORK = "moment_work"
"""Counter of the reference: work of rolling and torsional friction [J], where a scene has any."""
RESIDUAL_COUNTERS = ("residual", "residual.body_a", "residual.body_b")
"""Counters that belong together: the largest speed by which a contact violates its law after the solve [m/s],
and the indices of its bodies (-1: none). Over several steps, those of the largest residual are kept."""

CONTACT_FIELDS = np.dtype(
    [
        ("time", "f8"),  # [s] start of the step, or time of the impact if the engine knows it
        ("body_a", "i8"),
        ("body_b", "i8"),
        ("position", "f8", 3),  # [m] midpoint of the two witnesses
        ("normal", "f8", 3),  # from A to B
        ("distance", "f8"),  # [m]
        ("impulse", "f8", 3),  # [N s] on B
        ("velocity_a_before", "f8", 3),  # [m/s] of A's surface at `position`; NaN: the recorder computes it
        ("velocity_b_before", "f8", 3),
        ("velocity_a_after", "f8", 3),
        ("velocity_b_after", "f8", 3),
    ]
)
BODIES, POSITION, NORMAL, DISTANCE, IMPULSE = slice(1, 3), slice(3, 6), slice(6, 9), 9, slice(10, 13)
"""Places of fields of CONTACT_FIELDS, counted in words of 8 bytes."""

FRICTION_IMPULSES, NOT_REPORTED = "friction_impulses", "not reported"
"""Fact in the settings of a manifest, and its value, of an engine that reports normal impulses alone."""

LARGEST_STATE = 1e30
"""Magnitude that no number of a state reaches [SI units]: it fits single precision, its powers fit double."""

MISSING, UNIMPORTABLE = "missing", "unimportable"
"""Status of a run whose engine is not installed, or is installed but cannot be imported."""


class AdapterError(Exception):
    """Base class of the adapters' exceptions; `status` is the status of a run that raises it."""

    status: ClassVar[str] = "error"


class Unsupported(AdapterError):
    """The engine cannot represent the scene; the message starts with the engine's name."""

    status = "skipped"


class NotInstalled(AdapterError):
    """The engine's package is missing; the message names what pip installs."""

    status = MISSING


@dataclass(frozen=True, slots=True)
class Settings:
    """How to run an engine.

    Attributes:
        profile: name of the profile.
        dt: native step [s].
        changes: "key=value" that differ from the profile (`registry.settings_of`).
        effects: effects requested; None: those that the scene requires.
        skipped: stages that the reference skips, from the plan.
        fat_bounds: whether the reference skips collision checks of pieces that stay inside their fat bounds.
        sleeping: whether DART, Bullet and MuJoCo let bodies sleep, by their own thresholds.
        drive: one of DRIVES.
        tracker: one of TRACKERS, the variant of the scene's trackers.
    """

    profile: str
    dt: float
    changes: tuple[str, ...] = ()
    effects: tuple[str, ...] | None = None
    skipped: tuple[str, ...] = ()
    fat_bounds: bool = False
    sleeping: bool = False
    drive: str = DRIVES[0]
    tracker: str = TRACKERS[0]

    @property
    def label(self) -> str:
        """Key of the results, distinct for every change of a profile."""
        changed = [*self.changes]
        if self.drive != DRIVES[0]:
            changed.append(f"drive={self.drive}")
        if self.tracker != TRACKERS[0]:
            changed.append(f"tracker={self.tracker}")
        if self.effects is not None:
            changed.append("effects=" + ("all" if self.effects == PLANNED else "+".join(self.effects)))
        return ", ".join((self.profile, *changed))


@dataclass(frozen=True, slots=True)
class BodyFacts:
    """Mass [kg], centre of mass [m, body frame], inertia about it along the body axes [kg m^2]."""

    mass: float
    center_of_mass: tuple[float, ...]
    inertia: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, mass: float, center_of_mass: ArrayLike, inertia: ArrayLike) -> BodyFacts:
        """Facts from arrays of numbers of any precision."""
        center, rows = np.asarray(center_of_mass, float).tolist(), np.asarray(inertia, float).tolist()
        return cls(float(mass), tuple(center), tuple(map(tuple, rows)))


@dataclass(frozen=True, slots=True)
class PairFacts:
    """Restitution and friction that the engine uses for a pair of bodies, after its own combine rule."""

    body_a: str
    body_b: str
    restitution: float
    friction: float


@dataclass(frozen=True, slots=True, repr=False)
class Manifest(ShortRepr):
    """What the engine simulates, read back from it, hidden defaults included."""

    engine: str
    version: str
    profile: str
    dt: float
    settings: Mapping[str, Scalar]
    bodies: Mapping[str, BodyFacts]
    pairs: tuple[PairFacts, ...]
    drives: Mapping[str, object] = field(default_factory=dict)
    effects: Mapping[str, str] = field(default_factory=dict)  # the plan's decision on each, and why
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # of each hinge [rad]
    pieces: Mapping[str, int] = field(default_factory=dict)  # of each body
    freedom: int = 0  # degrees of freedom of all simulated and driven bodies


def contact_capacity(scenario: Scenario) -> int:
    """Largest number of contact points that a step of a scenario may have."""
    return max(CONTACT_CAPACITY, CONTACTS_PER_BODY * len(scenario.bodies))


def contact_overflow(capacity: int) -> str:
    """Message for a step whose contact points exceed the capacity."""
    return f"more than {capacity} contact points in one step: the scene has too many contacts to record"


def contact_words(rows: np.ndarray) -> NDArray[np.int64]:
    """Rows of CONTACT_FIELDS (c,) as words of 8 bytes (c, 25): copied ten times as fast as fields."""
    return rows.view(np.int64).reshape(len(rows), CONTACT_FIELDS.itemsize // 8)


STATE_FIELDS = (
    *("position", "orientation", "linear_velocity", "angular_velocity"),
    *("joint_angle", "joint_rate"),
)
"""Arrays of a state, in the order of `State.values`."""


def _sizes(scenario: Scenario) -> tuple[int, int, int]:
    """Numbers of bodies, trackers and hinges."""
    trackers = scenario.trackers
    return len(scenario.bodies), len(trackers), sum(len(tracker.joints) for tracker in trackers)


def state_fields(values: Array, scenario: Scenario) -> tuple[Array, ...]:
    """Views of `State.values`, or of a stack of them (..., m): STATE_FIELDS, in order."""
    n, _, j = _sizes(scenario)
    shapes = ((n, 3), (n, 4), (n, 3), (n, 3), (j,), (j,))
    return _views(values, shapes)


def applied_fields(applied: Array, scenario: Scenario) -> tuple[Array, ...]:
    """Views of `State.applied`, or of a stack of them: force, torque and hinge torques."""
    _, t, j = _sizes(scenario)
    return _views(applied, ((t, 3), (t, 3), (j,)))


def _views(flat: Array, shapes: tuple[tuple[int, ...], ...]) -> tuple[Array, ...]:
    ends = np.cumsum([prod(shape) for shape in shapes])
    parts = zip(ends, shapes)
    return tuple(flat[..., end - prod(shape) : end].reshape(*flat.shape[:-1], *shape) for end, shape in parts)


class State:
    """State after a step, in preallocated arrays that `World.read` fills.

    n bodies (links included), t trackers, j hinges in the order of the trackers' joints. `force` and `torque`
    [N, N m; world, at the root's origin] and `hinge_torque` [N m] are what the drive applied during the step;
    NaN if the engine poses its driven bodies itself, or does not report it.
    """

    def __init__(self, scenario: Scenario) -> None:
        n, t, j = _sizes(scenario)
        self.values = np.zeros(13 * n + 2 * j)
        self.applied = np.full(6 * t + j, np.nan)
        fields = state_fields(self.values, scenario)
        self.position, self.orientation, self.linear_velocity, self.angular_velocity = fields[:4]
        self.joint_angle, self.joint_rate = fields[4:]
        self.orientation[:, 0] = 1.0
        self.force, self.torque, self.hinge_torque = applied_fields(self.applied, scenario)
        self.contacts = np.zeros(contact_capacity(scenario), dtype=CONTACT_FIELDS)
        self.contact_words = contact_words(self.contacts)
        self._contact_numbers = self.contact_words.view(np.float64)
        self.contact_count = 0

    @property
    def replaced(self) -> str:
        """Name of an array that an engine replaced instead of writing into it; "" if there is none."""
        for name in STATE_FIELDS:
            if getattr(self, name).base is not self.values:
                return name
        return ""

    def clear_contacts(self) -> None:
        self.contact_count = 0

    def add_contact(
        self, a: int, b: int, position: Array, normal: Array, distance: float, impulse: Array
    ) -> None:
        """Append one contact point. `normal` points from body a to body b and `impulse` acts on b; both are
        flipped if a comes after b in the scenario."""
        place, direction, push = (np.reshape(vector, (1, 3)) for vector in (position, normal, impulse))
        self.add_contacts(np.array((a,)), np.array((b,)), place, direction, np.array((distance,)), push)

    def add_contacts(
        self, a: Array, b: Array, position: Array, normal: Array, distance: Array, impulse: Array
    ) -> None:
        """Append k points by columns, as `add_contact` does: bodies, distances (k,), vectors (k, 3).
        One call per step takes a tenth of the time of one call per point."""
        end = self.contact_count + len(a)
        if end > len(self.contacts):
            raise AdapterError(contact_overflow(len(self.contacts)))
        numbers = self._contact_numbers[self.contact_count : end]
        numbers[:] = np.nan
        sign = np.where(a < b, 1.0, -1.0)[:, None]
        words = self.contact_words[self.contact_count : end]
        words[:, BODIES] = np.transpose((np.minimum(a, b), np.maximum(a, b)))
        numbers[:, POSITION], numbers[:, DISTANCE] = position, distance
        numbers[:, NORMAL], numbers[:, IMPULSE] = sign * normal, sign * impulse
        self.contact_count = end


class World(Protocol):
    """A scene inside an engine. The recorder calls drive, step and read in every step."""

    def drive(self, step: int) -> None:
        """Command the driven bodies for native step number `step` (0 is the first)."""

    def step(self) -> None:
        """Advance by one native step. This call is timed, so it contains the engine's own call and nothing
        else."""

    def read(self, state: State) -> None:
        """Write poses, velocities, hinges, drive and contacts of the last step into `state`."""

    def describe(self) -> Manifest:
        """Manifest as read back from the engine."""

    def cross(self) -> None:
        """Make an empty call into the engine, which measures the call overhead from Python."""

    def stage_seconds(self) -> Mapping[str, float]:
        """Time per stage since the last call [s]; empty if the engine reports none."""

    def work(self) -> Mapping[str, float]:
        """Work counters of the last step (pairs, impulses, iterations) and what it left unresolved.

        The latter are RESIDUAL_COUNTERS, `dropped_time` [s] that was not simulated, and `parted_energy` [J]
        added by the separation of overlapping bodies. Empty if the engine reports none.
        """

    def close(self) -> None:
        """Release the engine's resources."""


class Engine(Protocol):
    """An engine. `profiles` maps each profile's name to its native step [s], as in the registry. One that has
    joints between bodies and exclusions of contact sets `plays_body_joints`; one that has laws of friction
    beyond mu names them in `friction_laws` (of FRICTION_LAWS)."""

    name: ClassVar[str]
    profiles: ClassVar[Mapping[str, float]]

    def build(self, scenario: Scenario, settings: Settings) -> World:
        """Translate a scenario; raises Unsupported if the engine cannot represent it."""

    def version(self) -> str:
        """Version that the engine reports."""
