"""The contract every engine meets: Engine, World, Settings, State, Manifest, Unsupported.

Conventions: SI, radians, z up, quaternions wxyz. A body's position is its origin in the world, its linear
velocity that of its *centre of mass*, its angular velocity along the world's axes. A contact's normal
points from body A to body B and A comes before B in the scenario; its distance is negative in overlap; its
impulse is the one B feels in this step, in world axes, friction included. A body drawn from a driven hand
is one link. Contacts carry the geometry of the *start* of the step they acted in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from touchstone.scenarios.avatar.noisy_tracker import TRACKERS
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

Array = NDArray[np.float64]
Scalar = str | int | float | bool

CONTACT_CAPACITY = 32_768
"""Contact points a step may report; more is an error, never a silent loss."""

DRIVES = ("native", "torque", "posed")
"""How an engine's hinges follow their tracker: by its own position servo (the default), by explicit torques
that we hold over a step, or not at all, for links are kinematic (`posed.py`)."""

RESIDUAL_COUNTERS = ("residual", "residual.body_a", "residual.body_b")
"""Counters that belong together: the largest speed by which a contact misses its law after it was solved
[m/s], and its bodies by index (-1: none). Of several steps those of the largest residual are kept."""

CONTACT_FIELDS = np.dtype(
    [
        ("time", "f8"),  # [s] start of the step, or the moment of the impact where an engine knows it
        ("body_a", "i8"),
        ("body_b", "i8"),
        ("position", "f8", 3),  # [m] midpoint of the two witnesses
        ("normal", "f8", 3),  # from A to B
        ("distance", "f8"),  # [m]
        ("impulse", "f8", 3),  # [N s] on B
        ("velocity_a_before", "f8", 3),  # [m/s] of A's surface at `position`; NaN: record.py works it out
        ("velocity_b_before", "f8", 3),
        ("velocity_a_after", "f8", 3),
        ("velocity_b_after", "f8", 3),
    ]
)


MISSING, UNIMPORTABLE = "missing", "unimportable"
"""How a run ends whose engine is not installed, and whose engine is installed but cannot be imported."""


class AdapterError(Exception):
    """Base of what adapters raise on purpose; `status` is how a run that raises it ends."""

    status: ClassVar[str] = "error"


class Unsupported(AdapterError):
    """The engine cannot represent the scene; the message starts with the engine's name."""

    status = "skipped"


class NotInstalled(AdapterError):
    """The engine's package is missing; the message names the extra that brings it."""

    status = MISSING


@dataclass(frozen=True, slots=True)
class Settings:
    """How an engine is to run: a named profile, the native step [s], and "key=value" that differ from the
    profile (reference only); the effects asked for, or None for those that the scene calls for; and, filled
    in from the plan, the stages that the reference leaves out, whether it leaves out in each frame what can
    meet nothing in it, and whether DART, Bullet and MuJoCo let bodies sleep, by their own thresholds;
    one of DRIVES, how they drive hinges; and one of TRACKERS, which variant of them the scene was given."""

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
        """What results are filed under: a changed profile is never mistaken for the profile."""
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


@dataclass(frozen=True, slots=True)
class PairFacts:
    """Restitution and friction the engine will use for a pair of bodies, under its own mixing rule."""

    body_a: str
    body_b: str
    restitution: float
    friction: float


@dataclass(frozen=True, slots=True)
class Manifest:
    """What the engine says it simulates: everything here is read back from it, hidden defaults included."""

    engine: str
    version: str
    profile: str
    dt: float
    settings: Mapping[str, Scalar]
    bodies: Mapping[str, BodyFacts]
    pairs: tuple[PairFacts, ...]
    drives: Mapping[str, object] = field(default_factory=dict)
    effects: Mapping[str, str] = field(default_factory=dict)  # what the plan does about each, and why
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)  # of each hinge [rad]
    pieces: Mapping[str, int] = field(default_factory=dict)  # of each body
    freedom: int = 0  # degrees of freedom of all simulated and driven bodies


