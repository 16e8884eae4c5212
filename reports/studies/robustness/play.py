"""Plays one random scene on one engine, and assesses the run without a closed form.

Energy of simulated bodies may only decrease, momentum of isolated ones is conserved, bodies do not overlap or
pass through each other, and the run is finite and ends in time. U is the energy at the start (`available`).
Drivers may add the work of their contacts, as `energy.injected` counts it, if the engine reports it; U then
includes the largest of it. None is thrown: bodies are at most some times as fast as the trackers, and so are
roots that follow no jumps.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from math import inf, nan
from time import process_time

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings, Unsupported
from touchstone.adapters.recorder import Player, ready
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.contacts.overlap import overlap_depth
from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.contacts.swept_boxes import UNBOUNDED
from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.energy import (
    STORING,
    drive_work,
    energy_rise,
    mechanical_energy,
)
from touchstone.reports.metrics.motion.momentum import momentum_angular, momentum_linear
from touchstone.reports.studies.tasks import Ended, Task
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.random_scenes.bodies import support
from touchstone.scenarios.scenario import Scenario, Tracker
from touchstone.scenarios.transforms import perturbed

OUTCOMES = (
    "skipped",
    "error",
    "hang",
    "not finite",
    "exploded",
    "passed",
    "overlap",
    "momentum",
    "rise",
    "work",
    "residual",
    "ok",
)
"""Classes of a run, the worst first; a run belongs to the first that applies."""
FRAME_SECONDS = 5.0
"""Time of a frame from which a run counts as hanging [s]: three hundred times a frame of 60 Hz."""
SCENE_SECONDS = 120.0
"""Processor time of a whole run from which it counts as hanging [s]: one that waits ends after PATIENCE."""
PATIENCE = 300.0
"""Time without an answer after which the process is terminated [s]: longer than a cold compilation."""
EXPLODED = 1.0
"""Energy gained since the start, over U, from which a run counts as exploded [1]: it has doubled."""
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
class SeededTask:
    """One run: the scene of a seed on an engine; `perturbation` displaces each body by that distance [m]."""

    engine: str
    settings: Settings
    seed: int
    kind: str | None = None
    perturbation: float = 0.0

    @property
    def scenario(self) -> Scenario:
        """The scene to play."""
        scenario = random_scene(self.seed, self.kind)
        return perturbed(scenario, self.perturbation, self.seed) if self.perturbation else scenario


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


def available(scenario: Scenario) -> float:
    """U: the kinetic energy of simulated bodies at the start plus sum(m g h), with h the height of a centre
    of mass over the lowest of them [J]."""
    bodies = [body for body in scenario.bodies if body.kind == "simulated"]
    g = np.array(scenario.acting_gravity)
    size = float(np.linalg.norm(g))
    energy = 0.0
    for body in bodies:
        w = np.array(body.angular_velocity)
        local = Rotation.from_quat(body.orientation, scalar_first=True).inv().apply(w)
        energy += body.mass * float(np.dot(body.linear_velocity, body.linear_velocity)) / 2
        energy += float(local @ np.array(body.inertia) @ local) / 2
    if size == 0:
        return energy
    down = tuple((g / size).tolist())
    depths = [
        float(np.dot(body.position, down)) + support(body.pieces[0].shape, body.orientation, down)
        for body in bodies
    ]
    lowest = max(depths)
    return energy + sum(b.mass * size * (lowest - float(np.dot(b.position, down))) for b in bodies)


def assess(engine: Engine, scenario: Scenario, settings: Settings, bounds: RunBounds) -> Assessment:
    """Play a scene in this process and classify the run; a failed run is assessed up to its failure."""
    player: Player | None = None
    outcome, reason = "", ""
    try:
        player = ready(engine, scenario, settings)
        outcome = _play(player, scenario)
    except Unsupported as error:
        return Assessment("skipped", str(error))
    except AdapterError as error:
        outcome, reason = _cause(str(error)), str(error)
    if player is None:
        return Assessment(outcome, reason)
    recording = player.recording(reason)
    player.world.close()
    with np.errstate(over="ignore", invalid="ignore"):
        return _judged(recording, scenario, bounds, outcome, reason)


def _play(player: Player, scenario: Scenario) -> str:
    """Play frame by frame until the end or a timeout; returns "" or "hang"."""
    start = process_time()
    for _ in range(scenario.frame_count):
        before = player.seconds_played
        player.play(1)
        if player.seconds_played - before > FRAME_SECONDS or process_time() - start > SCENE_SECONDS:
            return "hang"
    return ""


def _cause(message: str) -> str:
    """Class of a run that an adapter aborted with `message`."""
    if "diverged" not in message:
        return "error"
    return "not finite" if "not finite" in message else "exploded"


def _judged(
    recording: Recording, scenario: Scenario, bounds: RunBounds, outcome: str, reason: str
) -> Assessment:
    """Class and figures of a run; `outcome` is the class if already known."""
    context = Context(recording, scenario)
    states = ("position", "orientation", "linear_velocity", "angular_velocity")
    finite = all(bool(np.isfinite(getattr(recording, name)).all()) for name in states)
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
    if not finite:
        return Assessment(outcome or "not finite", reason, **found)  # type: ignore[arg-type]
    alone = not any(True for _ in scenario.touching_pairs())
    depth = np.zeros(len(recording.time)) if alone else overlap_depth(context)
    depth = np.where(depth < UNBOUNDED, depth, inf)
    rise, gain = _energy(context, depth)
    given = _beyond_work(context)
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
        "momentum": _momentum(context),
    }
    residual = max(found["residuals"], default=0.0)  # type: ignore[call-overload]
    breaks = {
        "exploded": exploded,
        "passed": found["passages"],
        "overlap": found["overlap"] > bounds.overlap,  # type: ignore[operator]
        "momentum": found["momentum"] > bounds.momentum,  # type: ignore[operator]
        "rise": rise > bounds.rise,
        "work": given > bounds.given,
        "residual": residual > bounds.residual,
    }
    classes = [name for name in OUTCOMES if name == outcome or breaks.get(name)]
    return Assessment((classes or ["ok"])[0], reason, **found)  # type: ignore[arg-type]


def _energy(context: Context, depth: Array) -> tuple[float, float]:
    """Largest rise in a frame and largest gain since the start, both over U [1]; NaN where a driver does
    work.

    A soft contact stores energy: a frame that starts deeper than STORING does not count as a rise.
    """
    if context.drives.any():
        return nan, nan
    energy = mechanical_energy(context, context.simulated)
    rises = np.where(depth[:-1] > STORING, 0.0, np.diff(energy))
    u = available(context.scenario)
    return max(0.0, float(rises.max(initial=0.0))) / u, float((energy - energy[0]).max()) / u


def _beyond_work(context: Context) -> float:
    """Largest rise of energy over any window beyond the work of drivers, over U and that work [1]; NaN where
    it is unknown. Impulses that did not converge, as in a jam, do work of unknown sign by the residual."""
    if context.recording.facts["engine"] != "reference" or not (context.drives.any() and context.simulated):
        return nan
    u = available(context.scenario) + sum(np.abs(work).max() for work in drive_work(context).values())
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


def _momentum(context: Context) -> float:
    """Largest change of linear or angular momentum of an isolated scene [1]; NaN for others."""
    found = []
    for measure in (momentum_linear, momentum_angular):
        with suppress(NotMeasured):
            found += [float(value) for value in measure(context).values()]  # type: ignore[arg-type]
    return max(found, default=nan)


def assess_task(engine: Engine, task: Task | SeededTask) -> Assessment:
    """Play a task in this process, with the bounds of its engine."""
    bounds = EXACT if task.engine == "reference" else FIRST_ORDER
    return assess(engine, task.scenario, task.settings, bounds)


def assessment_of(found: Assessment | Ended) -> Assessment:
    """Assessment of a task, or the class of one that ended its process."""
    if not isinstance(found, Ended):
        return found
    return Assessment(
        "hang" if found.hung else found.status if found.status == "skipped" else "error", found.reason
    )
