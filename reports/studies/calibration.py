"""The study `calibration`: restitution and friction that engines achieve, compared with the requested values.

Every engine plays the same small scenes under each of its profiles; the estimates use only the bodies'
motion. Adapters never read the results.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from math import cos, isnan, nan, pi, sin, sqrt
from pathlib import Path
from typing import Any, Literal, NamedTuple

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ACCURATE, DEFAULT, ENGINES, installed, load
from touchstone.adapters.workers.pool import Ended, Loader
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import step_text
from touchstone.reports.runner.tasks import own_step, played
from touchstone.reports.studies.study import (
    Column,
    Picture,
    extremes,
    failure_lines,
    failures,
    kept,
    missing_rows,
    page_text,
    with_interval,
)
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.pictures import DASHES, DOTS, PALE, axis, by, color_of, grid, rule, save
from touchstone.reports.views.render import Part
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
        gravity = (pull_of(probe), 0.0, -G)
        bodies = [_body(probe.pair, 0, 0.0, (probe.speeds[0], 0.0, 0.0))]
    elif slides:
        bodies = _sliding(probe)
    elif probe.speeds:
        bodies = _bouncing(probe, dt)
    else:  # at rest, spread over the height of the fall within the last step
        last = sqrt(2 * G * DROP) * dt
        gaps = [DROP + phase * last for phase in probe.phases]
        bodies = [_body(probe.pair, k, gap, (0.0, 0.0, 0.0)) for k, gap in enumerate(gaps)]
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
    """Play a probe's scene in this process and return its motion."""
    played = record(engine, scene(task.probe, task.settings.dt), task.settings)
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
SLOW = "restitution.slow.max"
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
    ended = [(task, one) for task, one in found if isinstance(one, Ended)]
    motions = [(task, one) for task, one in found if isinstance(one, ProbeMotion)]
    if len({one for _, one in ended}) == 1 and not motions:  # the engine itself fails
        ((first, one), *_) = ended
        base = replace(_base(first), scenario=ALL, metric="run", verdict=one.status, reason=one.reason)
        profiles = dict.fromkeys(task.settings.profile for task, _ in ended)
        return [replace(base, profile=name, dt=own_step(base.engine, name)) for name in profiles]
    rows: list[Row] = []
    resting = {
        _base(task): float(np.median(motion.gap[-1]))
        for task, motion in motions
        if (task.probe.kind, task.probe.requested) == ("restitution", 0.0)
    }
    ladders: dict[Row, list[tuple[float, float]]] = {}
    for task, motion in motions:
        base, probe = _base(task), task.probe
        # never below 0: a body that rests deeper touched before
        achieved = partial(_returned, probe, motion, base.dt, max(0.0, resting.get(base, 0.0)))
        match probe.kind:
            case "restitution":
                rows += _restitution_rows(base, probe, achieved())
            case "lowest":
                ladders.setdefault(base, []).extend(zip(probe.speeds, achieved()[:, 0].tolist()))
            case "friction":
                rows += _friction_rows(base, probe, motion)
            case "slow":
                rows.append(_slow_row(base, probe, motion))
            case "drop":
                # for e = 1, and its range over the phases of a step
                values = [rebound_of(gap) for gap in motion.gap.T]
                row = replace(base, metric="restitution.drop", subject=f"e=1 h={DROP:g}", unit="1")
                rows.append(with_interval(row, (values[0], min(values), max(values)), reason="asked 1"))
    rows += _largest(rows)
    rows += [replace(base, metric="gap.rest", unit="m", value=level) for base, level in resting.items()]
    rows += [_lowest(base, rungs) for base, rungs in ladders.items()]
    for task, one in ended:
        row = replace(_base(task), metric="run", subject=f"{task.probe.kind} {task.probe.requested:g}")
        rows.append(replace(row, verdict=one.status, reason=one.reason))
    return rows


def _base(task: ProbeTask) -> Row:
    return Row(STUDY, task.probe.pair, task.engine, task.settings.profile, task.settings.dt, "")


