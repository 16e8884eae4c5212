"""The study `predictability`: amplification of small perturbations of the initial state.

Amplification is the distance of a perturbed run's final positions from the unperturbed run's, over the
perturbation, both as one vector of all bodies. Rows hold the median over random directions, with its range.
All sizes and engines use the same directions. Neither a high nor a low value is better; where there is a
closed form, its amplification is reported beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import MISSING, Array, Settings
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.registry import ENGINES, installed, missing_reason
from touchstone.adapters.workers.children import Children, Job
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, illustrate, save, save_manifest, table
from touchstone.reports.studies.agreement.study import own_profile
from touchstone.reports.studies.predictability.definitions import (
    CLOSED_FORM,
    DRAWS,
    ERROR,
    METRIC,
    SIZES,
    STUDY,
)
from touchstone.reports.studies.predictability.picture import amplifications
from touchstone.reports.verdict.judge import judged
from touchstone.scenarios.closed_form_ends import final_positions
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import shifted

NEAR = 2 * SIZES[-1]
"""Gap within which bodies touch at the start [m]: perturbations neither press these together nor separate
them."""
SCENES = ("fall", "bounce_e05", "collide_oblique", "cradle", "ball_snip")
"""Default scenes."""


def steps(scenarios: Sequence[Scenario]) -> int:
    """Number of progress steps of a run: displayed frames."""
    return sum(s.frame_count for s in scenarios) * len(ENGINES) * (1 + len(SIZES) * DRAWS)


def run(scenarios: Sequence[Scenario], seed: int, out: Path, progress: Progress) -> pd.DataFrame:
    """Play every scene unperturbed and perturbed; the folder appears complete or not at all."""
    rows: list[Row] = []
    with output_folder(out) as folder, Children(together=True) as children:
        (folder / "output").mkdir()
        (folder / "recordings").mkdir()
        for scenario in scenarios:
            found = rows_of_scene(scenario, seed, folder, children, progress)
            rows += [judged(row, scenario.tags) for row in found]
        frame = table(rows)
        save(frame, folder)
        _save_manifest(scenarios, seed, folder)

        illustrate(folder / "predictability.png", lambda part: amplifications(frame, part))
    return frame


def rows_of_scene(
    scenario: Scenario, seed: int, folder: Path, children: Children, progress: Progress
) -> list[Row]:
    """Rows of amplification per engine and size, and of the closed form's."""
    rows = [_ended(scenario, e, MISSING, missing_reason(e)) for e in ENGINES if not installed(e)]
    ends: dict[str, list[Array]] = {engine: [] for engine in ENGINES if installed(engine)}
    bodies = _outcome_bodies(scenario)
    first: Recording | None = None
    starts = [scenario]
    number = 0
    while number < len(starts):
        jobs = [_job(starts[number], engine, f"{scenario.name}-{engine}-{number}", folder) for engine in ends]
        for outcome in children.play(jobs, progress):
            engine = outcome.job.engine
            if outcome.status == "done":
                recording = load(outcome.job.recording)
                first = first or recording
                ends[engine].append(recording.position[-1, bodies])
            else:
                rows.append(_ended(scenario, engine, outcome.status, outcome.reason))
                ends.pop(engine)
        if number == 0 and first is not None:
            moved = directions(scenario, touching(first, scenario), seed)
            starts += [shifted(scenario, size * one) for size in SIZES for one in moved]
        number += 1
    true_ends = [end for end in map(final_positions, starts) if end is not None]
    truth = _amplifications(true_ends) if len(true_ends) == len(starts) else None
    for engine, found in ends.items() if len(starts) > 1 else ():
        rows += _rows(_base(scenario, engine), _amplifications(found), truth)
    return rows + (_rows(_base(scenario, CLOSED_FORM), truth) if truth is not None else [])


