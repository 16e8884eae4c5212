"""`touchstone study` and `touchstone bench`: measurements other than runs of scenes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli.options import (
    BAD_INPUT,
    Format,
    FormatOption,
    QuietOption,
    YesOption,
    columns_for,
    ended,
    engines_named,
    folder_of_now,
    known,
    measuring,
    require_judge,
    resumable,
    stop,
)

if TYPE_CHECKING:
    import pandas as pd

MOST = 10_000_000
"""Largest number of scenes, pairs or goals of a study [1]: days."""
study = typer.Typer(help="Studies beside the scenes.", no_args_is_help=True)


@study.command("narrow-phase")
def narrow_phase(
    pairs: Annotated[
        str, typer.Option(help="Number of random pairs over all families, or a file of pairs (JSON, TOML).")
    ] = "1000",
    seed: Annotated[int, typer.Option(min=0, help="Of the random poses.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/narrow-phase-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Send the same poses through every detector; compare with the explicit Minkowski difference."""
    from touchstone.reports.studies.narrow_phase.study import PairsError, run, steps
    from touchstone.reports.studies.narrow_phase.table import show

    folder = out or folder_of_now("narrow-phase-")
    if not re.fullmatch(r"[+-]?[0-9]+", pairs):
        ended(_of_file(Path(pairs), folder, quiet), show, folder, output, quiet)
        return
    if (count := int(pairs)) > MOST:
        stop(f"--pairs {pairs}: expected at most {MOST}", BAD_INPUT)
    with measuring(steps(count), quiet, PairsError) as progress:
        frame = run(count, seed, folder, progress)
    ended(frame, show, folder, output, quiet)


def _of_file(path: Path, folder: Path, quiet: bool) -> pd.DataFrame:
    """What all detectors say of the pairs of a file."""
    from touchstone.adapters.detectors import DETECTORS
    from touchstone.reports.studies.narrow_phase.given_pairs import UnknownTruth, run
    from touchstone.scenarios.files.pair_file import read_pairs
    from touchstone.scenarios.files.read import SceneFileError

    if path.suffix not in (".json", ".toml"):
        stop(f"--pairs {path}: expected a number of pairs, or a file .json or .toml", BAD_INPUT)
    try:
        given = read_pairs(path)
    except SceneFileError as error:
        stop(str(error), BAD_INPUT)
    with measuring(len(given) * len(DETECTORS), quiet, UnknownTruth) as progress:
        return run(given, folder, progress)


@study.command("ik")
def inverse_kinematics(
    goals: Annotated[int, typer.Option(max=MOST, help="Random reachable goals of the left arm.")] = 10_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random postures.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/ik-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Solve inverse kinematics of an arm from near and from rest, beside a loop on pinocchio."""
    from touchstone.reports.studies.inverse_kinematics.study import GoalsError, run, steps
    from touchstone.reports.studies.inverse_kinematics.table import show

    folder = out or folder_of_now("ik-")
    with measuring(steps(goals), quiet, GoalsError) as progress:
        frame = run(goals, seed, folder, progress)
    ended(frame, show, folder, output, quiet)


@study.command("calibration")
def calibration(
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    profile: Annotated[list[str] | None, typer.Option(help="Profiles (default: all).")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/calibration-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Measure the restitution and friction that engines achieve, beside what they were asked for."""
    from touchstone.reports.studies.calibration.show import show
    from touchstone.reports.studies.calibration.study import Grid, run, steps

    columns, folder = columns_for(engine or [], profile or []), out or folder_of_now("calibration-")
    with measuring(steps(columns, Grid()), quiet) as progress:
        frame = run(columns, folder, progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))


@study.command("agreement")
def agreement(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Scenes with a closed form (default: one or two per family).")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/agreement-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Play scenes at ever smaller steps: errors of step and of model, and the outlier."""
    from touchstone.reports.studies.agreement.study import SCENES, NoTruth, run, steps
    from touchstone.reports.studies.agreement.table import show
    from touchstone.scenarios.catalogue import catalogue

    chosen = [catalogue()[known("scenario", name, catalogue())] for name in scenario or SCENES]
    folder = out or folder_of_now("agreement-")
    with measuring(steps(chosen), quiet, NoTruth) as progress:
        frame = run(chosen, folder, progress)
    ended(frame, show, folder, output, quiet)


@study.command("convergence")
def convergence(
    scenario: Annotated[
        list[str] | None,
        typer.Argument(help="Scenes with a truth (default: the curved and thirteen others)."),
    ] = None,
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    store: Annotated[Path, typer.Option(help="Folder of all cells; what it holds is skipped.")] = Path(
        "runs/sweep"
    ),
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/convergence-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Play scenes with a truth at seven steps: order of convergence and floor of every engine."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies.agreement.study import NoTruth
    from touchstone.reports.studies.convergence.definitions import cells, scenes
    from touchstone.reports.studies.convergence.study import run
    from touchstone.reports.studies.convergence.table import show
    from touchstone.reports.sweep.store import StoreError
    from touchstone.scenarios.catalogue import catalogue

    names = [known("scenario", name, catalogue()) for name in dict.fromkeys(scenario or scenes())]
    folder = out or folder_of_now("convergence-")
    try:
        asked = cells(names, engines_named(engine or ENGINES))
    except NoTruth as error:
        stop(str(error), BAD_INPUT)
    with resumable(store), measuring(len(asked), quiet, StoreError) as progress:
        frame = run(asked, store, folder, jobs, progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))


@study.command("effects")
def effects(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Scenes (default: the gallery and the probes).")
    ] = None,
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/effects-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Play scenes with their plan and with all effects, and toggle each: time saved, outcome changed."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies.effects.study import run, scenes, steps
    from touchstone.reports.studies.effects.table import show
    from touchstone.scenarios.catalogue import catalogue

    chosen = [catalogue()[known("scenario", name, catalogue())] for name in scenario or ()] or scenes()
    engines = engines_named(engine or ENGINES)
    folder = out or folder_of_now("effects-")
    with measuring(steps(chosen, engines), quiet) as progress:
        frame = run(chosen, engines, folder, progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))


