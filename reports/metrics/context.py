"""The context of a metric: a recording, its scene, and quantities derived from both, computed once.

`adapters.oracles` measures overlap and gaps (coal) and postures (pinocchio): without these libraries, which
are core dependencies, their metrics get no verdict, and the user gets an error message.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sized
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.scenarios.avatar.surface_motion import material_velocity, surface_moves
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import TRACKED, Scenario
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.named_pairs import named_pairs
from touchstone.scenarios.truths.pair_names import PairName

if TYPE_CHECKING:
    from touchstone.adapters.oracles.overlap import Distances


JUDGES = {
    "touchstone.adapters.oracles.overlap": "overlap, gaps and passages",
    "touchstone.adapters.oracles.nearest_posture": "postures",
}
"""Quantity that each oracle measures."""
REINSTALLED = "coal pin numba"
"""What pip reinstalls: the oracles' packages, and numba so that numpy stays at a version that it takes."""


def judge_faults() -> list[str]:
    """One line per oracle that cannot be imported: the unjudged quantities and the reason."""
    found = []
    for module, measured in JUDGES.items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            found.append(f"{measured} cannot be judged: {fault_text(error)}")
    return found


def fault_text(error: ImportError) -> str:
    """The reason why an oracle is missing and how to install it, in one line."""
    reason = str(error).partition("\n")[0]
    return f"{reason} (pip install --force-reinstall {REINSTALLED})"


ROUNDING = 1e-9
"""Share of a frame by which rounding may assign a contact at its start to the previous frame [1]."""


class NotMeasured(Exception):
    """A metric that does not apply to this recording; the message is the row's reason."""


class JudgeMissing(NotMeasured):
    """The oracle cannot be imported; this differs from a metric that does not apply."""


@dataclass(frozen=True, slots=True)
class Value:
    """A value with an optional remark; a missing value is NaN, with the reason."""

    value: float
    reason: str = ""


Values = Mapping[str, float | Value]
"""Subject (a pair, a body, an event; "" for the whole scene) -> value."""
Found = TypeVar("Found", bound=Sized)


def measured(found: Found, reason: str) -> Found:
    """What was found; raises NotMeasured if it is nothing."""
    if not found:
        raise NotMeasured(reason)
    return found


def worst(found: Mapping[str, float]) -> Values:
    """The largest value of several bodies, for the whole scene; the remark names the body."""
    name = max(found, key=lambda body: abs(found[body]))
    return {"": Value(found[name], f"of {name}" if len(found) > 1 else "")}


@contextmanager
def judging() -> Iterator[None]:
    """Import an oracle; raises JudgeMissing with the reason where that fails."""
    try:
        yield
    except ImportError as error:
        raise JudgeMissing(fault_text(error)) from error


@dataclass(frozen=True, slots=True)
class Metric:
    """A row of the METRICS table. `label` is its name for readers of pages;
    `shown` is the unit in tables, and how many of it make one `unit`. `better` is `lower` where a value
    nearer to 0 is: a signed one is an error, whose truth is 0."""

    name: str
    label: str
    unit: str
    better: Literal["lower", "none"]
    measure: Callable[[Context], Values]
    shown: tuple[str, float] | None = None

    @property
    def formula(self) -> str:
        """The first line of the metric's docstring."""
        return (self.measure.__doc__ or "").strip().splitlines()[0]


