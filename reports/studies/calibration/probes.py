"""Scenes of the study `calibration`: bodies side by side that drop on a floor, or slide over it.

A scene requests one restitution, or one friction, of one pair of shapes. Its bodies differ in approach speed
and in the phase within a native step at which they meet the floor, or in heading. Its frames are native
steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import cos, isnan, nan, pi, sin, sqrt
from typing import Literal, NamedTuple

import numpy as np

from touchstone.adapters.contract import Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.results import Row
from touchstone.reports.runner.tasks import own_step
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Hull,
    Matrix,
    PairCoefficients,
    Piece,
    Scenario,
    Shape,
    Sphere,
    Vector,
)
from touchstone.scenarios.solids import box_inertia, sphere_inertia

G = 9.81
HEIGHT = 0.1
"""Height of every body's centre over the floor on which it rests [m]."""
WIDTH = 0.16
"""Half width of box and hull [m]: at mu = 1 they slide without tipping."""
PRISM = tuple(
    (WIDTH * cos(k * pi / 3), WIDTH * sin(k * pi / 3), z) for k in range(6) for z in (-HEIGHT, HEIGHT)
)
SHAPES: dict[str, tuple[Shape, Matrix]] = {
    # Shapes that land on the floor, which is a box; shape and inertia for 1 kg.
    "sphere-box": (Sphere(HEIGHT), sphere_inertia(1.0, HEIGHT)),
    "box-box": (Box((WIDTH, WIDTH, HEIGHT)), box_inertia(1.0, (WIDTH, WIDTH, HEIGHT))),
    "hull-box": (Hull(PRISM), box_inertia(1.0, (WIDTH, WIDTH, HEIGHT))),
}
SPACING, ROW = 4.0, 8
"""Distance between bodies [m], and bodies per row: no body reaches another."""
LEAD_STEPS = 2
"""Number of free steps before a body meets the floor, if its approach is long enough [1]."""
DROP = 0.5
"""Height of a fall from rest [m]: it lands at 3.1 m/s."""
SLIDE_TIME = 0.3
"""Duration of a slide until it stops under Coulomb's law [s]."""
Kind = Literal["restitution", "lowest", "drop", "friction", "slow"]
TIMES: dict[Kind, float] = {
    # Duration of a scene [s]. The softest contact lasts 40 ms; a fall and a rise of DROP take 0.32 s each;
    # a slide at 0.7 of the requested friction still stops.
    "restitution": 0.2,
    "lowest": 0.2,
    "drop": 0.75,
    "friction": 1.5 * SLIDE_TIME,
    "slow": SLIDE_TIME,
}


@dataclass(frozen=True, slots=True)
class Probe:
    """Request of a scene. Restitution: bodies that meet the floor at `speeds` [m/s] and `phases` [steps]
    (`lowest`: rungs of a ladder of speeds), or that drop from DROP, for other phases from a little higher.
    Friction: bodies that slide along `headings` [degrees]; `slow`: one that slides down a slope at a speed
    which Coulomb's law takes away in SLIDE_TIME. Body 0 is the floor; the others follow, with the
    phases varying fastest."""

    pair: str
    kind: Kind
    requested: float
    speeds: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
    headings: tuple[float, ...] = ()


def scene(probe: Probe, dt: float) -> Scenario:
    """The scene of a probe for a native step of `dt` [s]."""
    slides, rate = probe.kind in ("friction", "slow"), round(1 / dt)
    gravity = (0.0, 0.0, -G)
    if probe.kind == "slow":
        (speed,) = probe.speeds
        gravity = (pull_of(probe), 0.0, -G)
        bodies = [_body(probe.pair, 0, 0.0, (speed, 0.0, 0.0))]
    elif slides:
        bodies = _sliding(probe)
    else:
        bodies = _bouncing(probe, dt) if probe.speeds else _dropped(probe, dt)
    asked = (0.0, probe.requested) if slides else (probe.requested, 0.0)
    half = SPACING * (len(bodies) + 2)
    # The piece is at its body's origin: Bullet treats a shifted one as a compound, whose contacts differ.
    slab = Piece("floor", Box((half, half, 1.0)))
    return Scenario(
        f"{probe.kind} {probe.requested:g} {probe.pair}",
        f"{probe.pair} pairs with a {probe.kind} of {probe.requested:g}",
        (),
        (Body("floor", "fixed", "any", (slab,), position=(0.0, 0.0, -1.0)), *bodies),
        round(TIMES[probe.kind] * rate) / rate,
        (PairCoefficients("any", "any", *asked),),
        gravity=gravity,
        frame_rate=rate,
    )