@study.command("predictability")
def predictability(
    scenario: Annotated[list[str] | None, typer.Argument(help="Scenes (default: five of all kinds).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random directions.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/predictability-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Perturb the start of scenes: by how much engines amplify it, beside the closed form."""
    from touchstone.reports.studies.predictability.study import SCENES, run, steps
    from touchstone.reports.studies.predictability.table import show
    from touchstone.scenarios.catalogue import catalogue

    chosen = [catalogue()[known("scenario", name, catalogue())] for name in dict.fromkeys(scenario or SCENES)]
    folder = out or folder_of_now("predictability-")
    require_judge()
    with measuring(steps(chosen), quiet) as progress:
        frame = run(chosen, seed, folder, progress)
    ended(frame, show, folder, output, quiet)


@study.command("robustness")
def robustness(
    scenes: Annotated[int, typer.Option(min=1, max=MOST, help="Random scenes, from --seed on.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of the first scene.")] = 0,
    kind: Annotated[str, typer.Option(help="Kind of all scenes (default: each as its seed says).")] = "",
    perturbation: Annotated[float, typer.Option(min=0, max=1, help="Move bodies by so many metres.")] = 0.0,
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: reference).")] = None,
    profile: Annotated[list[str] | None, typer.Option(help="Profiles (default: the usual ones).")] = None,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/robustness-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Play random scenes: energy, overlap, residual and time against limits, the worst ones listed."""
    from touchstone.reports.studies.robustness.study import PROFILES, run, tasks
    from touchstone.reports.studies.robustness.table import show
    from touchstone.scenarios.random_scenes import ALL_KINDS

    columns = columns_for(engine or ["reference"], profile or [], PROFILES)
    chosen = known("kind", kind, ALL_KINDS) if kind else None
    asked = tasks(columns, scenes, seed, chosen, perturbation)
    folder = out or folder_of_now("robustness-")
    require_judge()
    with measuring(len(asked), quiet) as progress:
        frame = run(columns, asked, folder, progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))


@study.command("paper")
def paper(
    repeats: Annotated[int, typer.Option(min=1, help="Timed plays of every scene.")] = 15,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/paper-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Replay the experiments of the paper on the profile `paper`, and judge its claims one by one."""
    from touchstone.reports.studies.paper.study import run, steps
    from touchstone.reports.studies.paper.table import show

    folder = out or folder_of_now("paper-")
    require_judge()
    with measuring(steps(repeats), quiet) as progress:
        frame = run(repeats, folder, progress)
    ended(frame, show, folder, output, quiet)


def bench(
    name: Annotated[str, typer.Argument(help="geometry, frame or scaling.")],
    scenario: Annotated[
        list[str] | None,
        typer.Argument(help="Scenes of `frame` (default: gallery, slide, stack, balls_box, dominoes)."),
    ] = None,
    restarts: Annotated[int, typer.Option(min=1, help="Starts of every engine in `frame`.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of the order of engines, scenes and columns.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/bench-<name>-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Measure what the reference costs, over others in the same run: depth, frames, growth with size."""
    from touchstone.reports.bench import BENCHES, load
    from touchstone.reports.bench import frame as bench_frame
    from touchstone.scenarios.catalogue import catalogue

    chosen = load(known("bench", name, BENCHES))
    folder = out or folder_of_now(f"bench-{name}-")
    if name != "frame":
        if scenario:
            stop(f"bench {name}: takes no scenes, found {scenario[0]!r}", BAD_INPUT)
        with measuring(chosen.steps(), quiet) as progress:
            found = chosen.run(folder, progress)
    else:
        scenes = [catalogue()[known("scenario", one, catalogue())] for one in dict.fromkeys(scenario or ())]
        played = scenes or bench_frame.scenes()
        with measuring(bench_frame.steps(played, restarts), quiet) as progress:
            found = bench_frame.run(folder, progress, played, restarts, seed)
    ended(found, chosen.show, folder, output, quiet)


@study.command("work-precision")
def work_precision(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Scenes (default: the gallery and six probes).")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Five scenes, three steps, two rounds.")] = False,
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes (default: one per core).")] = None,
    store: Annotated[Path, typer.Option(help="Folder of all cells; what it holds is skipped.")] = Path(
        "runs/sweep"
    ),
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/work-precision-<time>).")] = None,
    output: FormatOption = Format.table,
    yes: YesOption = False,
    quiet: QuietOption = False,
) -> None:
    """Measure error over wall time of every engine and setting: what accuracy costs."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies.work_precision.definitions import scenes
    from touchstone.reports.studies.work_precision.study import Plan, run
    from touchstone.reports.studies.work_precision.table import show
    from touchstone.reports.sweep.store import StoreError
    from touchstone.scenarios.catalogue import catalogue

    names = [known("scenario", name, catalogue()) for name in dict.fromkeys(scenario or scenes(quick))]
    engines = engines_named(engine or ENGINES)
    plan, folder = Plan(names, engines, quick), out or folder_of_now("work-precision-")
    require_judge()
    with resumable(store), measuring(plan.size, quiet, StoreError) as progress:
        frame = run(plan, store, folder, jobs, progress)
    ended(frame, show, folder, output, quiet, by_name=bool(engine))