def directions(scenario: Scenario, normals: Array, seed: int) -> list[Array]:
    """DRAWS unit vectors (n, 3) over the simulated bodies, or over the trackers if there are none. To first
    order they change no gap of touching pairs (`touching`)."""
    rng = np.random.default_rng([seed, scenario.seed])
    count = len(_simulated(scenario)) or len(scenario.trackers)
    found = []
    for _ in range(DRAWS):
        drawn = rng.standard_normal(3 * count)
        if len(normals):
            drawn -= np.linalg.pinv(normals) @ (normals @ drawn)
        found.append((drawn / np.linalg.norm(drawn)).reshape(count, 3))
    return found


def touching(recording: Recording, scenario: Scenario) -> Array:
    """Gradient of the gap with respect to the positions of simulated bodies: one row (3 n,) per pair that
    touches in the first frame."""
    from touchstone.adapters.oracles.overlap import measure

    start = {name: getattr(recording, name)[:1] for name in ("time", "position", "orientation")}
    distances = measure(replace(recording, **start), scenario)
    simulated, rows = _simulated(scenario), []
    for pair, distance in distances.distance.items():
        row = np.zeros((len(simulated), 3))
        for body, sign in zip(pair, (-1.0, 1.0)):
            if distance[0] < NEAR and body in simulated:
                row[simulated.index(body)] = sign * distances.normal[pair][0]
        if row.any():
            rows.append(row.ravel())
    return np.array(rows)


def _simulated(scenario: Scenario) -> list[int]:
    return [k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"]


def _outcome_bodies(scenario: Scenario) -> list[int]:
    """Bodies whose final positions count: simulated bodies, or else all driven ones."""
    driven = [k for k, body in enumerate(scenario.bodies) if body.kind == "driven"]
    return _simulated(scenario) or driven


def _amplifications(ends: list[Array]) -> Array:
    """Final distance over the perturbation (SIZES, DRAWS), from the unperturbed end state and those after
    it."""
    moved = np.reshape(ends[1:], (len(SIZES), DRAWS, -1)) - np.ravel(ends[0])
    return np.asarray(np.linalg.norm(moved, axis=-1) / np.array(SIZES)[:, None])


def _rows(base: Row, found: Array, truth: Array | None = None) -> list[Row]:
    """Per size the median over the directions with the range, and the largest error against the closed
    form's."""
    rows = []
    for k, size in enumerate(SIZES):
        row = replace(base, metric=METRIC, unit="1", subject=f"{size:g} m", value=float(np.median(found[k])))
        rows.append(replace(row, low=float(found[k].min()), high=float(found[k].max())))
        if truth is not None:
            error = float(np.abs(found[k] / truth[k] - 1).max())
            rows.append(replace(row, metric=ERROR, value=error))
    return rows


def _job(scenario: Scenario, engine: str, name: str, folder: Path) -> Job:
    profile = own_profile(engine)
    settings = Settings(profile, ENGINES[engine].profiles[profile])
    recording, output = folder / "recordings" / f"{name}.npz", folder / "output" / f"{name}.txt"
    return Job(engine, scenario, settings, recording, output)


def _base(scenario: Scenario, engine: str) -> Row:
    if engine not in ENGINES:
        return Row(STUDY, scenario.name, engine, "", float("nan"), METRIC)
    profile = own_profile(engine)
    return Row(STUDY, scenario.name, engine, profile, ENGINES[engine].profiles[profile], METRIC)


def _ended(scenario: Scenario, engine: str, verdict: str, reason: str) -> Row:
    return replace(_base(scenario, engine), metric="run", verdict=verdict, reason=reason)


def _save_manifest(scenarios: Sequence[Scenario], seed: int, folder: Path) -> None:
    save_manifest(
        folder,
        {
            "study": STUDY,
            "seed": seed,
            "sizes": SIZES,
            "draws": DRAWS,
            "scenarios": {s.name: {"tags": s.tags, "seed": s.seed} for s in scenarios},
        },
    )