def _returned(probe: Probe, motion: ProbeMotion, dt: float, level: float) -> Array:
    """Achieved restitution per speed and phase; NaN where a hop is too short to measure."""
    bodies = zip(motion.gap.T, motion.velocity[..., 2].T)
    achieved = np.array([restitution_of(gap, rate, G, dt, level) for gap, rate in bodies])
    achieved = achieved.reshape(len(probe.speeds), len(probe.phases))
    hop = 2 * probe.requested * np.array(probe.speeds) / G
    achieved[(hop > 0) & (hop < HOP_STEPS * dt)] = nan
    return achieved


def _restitution_rows(base: Row, probe: Probe, achieved: Array) -> list[Row]:
    """Achieved restitution and bias per speed: the median over the phases with its range."""
    rows = []
    for speed, values in zip(probe.speeds, achieved):
        subject = subject_of("restitution", probe.requested, speed)
        row = replace(base, metric="restitution.achieved", subject=subject, unit="1")
        if np.isnan(values).any():
            reason = f"asked {probe.requested:g}; a hop of less than {HOP_STEPS} steps"
            rows.append(replace(row, verdict="skipped", reason=reason))
            continue
        rows.append(with_interval(row, extremes(values), reason=f"asked {probe.requested:g}"))
        bias = extremes(values - probe.requested)
        rows.append(with_interval(row, bias, metric="restitution.bias"))
    return rows


def _lowest(base: Row, rungs: Sequence[tuple[float, float]]) -> Row:
    speeds, returned = np.array(sorted(rungs)).T
    lowest = lowest_speed(speeds, returned)
    row = replace(base, metric="restitution.lowest", subject="e=1", unit="m/s", value=lowest)
    if isnan(lowest):
        reason = f"not even {speeds[-1]:.2f} m/s returns {BOUNCES:g} of e = 1"
        return replace(row, verdict="skipped", reason=reason)
    return replace(row, reason=f"from here on at least {BOUNCES:g} of e = 1 is returned")


def _friction_rows(base: Row, probe: Probe, motion: ProbeMotion) -> list[Row]:
    rows = []
    for k, heading in enumerate(probe.headings):
        mu = friction_of(motion.velocity[:, k, :2], motion.surface[:, k, :2], G, base.dt)
        subject = subject_of("friction", probe.requested, heading)
        row = replace(base, metric="friction.achieved", subject=subject, unit="1", value=mu)
        if isnan(mu):
            rows.append(replace(row, verdict="skipped", reason=f"asked {probe.requested:g}; slides on"))
        else:
            rows.append(replace(row, reason=f"asked {probe.requested:g}"))
            rows.append(replace(row, metric="friction.bias", value=mu / probe.requested - 1))
    return rows


def _slow_row(base: Row, probe: Probe, motion: ProbeMotion) -> Row:
    mu = slow_friction_of(motion.surface[:, 0, 0], pull_of(probe), G, base.dt)
    subject = subject_of("slow", probe.requested, probe.speeds[0])
    row = replace(base, metric="friction.slow", subject=subject, unit="1", value=mu / probe.requested)
    if isnan(mu):
        return replace(row, verdict="skipped", reason=f"asked {probe.requested:g}; it stops within two steps")
    return replace(row, reason=f"asked {probe.requested:g}")


def _largest(found: Sequence[Row]) -> list[Row]:
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


LADDER_PART = 26
"""Bodies of the ladder per scene: more would overflow an engine's log of contacts."""


@dataclass(frozen=True, slots=True)
class Requested:
    """Requested values: restitutions at approach `speeds` [m/s], frictions at `headings` [degrees], a ladder
    of speeds for the lowest one that bounces, slow slides at `slips` [m/s], and e = 1 from a fall under
    several steps [1/s]."""

    pairs: tuple[str, ...] = tuple(SHAPES)
    restitutions: tuple[float, ...] = (0.0, 0.3, 0.5, 0.8, 1.0)
    speeds: tuple[float, ...] = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    phases: tuple[float, ...] = (1 / 6, 1 / 2, 5 / 6)
    frictions: tuple[float, ...] = (0.1, 0.3, 0.5, 1.0)
    headings: tuple[float, ...] = (0.0, 22.5, 45.0)
    slips: tuple[float, ...] = (1e-3, 1e-2, 0.1)
    ladder: tuple[float, ...] = tuple(0.02 * 1.05**k for k in range(71))
    steps: tuple[int, ...] = (60, 240, 1000, 4000)
    drop_phases: tuple[float, ...] = tuple(k / 8 for k in range(8))


