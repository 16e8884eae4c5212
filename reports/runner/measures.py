"""Measures of cells: accuracy of a run, and its time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from touchstone.adapters.contract import Array, Engine
from touchstone.adapters.recorder import build, frame_seconds, record
from touchstone.adapters.recording import Recording, RunEnded
from touchstone.reports.metrics.context import Context
from touchstone.reports.results import Row
from touchstone.reports.runner.cells import Cell
from touchstone.reports.verdict.rows import measured_of
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

STUDY = "sweep"
METRICS = (
    *("truth.position", "truth.velocity", "truth.orientation", "truth.spin"),
    *("overlap.max", "overlap.p95", "overlap.tunnelled", "contact.gap"),
    *("energy.gain", "energy.loss", "energy.injected"),
    *("friction.cone", "friction.deficit", "friction.direction", "friction.stop", "friction.coast"),
    *("friction.creep", "friction.heading", "restitution.error", "bounce.height", "rolling.time"),
    *("events.touch", "events.roll", "events.leave", "events.land", "events.meet", "events.part"),
    *("posture.deviation", "momentum.linear"),
)
FRAMES, PATH = "frames", "path"
"""Rows with a series: native seconds of each displayed frame, and the centres of mass of the moving bodies,
flat (f, n, 3) [m]. Their values are the numbers of frames and of bodies."""
PERTURBED_SEEDS = (0, 1)
"""Perturbed runs that measure the horizon."""
HORIZON_DISTANCE = 1e-4
"""Distance from the unperturbed run beyond which a scene is no longer compared [m]: a perturbation of 1e-6 m
has grown by a hundred; a tenth of the tolerance of positions."""
LEFT_PLAN = "plan does not hold"
"""Part of the message of a run that left the bounds of its plan; it is played again with all effects."""
TIMED_SECONDS = 0.1
"""Time of native steps after which a timing cell stops [s]; the rest of the scene is extrapolated by the
accuracy cell's times of frames."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What a measure returns: rows, and the series of some of them by metric."""

    rows: tuple[Row, ...]
    series: Mapping[str, Array] = field(default_factory=dict)


def base_row(cell: Cell) -> Row:
    """Row of a cell without a metric."""
    column = (cell.scenario, cell.engine, cell.profile, cell.dt)
    return Row(STUDY, *column, "run", seed=cell.seed, repeat=cell.repeat)


def moving(scenario: Scenario) -> list[int]:
    """Indices of the bodies whose paths are compared: simulated ones, or else driven ones."""
    for kind in ("simulated", "driven"):
        if found := [k for k, body in enumerate(scenario.bodies) if body.kind == kind]:
            return found
    return []


def last_within(away: Array, distance: float) -> int:
    """Last frame before the first in which a distance (f,) exceeds one [m] or is unknown; else the last."""
    beyond = np.flatnonzero(~(away <= distance))
    return (int(beyond[0]) if len(beyond) else len(away)) - 1


def closed_path(scenario: Scenario) -> Array | None:
    """Centres of mass of the moving bodies in closed form (f, n, 3) [m]; None unless all have one."""
    truths = {scenario.body_index(truth.body): truth for truth in scenario.truths}
    bodies = moving(scenario)
    if not truths or not set(bodies) <= truths.keys():
        return None
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    return np.stack([motion(scenario, truths[k], times).position for k in bodies], axis=1)


def accuracy(cell: Cell, scenario: Scenario, engine: Engine) -> Measured:
    """Play the whole scene and measure METRICS (or those of the option `metrics`).

    A run at a coarse step may leave the bounds of its plan; it is then played with all effects. A run that
    ends early keeps no metrics: its row says why.
    """
    recording, note = _record(cell, scenario, engine)
    base = base_row(cell)
    context = Context(recording, scenario)
    names = tuple(filter(None, cell.option("metrics").split("+"))) or METRICS
    rows = [row for row in measured_of(base, context, names) if row.metric in names]
    seconds = recording.time_frame
    centers = context.mass_centers[:, moving(scenario)]
    facts = [
        replace(base, metric="run", value=float(seconds.sum()), unit="s", reason=note),
        replace(base, metric=FRAMES, value=len(seconds), unit="s"),
        replace(base, metric=PATH, value=len(moving(scenario)), unit="m"),
    ]
    return Measured((*facts, *rows), {FRAMES: seconds, PATH: centers.ravel()})


def _record(cell: Cell, scenario: Scenario, engine: Engine) -> tuple[Recording, str]:
    """Recording, and a remark if all effects were needed."""
    try:
        return record(engine, scenario, cell.settings), ""
    except RunEnded as error:
        if LEFT_PLAN not in str(error) or cell.effects:
            raise
    return record(engine, scenario, replace(cell.settings, effects=PLANNED)), "played with all effects"


def timing(cell: Cell, scenario: Scenario, engine: Engine) -> Measured:
    """Time native steps, without reading the state, until TIMED_SECONDS have passed: seconds per frame.

    The process is pinned to a core and alone, and has warmed up its engine (`InTurns`).
    """
    world, settings, _ = build(engine, scenario, cell.settings)
    spent: list[float] = []
    while len(spent) < scenario.frame_count and sum(spent) < TIMED_SECONDS:
        spent.append(frame_seconds(world, scenario, settings, len(spent)))
    world.close()
    base = base_row(cell)
    facts = (
        replace(base, metric="run", value=sum(spent), unit="s"),
        replace(base, metric=FRAMES, value=len(spent), unit="s"),
    )
    return Measured(facts, {FRAMES: np.array(spent)})
