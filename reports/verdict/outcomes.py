"""Outcome of a run: the first class of CLASSES that applies, from its recording.

A hard scene is judged by its checks, a random one, which has no closed form, by bounds that hold in all
scenes: energy of simulated bodies may only decrease, momentum of isolated ones is conserved, bodies do not
overlap or pass through each other, and the run is finite and ends in time. Drivers may add the work of
their contacts, as `energy.injected` counts it, if the engine reports it; none is thrown: bodies are at most
some times as fast as the trackers, and so are roots that follow no jumps.

In a hard scene an engine's own word counts once only: a run that failed is `gave up` instead of a silent
failure where the engine reported, up to then, that it left something unsolved.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf, isnan

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.context import Context
from touchstone.reports.verdict import figures as measures
from touchstone.scenarios.difficulty.checks import Checks
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
    *(
        "skipped",
        "error",
        "hang",
        "non-finite",
        "exploded",
        "tunnelled",
        "overlap",
        "momentum",
        "rise",
        "work",
    ),
    *("residual", "ok"),
)
"""Classes of random scenes."""
HARD_CLASSES = tuple(
    name for name in CLASSES if name not in ("hang", "overlap", "momentum", "rise", "work", "residual")
)
"""Classes of hard scenes."""
SILENT = HARD_CLASSES[HARD_CLASSES.index("non-finite") : HARD_CLASSES.index("ok")]
"""Failures of hard scenes that the engine did not announce."""
SURVIVED = ("ok",)
"""Classes that count as survived."""
GROSS = ("non-finite", "exploded", "sink-through", "tunnelled")
"""Failures that the profile `balanced` must not show at 1/60 s."""


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
                parts.append(
                    f"{name} {values[beyond].max():.2g} in {len(beyond)} frames from {beyond[0] + 1}"
                )
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
    change, speed = measures.momentum_change(context), measures.top_speed(context)
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