def tasks(columns: Sequence[Column], grid: Requested) -> list[ProbeTask]:
    """All probes, engine by engine; steps other than an engine's own only under its first profile."""
    found: list[ProbeTask] = []
    drop = Probe("sphere-box", "drop", 1.0, phases=grid.drop_phases)
    for engine in dict.fromkeys(engine for engine, _ in columns):
        profiles = [profile for name, profile in columns if name == engine]
        for profile in profiles:
            settings = Settings(profile, own_step(engine, profile))
            found += [ProbeTask(engine, settings, probe) for probe in probes_of(grid)]
        found += [ProbeTask(engine, Settings(profiles[0], 1 / rate), drop) for rate in grid.steps]
    return found


def probes_of(grid: Requested) -> list[Probe]:
    """The scenes of one column. Spheres meet the floor at every phase of a step, the others at its middle."""
    probes = []
    for pair in grid.pairs:
        phases = grid.phases if pair == "sphere-box" else (0.5,)
        probes += [Probe(pair, "restitution", e, grid.speeds, phases) for e in grid.restitutions]
        probes += [Probe(pair, "friction", mu, headings=grid.headings) for mu in grid.frictions]
        if pair != "sphere-box":  # a sphere rolls
            probes += [Probe(pair, "slow", mu, (v,)) for mu in grid.frictions for v in grid.slips]
    parts = (grid.ladder[k : k + LADDER_PART] for k in range(0, len(grid.ladder), LADDER_PART))
    return probes + [Probe("sphere-box", "lowest", 1.0, speeds, (0.5,)) for speeds in parts]


def run(
    columns: Sequence[Column],
    out: Path,
    progress: Progress,
    grid: Requested | None = None,
    loader: Loader = load,
) -> pd.DataFrame:
    """Play all columns; the folder appears complete or not at all."""
    grid = grid or Requested()
    with output_folder(out) as folder:
        asked = tasks([column for column in columns if installed(column[0])], grid)
        found = list(zip(asked, played(measure, asked, folder / "output", progress, loader=loader)))
        rows = missing_rows(STUDY, columns)
        engines = {}
        for engine in dict.fromkeys(engine for engine, _ in columns):
            mine = [(task, one) for task, one in found if task.engine == engine]
            rows += rows_of_engine(mine)
            version = next((one.version for _, one in mine if isinstance(one, ProbeMotion)), "")
            profiles = [profile for name, profile in columns if name == engine]
            engines[engine] = {"version": version, "profiles": profiles}
        facts = {"study": STUDY, "grid": asdict(grid), "engines": engines}
        pictures: dict[str, Picture] = {"calibration.png": requested_and_achieved}
        pictures["report.md"] = lambda frame, path: path.write_text(page(frame), "utf-8")
        return kept([judged(row, ()) for row in rows], folder, facts, pictures)


SHOWN_SPEED = 1.0
"""Approach speed of the restitutions in the table [m/s]."""
NOTES = (
    f"asked: what a sphere at {SHOWN_SPEED:g} m/s returned; bias: largest |achieved - asked| from 1 m/s on",
    "lowest: speed from which on a quarter of e = 1 is returned, or the least one tried",
    "friction: mean over the coefficients asked; bias: the largest of a single one",
    "-: a hop of less than two steps, or a slide that is over within two",
)


