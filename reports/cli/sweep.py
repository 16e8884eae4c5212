"""`touchstone sweep` and `touchstone soak`."""

from __future__ import annotations

import os
import sys
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.studies import scenes_named


def sweep(
    scenario: Annotated[options.Names, typer.Argument(help="Scenes (default: --tag).")] = None,
    tag: Annotated[str, typer.Option(help="Every scene with this tag.")] = "gallery",
    engine: options.EngineOption = None,
    profile: Annotated[
        options.Names, typer.Option(help="Profiles (default: balanced, recommended, equal-step).")
    ] = None,
    dt: Annotated[str, typer.Option(help="Native steps [s], such as 1/60,1/240,1/960.")] = "",
    change: Annotated[
        options.Names,
        typer.Option("--set", help="KEY=VALUE[,VALUE...] or ENGINE.KEY=... (touchstone list settings)."),
    ] = None,
    seed: Annotated[
        str, typer.Option(help="0: the scene as it is; others move bodies by 1 um at random: 0,1,2.")
    ] = "0",
    timing: Annotated[
        bool, typer.Option(help="Time each cell too, alone on one core, in --repeats rounds.")
    ] = False,
    repeats: Annotated[int, typer.Option(min=1, help="How often each cell is measured.")] = 1,
    jobs: options.JobsOption = None,
    dask: options.DaskOption = "",
    slurm_script: Annotated[
        Path | None, typer.Option(help="Write an array job for Slurm here, and play nothing.")
    ] = None,
    part: Annotated[str, typer.Option(help="Play every N-th cell from the K-th on: K/N.")] = "",
    out: Annotated[Path, typer.Option(help="Folder of the store; what it holds is skipped.")] = options.STORE,
    output: options.FormatOption = options.Format.table,
    yes: options.YesOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Measure every combination of scene, engine, profile and step, each once."""
    from touchstone.adapters.knobs import SettingError
    from touchstone.reports.runner.cells import grid
    from touchstone.reports.runner.request import DEFAULT_PROFILES
    from touchstone.reports.runner.store import StoreError
    from touchstone.reports.runner.sweep import ClusterError, DaskPool, PartError, part_of, sweep_timed
    from touchstone.reports.runner.sweep import sweep as run_sweep
    from touchstone.scenarios.catalogue import tagged, tags

    if slurm_script is not None:
        options.require_new(slurm_script, "--slurm-script")
    scenarios = scenes_named(scenario or ()) or list(tagged(options.known("tag", tag, tags())))
    columns = options.columns_for(engine, profile, DEFAULT_PROFILES)
    names = [one.name for one in scenarios]
    for option, given in (("--dask", dask), ("--slurm-script", slurm_script), ("--part", part)):
        if timing and given:
            options.stop(f"--timing {option}: times are measured on this machine, one cell at a time")
    parts = filter(None, map(str.strip, dt.split(",")))
    steps = list(dict.fromkeys(options.step_for(one, scenarios) for one in parts))
    seeds = [one.strip() for one in seed.split(",")]
    for one in seeds:
        if not (one.isascii() and one.isdecimal()):
            options.stop(f"--seed {' '.join(seed.split())}: found {one!r}, expected numbers such as 0,1,2")
    numbers = list(dict.fromkeys(map(int, seeds)))
    once = 1 if timing else repeats
    try:
        cells = grid(names, columns, steps=steps, changes=change or [], seeds=numbers, repeats=once)
    except SettingError as error:
        options.stop(f"--set {error}")
    if slurm_script is not None:
        write_script(slurm_script, out, len(cells), quiet)
        return
    with options.refusing(PartError):
        cells = part_of(cells, part) if part else cells
    executor = partial(DaskPool, dask, jobs or os.cpu_count() or 1) if dask else None
    count = len(cells) * (1 + repeats * timing)
    with options.resumable(out), options.measuring(count, quiet, StoreError, ClusterError) as progress:
        if timing:
            frame = sweep_timed(cells, out, repeats, jobs=jobs, progress=progress)
        else:
            frame = run_sweep(cells, out, jobs=jobs, executor=executor, progress=progress)
    if not options.printed(frame, output) and not quiet:
        from touchstone.reports.views.sweep_table import report

        options.show(report(frame), f"store: {out}")
    runs = frame[frame.metric == "run"]
    if quiet:
        options.tell_failures(runs, bool(engine))
    options.exit_for(runs.verdict, bool(engine))


def write_script(path: Path, out: Path, cells: int, quiet: bool) -> None:
    """Write the array job of this command; its store is named by its absolute path."""
    from touchstone.reports.runner.sweep import script

    arguments = without(sys.argv[2:], "--slurm-script", "--out", "--part", "--jobs")
    text = script([*arguments, "--out", str(out.resolve())], cells)
    options.write_file(path, lambda part: part.write_text(text), "--slurm-script")
    if not quiet:
        print(f"sbatch {path}")


def without(arguments: list[str], *dropped: str) -> list[str]:
    """Arguments without some options and their values."""
    left, skip = [], False
    for argument in arguments:
        if skip or argument.partition("=")[0] in dropped:
            skip = not skip and "=" not in argument
            continue
        left.append(argument)
    return left


MOST_MINUTES = 100_000.0
"""Longest soak [min]: seventy days."""


def soak(
    minutes: Annotated[
        float, typer.Option(min=0.0, max=MOST_MINUTES, help="Time after which no scene is started.")
    ] = 10.0,
    seed: Annotated[int, typer.Option(min=0, help="Of the first random scene.")] = 0,
    kind: Annotated[str, typer.Option(help="Kind of all scenes (default: each as its seed says).")] = "",
    profile: Annotated[str, typer.Option(help="Profile of the reference.")] = "balanced",
    out: Annotated[Path | None, typer.Option(help="Folder of failures (default: runs/soak-<time>).")] = None,
    output: options.FormatOption = options.Format.table,
    yes: options.YesOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Play random scenes on the reference for as long as asked; shrink each failure to its smallest scene."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.docs.listing import show_rows
    from touchstone.reports.studies.soak import Extent
    from touchstone.reports.studies.soak import soak as run
    from touchstone.scenarios.plural import plural
    from touchstone.scenarios.random_scenes import ALL_KINDS, random_scene

    options.known("profile", profile, ENGINES["reference"].profiles)
    chosen = options.known("kind", kind, ALL_KINDS) if kind else None
    folder = out or options.folder_of_now("soak-")
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        options.stop(f"--out {folder}: exists and is not an empty folder")
    options.require_judge()
    said = print if output is options.Format.table else lambda line: print(line, file=sys.stderr)
    found = run(Extent(minutes, seed), profile, folder, said, scene=partial(random_scene, kind=chosen))
    counts = {"seed": seed, "scenes": found.scenes, "frames": found.frames, "broken": len(found.failures)}
    if output is not options.Format.table:
        show_rows([counts | {f"outcome {name}": count for name, count in found.classes.items()}], output)
    elif not quiet:
        classes = ", ".join(f"{count} {name}" for name, count in found.classes.most_common())
        print(f"{plural(found.scenes, 'scene')} from seed {seed}, {plural(found.frames, 'frame')}: {classes}")
        print(f"broken invariants: {len(found.failures)}" + (f", in {folder}" if found.failures else ""))
    if found.failures:
        raise typer.Exit(options.LIMIT_BROKEN)
