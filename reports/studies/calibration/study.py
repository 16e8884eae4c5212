"""The study `calibration`: restitution and friction that engines achieve, compared with the requested values.

Every engine plays the same small scenes under each of its profiles; the estimates use only the bodies'
motion. Adapters never read the results.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import zip_longest
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import MISSING, Settings
from touchstone.adapters.registry import ENGINES, installed, missing_reason
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import illustrate, save, save_manifest, table
from touchstone.reports.studies.calibration.children import Child, Loader, Motion
from touchstone.reports.studies.calibration.rows import STUDY, Measured, rows_of_study
from touchstone.reports.studies.calibration.scenes import SHAPES, Probe
from touchstone.reports.verdict.judge import judged

Job = tuple[Settings, Probe]
LADDER_PART = 26
"""Bodies of the ladder per scene: more would overflow an engine's log of contacts."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Requested values: restitutions at approach `speeds` [m/s], frictions at `headings` [degrees], a ladder
    of speeds for the lowest one that bounces, and e = 1 from a fall under several steps [1/s]."""

    pairs: tuple[str, ...] = tuple(SHAPES)
    restitutions: tuple[float, ...] = (0.0, 0.3, 0.5, 0.8, 1.0)
    speeds: tuple[float, ...] = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
    phases: tuple[float, ...] = (1 / 6, 1 / 2, 5 / 6)
    frictions: tuple[float, ...] = (0.1, 0.3, 0.5, 1.0)
    headings: tuple[float, ...] = (0.0, 22.5, 45.0)
    ladder: tuple[float, ...] = tuple(0.05 * 1.05**k for k in range(52))
    steps: tuple[int, ...] = (60, 240, 1000, 4000)
    drop_phases: tuple[float, ...] = tuple(k / 8 for k in range(8))


def jobs_of(engine: str, profiles: Sequence[str], grid: Grid) -> list[Job]:
    """The jobs of an engine; steps other than its own only under its first profile."""
    jobs = []
    for profile in profiles:
        settings = Settings(profile, ENGINES[engine].profiles[profile])
        jobs += [(settings, probe) for probe in probes_of(grid)]
    drop = Probe("sphere-box", "drop", 1.0, phases=grid.drop_phases)
    return jobs + [(Settings(profiles[0], 1 / rate), drop) for rate in grid.steps]


def probes_of(grid: Grid) -> list[Probe]:
    """The scenes of one column. Spheres meet the floor at every phase of a step, the others at its middle."""
    probes = []
    for pair in grid.pairs:
        phases = grid.phases if pair == "sphere-box" else (0.5,)
        probes += [Probe(pair, "restitution", e, grid.speeds, phases) for e in grid.restitutions]
        probes += [Probe(pair, "friction", mu, headings=grid.headings) for mu in grid.frictions]
    parts = (grid.ladder[k : k + LADDER_PART] for k in range(0, len(grid.ladder), LADDER_PART))
    return probes + [Probe("sphere-box", "lowest", 1.0, speeds, (0.5,)) for speeds in parts]


def steps(columns: Sequence[tuple[str, str]], grid: Grid) -> int:
    """Number of progress steps of a run: its scenes."""
    engines = {engine for engine, _ in columns}
    return len(columns) * len(probes_of(grid)) + len(engines) * len(grid.steps)


def run(
    columns: Sequence[tuple[str, str]],
    out: Path,
    progress: Progress,
    grid: Grid | None = None,
    loader: Loader | None = None,
) -> pd.DataFrame:
    """Play all columns; store rows, picture, report and manifest. The folder appears complete or not at
    all."""
    grid = grid or Grid()
    with output_folder(out) as folder:
        (folder / "output").mkdir()
        measured = _measure(columns, grid, folder / "output", progress, loader)
        progress("judge", 0)
        frame = table(judged(row, ()) for row in rows_of_study(measured))
        save(frame, folder)
        _save_manifest(grid, measured, folder)
        from touchstone.reports.studies.calibration.findings import report
        from touchstone.reports.views.pictures import requested_and_achieved

        illustrate(folder / "report.md", lambda part: part.write_text(report(frame), "utf-8"))
        illustrate(folder / "calibration.png", lambda part: requested_and_achieved(frame, part))
    return frame


def _measure(
    columns: Sequence[tuple[str, str]],
    grid: Grid,
    output: Path,
    progress: Progress,
    loader: Loader | None,
) -> dict[str, Measured]:
    """Play every engine in a child process of its own, all in parallel: nothing is timed."""
    measured: dict[str, Measured] = {}
    children: list[tuple[Child, list[Job]]] = []
    for engine in dict.fromkeys(name for name, _ in columns):
        profiles = [profile for name, profile in columns if name == engine]
        jobs, mine = jobs_of(engine, profiles, grid), Measured(profiles)
        measured[engine] = mine
        if not installed(engine):
            mine.ended = (MISSING, missing_reason(engine))
            progress(engine, len(jobs))
            continue
        file = output / f"{engine}.txt"
        children.append((Child(engine, file, loader) if loader else Child(engine, file), jobs))
    try:
        for child, _ in children:
            child.send("load")
        for child, _ in children:
            progress(f"{child.name}: load", 0)
            measured[child.name].version = child.receive() or ""
        for round_ in zip_longest(*(jobs for _, jobs in children)):
            _play(children, round_, measured, progress)
        for child, _ in children:
            measured[child.name].ended = child.failure
    finally:
        for child, _ in children:
            child.stop()
    return measured


def _play(
    children: Sequence[tuple[Child, list[Job]]],
    jobs: Sequence[Job | None],
    measured: dict[str, Measured],
    progress: Progress,
) -> None:
    """Play one scene per engine."""
    asked = [(child, job) for (child, _), job in zip(children, jobs) if job is not None]
    for child, (settings, probe) in asked:
        child.send("play", (probe, settings))
    for child, (settings, probe) in asked:
        answer: Motion | tuple[str, str] | None = child.receive()
        progress(f"{child.name} {settings.profile}", 1)
        if isinstance(answer, Motion):
            measured[child.name].motions[settings, probe] = answer
        elif answer is not None:
            measured[child.name].failures[settings, probe] = answer


def _save_manifest(grid: Grid, measured: dict[str, Measured], folder: Path) -> None:
    facts = {
        "study": STUDY,
        "grid": asdict(grid),
        "engines": {name: {"version": m.version, "profiles": m.profiles} for name, m in measured.items()},
    }
    save_manifest(folder, facts)