class Values:
    """The values of a calibration's rows, by (engine, profile, scenario, metric, subject)."""

    def __init__(self, frame: pd.DataFrame) -> None:
        rows = rows_of(frame[frame.metric != "run"])
        self.steps = {(r.engine, r.profile): r.dt for r in reversed(rows) if r.metric != "restitution.drop"}
        columns = dict.fromkeys((r.engine, r.profile) for r in rows)
        self.columns = [key for key in columns if key in self.steps]
        self._rows = {(r.engine, r.profile, r.scenario, r.metric, r.subject): r.value for r in rows}
        subjects = [r.subject for r in rows]
        self.restitutions = asked(subjects, "e")
        self.frictions, self.headings = asked(subjects, "mu"), asked(subjects, "heading")
        slow = [r.subject for r in rows if r.metric == "friction.slow"]
        fast = [r.subject for r in rows if r.metric == "restitution.achieved"]
        self.slips, self.speeds = asked(slow, "v"), asked(fast, "v")

    def __call__(self, column: tuple[str, str], pair: str, metric: str, subject: str = "") -> float:
        return self._rows.get((*column, pair, metric, subject), nan)

    def first(self, engine: str) -> str:
        """The engine's default profile, else its first, or ""."""
        own = [profile for name, profile in self.columns if name == engine]
        return DEFAULT if DEFAULT in own else next(iter(own), "")

    def both(self, engine: str) -> tuple[tuple[str, str], tuple[str, str]]:
        """The columns of an engine's default and of its accurate profile."""
        return (engine, self.first(engine)), (engine, ACCURATE)

    def step(self, engine: str) -> float:
        """Native step of an engine in its default profile [s]."""
        return self.steps.get((engine, self.first(engine)), nan)

    def lowest(self, engine: str) -> float:
        """Lowest speed that bounces under an engine's first profile [m/s]."""
        return self((engine, self.first(engine)), "sphere-box", "restitution.lowest", "e=1")

    def share(self, column: tuple[str, str], pair: str, heading: float) -> float:
        """Achieved over requested friction along a heading, mean over the coefficients."""
        subjects = [subject_of("friction", mu, heading) for mu in self.frictions]
        found = [self(column, pair, "friction.bias", subject) for subject in subjects]
        known = [1 + bias for bias in found if not isnan(bias)]
        return float(np.mean(known)) if known else nan


def asked(subjects: Sequence[str], name: str) -> list[float]:
    """The values of a name in the subjects, ascending."""
    words = [word for subject in subjects for word in subject.split()]
    return sorted({float(word.partition("=")[2]) for word in words if word.startswith(f"{name}=")})


def grids(frame: pd.DataFrame) -> list[Part]:
    """Restitution, friction, both of slow bodies, and a fall under several steps."""
    values = Values(frame)
    parts = (_restitution(values), _friction(values), _slow(values), _drops(frame))
    return [
        replace(one, heads=[head.replace(" ", "\n", 1) for head in one.heads], tight=True) for one in parts
    ]


def _restitution(values: Values) -> Part:
    biases = [f"{pair.partition('-')[0]} bias" for pair in SHAPES]
    heads = ["", *(f"asked {e:g}" for e in values.restitutions), *biases, "lowest [m/s]"]
    rows = []
    for column in values.columns:
        subjects = [subject_of("restitution", e, SHOWN_SPEED) for e in values.restitutions]
        achieved = [values(column, "sphere-box", "restitution.achieved", subject) for subject in subjects]
        largest = [values(column, pair, "restitution.bias.max") for pair in SHAPES]
        lowest = values(column, "sphere-box", "restitution.lowest", "e=1")
        rows.append([_name(values, column), *map(_text, [*achieved, *largest, lowest])])
    return Part("restitution, asked and achieved", heads, rows)


def _friction(values: Values) -> Part:
    pairs = [pair.partition("-")[0] for pair in SHAPES]
    heads = ["", *(f"{pair} {heading:g}°" for pair in pairs for heading in values.headings), "bias"]
    rows = []
    for column in values.columns:
        shares = [values.share(column, pair, heading) for pair in SHAPES for heading in values.headings]
        rows.append([_name(values, column), *map(_text, [*shares, values(column, ALL, "friction.bias.max")])])
    return Part("friction, achieved over asked, per heading", heads, rows)


