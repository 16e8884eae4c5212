"""Classes of outcome of hard cases and random scenes, judged by independent oracles.

Outcome of a run: the first class of CLASSES that applies, from its recording.

A hard scene is judged by its checks, a random one, which has no closed form, by bounds that hold in all
scenes: energy of simulated bodies may only decrease, momentum of isolated ones is conserved, bodies do not
overlap or pass through each other, and the run is finite and ends in time. Drivers may add the work of
their contacts, as `energy.injected` counts it, if the engine reports it; none is thrown: bodies are at most
some times as fast as the trackers, and so are roots that follow no jumps.

In a hard scene an engine's own word counts once only: a run that failed is `gave up` instead of a silent
failure where the engine reported, up to then, that it left something unsolved.

Outcome of a random scene, for which nothing was tuned, without a closed form.

U is the energy at the start (`available_energy`); where drivers do work it includes the largest of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf, isnan, nan, sqrt

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.contacts.overlap import overlap_depth
from touchstone.reports.metrics.contacts.passages import UNBOUNDED, passages
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import STORING, drive_work, energy_rise, mechanical_energy
from touchstone.reports.metrics.motion.joints import driving
from touchstone.reports.verdict import figures as measures
from touchstone.reports.verdict.figures import available_energy, finite, momentum_change
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.difficulty.checks import Checks
from touchstone.scenarios.plural import plural
from touchstone.scenarios.random_scenes.bodies import support
from touchstone.scenarios.scenario import Scenario

CLASSES = {
    "skipped": "the engine cannot represent the scene, or is not installed",
    "error": "an exception, or a process that died",
    "hang": "a frame or a scene takes seconds, or the process does not answer",
    "slow": "the engine's steps take longer than the budget: the run was cut off",
    "gave up": "the run failed, and the engine said so",
    "non-finite": "a value that is not finite",
    "auto-reset": "the engine put the state back to the start by itself",
    "exploded": "more energy or speed than the scene has",
    "tunnelled": "a body is on the other side of another within a tenth of a second",
    "sink-through": "a body sinks into another by half of its inner radius or more",
    "overlap": "bodies overlap by more than the engine's method leaves",
    "momentum": "an isolated scene does not keep its momentum",
    "rise": "the energy rises in a frame",
    "work": "the energy rises by more than the work of the drivers",
    "residual": "a contact solve is left open",
    "creep": "a body that should rest drifts away",
    "jitter": "a body that should rest shakes",
    "inaccurate": "beyond the tolerances of the family",
    "ok": "within all tolerances",
}
"""Name and meaning, the worst first; a run belongs to the first that applies."""
RANDOM_CLASSES = (
    *("skipped", "error", "hang", "non-finite", "exploded", "tunnelled"),
    *("overlap", "momentum", "rise", "work", "residual", "ok"),
)
HARD_CLASSES = tuple(
    name for name in CLASSES if name not in ("hang", "overlap", "momentum", "rise", "work", "residual")
)
SILENT = HARD_CLASSES[HARD_CLASSES.index("non-finite") : HARD_CLASSES.index("ok")]
"""Failures of hard scenes that the engine did not announce."""
SURVIVED = ("ok",)


@dataclass(frozen=True, slots=True)
class Outcome:
    """Class of a run, its reason in one line, and the figures that decided it.

    `under` is the class that a run which gave up would have had; figures are those of `figures.py`.
    """

    name: str
    reason: str = ""
    under: str = ""
    figures: dict[str, float] = field(default_factory=dict)


EXPLODED = 1.0
"""Gain over the available energy from which a run has exploded [1]: it has doubled."""
SUNK = 0.5
"""Depth over the smaller inner radius of two bodies from which one sinks into the other [1]."""
QUICK = 0.1
"""Longest time of a passage that counts as tunnelling [s]; slower ones sink through."""
CREEPING = 0.05
"""Largest mean speed of a creep [m/s]; a faster body has fallen or slid away."""
SHAKING = 2.0
"""Factor by which the speed of a jittering body exceeds that of its displacement [1]."""
ANNOUNCED = {"gave_up": 0.0, "lost": 0.0, "dropped_time": 0.0, "residual": 1e-7}
"""Counters by which an engine says that it left something unsolved, and the values that do not count."""
Finding = tuple[str, str]


def judge(recording: Recording, scenario: Scenario, checks: Checks, ended: str = "") -> Outcome:
    """Outcome of a run.

    Args:
        recording: all complete frames, up to a failure.
        ended: why the run ended before its scene; empty if it did not.
    """
    context = Context(recording, scenario)
    figures: dict[str, float] = {}
    with np.errstate(all="ignore"):
        found = list(_findings(context, checks, ended, figures))
    order = list(CLASSES)
    name, reason = min(found, key=lambda one: order.index(one[0]), default=("ok", ""))
    said = announcement(recording)
    if name in SILENT and said:
        return Outcome("gave up", f"{said}; {reason}", name, figures)
    if name == "ok" and len(recording.time) <= scenario.frame_count:
        name, reason = "slow", f"cut off after {recording.time[-1]:g} s of the scene"
    return Outcome(name, reason, "", figures)


def class_of_end(message: str, other: str) -> str:
    """Class of a run that an adapter ended with a message; `other` where it did not diverge."""
    if "diverged" not in message:
        return other
    return "non-finite" if "not finite" in message else "exploded"


def announcement(recording: Recording) -> str:
    """What the engine said of its unsolved frames; empty if nothing."""
    parts = []
    for name, allowed in ANNOUNCED.items():
        columns = np.flatnonzero(recording.work_names == name)
        if len(columns):
            values = recording.work[:, columns[0]]
            beyond = np.flatnonzero(~(values <= allowed))
            if len(beyond):
                where = f"{plural(len(beyond), 'frame')} from {beyond[0] + 1}"
                parts.append(f"{name} {values[beyond].max():.2g} in {where}")
    return ", ".join(parts)


def _findings(context: Context, checks: Checks, ended: str, figures: dict[str, float]) -> Iterator[Finding]:
    """All classes that apply, each with its reason; fills `figures`."""
    if ended:
        yield class_of_end(ended, "gave up"), ended
    if not measures.finite(context):
        yield "non-finite", "a value of the state is not finite"
        return
    if not measures.rotations(context):
        yield "non-finite", "an orientation is no unit quaternion"
        return
    frame = measures.reset_frame(context)
    if frame is not None:
        yield "auto-reset", f"all bodies are back at their start in frame {frame}"
    yield from _energy(context, checks, figures)
    yield from _crossings(context, checks)
    yield from _overlap(context, checks, figures)
    if len(context.recording.time) > context.scenario.frame_count:
        yield from _rest(context, checks, figures)
        yield from _ends(context, checks)
    error, body = measures.truth_error(context)
    figures["position error [m]"] = error
    if error > checks.position:
        yield "inaccurate", f"{body!r} is {error:.2g} m off its closed form (tolerance {checks.position:g} m)"


def _energy(context: Context, checks: Checks, figures: dict[str, float]) -> Iterator[Finding]:
    gain, loss = measures.energy_change(context)
    change = measures.momentum_change(context)
    speed = float(np.linalg.norm(context.recording.linear_velocity, axis=2).max())
    figures |= {"energy gain [1]": gain, "energy loss [1]": loss, "speed [m/s]": speed}
    figures["momentum change [1]"] = change
    if checks.energy < inf and not isnan(gain) and not gain <= EXPLODED:
        yield "exploded", f"gains {gain:.2g} of the energy there is"
    if not speed <= checks.speed:
        yield "exploded", f"a body moves at {speed:.2g} m/s (at most {checks.speed:g} m/s)"
    if not isnan(gain) and not gain <= checks.energy:
        yield "inaccurate", f"gains {gain:.2g} of the energy there is (tolerance {checks.energy:g})"
    if loss > checks.energy_loss:
        yield "inaccurate", f"loses {loss:.2g} of the energy there is (tolerance {checks.energy_loss:g})"
    if change > checks.momentum:
        yield "inaccurate", f"momentum changes by {change:.2g} of its sum (tolerance {checks.momentum:g})"


def _crossings(context: Context, checks: Checks) -> Iterator[Finding]:
    bodies = context.scenario.bodies
    for wall in checks.walls:
        crossing = measures.wall_crossing(context, wall)
        if crossing:
            k, before, behind = crossing
            quick = (behind - before) * context.frame <= QUICK
            name = "tunnelled" if quick else "sink-through"
            yield name, f"{bodies[k].name!r} crosses a wall between frames {before} and {behind}"
    for passage in passages(context)[:1]:
        names = " through ".join(repr(bodies[k].name) for k in (passage.a, passage.b))
        yield "tunnelled", f"{names} at {passage.time:.3f} s"


def _overlap(context: Context, checks: Checks, figures: dict[str, float]) -> Iterator[Finding]:
    found = measures.depths(context)
    figures["overlap [m]"] = max((float(depth.max()) for depth in found.values()), default=0.0)
    inner, names = measures.inner_radii(context), [body.name for body in context.scenario.bodies]
    late = context.recording.time >= checks.parted_by - 1e-9
    for (a, b), depth in found.items():
        allowed = np.where(late, 0.0, depth[0]) if checks.parted_by > 0 else np.full(len(depth), 0.0)
        allowed = np.full(len(depth), depth[0]) if checks.parted_by == inf else allowed
        sunk = depth > allowed + SUNK * min(inner[a], inner[b])
        deep = depth > allowed + checks.overlap
        pair = f"{names[a]!r} and {names[b]!r}"
        if sunk.any():
            frame = int(np.argmax(sunk))
            yield "sink-through", f"{pair} overlap by {depth[frame]:.2g} m in frame {frame}"
        elif deep.any():
            yield "inaccurate", f"{pair} overlap by {depth.max():.2g} m (tolerance {checks.overlap:g} m)"


def _rest(context: Context, checks: Checks, figures: dict[str, float]) -> Iterator[Finding]:
    found = measures.rest(context, checks)
    if not found:
        return
    seconds = (float(context.recording.time[-1]) - checks.rest_from) / 2
    settled, drift, shaking = (max(values) for values in zip(*found.values()))
    figures |= {"rest.settled [m]": settled, "rest.drift [m]": drift, "jitter [m/s]": shaking}
    most = checks.overlap + checks.creep
    for name, (first, way, speed) in found.items():
        if speed > checks.jitter and speed > SHAKING * max(way, first) / seconds:
            yield "jitter", f"{name!r} shakes at {speed:.2g} m/s (tolerance {checks.jitter:g} m/s)"
        elif way > checks.creep / 2:
            what = "creep" if way / seconds <= CREEPING else "inaccurate"
            limit = f"tolerance {checks.creep / 2:g} m"
            yield what, f"{name!r} drifts by {way:.2g} m in the last {seconds:g} s ({limit})"
        elif first > most:
            yield "inaccurate", f"{name!r} settles by {first:.2g} m (tolerance {most:g} m)"


def _ends(context: Context, checks: Checks) -> Iterator[Finding]:
    if checks.tracked < inf:
        error, link = measures.tracking_error(context)
        if not error <= checks.tracked:
            yield "inaccurate", f"{link!r} ends {error:.2g} m off its tracked place"
    for region in checks.regions:
        k = context.scenario.body_index(region.body)
        end = context.recording.position[-1, k]
        if not ((np.array(region.low) <= end) & (end <= np.array(region.high))).all():
            place = ", ".join(f"{value:.3g}" for value in end)
            yield "inaccurate", f"{region.body!r} ends at ({place}) m, outside of its region"


EXPLODED_SPEED, EXPLODED_PACE = 30.0, 4.0
"""Speed from which a run with a driven body counts as exploded [m/s], ten times the fastest hand's, or over
the speed of the fastest tracker [1]: an impact doubles it, and the next one again."""
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
    rise, gain = _energies(context, depth, u)
    given = _beyond_work(context, u)
    exploded = _too_fast(context, given) if context.drives.any() else gain > EXPLODED
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
        if body.kind == "simulated" and body.pieces
    }


def _energies(context: Context, depth: Array, u: float) -> tuple[float, float]:
    """Largest rise in a frame and largest gain since the start, both over `u` [1]; NaN where a driver does
    work.

    A soft contact stores energy: a frame that starts deeper than STORING does not count as a rise.
    """
    if context.drives.any() or driving(context.scenario):
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
    found = energy_rise(context, rigid=True)
    recording = context.recording
    residual = recording.work[:, recording.work_names.tolist().index("residual")]
    sizes = np.linalg.norm(recording.contacts["impulse"], axis=1)
    unconverged = residual @ np.bincount(context.contact_frame, sizes, len(residual))[: len(residual)]
    return max(0.0, float(found.get("driven", found["simulated"]).max()) - float(unconverged)) / u


def _too_fast(context: Context, given: float) -> bool:
    """Whether a body moves faster than drivers explain. A tracker that jumps by d gives its driver at most
    the speed R d / m of the damper (Eq. 6), and a coupling that was x long sqrt(K / m) x, x up to the longest
    in a frame before and the tracker's way since. Of other bodies the energy tells, where `given` is known: a
    light one that heavy ones squeeze out may be faster."""
    scenario, recording = context.scenario, context.recording
    speeds = np.abs(recording.linear_velocity).max(axis=2)
    times = np.linspace(0.0, scenario.duration, 8 * scenario.frame_count + 1)  # a sweep may take a frame
    limit, whips = EXPLODED_SPEED, []
    for tracker in scenario.trackers:
        root = scenario.body_index(tracker.root)
        mass = sum(scenario.bodies[k].mass for k in scenario.links(tracker))
        if tracker.interpolation == "held":
            jumps = np.linalg.norm(np.diff(np.array(tracker.positions), axis=0), axis=1)
            pace = float(jumps.max(initial=0.0)) * tracker.damping / mass
        else:
            pace = float(np.abs(sample(tracker, times).linear_velocity).max())
        limit = max(limit, EXPLODED_PACE * pace)
        if not scenario.prescribes(tracker):
            target = sample(tracker, recording.time).position
            way = np.linalg.norm(np.diff(target, axis=0), axis=1)
            away = np.linalg.norm(target - recording.position[:, root], axis=1)
            longest = np.maximum.accumulate(away)[:-1] + way
            whips.append((speeds[1:, root], sqrt(tracker.stiffness / mass) * longest))
    whipped = any((speed > np.maximum(limit, whip)).any() for speed, whip in whips)
    fast = speeds[:, context.simulated].max(initial=0.0) > limit if isnan(given) else given > EXPLODED
    return whipped or bool(fast)
