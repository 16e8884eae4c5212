"""Farthest apart: per body the largest distance between two columns of a scene, and from when on they differ.

It needs no truth. Where a scene amplifies perturbations, columns are compared up to its horizon: the last
moment at which a run whose bodies start PERTURBATION away is within HORIZON_DISTANCE of the unperturbed one.
Driven bodies count as one, by the link that is farthest apart; fixed and prescribed bodies do not count, nor
does BARE, the paper's pipeline without our guarantees, where two other columns played.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations
from math import inf, nan

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import load
from touchstone.adapters.registry import backend_of
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.reports.metrics import HORIZON, PARITY, SPREAD
from touchstone.reports.metrics.context import Context
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.runner.cells import PERTURBATION
from touchstone.reports.runner.measures import (
    HORIZON_DISTANCE,
    PERTURBED_SEEDS,
    closed_path,
    last_within,
    moving,
)
from touchstone.reports.runner.request import EVERY_ENGINE, MACHINE_PROFILE, STUDY
from touchstone.reports.views.tables import length_text
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import perturbed

Column = tuple[str, str]
Pair = tuple[Column, Column]
BARE = "paper"
"""Profile that is compared only where fewer than two others played."""
THRESHOLD = 1e-3
"""Distance from which on columns count as apart [m]: the error of a position that most users accept."""


def apart_rows(
    scenario: Scenario, played: Mapping[Column, Context], horizon: Callable[[], float] = lambda: inf
) -> list[Row]:
    """Rows of SPREAD per body, and of HORIZON if it was measured; none for a single column.

    Args:
        horizon: measures the horizon of the scene [s], NaN if it cannot; called where columns are apart and
            not every body has a closed form.
    """
    others = {column: one for column, one in played.items() if column[1].partition(", ")[0] != BARE}
    played = others if len(others) > 1 else played
    groups = _groups(scenario, next(iter(played.values()), None))
    if len(played) < 2 or not groups:
        return []
    distances = _distances(played, groups)
    until, rows = inf, []
    size, limit = f"{1e6 * PERTURBATION:g} um", length_text(HORIZON_DISTANCE)
    if max(map(np.nanmax, distances.values())) > THRESHOLD and closed_path(scenario) is None:
        until = horizon()
    base = Row(STUDY, scenario.name, EVERY_ENGINE, MACHINE_PROFILE, nan, HORIZON, until, "s")
    if np.isfinite(until):
        rows.append(replace(base, reason=f"until {size} at the start have grown to {limit}"))
    else:
        until = inf
    last = min(len(next(iter(distances.values()))) - 1, int(min(until * scenario.frame_rate + 1e-6, 1e18)))
    for k, subject in enumerate(groups):
        found = {pair: d[: last + 1, k] for pair, d in distances.items()}
        value, text = _farthest(found, scenario.frame_rate)
        if last < scenario.frame_count:
            later = length_text(max(np.nanmax(d[last + 1 :, k], initial=0.0) for d in distances.values()))
            text += f"; until {last / scenario.frame_rate:.3g} s, when {size} at the start are {limit}"
            text += f" (the horizon); {later} later"
        rows.append(replace(base, metric=SPREAD, value=value, unit="m", subject=subject, reason=text))
    return rows


def parity_rows(scenario: Scenario, played: Mapping[Column, Context]) -> list[Row]:
    """Rows of PARITY: of each column whose engine is a backend of another with a column of this name."""
    rows = []
    for (engine, label), context in played.items():
        other, groups = backend_of(engine), _groups(scenario, context)
        if (other, label) not in played or not groups:
            continue
        pair = {column: played[column] for column in ((other, label), (engine, label))}
        away = next(iter(_distances(pair, groups).values())).max(axis=1)
        until = last_within(away, THRESHOLD) / scenario.frame_rate
        said = f"bodies are within {length_text(THRESHOLD)} of those of {other}"
        said += f", at most {length_text(np.nanmax(away))} apart"
        dt = context.recording.facts["dt"]
        rows.append(Row(STUDY, scenario.name, engine, label, dt, PARITY, until, "s", reason=said))
    return rows


def measured_horizon(scenario: Scenario, plain: Job, children: Children, progress: Progress) -> float:
    """Horizon of a scene [s] in the column of a job that was played; its duration if the scene does not
    amplify, NaN if a perturbed run failed."""
    unperturbed, last = load(plain.recording), scenario.frame_count
    with scratch_folder() as folder:
        for seed in PERTURBED_SEEDS:
            moved = perturbed(scenario, PERTURBATION, seed)
            files = {"recording": folder / f"{seed}.npz", "output": folder / f"{seed}.txt"}
            job = replace(plain, scenario=moved, **files)  # type: ignore[arg-type]
            (outcome,) = children.play([job], lambda label, _: progress(f"{label}, perturbed", 0))
            if outcome.status != "done":
                return nan
            bodies, other = moving(scenario), load(job.recording).position
            frames = min(len(other), len(unperturbed.position))
            away = (other[:frames] - unperturbed.position[:frames])[:, bodies]
            last = min(last, last_within(np.linalg.norm(away, axis=-1).max(axis=1), HORIZON_DISTANCE))
    return max(last, 1) / scenario.frame_rate


def _groups(scenario: Scenario, context: Context | None) -> dict[str, list[int]]:
    """Name -> bodies: each simulated body, and the links of each driven one by the name of its root."""
    found: dict[str, list[int]] = {}
    for k, body in enumerate(scenario.bodies):
        if context is not None and body.kind in ("simulated", "driven"):
            found.setdefault(context.owner(k), []).append(k)
    return found


def _distances(played: Mapping[Column, Context], groups: Mapping[str, list[int]]) -> dict[Pair, Array]:
    """Distance of the centres of mass (f, groups) [m] per pair of columns; NaN after one of them ended."""
    frames = max(len(context.recording.time) for context in played.values())
    found: dict[Pair, Array] = {}
    for one, other in combinations(played, 2):
        a, b = played[one].mass_centers, played[other].mass_centers
        both = min(len(a), len(b))
        away = np.linalg.norm(a[:both] - b[:both], axis=-1)
        found[one, other] = np.full((frames, len(groups)), nan)
        for k, bodies in enumerate(groups.values()):
            found[one, other][:both, k] = away[:, bodies].max(axis=1)
    return found


def _farthest(distances: Mapping[Pair, Array], frame_rate: float) -> tuple[float, str]:
    """Largest of the distances (f,) of a body, with a sentence: between which columns, when, from when on any
    two are apart, and if any are, how far the others are without the column that is farthest from them."""
    peaks = {pair: float(np.nanmax(one)) for pair, one in distances.items()}
    pair = max(peaks, key=lambda each: peaks[each])
    when = int(np.nanargmax(distances[pair])) / frame_rate
    beyond = [np.flatnonzero(one > THRESHOLD) for one in distances.values()]
    first = min((int(one[0]) for one in beyond if len(one)), default=None)
    limit = length_text(THRESHOLD)
    onset = f"never above {limit}" if first is None else f"above {limit} from {first / frame_rate:.3g} s on"
    text = f"{' '.join(pair[0])} and {' '.join(pair[1])} at {when:.3g} s; {onset}"
    left = {c: max((d for p, d in peaks.items() if c not in p), default=nan) for c in pair}
    if len(peaks) > 1 and first is not None:
        outlier = min(left, key=lambda column: left[column])
        text += f"; {length_text(left[outlier])} without {' '.join(outlier)}"
    return peaks[pair], text