def _slow(values: Values) -> Part:
    """What e = 1 returns per approach speed, and friction per speed of the slip."""
    speeds = [speed for speed in values.speeds if speed <= JUDGED_SPEED]
    heads = ["", *(f"bounce {v:g}" for v in speeds), *(f"slide {v:g}" for v in values.slips), "slide bias"]
    rows = []
    for column in values.columns:
        cells = [
            values(column, "sphere-box", "restitution.achieved", subject_of("restitution", 1.0, v))
            for v in speeds
        ]
        for v in values.slips:
            subjects = [subject_of("slow", mu, v) for mu in values.frictions]
            found = [values(column, pair, "friction.slow", one) for pair in SHAPES for one in subjects]
            known = [one for one in found if not isnan(one)]
            cells.append(float(np.mean(known)) if known else nan)
        cells.append(values(column, ALL, "friction.slow.max"))
        rows.append([_name(values, column), *map(_text, cells)])
    return Part("slow bodies [m/s]: what e = 1 returns, friction achieved over asked", heads, rows)


def _drops(frame: pd.DataFrame) -> Part:
    rows = rows_of(frame[frame.metric == "restitution.drop"])
    steps = sorted({row.dt for row in rows}, reverse=True)
    heads = ["", *(f"{step_text(dt)} s" for dt in steps)]
    lines = []
    for engine in dict.fromkeys(row.engine for row in rows):
        mine = [r for r in rows if r.engine == engine]
        cells = {r.dt: f"{_text(r.value)} ({_text(r.low)} to {_text(r.high)})" for r in mine}
        lines.append([engine, *(cells.get(dt, "-") for dt in steps)])
    title = "e = 1 from a fall of half a metre, and its range over where within a step bodies land"
    return Part(title, heads, lines)


def _name(values: Values, column: tuple[str, str]) -> str:
    return f"{column[0]} {column[1]} {step_text(values.steps[column])} s"


def _text(value: float) -> str:
    """Three decimals: coefficients are of order 1."""
    return "-" if isnan(value) else f"{value:.3f}"


DART_BOUNCE = 0.1
"""DART bounces where e v is above this (DART_BOUNCING_VELOCITY_THRESHOLD, ContactSurface.hpp) [m/s]."""
BULLET_MARGIN = 0.02
"""Share of a body's size within which Bullet generates contacts (getContactBreakingThreshold) [1]."""
BULLET_BOUNCE = 0.2
"""Bullet's default restitutionVelocityThreshold [m/s]."""


