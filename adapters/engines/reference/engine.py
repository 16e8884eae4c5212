"""Adapter of the reference: translate a scenario to arrays, run one compiled step per frame, read the state.

The contract's conventions are the reference's own. A step covers a whole frame and includes the drive, which
finds postures among fixed bodies by geometry, so its work is unknown (NaN). Its contacts record the time of
the impulse and the velocities before and after it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import ClassVar

import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured
from numpy.typing import NDArray

from touchstone.adapters.contract import (
    BODIES,
    MOMENT_WORK,
    AdapterError,
    BodyFacts,
    Manifest,
    PairFacts,
    Scalar,
    Settings,
    State,
    Unsupported,
    contact_overflow,
    contact_words,
)
from touchstone.adapters.engines.reference.compiling import compile_seconds, frame_of, nothing, small_world
from touchstone.adapters.engines.reference.mechanisms import set_exclusions
from touchstone.adapters.engines.reference.reference_world import (
    Units,
    body_order,
    kinematic,
    translate,
    units,
)
from touchstone.adapters.engines.reference.settings import PAPER, configure, describe
from touchstone.adapters.registry import ENGINES
from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core import conventions, counters
from touchstone.reference_impl.core.conventions import DRIVEN, SIMULATED
from touchstone.reference_impl.core.kernel import JIT, entry_point
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.paper import attraction, ccd_ik, impulses, overlap_avoidance
from touchstone.reference_impl.paper import frame as paper_frame
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.avatar.tracking import TrackerMotion, sample
from touchstone.scenarios.body_joints import is_limited
from touchstone.scenarios.scenario import FRICTION_LAWS, UNMOVED, Scenario, ScenarioError

STAGES = ("drive", "removal", "contact", "rotation")
"""Stages that settings can disable in the compiled step."""
TARGETS = tuple(
    f"{moment}target_{name}"
    for moment in ("old_", "")
    for name in ("position", "orientation", "velocity", "omega")
)
"""Fields of a driver that hold its tracker's poses and velocities, in memory order."""
INEXACT = {
    "residual": "residual",
    "residual.body_a": "residual_body_a",
    "residual.body_b": "residual_body_b",
    "dropped_time": "dropped_time",
    "parted_energy": "parted_energy",
}
"""Counter -> state field with what a frame left unresolved: 0 if nothing (bodies: -1)."""
NUMBERS = tuple(
    (conventions, name)
    for name in ("OVERLAP_TOLERANCE", "TOUCH_DISTANCE", "APPROACH_MIN", "REMOVAL_ROUNDS", "EVENT_CAP")
)
"""Constants in the manifest: module and name."""
PAPER_NUMBERS = (
    (conventions, "OVERLAP_TOLERANCE"),
    (conventions, "TOUCH_DISTANCE"),
    (attraction, "ATTRACTION_TIME"),
    (overlap_avoidance, "TRANSLATION_ROUNDS"),
    (overlap_avoidance, "CHAIN_ROUNDS"),
    (ccd_ik, "CCD_TOLERANCE"),
    (ccd_ik, "CCD_PASSES"),
    (impulses, "APPROACH_LEAST"),
    (impulses, "IMPULSES_AT_ONCE"),
    (paper_frame, "COLLISION_TIMES"),
)
"""The same of profile `paper`."""
FLIPPED = [0, 2, 1, *range(3, 13), *(16, 17, 18), *(13, 14, 15), *(22, 23, 24), *(19, 20, 21)]
"""Places of the words of a contact after its bodies have changed sides (CONTACT_FIELDS)."""


class ReferenceEngine:
    """Engine interface of `reference_impl`."""

    name: ClassVar[str] = "reference"
    profiles: ClassVar[Mapping[str, float]] = ENGINES["reference"].profiles
    plays_body_joints: ClassVar[bool] = True
    friction_laws: ClassVar[tuple[str, ...]] = FRICTION_LAWS

    def version(self) -> str:
        """Version of this project."""
        from importlib.metadata import version

        return version(ENGINES["reference"].distribution)

    def build(self, scenario: Scenario, settings: Settings) -> _World:
        """Translate a scenario to a world of the reference."""
        if settings.profile == PAPER and any(map(scenario.prescribes, scenario.trackers)):
            raise Unsupported("reference: the method of profile paper has no prescribed bodies")
        if settings.profile == PAPER and any(map(surface_moves, scenario.bodies)):
            raise Unsupported("reference: the method of profile paper has no moving surfaces")
        if settings.profile == PAPER and scenario.body_joints:
            raise Unsupported("reference: the method of profile paper has no joints between bodies")
        if settings.profile == PAPER and any(
            getattr(pair, law) > 0 for pair in scenario.coefficients for law in FRICTION_LAWS
        ):
            raise Unsupported("reference: the method of profile paper has no friction beyond its mu")
        compile_seconds()
        return _World(scenario, settings, self.version())