def contact_overflow(capacity: int) -> str:
    """The line for a step with more contact points than there is room for."""
    return f"more than {capacity} contact points in one step: the scene has too many contacts to record"


class State:
    """What a step leaves behind, in preallocated arrays that `World.read` fills.

    n bodies (links included), t trackers, j hinges in the order of the trackers' joints. `force` and
    `torque` [N, N m; world, at the root's origin] and `hinge_torque` [N m] are what the drive applied during
    the step; NaN where the engine poses its driven bodies itself.
    """

    def __init__(self, scenario: Scenario) -> None:
        n, t = len(scenario.bodies), len(scenario.trackers)
        j = sum(len(tracker.joints) for tracker in scenario.trackers)
        self.position = np.zeros((n, 3))
        self.orientation = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        self.linear_velocity = np.zeros((n, 3))
        self.angular_velocity = np.zeros((n, 3))
        self.joint_angle = np.zeros(j)
        self.joint_rate = np.zeros(j)
        self.force = np.full((t, 3), np.nan)
        self.torque = np.full((t, 3), np.nan)
        self.hinge_torque = np.full(j, np.nan)
        self.contacts = np.zeros(CONTACT_CAPACITY, dtype=CONTACT_FIELDS)
        self.contact_count = 0

    def clear_contacts(self) -> None:
        """Forget the contacts of the last step."""
        self.contact_count = 0

    def add_contact(
        self, a: int, b: int, position: Array, normal: Array, distance: float, impulse: Array
    ) -> None:
        """Append one contact point. `normal` goes from body a to body b and `impulse` acts on b; both are
        turned round when a comes after b in the scenario."""
        if self.contact_count == CONTACT_CAPACITY:
            raise AdapterError(contact_overflow(CONTACT_CAPACITY))
        sign = 1.0 if a < b else -1.0
        row = self.contacts[self.contact_count]
        row["body_a"], row["body_b"] = min(a, b), max(a, b)
        row["position"] = position
        row["normal"] = sign * normal
        row["distance"] = distance
        row["impulse"] = sign * impulse
        for name in (
            "time",
            "velocity_a_before",
            "velocity_b_before",
            "velocity_a_after",
            "velocity_b_after",
        ):
            row[name] = np.nan
        self.contact_count += 1


class World(Protocol):
    """A scene inside an engine. `record.py` calls, per step: drive, step, read."""

    def drive(self, step: int) -> None:
        """Command the driven bodies for native step number `step` (0 is the first)."""

    def step(self) -> None:
        """Advance by one native step: the engine's own call and nothing else, for it is what is timed."""

    def read(self, state: State) -> None:
        """Write poses, velocities, hinges, drive and contacts of the step just made into `state`."""

    def describe(self) -> Manifest:
        """The manifest, as read back from the engine."""

    def cross(self) -> None:
        """An empty call into the engine: what crossing from Python costs."""

    def stage_seconds(self) -> Mapping[str, float]:
        """Seconds per stage since the last call; empty where the engine tells nothing."""

    def work(self) -> Mapping[str, float]:
        """Work counters of the last step (pairs, impulses, iterations), and what it left unresolved:
        RESIDUAL_COUNTERS, `dropped_time` [s] that was not simulated, `parted_energy` [J] that parting
        overlapping bodies added. Empty where the engine reports none."""

    def close(self) -> None:
        """Free what the engine holds."""


class Engine(Protocol):
    """An engine. `profiles` maps each profile's name to its native step [s]; it stands in the registry."""

    name: ClassVar[str]
    profiles: ClassVar[Mapping[str, float]]

    def build(self, scenario: Scenario, settings: Settings) -> World:
        """Translate a scenario; raises Unsupported where the engine cannot represent it."""

    def version(self) -> str:
        """The engine's version, as it says itself."""