def findings(frame: pd.DataFrame) -> list[str]:
    """One line per finding whose numbers are all in the frame."""
    of, margin = Values(frame), BULLET_MARGIN * HEIGHT
    dart, mujoco, bullet = (of.both(engine) for engine in ("dart", "mujoco", "bullet"))
    rest, least = 2 * G * of.step("reference"), DART_BOUNCE - 1.5 * G * of.step("dart")
    cones = {column: of.share(column, "box-box", 45.0) for column in (*dart, *mujoco, *bullet)}
    springs = [of(column, "sphere-box", "restitution.achieved", "e=0.3 v=5") for column in mujoco]
    slowest = f"mu={min(of.frictions, default=0):g} heading=45"
    drops = [row for row in rows_of(frame[frame.metric == "restitution.drop"]) if row.engine == "bullet"]
    returned = ", ".join(f"{row.value:.2f} at {step_text(row.dt)} s" for row in drops) or "nan"
    gaps = [1e3 * of(column, "hull-box", "gap.rest") for column in bullet]
    lines = [
        f"reference: bounces from {of.lowest('reference'):.3f} m/s on, by its own law: e fades evenly "
        f"from 4 g h = {2 * rest:.3f} m/s to none at 2 g h = {rest:.3f} m/s, with a quarter of it at "
        f"2.5 g h = {1.25 * rest:.3f} m/s",
        f"dart: bounces from {of.lowest('dart'):.3f} m/s on: it has no bounce unless e v > "
        f"{DART_BOUNCE:g} m/s, where v has fallen on past the surface, for half a step here, and holds one "
        f"more step of gravity: {DART_BOUNCE:g} - 1.5 g h = {least:.3f} m/s. dartpy has no setter. A bounce "
        "gains about 2 g h / v, for gravity pulls in the step before it, not in its own",
        f"dart: {cones[dart[0]]:.3f} of mu at 45 degrees, for each of two directions may have all of mu: "
        "sqrt(2) together. The cone of its NSGS solver is circular (accurate): "
        f"{cones[dart[1]]:.3f}",
        f"bullet: loses restitution as the step shrinks: e = 1 from a fall of 0.5 m returns {returned}. "
        f"Contacts are found before bodies touch, within {BULLET_MARGIN:.0%} of their size "
        f"({1e3 * margin:g} mm here), and brake a body "
        "so that it just arrives at the end of the step; what speed it has left is what bounces. Long steps "
        "jump over that margin; they gain by position correction and by a step "
        "without gravity. contactProcessingThreshold = 0 (accurate) takes the margin away: e = 1 returns "
        f"{of(bullet[1], 'sphere-box', 'restitution.achieved', 'e=1 v=1'):.2f} at 1 m/s. Bodies of shifted "
        "pieces (compounds) have no margin to begin with",
        f"bullet: bounces from {of.lowest('bullet'):.3f} m/s on; below restitutionVelocityThreshold = "
        f"{BULLET_BOUNCE:g} m/s not at all, and below {margin / (1.5 * of.step('bullet')):.3f} m/s it needs "
        "more than a step and a half through the margin and is braked twice",
        f"bullet: {of.share(bullet[0], 'sphere-box', 45.0):.3f} of mu at 45 degrees under a sphere, "
        f"{cones[bullet[0]]:.3f} under a box: each point of a "
        "face is on its cone, but in a direction of its own, and they do not add up",
        f"bullet: hulls rest {gaps[0]:.2f} mm high, {gaps[1]:.2f} mm without collisionMargin (accurate). A "
        "hull that lands flat is found one point a step and begins to spin: its restitution is off by up to "
        f"{of(bullet[1], 'hull-box', 'restitution.bias.max'):.2f} even so",
        f"mujoco: e = 0.3 returns {springs[0]:.3f} at 5 m/s: a damped spring that may not pull lets go while "
        f"still compressed. Allowing for that, with a stiff contact (accurate): {springs[1]:.3f}; slow "
        "bodies return less, for they let go below the surface and climb out against gravity",
        f"mujoco: {1 + of(mujoco[0], 'box-box', 'friction.bias', slowest):.3f} of mu at 45 degrees for the "
        "slowest box: the default cone is a pyramid with its edges over the axes, and its sides are "
        "1 / sqrt(2) = 0.707 from its middle. Faster bodies hop, for friction also lifts them. Elliptic "
        f"cone, friction damped by itself (accurate): {cones[mujoco[1]]:.3f} on average",
    ]
    return [line for line in lines if "nan" not in line]


def report(frame: pd.DataFrame) -> list[Part]:
    """All tables, their notes, and every finding, failure and broken limit."""
    return [*grids(frame), Part(notes=NOTES, lines=["", *findings(frame)]), failures(frame)]


def page(frame: pd.DataFrame) -> str:
    """The study as a page."""
    notes, found = Part(notes=NOTES, picture="calibration.png"), Part("findings", lines=findings(frame))
    remarks = Part("remarks", lines=failure_lines(frame), empty="none")
    return page_text(f"study {STUDY}", (*grids(frame), notes, found, remarks))


SIDES = ((2**0.5, "√2"), (0.5**0.5, "1 / √2"))
"""Shares of friction at 45 degrees that reveal a pyramid in place of a cone [1]."""


