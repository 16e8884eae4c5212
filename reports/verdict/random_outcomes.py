"""Outcome of a random scene, for which nothing was tuned, without a closed form.

U is the energy at the start (`available_energy`); where drivers do work it includes the largest of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.contacts.overlap import overlap_depth
from touchstone.reports.metrics.contacts.passages import UNBOUNDED, passages
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import STORING, drive_work, energy_rise, mechanical_energy
from touchstone.reports.verdict.figures import available_energy, finite, momentum_change
from touchstone.reports.verdict.outcomes import EXPLODED, RANDOM_CLASSES
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.random_scenes.bodies import support
from touchstone.scenarios.scenario import Scenario, Tracker

EXPLODED_SPEED, EXPLODED_PACE = 30.0, 4.0
"""Speed from which a run with a driven body counts as exploded [m/s], ten times the fastest hand's, or over
the speed of the fastest tracker that does not jump [1]: an impact doubles it, and the next one again."""
COUNTERS = ("gave_up", "unconverged", "dropped_time", "parted_energy", "solves", "solves.open")
"""Counters of the reference for frames that were not resolved exactly; dropped_time in s, parted_energy in
J."""


@dataclass(frozen=True, slots=True)
class RunBounds:
    """Largest values of an `ok` run: overlap [m], change of momentum over its sum [1], rise of energy in a
    frame over U [1], residual of a frame [m/s], rise of energy beyond the work of drivers over U [1]."""

    overlap: float
    momentum: float
    rise: float
    residual: float
    given: float


EXACT = RunBounds(overlap=1.02e-6, momentum=1e-9, rise=1e-6, residual=1e-7, given=0.01)
"""Bounds of the reference: it detects touching within 1e-6 m, the oracle's tolerance is 1e-8 m; the rest is
what the solver guarantees. The work of a stiff driver in a substep that ends early is known to a percent."""
FIRST_ORDER = RunBounds(overlap=1e-2, momentum=1e-6, rise=0.05, residual=inf, given=inf)
"""Bounds of DART, Bullet and MuJoCo: they detect contact after overlap, by v h at 2.4 m/s and 1/240 s; energy
to 5 %."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """Assessment of a run; NaN where a figure does not apply."""

    outcome: str
    reason: str = ""
    bodies: int = 0
    frames: int = 0
    rise: float = nan  # largest in a frame over U [1]
    gain: float = nan  # largest since the start over U [1]
    given: float = nan  # largest over any window beyond the work of drivers, over U [1]
    overlap: float = nan  # deepest [m]
    passages: float = nan
    momentum: float = nan  # largest change, linear or angular, over its sum [1]
    residuals: tuple[float, ...] = ()  # of each frame [m/s]
    counters: tuple[float, ...] = (nan,) * len(COUNTERS)
    slowest: float = nan  # frame [s]

    @property
    def solves(self) -> tuple[float, float]:
        """Number of contact solves, and of those with a residual over RESIDUAL_OPEN."""
        counts = dict(zip(COUNTERS, self.counters))
        return counts["solves"], counts["solves.open"]

    @property
    def dropped_time(self) -> float:
        """Time of all frames that was not simulated [s]."""
        return dict(zip(COUNTERS, self.counters))["dropped_time"]

    @property
    def residual(self) -> float:
        """Largest residual of a frame [m/s]."""
        return max(self.residuals, default=nan)


@np.errstate(over="ignore", invalid="ignore")
def judge_random(
    recording: Recording, scenario: Scenario, bounds: RunBounds, outcome: str, reason: str
) -> Assessment:
    """Class and figures of a run; `outcome` is the class if already known."""
    context = Context(recording, scenario)
    names = recording.work_names.tolist()
    columns = {name: recording.work[:, k] for k, name in enumerate(names)}
    has_residuals = "residual" in columns
    found = {
        "bodies": len(context.simulated),
        "frames": len(recording.time) - 1,
        "residuals": tuple(columns["residual"].tolist()) if has_residuals else (),
        "counters": tuple(float(columns[name].sum()) if name in columns else nan for name in COUNTERS),
        "slowest": float(recording.time_frame.max(initial=0.0)),
    }
    if not finite(context):
        return Assessment(outcome or "non-finite", reason, **found)  # type: ignore[arg-type]
    alone = not any(True for _ in scenario.touching_pairs())
    depth = np.zeros(len(recording.time)) if alone else overlap_depth(context)
    depth = np.where(depth < UNBOUNDED, depth, inf)
    u = available_energy(scenario, lowest_points(scenario))
    rise, gain = _energy(context, depth, u)
    given = _beyond_work(context, u)
    steady = [tracker for tracker in scenario.trackers if tracker.interpolation == "cubic"]
    moving = [*context.simulated, *(scenario.body_index(tracker.root) for tracker in steady)]
    speed = float(np.abs(recording.linear_velocity[:, moving]).max(initial=0.0))
    exploded = speed > _fastest(scenario, steady) if context.drives.any() else gain > EXPLODED
    found |= {
        "rise": rise,
        "gain": gain,
        "given": given,
        "overlap": float(depth.max()),
        "passages": float(len(passages(context))),
        "momentum": momentum_change(context),
    }
    residual = max(found["residuals"], default=0.0)  # type: ignore[call-overload]
    breaks = {
        "exploded": exploded,
        "tunnelled": found["passages"],
        "overlap": found["overlap"] > bounds.overlap,  # type: ignore[operator]
        "momentum": found["momentum"] > bounds.momentum,  # type: ignore[operator]
        "rise": rise > bounds.rise,
        "work": given > bounds.given,
        "residual": residual > bounds.residual,
    }
    classes = [name for name in RANDOM_CLASSES if name == outcome or breaks.get(name)]
    return Assessment((classes or ["ok"])[0], reason, **found)  # type: ignore[arg-type]


def lowest_points(scenario: Scenario) -> dict[int, float]:
    """Distance of the lowest point of each simulated body of one piece below its centre, by body index
    [m]."""
    down = scenario.acting_gravity
    size = float(np.linalg.norm(down)) or 1.0
    unit = (down[0] / size, down[1] / size, down[2] / size)
    return {
        k: support(body.pieces[0].shape, body.orientation, unit)
        for k, body in enumerate(scenario.bodies)
        if body.kind == "simulated"
    }


def _energy(context: Context, depth: Array, u: float) -> tuple[float, float]:
    """Largest rise in a frame and largest gain since the start, both over `u` [1]; NaN where a driver does
    work.

    A soft contact stores energy: a frame that starts deeper than STORING does not count as a rise.
    """
    if context.drives.any():
        return nan, nan
    energy = mechanical_energy(context, context.simulated)
    rises = np.where(depth[:-1] > STORING, 0.0, np.diff(energy))
    return max(0.0, float(rises.max(initial=0.0))) / u, float((energy - energy[0]).max()) / u


def _beyond_work(context: Context, u: float) -> float:
    """Largest rise of energy over any window beyond the work of drivers, over `u` [J] and that work [1];
    NaN where it is unknown. Impulses that did not converge, as in a jam, do work of unknown sign by the
    residual."""
    if context.recording.facts["engine"] != "reference" or not (context.drives.any() and context.simulated):
        return nan
    u += sum(np.abs(work).max() for work in drive_work(context).values())
    found = energy_rise(context)
    rise = float(found.get("driven", found["simulated"]).max()) - _unconverged_work(context)
    return max(0.0, rise) / u


def _unconverged_work(context: Context) -> float:
    """Sum over frames of the residual times all impulses [J]."""
    recording = context.recording
    residual = recording.work[:, recording.work_names.tolist().index("residual")]
    sizes = np.linalg.norm(recording.contacts["impulse"], axis=1)
    return float(residual @ np.bincount(context.contact_frame, sizes, len(residual))[: len(residual)])


def _fastest(scenario: Scenario, steady: list[Tracker]) -> float:
    """Speed of a body from which a run with drivers counts as exploded [m/s]; `steady`: trackers that do not
    jump."""
    times = np.linspace(0.0, scenario.duration, 8 * scenario.frame_count + 1)  # a sweep may take a frame
    paces = [float(np.abs(sample(tracker, times).linear_velocity).max()) for tracker in steady]
    return max(EXPLODED_SPEED, EXPLODED_PACE * max(paces, default=0.0))