def pull_of(probe: Probe) -> float:
    """Gravity along the slope of a slow slide [m/s^2]."""
    return probe.requested * G - probe.speeds[0] / SLIDE_TIME


def _bouncing(probe: Probe, dt: float) -> list[Body]:
    """Bodies that meet the floor at each speed and phase."""
    bodies: list[Body] = []
    for speed in probe.speeds:
        for phase in probe.phases:
            # Gravity adds to the speed during the approach: a slow body starts nearer than LEAD_STEPS.
            time = min((LEAD_STEPS + phase) * dt, phase * speed / G)
            gap = speed * time - G * time * time / 2
            bodies.append(_body(probe.pair, len(bodies), gap, (0.0, 0.0, G * time - speed)))
    return bodies


def _dropped(probe: Probe, dt: float) -> list[Body]:
    """Bodies at rest, spread over the height of the fall within the last step."""
    last = sqrt(2 * G * DROP) * dt
    gaps = [DROP + phase * last for phase in probe.phases]
    return [_body(probe.pair, k, gap, (0.0, 0.0, 0.0)) for k, gap in enumerate(gaps)]


def _sliding(probe: Probe) -> list[Body]:
    """Bodies on the floor that Coulomb's law stops after SLIDE_TIME, rotated with their headings."""
    speed, angles = probe.requested * G * SLIDE_TIME, [pi / 180 * heading for heading in probe.headings]
    velocities = [(speed * cos(a), speed * sin(a), 0.0) for a in angles]
    return [_body(probe.pair, k, 0.0, v, a) for k, (v, a) in enumerate(zip(velocities, angles))]