def _unturned(bodies: np.ndarray) -> bool:
    """Whether all orientations of simulated bodies are bitwise invariant under normalization.

    A rotation by zero normalizes them, so it can be skipped only if this holds.
    """
    q = bodies["orientation"][bodies["kind"] == SIMULATED]
    size = np.sqrt(q[:, 0] * q[:, 0] + q[:, 1] * q[:, 1] + q[:, 2] * q[:, 2] + q[:, 3] * q[:, 3])
    return bool((q / size[:, None] == q).all())


@cache
def _entry_points(profile: str) -> tuple[Callable[..., None], ...]:
    """Compiled code of a profile's `prepare` and `step`, and of an empty kernel.

    The arrays of all worlds have the same types.
    """
    world, frame = small_world(), frame_of(profile)
    return tuple(entry_point(kernel, *world) for kernel in (frame.prepare, frame.step, nothing))


def _targets(world: World, motions: Sequence[TrackerMotion]) -> list[tuple[np.ndarray, list[np.ndarray]]]:
    """Precompute tracker targets: views of drivers and joints, each with the values to copy per frame.

    One copy serves all drivers and one all hinges; each takes up to a third of a microsecond.
    """
    if not motions:
        return []
    names = ("position", "orientation", "linear_velocity", "angular_velocity")
    drivers, hinges = world.drivers[: len(motions)], sum(motion.angle.shape[1] for motion in motions)
    poses = np.stack([np.hstack([getattr(m, name) for name in names]) for m in motions], axis=1)
    shown = np.concatenate([poses[:-1], poses[1:]], axis=2)
    found = [(structured_to_unstructured(drivers[list(TARGETS)], copy=False), list(shown))]
    if hinges:
        angles, rates = (np.hstack([getattr(m, name)[1:] for m in motions]) for name in ("angle", "rate"))
        joints = structured_to_unstructured(
            world.joints[:hinges][["target_angle", "target_rate"]], copy=False
        )
        found.append((joints, list(np.stack([angles, rates], axis=2))))
    return found


def _in_si(contacts: np.ndarray, units: Units) -> None:
    """Convert rows of contacts from a scene's units."""
    contacts["time"] *= units.time
    contacts["position"] *= units.length
    contacts["distance"] *= units.length
    contacts["impulse"] *= units.mass * units.time
    for name in ("velocity_a_before", "velocity_b_before", "velocity_a_after", "velocity_b_after"):
        contacts[name] *= units.time