def requested_and_achieved(frame: pd.DataFrame, path: Path) -> None:
    """Draw achieved over requested restitution and friction per engine.

    Restitution from JUDGED_SPEED: medians over speeds and shapes, with the range over these and over the
    phase within a step at which bodies land. Friction per heading: medians over coefficients and shapes, with
    their range.
    """
    parts = {engine: frame[(frame.engine == engine) & frame.value.notna()] for engine in ENGINES}
    bounced = {engine: _ranges(part, _restitutions, 0.014) for engine, part in parts.items() if len(part)}
    slid = {engine: _ranges(part, _frictions, 1.1) for engine, part in parts.items() if len(part)}
    line = alt.Chart(pd.DataFrame({"x": [0, 1], "middle": [0, 1]})).mark_line(color=PALE, strokeDash=DASHES)
    sides = alt.Chart(pd.DataFrame(SIDES, columns=["middle", "name"])).encode(y="middle:Q")
    text = sides.mark_text(align="left", dx=4, dy=-5, color=PALE).encode(x=alt.value(0), text="name:N")
    levels = rule(DASHES, y=1) + sides.mark_rule(color=PALE, strokeDash=DOTS) + text
    x = axis(alt.X, "x", "restitution asked", (-0.05, 1.05))
    y = axis(alt.Y, "middle", "restitution achieved", _span(bounced, -0.05, 1.05))
    below, legend = line.encode(x="x:Q", y="middle:Q"), alt.Legend(orient="top-left", columns=1)
    panels = [below + _panel(engine, part, x, y, legend) for engine, part in bounced.items()]
    headings: dict[str, Any] = {"values": [0, 22.5, 45], "labelExpr": "datum.value + '°'", "grid": False}
    x = axis(alt.X, "x", "heading of the slide", (-7, 52), **headings)
    y = axis(alt.Y, "middle", "friction achieved / asked", _span(slid, 0.45, 1.5))
    panels += [levels + _panel(engine, part, x, y, None) for engine, part in slid.items()]
    title = "Bodies that land on a floor and slide over it: what engines make of restitution and friction"
    note = (
        "marker: median; bar: range over balls, boxes and hulls, and over speeds from "
        f"{JUDGED_SPEED:g} m/s on (restitution) or the coefficients asked (friction)"
    )
    save(grid(panels, len(bounced)).resolve_scale(fill="independent"), path, title, note)


def _span(found: Mapping[str, pd.DataFrame], low: float, high: float) -> tuple[float, float]:
    whole = pd.concat([pd.DataFrame({"low": [low], "high": [high]}), *found.values()])
    return whole.low.min(), whole.high.max()


Ranges = dict[float, list[float]]


def _profiles(frame: pd.DataFrame) -> list[tuple[str, bool]]:
    """The first profile, drawn filled, and the accurate one or the next, drawn hollow."""
    first, *others = dict.fromkeys(frame.profile)
    second = [ACCURATE] if ACCURATE in others else others[:1]
    return [(first, True), *((name, False) for name in second)] if first != ACCURATE else [(first, True)]


def _ranges(frame: pd.DataFrame, find: Callable[[pd.DataFrame], Ranges], shift: float) -> pd.DataFrame:
    """Median and range of each list by its abscissa; the first profile a little to the left."""
    rows = []
    for profile, filled in _profiles(frame):
        for place, found in sorted(find(frame[frame.profile == profile]).items()):
            x = place + (-shift if filled else shift)
            rows.append((profile, filled, x, min(found), float(np.median(found)), max(found)))
    return pd.DataFrame(rows, columns=["profile", "filled", "x", "low", "middle", "high"])


def _panel(engine: str, found: pd.DataFrame, x: Any, y: Any, legend: Any) -> Any:
    color = color_of(engine)
    fill = by(alt.Fill, "profile", dict(zip(dict.fromkeys(found.profile), (color, "white"))), legend=legend)
    base = alt.Chart(found).encode(x=x)
    drawn = base.mark_point(stroke=color, size=45, opacity=1).encode(y=y, fill=fill)
    for chosen, look in (("", {"strokeWidth": 5, "strokeOpacity": 0.3}), ("!", {"strokeWidth": 1.3})):
        bars = base.transform_filter(f"{chosen}datum.filled").mark_rule(color=color, **look)
        drawn += bars.encode(y="low:Q", y2="high:Q")
    return drawn.properties(title={"text": engine, "color": color}, width=190, height=190)


def _asked(subject: str) -> tuple[float, float]:
    """The coefficient and the speed or heading that a row's subject names."""
    first, second = (float(word.partition("=")[2]) for word in subject.split())
    return first, second


def _restitutions(frame: pd.DataFrame) -> Ranges:
    found: Ranges = {}
    for row in rows_of(frame[frame.metric == "restitution.achieved"]):
        e, speed = _asked(row.subject)
        if speed >= JUDGED_SPEED:
            found.setdefault(e, []).extend((row.low, row.value, row.high))
    return found


def _frictions(frame: pd.DataFrame) -> Ranges:
    found: Ranges = {}
    for row in rows_of(frame[frame.metric == "friction.bias"]):
        found.setdefault(_asked(row.subject)[1], []).append(1 + row.value)
    return found