class Context:
    """A recording and its scene; bodies by index, conventions as in `adapters/contract.py`."""

    def __init__(self, recording: Recording, scenario: Scenario) -> None:
        self.recording = recording
        self.scenario = scenario
        self.frame = 1 / scenario.frame_rate
        self.gravity = np.array(scenario.acting_gravity)
        self.mass = np.array([body.mass for body in scenario.bodies])
        self.kind = [body.kind for body in scenario.bodies]
        self.simulated = [k for k, kind in enumerate(self.kind) if kind == "simulated"]

    @cached_property
    def expected_pairs(self) -> dict[tuple[str, str], list[tuple[int, int]]]:
        """Body pairs (a < b) of each pair of names in the expectations; a root stands for all of its
        links."""
        names = dict.fromkeys((e.body, e.other) for e in self.scenario.expectations)
        return {pair: named_pairs(self.scenario, *pair) for pair in names}

    @cached_property
    def distances(self) -> Distances:
        """Signed distances by the overlap oracle; raises JudgeMissing where it cannot be imported."""
        with judging():
            from touchstone.adapters.oracles.overlap import measure
        asked = {pair for pairs in self.expected_pairs.values() for pair in pairs}
        asked |= {(a, b) for a, b in self.met[0] if "simulated" in (self.kind[a], self.kind[b])}
        asked |= {pair for pair in self.scenario.touching_pairs() if set(pair) & self.truths.keys()}
        return measure(self.recording, self.scenario, asked)

    @cached_property
    def truths(self) -> dict[int, Motion]:
        """Closed-form motion per body index at the recording's times; empty without a closed form."""
        scene, time = self.scenario, self.recording.time
        return {scene.body_index(truth.body): motion(scene, truth, time) for truth in scene.truths}

    @cached_property
    def mass_centers(self) -> Array:
        """Centres of mass (f, n, 3) [m]."""
        r = self.recording
        frames, count = r.orientation.shape[:2]
        turned = Rotation.from_quat(r.orientation.reshape(-1, 4), scalar_first=True)
        local = np.tile([body.center_of_mass for body in self.scenario.bodies], (frames, 1))
        return r.position + turned.apply(local).reshape(frames, count, 3)

    def surface_velocity(self, body: int, point: Array) -> Array:
        """Velocity (f, 3) of a body at world points (f, 3), without the motion of its surface's material."""
        r = self.recording
        arm = point - self.mass_centers[:, body]
        return r.linear_velocity[:, body] + np.cross(r.angular_velocity[:, body], arm)

    def material_velocity(self, body: int, point: Array, normal: Array) -> Array:
        """Velocity (f, 3) of a body's material at points (f, 3) of contact planes with normals (f, 3)."""
        r = self.recording
        arm, turn = point - r.position[:, body], r.orientation[:, body]
        motion = material_velocity(self.scenario.bodies[body], turn, arm, normal)
        return self.surface_velocity(body, point) + motion

    @cached_property
    def drives(self) -> NDArray[np.bool_]:
        """Per body, whether its contacts do work: it follows a tracker, or its surface moves."""
        return np.array([body.kind in TRACKED or surface_moves(body) for body in self.scenario.bodies])

    @cached_property
    def restitution(self) -> Array:
        """Requested coefficient of restitution per contact row."""
        return self._coefficients[:, 0]

    @cached_property
    def friction(self) -> Array:
        """Requested friction coefficient per contact row. In the reference, as in the paper, driven bodies
        have no friction on fixed ones or on each other."""
        if self.recording.facts["engine"] != "reference":
            return self._coefficients[:, 1]
        rows = self.recording.contacts
        kinds = np.array(self.kind)
        simulated = (kinds[rows["body_a"]] == "simulated") | (kinds[rows["body_b"]] == "simulated")
        return np.where(simulated, self._coefficients[:, 1], 0.0)

    @cached_property
    def most_friction(self) -> Array:
        """The same of contacts that stick: that of static friction, if it is larger."""
        met, which = self.met
        static = np.array([self.scenario.friction_law(a, b).static for a, b in met])[which]
        lost = (self.friction == 0) & (self._coefficients[:, 1] > 0)
        return np.where(lost, 0.0, np.maximum(self.friction, static))

    @cached_property
    def _coefficients(self) -> Array:
        met, which = self.met
        return np.array([self.scenario.pair_coefficients(a, b) for a, b in met]).reshape(-1, 2)[which]

    @cached_property
    def met(self) -> tuple[list[tuple[int, int]], NDArray[np.int64]]:
        """Body pairs that have contact rows, and the pair's index per row."""
        rows, count = self.recording.contacts, len(self.kind)
        codes = rows["body_a"].astype(np.int64) * count + rows["body_b"]
        codes, which = np.unique(codes, return_inverse=True)
        return [divmod(code, count) for code in codes.tolist()], which

    @cached_property
    def pair_rows(self) -> dict[tuple[int, int], NDArray[np.int64]]:
        """Contact rows of each body pair that has any, in time order."""
        met, which = self.met
        ends = np.cumsum(np.bincount(which, minlength=len(met)))
        return dict(zip(met, np.split(np.argsort(which, kind="stable"), ends[:-1])))

    @cached_property
    def impulses(self) -> tuple[Array, Array]:
        """Per contact row: normal impulse (c,) and tangential impulse on B (c, 3) [N s]."""
        rows = self.recording.contacts
        normal = np.einsum("ij,ij->i", rows["impulse"], rows["normal"])
        return normal, rows["impulse"] - normal[:, None] * rows["normal"]

    @cached_property
    def contact_frame(self) -> NDArray[np.int64]:
        """Index of the displayed step (of s = frames - 1) in which each contact row acted."""
        step = self.recording.contacts["time"] / self.frame + ROUNDING
        return np.minimum(step.astype(np.int64), len(self.recording.time) - 2)

    def slip(self, moment: Literal["before", "after"]) -> Array:
        """Tangential velocity of B relative to A per contact row (c, 3) [m/s]."""
        rows = self.recording.contacts
        relative = rows[f"velocity_b_{moment}"] - rows[f"velocity_a_{moment}"]
        along = np.einsum("ij,ij->i", relative, rows["normal"])
        return np.asarray(relative - along[:, None] * rows["normal"])

    @cached_property
    def least_impulse(self) -> Array:
        """j_0 = 1e-3 m g h per contact row [N s]; smaller impulses are noise."""
        rows = self.recording.contacts
        weight = np.linalg.norm(self.gravity) or 1.0
        step = float(self.recording.facts["dt"])
        masses = np.where(np.array([kind == "simulated" for kind in self.kind]), self.mass, np.inf)
        lighter = np.minimum(masses[rows["body_a"]], masses[rows["body_b"]])
        return np.asarray(1e-3 * np.where(np.isfinite(lighter), lighter, self.mass.max()) * weight * step)

    def pair_name(self, a: int, b: int, event: int = 0) -> PairName:
        """Subject of a pair of bodies, or of one of its events."""
        return PairName(self.scenario.bodies[a].name, self.scenario.bodies[b].name, event)

    def owner_pair(self, a: int, b: int) -> PairName:
        """Subject of a pair of bodies; the name of the root stands for any link of a driven body."""
        return PairName(self.owner(a), self.owner(b))

    def owner(self, body: int) -> str:
        """Name of a body, or of the root of the driven body whose link it is."""
        group = self._groups[body]
        return self.scenario.trackers[group].root if group >= 0 else self.scenario.bodies[body].name

    @cached_property
    def _groups(self) -> tuple[int, ...]:
        return self.scenario.groups()
