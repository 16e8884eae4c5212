"""`touchstone.run`, `sweep` and `work_precision`: the commands of these names as functions."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from math import isfinite
from pathlib import Path
from typing import TypedDict, Unpack

import pandas as pd

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.engines.reference.compile_progress import announcement
from touchstone.adapters.knobs import SettingError
from touchstone.adapters.recorder import substeps
from touchstone.adapters.registry import ENGINES, registered
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.reports.run.study import run as run_study
from touchstone.reports.runner.request import DEFAULT_PROFILES, REFERENCE, Request, Results, columns_of
from touchstone.reports.verdict.limits import check_limits
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.named import scenes_called
from touchstone.scenarios.names import checked
from touchstone.scenarios.scenario import Scenario


def run(
    scenes: str | Path | Scenario | Iterable[str | Path | Scenario],
    engines: str | Iterable[str] | None = None,
    profiles: str | Iterable[str] | None = None,
    dt: float | None = None,
    out: str | Path | None = None,
) -> Results:
    """Play scenes on engines, each engine in a process of its own, and judge what they did.

    Args:
        scenes: names of the catalogue, files of scenes (.toml, .json, .py) or scenarios of your own; one, or
            several.
        engines: one name or several, also "module:Class" of an engine of your own; None: all of ours. One
            that is not installed gives a row that says so.
        profiles: one name or several; None: `balanced`, `paper` and `recommended`, each on the engines
            that have it.
        dt: native step of all engines [s]; None: that of each profile.
        out: new folder that keeps table, recordings, report and pictures; None: nothing is kept on disk.
    Returns:
        `frame`, a DataFrame with a row per metric, and `recordings` by (scene, engine, profile).
    Raises:
        ValueError: an unknown name, or a step that does not divide the frame; the message names valid ones.
    """
    chosen = [scenes] if isinstance(scenes, (str, Path, Scenario)) else list(scenes)
    scenarios = tuple(scenario for one in chosen for scenario in scenes_called(one))
    check_limits(scenarios)
    if not scenarios or len({scenario.name for scenario in scenarios}) < len(scenarios):
        raise ValueError("scenes: expected one or more, each with a name of its own")
    columns = _columns(engines, profiles)
    if dt is not None:
        _check_step(dt, scenarios)
    _announce(engine for engine, _ in columns)
    with scratch_folder() as folder:
        request = Request(scenarios, columns, Path(out) if out else Path(folder) / "run", dt)
        return run_study(request, lambda label, frames: None)


class HowOften(TypedDict, total=False):
    """How often `sweep` measures a cell.

    Attributes:
        repeats: number of measurements of each cell; default 1.
        seeds: 0 is the scene as it is; others move its bodies by 1e-6 m in a random direction of the seed.
        timing: time each cell too, alone on one core, in `repeats` rounds; the rows' `measure` says so.
    """

    repeats: int
    seeds: int | Iterable[int]
    timing: bool


def sweep(
    scenes: str | Iterable[str],
    engines: str | Iterable[str] | None = None,
    profiles: str | Iterable[str] | None = None,
    steps: float | Iterable[float] | None = None,
    changes: str | Iterable[str] = (),
    *,
    jobs: int | None = None,
    out: str | Path | None = None,
    **often: Unpack[HowOften],
) -> pd.DataFrame:
    """Measure every combination of scene, engine, profile, step and settings, in parallel.

    Args:
        scenes: names of the catalogue.
        engines, profiles: as in `run`.
        steps: native steps [s]; None: that of each profile.
        changes: "key=value,value" or "engine.key=value,value" (touchstone list settings); each engine plays
            every combination of those that it has.
        jobs: processes; None: one per core.
        out: folder of the store. What it holds already is not measured again; None: nothing is kept.
        often: `repeats`, `seeds` and `timing`, as in HowOften.
    Returns:
        A row per metric of each cell; column `outcome` says how a cell ended, a cell that failed has one row.
    Raises:
        ValueError: an unknown name or setting, or a step that does not divide the frame; the message names
            valid ones.
        touchstone.reports.runner.store.StoreError: the store is damaged, or it cannot be written.
    """
    from touchstone.reports.runner.cells import grid
    from touchstone.reports.runner.sweep import sweep as run_sweep
    from touchstone.reports.runner.sweep import sweep_timed

    names = [checked("scene", name, catalogue()) for name in _several(scenes)]
    if not names:
        raise ValueError("scenes: expected one or more")
    asked = [] if steps is None else [steps] if isinstance(steps, float | int) else list(steps)
    for dt in asked:
        _check_step(dt, [catalogue()[name] for name in names])
    if unknown := often.keys() - HowOften.__annotations__.keys():
        raise TypeError(f"sweep() got an unexpected keyword argument {min(unknown)!r}")
    given, repeats, timing = often.get("seeds", 0), often.get("repeats", 1), often.get("timing", False)
    chosen = [given] if isinstance(given, int) else list(given)
    if wrong := [seed for seed in chosen if not isinstance(seed, int) or seed < 0]:
        raise ValueError(f"seeds: found {wrong[0]!r}, expected whole numbers from 0 on")
    once = 1 if timing else repeats
    columns, texts = _columns(engines, profiles), _several(changes)
    try:
        cells = grid(names, columns, steps=asked, changes=texts, seeds=chosen, repeats=once)
    except SettingError as error:
        raise ValueError(str(error)) from error
    _announce(engine for engine, _ in columns)
    with scratch_folder() as folder:
        store = Path(out) if out else folder / "sweep"
        return sweep_timed(cells, store, repeats, jobs=jobs) if timing else run_sweep(cells, store, jobs=jobs)


def work_precision(
    scenes: str | Iterable[str] | None = None,
    engines: str | Iterable[str] | None = None,
    *,
    quick: bool = False,
    jobs: int | None = None,
    store: str | Path | None = None,
) -> pd.DataFrame:
    """Measure error over wall time of engines and settings, as `touchstone study work-precision` does.

    Args:
        scenes: names of the catalogue; None: the gallery, six probes and two mechanisms.
        engines: one name or several; None: all.
        quick: fewer scenes, steps and rounds of timing.
        jobs: processes for accuracy; None: one per core. Times are measured one at a time.
        store: folder of all cells. What it holds is not measured again; None: nothing is kept.
    Returns:
        A row per scene, setting and quantity: its error, the time per simulated second with its range,
        whether it is on the Pareto front, and the command that plays it again. `attrs` holds the tables
        `fronts` and `ladder`.
    Raises:
        ValueError: an unknown name; the message names valid ones.
        touchstone.reports.runner.store.StoreError: the store is damaged, or it cannot be written.
    """
    from touchstone.reports.studies.work_precision import points
    from touchstone.reports.studies.work_precision.points import fronts
    from touchstone.reports.studies.work_precision.study import StudyCells, measure

    wanted = points.scenes(quick) if scenes is None else _several(scenes)
    names = [checked("scene", name, catalogue()) for name in wanted]
    cells = StudyCells(names, [_registered(name) for name in _several(engines)], quick)
    _announce([REFERENCE])  # it also gives the converged solutions
    with scratch_folder() as folder:
        table, ladder = measure(cells, Path(store) if store else folder / "sweep", jobs)
    table.attrs |= {"fronts": fronts(table), "ladder": ladder}
    return table


def _announce(engines: Iterable[str]) -> None:
    """Say on standard error that the reference is about to compile, if it is among the engines."""
    if REFERENCE in engines and (note := announcement()):
        print(note, file=sys.stderr, flush=True)


def _columns(
    engines: str | Iterable[str] | None, profiles: str | Iterable[str] | None
) -> tuple[tuple[str, str], ...]:
    """(engine, profile) columns for names; raises ValueError with the valid ones."""
    names = [_registered(name) for name in _several(engines) or ENGINES]
    every = dict.fromkeys(profile for entry in ENGINES.values() for profile in entry.profiles)
    wanted = [checked("profile", name, every) for name in _several(profiles) or DEFAULT_PROFILES]
    columns = columns_of(names, wanted)
    if not columns:
        raise ValueError(f"no engine of {', '.join(names)} has a profile of {', '.join(wanted)}")
    return columns


def _check_step(dt: float, scenarios: Iterable[Scenario]) -> None:
    """Raise ValueError if a step [s] does not divide the frame of every scene."""
    if not isfinite(dt) or dt <= 0:
        raise ValueError(f"dt: {dt} is no step; give seconds, such as 1/240")
    for scenario in scenarios:
        substeps(scenario, dt)


def _registered(name: str) -> str:
    """Name of an engine, registered; raises ValueError if it is unknown or cannot be loaded."""
    try:
        return registered(name)
    except AdapterError as error:
        raise ValueError(str(error)) from error


def _several(names: str | Iterable[str] | None) -> list[str]:
    """Names without repetition; a single one may be given as such."""
    return list(dict.fromkeys([names] if isinstance(names, str) else names or ()))