def _body(pair: str, k: int, gap: float, velocity: Vector, turn: float = 0.0) -> Body:
    shape, inertia = SHAPES[pair]
    return Body(
        f"body {k}",
        "simulated",
        "any",
        (Piece("piece", shape),),
        1.0,
        inertia=inertia,
        position=(SPACING * (k % ROW), SPACING * (k // ROW), HEIGHT + gap),
        orientation=(cos(turn / 2), 0.0, 0.0, sin(turn / 2)),
        linear_velocity=velocity,
    )


class ProbeMotion(NamedTuple):
    """Motion of a probe's bodies (b) at every step (n): heights over the floor (n, b) [m], and velocities of
    the centre and of the surface point that touches the floor (n, b, 3) [m/s]; and the engine's version."""

    gap: Array
    velocity: Array
    surface: Array
    version: str


@dataclass(frozen=True, slots=True)
class ProbeTask:
    """A probe on an engine."""

    engine: str
    settings: Settings
    probe: Probe


def measure(engine: Engine, task: ProbeTask) -> ProbeMotion:
    """Play a task in this process."""
    return motion_of(engine, task.probe, task.settings)


def motion_of(engine: Engine, probe: Probe, settings: Settings) -> ProbeMotion:
    """Play a probe's scene and return its motion."""
    played = record(engine, scene(probe, settings.dt), settings)
    # All bodies but the floor; the surface point is the one under the centre.
    velocity, omega = played.linear_velocity[:, 1:], played.angular_velocity[:, 1:]
    surface = velocity + np.cross(omega, (0.0, 0.0, -HEIGHT))
    return ProbeMotion(played.position[:, 1:, 2] - HEIGHT, velocity, surface, engine.version())


FREE = 1e-3
"""Share of its weight by which the floor may push a free body [1]: a solver's residual is far smaller."""
SLIP_WINDOW = (0.7, 0.2)
"""Shares of the first slip between which friction is measured [1]: contacts have settled, and none sticks."""
BOUNCES = 0.25
"""Least restitution at which a body counts as bouncing, for a requested restitution of 1 [1]."""


def restitution_of(gap: Array, rate: Array, g: float, dt: float, level: float = 0.0) -> float:
    """Speed after the first contact over that before it, both extrapolated to the height of contact under
    gravity.

    Args:
        gap, rate: height over the floor [m] and its velocity [m/s], (n,), every dt [s].
        level: height at which bodies touch [m]: 0, except for an engine with a contact margin. Returns:
        0 where the body never rises freely again; NaN where it never lands.
    """
    free = np.abs(np.diff(rate) + g * dt) < FREE * g * dt
    if free.all():
        return float("nan")
    k = int(np.argmin(free))
    approach = rate[k] ** 2 + 2 * g * (gap[k] - level)
    # Out of contact: above the floor or free again, and rising; a body that is only braked still falls.
    later = np.arange(k + 1, len(free))
    left = later[(rate[later] > 0) & ((gap[later] > level) | free[later])]
    if not len(left) or approach <= 0:
        return 0.0
    m = int(left[0])
    return float(np.sqrt(max(0.0, rate[m] ** 2 + 2 * g * (gap[m] - level)) / approach))


def rebound_of(gap: Array) -> float:
    """Square root of the rebound height after the first contact over the drop height; gap (n,) [m]."""
    rising = np.flatnonzero(np.diff(gap) > 0)
    top = float(gap[rising[0] :].max()) if len(rising) else 0.0
    return float(np.sqrt(max(0.0, top) / gap[0]))


def friction_of(velocity: Array, slip: Array, g: float, dt: float) -> float:
    """Mean deceleration over g while the slip falls from 70 to 20 % of the first.

    Args:
        velocity, slip: of the centre of mass, and of the surface over the floor, horizontal (n, 2) [m/s].
    Returns:
        NaN where the slip does not fall that far, or within one step.
    """
    speed = np.linalg.norm(slip, axis=1)
    below = [np.flatnonzero(speed <= share * speed[0]) for share in SLIP_WINDOW]
    if not all(map(len, below)) or below[0][0] == below[1][0]:
        return float("nan")
    first, last = int(below[0][0]), int(below[1][0])
    lost = velocity[first] - velocity[last]
    return float(lost @ slip[0] / speed[0] / ((last - first) * dt * g))


def slow_friction_of(slip: Array, pull: float, g: float, dt: float) -> float:
    """Mean friction over the normal force of a slide down a slope, until the slip has fallen to 20 % of the
    first, or two thirds of SLIDE_TIME have passed.

    Args:
        slip: along the slope (n,) [m/s].
        pull, g: gravity along the slope and into it [m/s^2].
    Returns:
        NaN where the slip falls so far within two steps.
    """
    below = np.append(np.flatnonzero(slip <= SLIP_WINDOW[1] * slip[0]), len(slip))[0]
    last = min(int(below), round(2 * SLIDE_TIME / 3 / dt))
    return float((pull - (slip[last] - slip[0]) / (last * dt)) / g) if last > 2 else float("nan")


def lowest_speed(speeds: Array, achieved: Array) -> float:
    """The least of ascending speeds from which all return at least BOUNCES [m/s]; NaN if there is none."""
    bouncing = np.append(np.flatnonzero(~(achieved >= BOUNCES)), -1).max() + 1
    return float(speeds[bouncing]) if bouncing < len(speeds) else float("nan")


STUDY = "calibration"
ALL = "all"
"""Scenario name of the aggregate over all pairs."""
JUDGED_SPEED = 1.0
"""Least approach speed of the aggregated bias of restitution [m/s]; below it, engines fade it out."""
LARGEST = {
    "restitution.bias": "restitution.bias.max",
    "friction.bias": "friction.bias.max",
    "friction.slow": "friction.slow.max",
}
"""Metric -> the name of its aggregate."""
SLOW = "restitution.slow.max"
"""Aggregate of the bias of restitution below JUDGED_SPEED."""
HOP_STEPS = 2
"""Least duration of a hop, to distinguish it from rest [steps]."""


def subject_of(kind: str, requested: float, value: float) -> str:
    """Subject of a row: the requested value, and the speed [m/s] or heading [degrees]."""
    if kind == "restitution":
        return f"e={requested:g} v={value:.3g}"
    if kind == "slow":
        return f"mu={requested:g} v={value:.3g}"
    return f"mu={requested:g} heading={value:g}"


def rows_of_engine(found: Sequence[tuple[ProbeTask, ProbeMotion | Ended]]) -> list[Row]:
    """The achieved values of an engine, the largest biases, gaps at rest, and failures."""
    rows: list[Row] = []
    ended = [(task, one) for task, one in found if isinstance(one, Ended)]
    motions = [(task, one) for task, one in found if isinstance(one, ProbeMotion)]
    resting = {
        _base(task): float(np.median(motion.gap[-1]))
        for task, motion in motions
        if (task.probe.kind, task.probe.requested) == ("restitution", 0.0)
    }
    ladders: dict[Row, list[tuple[float, float]]] = {}
    for task, motion in motions:
        base, probe = _base(task), task.probe
        # never below 0: a body that rests deeper touched before
        achieved = partial(_restitutions, probe, motion, base.dt, max(0.0, resting.get(base, 0.0)))
        match probe.kind:
            case "restitution":
                rows += _restitution(base, probe, achieved())
            case "lowest":
                ladders.setdefault(base, []).extend(zip(probe.speeds, achieved()[:, 0].tolist()))
            case "friction":
                rows += _friction(base, probe, motion)
            case "slow":
                rows.append(_slow(base, probe, motion))
            case "drop":
                rows.append(_drop(base, motion))
    rows += _largest(rows)
    rows += [replace(base, metric="gap.rest", unit="m", value=level) for base, level in resting.items()]
    rows += [_lowest(base, rungs) for base, rungs in ladders.items()]
    if len({one for _, one in ended}) == 1 and not motions:  # the engine itself fails
        profiles = dict.fromkeys(task.settings.profile for task, _ in ended)
        ((first, one), *_) = ended
        base = replace(_base(first), scenario=ALL, metric="run", verdict=one.status, reason=one.reason)
        return [replace(base, profile=name, dt=own_step(base.engine, name)) for name in profiles]
    for task, one in ended:
        row = replace(_base(task), metric="run", subject=f"{task.probe.kind} {task.probe.requested:g}")
        rows.append(replace(row, verdict=one.status, reason=one.reason))
    return rows


def _base(task: ProbeTask) -> Row:
    return Row(STUDY, task.probe.pair, task.engine, task.settings.profile, task.settings.dt, "")


def _restitutions(probe: Probe, motion: ProbeMotion, dt: float, level: float) -> Array:
    """Achieved restitution per speed and phase; NaN where a hop is too short to measure."""
    bodies = zip(motion.gap.T, motion.velocity[..., 2].T)
    achieved = np.array([restitution_of(gap, rate, G, dt, level) for gap, rate in bodies])
    achieved = achieved.reshape(len(probe.speeds), len(probe.phases))
    hop = 2 * probe.requested * np.array(probe.speeds) / G
    achieved[(hop > 0) & (hop < HOP_STEPS * dt)] = nan
    return achieved


def _restitution(base: Row, probe: Probe, achieved: Array) -> list[Row]:
    """Achieved restitution and bias per speed: the median over the phases with its range."""
    rows = []
    for speed, values in zip(probe.speeds, achieved):
        subject = subject_of("restitution", probe.requested, speed)
        row = replace(base, metric="restitution.achieved", subject=subject, unit="1")
        if np.isnan(values).any():
            reason = f"asked {probe.requested:g}; a hop of less than {HOP_STEPS} steps"
            rows.append(replace(row, verdict="skipped", reason=reason))
            continue
        middle, low, high = float(np.median(values)), float(values.min()), float(values.max())
        rows.append(replace(row, value=middle, low=low, high=high, reason=f"asked {probe.requested:g}"))
        asked = probe.requested
        bias = replace(row, metric="restitution.bias", value=middle - asked)
        rows.append(replace(bias, low=low - asked, high=high - asked))
    return rows


def _lowest(base: Row, rungs: Sequence[tuple[float, float]]) -> Row:
    """The lowest speed that bounces, from all rungs of the ladder."""
    speeds, returned = np.array(sorted(rungs)).T
    lowest = lowest_speed(speeds, returned)
    row = replace(base, metric="restitution.lowest", subject="e=1", unit="m/s", value=lowest)
    if isnan(lowest):
        reason = f"not even {speeds[-1]:.2f} m/s returns {BOUNCES:g} of e = 1"
        return replace(row, verdict="skipped", reason=reason)
    return replace(row, reason=f"from here on at least {BOUNCES:g} of e = 1 is returned")


def _drop(base: Row, motion: ProbeMotion) -> Row:
    """Restitution after a fall from DROP for e = 1, and its range over the phases of a step."""
    values = [rebound_of(gap) for gap in motion.gap.T]
    row = replace(base, metric="restitution.drop", subject=f"e=1 h={DROP:g}", unit="1", reason="asked 1")
    return replace(row, value=values[0], low=min(values), high=max(values))


def _friction(base: Row, probe: Probe, motion: ProbeMotion) -> list[Row]:
    rows = []
    for k, heading in enumerate(probe.headings):
        mu = friction_of(motion.velocity[:, k, :2], motion.surface[:, k, :2], G, base.dt)
        subject = subject_of("friction", probe.requested, heading)
        row = replace(base, metric="friction.achieved", subject=subject, unit="1", value=mu)
        if isnan(mu):
            reason = f"asked {probe.requested:g}; slides on"
            rows.append(replace(row, verdict="skipped", reason=reason))
            continue
        rows.append(replace(row, reason=f"asked {probe.requested:g}"))
        rows.append(replace(row, metric="friction.bias", value=mu / probe.requested - 1))
    return rows


def _slow(base: Row, probe: Probe, motion: ProbeMotion) -> Row:
    """Friction over the one asked for while a body slides slowly."""
    mu = slow_friction_of(motion.surface[:, 0, 0], pull_of(probe), G, base.dt)
    subject = subject_of("slow", probe.requested, probe.speeds[0])
    row = replace(base, metric="friction.slow", subject=subject, unit="1", value=mu / probe.requested)
    if isnan(mu):
        return replace(row, verdict="skipped", reason=f"asked {probe.requested:g}; it stops within two steps")
    return replace(row, reason=f"asked {probe.requested:g}")


def _largest(found: Sequence[Row]) -> list[Row]:
    """Largest biases per profile and pair, and over all pairs; those of restitution from JUDGED_SPEED on, and
    below it."""
    sizes: dict[tuple[str, str, float, str], list[float]] = {}
    for row in found:
        if row.metric not in LARGEST or isnan(row.value):
            continue
        name, value = LARGEST[row.metric], row.value - (row.metric == "friction.slow")
        if row.metric == "restitution.bias" and float(row.subject.partition("v=")[2]) < JUDGED_SPEED:
            name = SLOW
        for pair in (row.scenario, ALL):
            sizes.setdefault((name, row.profile, row.dt, pair), []).append(abs(value))
    return [
        Row(STUDY, pair, found[0].engine, profile, dt, name, max(values), "1")
        for (name, profile, dt, pair), values in sizes.items()
    ]