class _World:
    def __init__(self, scenario: Scenario, settings: Settings, version: str) -> None:
        self._scenario, self._settings, self._version = scenario, settings, version
        # the scenario's index of each row of the arrays, and the row of each body
        self._bodies = np.array(body_order(scenario), int)
        self._rows = np.argsort(self._bodies)
        self._reordered = bool((self._rows != np.arange(len(self._rows))).any())
        arranged = scenario.reduced(bodies=tuple(scenario.bodies[k] for k in self._bodies.tolist()))
        # the paper's times, such as that of the attraction, have no unit of the scene's
        self._units = units(scenario) if settings.profile != PAPER else Units()
        try:
            arranged = self._units.of(arranged)
        except ScenarioError as error:
            field, fault = error.faults[0]
            found = f"in units of {self._units.mass:.3g} kg and {self._units.length:.3g} m"
            raise Unsupported(f"reference: {found}, {field}: {fault}") from error
        self._world = translate(kinematic(arranged) if settings.drive == "posed" else arranged)
        self._state = self._world.state[0]
        self._contact_words = contact_words(self._world.contacts)
        self._state["dt"] = dt = settings.dt / self._units.time
        self._state["gravity"] = scenario.acting_gravity
        configure(self._state, settings.profile, settings.changes)
        # `paper` runs all its stages in every frame
        if settings.profile != PAPER:
            self._leave_out(settings)
        times = np.arange(round(scenario.duration / settings.dt) + 1) * dt
        times = np.minimum(times, arranged.duration)
        self._targets = _targets(self._world, [sample(tracker, times) for tracker in arranged.trackers])
        self._next = 0
        self._stages = np.zeros(len(counters.STAGES))
        prepare, self._step, self._cross = _entry_points(settings.profile)
        prepare(*self._world)
        if arranged.contact_exclusions:
            mechanisms = int(self._state["mechanisms"])
            set_exclusions(arranged, self._world.bodies, self._world.pieces, mechanisms)
        if not self._world.drivers["has_free"][: len(scenario.trackers)].all():
            self._refuse_stuck()

    def _leave_out(self, settings: Settings) -> None:
        """Disable the stages that the plan of the scene leaves out."""
        self._state["update_fat_bounds"] = settings.fat_bounds and not self._scenario.body_joints
        limited = any(map(is_limited, self._scenario.body_joints))
        for stage in settings.skipped:
            if stage == "contact" and limited:
                continue
            if stage == "sweep":
                self._state["detection"] = conventions.DETECTION_DISCRETE
            else:
                self._state[f"skip_{stage}"] = 1
        if not _unturned(self._world.bodies):
            self._state["skip_rotation"] = 0

    def _refuse_stuck(self) -> None:
        """Refuse a tracker that starts in an overlap which the first frame does not resolve."""
        self._aim_at(0)
        trial = World(*(array.copy() for array in self._world))
        self._step(*trial)
        for driver in np.flatnonzero(trial.drivers["is_free"] == 0).tolist():
            end, _ = detect(trial.of_stages(), DRIVEN, 0)
            mine = [
                pair
                for pair in trial.pairs[:end]
                if driver in trial.bodies["driver"][[pair["body_a"], pair["body_b"]]]
            ]
            deepest = min(mine, key=lambda pair: pair["distance"])
            a, b = (self._scenario.bodies[self._bodies[deepest[side]]].name for side in ("body_a", "body_b"))
            depth = -deepest["distance"] * self._units.length
            raise AdapterError(
                f"reference: trackers[{driver}] starts stuck: in frame 1 {a!r} and {b!r} overlap by "
                f"{depth:.3g} m and no way out is found; start it free of overlap"
            )

    def drive(self, step: int) -> None:
        """Select the frame; the reference's step contains the drive and reads its targets."""
        self._next = step

    def step(self) -> None:
        """Set the targets of the frame and run the compiled step."""
        self._aim_at(self._next)
        self._step(*self._world)

    def _aim_at(self, frame: int) -> None:
        """Copy the tracker's poses and velocities at the frame's start and end into the world."""
        for target, shown in self._targets:
            target[...] = shown[frame]

    def read(self, state: State) -> None:
        """Copy poses, velocities, hinges and contacts into `state`; raises AdapterError at overflow."""
        bodies, joints = self._world.bodies, self._world.joints
        self._stages += self._state["stage_seconds"]
        fields = (bodies[name] for name in ("position", "orientation", "velocity", "omega"))
        if self._reordered:
            fields = (field[self._rows] for field in fields)
        state.position[:], state.orientation[:], state.linear_velocity[:], state.angular_velocity[:] = fields
        hinges = joints[: len(state.joint_angle)]
        state.joint_angle[:], state.joint_rate[:] = hinges["angle"], hinges["rate"]
        units = self._units
        if units.time != 1:
            state.position[:] *= units.length
            state.linear_velocity[:] *= units.time
            state.angular_velocity[:] /= units.time
            state.joint_rate[:] /= units.time
        count = int(self._state["contact_count"])
        lost = int(self._state["counters"][counters.COUNT_LOST])
        if lost:
            full = "contacts" if count >= len(self._world.contacts) else "pairs"
            room = len(getattr(self._world, full))
            raise AdapterError(f"reference: more than {room} {full} in one step: {lost} were dropped")
        if count > len(state.contacts):
            raise AdapterError(f"reference: {contact_overflow(len(state.contacts))}")
        state.contact_words[:count] = self._contact_words[:count]
        if self._reordered:
            self._name_bodies(state.contacts[:count], state.contact_words[:count])
        if units != Units():
            _in_si(state.contacts[:count], units)
        state.contact_count = count

    def _name_bodies(self, rows: np.ndarray, words: NDArray[np.int64]) -> None:
        """Replace the arrays' indices of bodies by the scenario's, in which A comes before B."""
        words[:, BODIES] = self._bodies[words[:, BODIES]]
        flipped = rows["body_a"] > rows["body_b"]
        if flipped.any():
            words[flipped] = words[flipped][:, FLIPPED]
            rows["normal"][flipped] *= -1
            rows["impulse"][flipped] *= -1

    def describe(self) -> Manifest:
        """Manifest read from the arrays: masses, inertias, coefficients and settings."""
        scenario, world, units = self._scenario, self._world, self._units
        is_paper = self._settings.profile == PAPER
        settings: dict[str, Scalar] = {
            **({} if is_paper else describe(self._state)),
            "gravity": str(self._state["gravity"].tolist()),
            "compiled": JIT,
            "collision_shapes": len(self._world.pieces),
            "unit of mass": units.mass,
            "unit of length": units.length,
            "fat bounds": bool(self._state["update_fat_bounds"]),
            "stages left out": ", ".join(s for s in STAGES if self._state[f"skip_{s}"]) or "none",
        }
        for module, name in PAPER_NUMBERS if is_paper else NUMBERS:
            settings[name.lower().replace("_", " ")] = getattr(module, name)
        rows = zip(scenario.bodies, world.bodies[self._rows])
        facts = {
            body.name: BodyFacts(
                float(row["mass"]) * units.mass,
                tuple((row["center_of_mass"] * units.length).tolist()),
                tuple(map(tuple, (row["inertia"] * (units.mass * units.length**2)).tolist())),
            )
            for body, row in rows
            if body.kind not in UNMOVED
        }
        drives = {
            tracker.root: {
                "mass": float(row["mass"]) * units.mass,
                "stiffness": float(row["stiffness"]) * units.mass / units.length,
                "damping": float(row["damping"]) * units.mass / units.time,
            }
            for tracker, row in zip(scenario.trackers, world.drivers)
            if not row["prescribed"]
        }
        names = [name for tracker in scenario.trackers for name in tracker.joints]
        pairs = tuple(self._pair(a, b) for a, b in scenario.touching_pairs())
        free = (world.bodies["kind"] == conventions.SIMULATED) & (world.bodies["driver"] < 0)
        mechanisms = world.drivers[len(scenario.trackers) :]
        joined = int((mechanisms["hinge_count"] - mechanisms["loop_rows"]).sum())
        return Manifest(
            ReferenceEngine.name,
            self._version,
            self._settings.label,
            self._settings.dt,
            settings,
            facts,
            pairs,
            drives,
            limits={j: (float(row["lower"]), float(row["upper"])) for j, row in zip(names, world.joints)},
            pieces={
                b.name: int((world.pieces["body"] == k).sum()) for k, b in zip(self._rows, scenario.bodies)
            },
            freedom=6 * (int(free.sum()) + len(drives)) + len(names) + joined,
        )

    def _pair(self, a: int, b: int) -> PairFacts:
        one, two = (self._world.bodies[self._rows[k]]["material"] for k in (a, b))
        return PairFacts(
            self._scenario.bodies[a].name,
            self._scenario.bodies[b].name,
            float(self._state["restitution"][one, two]),
            float(self._state["friction_coefficient"][one, two]),
        )

    def cross(self) -> None:
        """Set the targets of a step and call an empty kernel with its arguments."""
        self._aim_at(self._next)
        self._cross(*self._world)

    def stage_seconds(self) -> Mapping[str, float]:
        """Time per stage since the last call [s]."""
        seconds = dict(zip(counters.STAGES, self._stages.tolist()))
        self._stages[:] = 0.0
        return seconds

    def work(self) -> Mapping[str, float]:
        """Work counters of the last frame, and what it left unresolved (INEXACT)."""
        counted = dict(zip(counters.COUNTERS, map(float, self._state["counters"].tolist())))
        left = {name: float(self._state[field]) for name, field in INEXACT.items()}
        for name in ("residual.body_a", "residual.body_b"):
            if left[name] >= 0:
                left[name] = float(self._bodies[int(left[name])])
        left["residual"] *= self._units.time
        left["dropped_time"] *= self._units.time
        left["parted_energy"] *= self._units.mass * self._units.length
        if self._state["moments"]:
            left[MOMENT_WORK] = float(self._state["moment_work"]) * self._units.mass * self._units.length
        return counted | left

    def close(self) -> None:
        """Release nothing: the world holds no external resources."""
