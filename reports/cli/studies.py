"""`touchstone study` and `touchstone bench`: measurements other than runs of scenes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from touchstone.reports.cli import options

if TYPE_CHECKING:
    import pandas as pd

    from touchstone.reports.progress import Progress
    from touchstone.reports.views.render import Part
    from touchstone.scenarios.files.pair_file import GivenPair
    from touchstone.scenarios.scenario import Scenario

MOST = 10_000_000
"""Largest number of scenes, pairs or goals of a study [1]: days."""


@dataclass(frozen=True, slots=True)
class StudyRequest:
    """A study with the arguments of its command.

    Attributes:
        steps: number of progress steps of `run`.
        run: measures into a new folder; returns the long table.
        report: the long table as a report.
        store: folder of cells that are kept, if the study has one.
    """

    steps: int
    run: Callable[[Path, Progress], pd.DataFrame]
    report: Callable[[pd.DataFrame], list[Part]]
    store: Path | None = None

    @classmethod
    def of(cls, module: Any, steps: int, *arguments: Any) -> StudyRequest:
        """A study without a store: `run` of its module with arguments, and `report`."""
        return cls(steps, partial(module.run, *arguments), module.report)


study = typer.Typer(help="Studies beside the scenes.", no_args_is_help=True)
reality = typer.Typer(help="Measured motion, played by every engine.", no_args_is_help=True)


def studied(
    name: str, judge: bool = False, group: typer.Typer = study
) -> Callable[[Callable[..., StudyRequest]], Callable[..., StudyRequest]]:
    """Register a function of a study's own options as `touchstone study NAME`, or in another group; it
    returns what they ask for.

    All studies have the options --out, --format, --yes and --quiet, measure with progress, and exit with the
    code of their verdicts. With `judge`, the libraries that judge measurements are needed.
    """

    def register(asked_for: Callable[..., StudyRequest]) -> Callable[..., StudyRequest]:
        def command(out: Path | None, output: options.Format, yes: bool, quiet: bool, **own: Any) -> None:
            from touchstone.reports.runner.store import StoreError
            from touchstone.reports.studies.study import RefusedError

            folder = out or options.folder_of_now(f"{name}-")
            with options.refusing(RefusedError):
                asked = asked_for(**own)
            if judge:
                options.require_judge()
            kept = nullcontext() if asked.store is None else options.resumable(asked.store)
            with kept, options.measuring(asked.steps, quiet, RefusedError, StoreError) as progress:
                frame = asked.run(folder, progress)
            options.ended(frame, asked.report, folder, output, quiet, by_name=bool(own.get("engine")))

        out = Annotated[Path | None, typer.Option(help=f"Folder (default: runs/{name}-<time>).")]
        table = options.Format.table
        shared: dict[str, tuple[Any, Any]] = {"out": (out, None), "output": (options.FormatOption, table)}
        shared |= {"yes": (options.YesOption, False), "quiet": (options.QuietOption, False)}
        hints = get_type_hints(asked_for, include_extras=True)
        own = signature(asked_for)
        parameters = [one.replace(annotation=hints[one.name]) for one in own.parameters.values()]
        parameters += [
            Parameter(option, Parameter.KEYWORD_ONLY, default=default, annotation=annotation)
            for option, (annotation, default) in shared.items()
        ]
        command.__dict__["__signature__"] = own.replace(parameters=parameters, return_annotation=None)
        command.__doc__ = asked_for.__doc__
        group.command(name)(command)
        return asked_for

    return register


def scenes_named(names: Iterable[str]) -> list[Scenario]:
    """Scenes of the catalogue, each once; a wrong name exits with one line."""
    from touchstone.scenarios.catalogue import catalogue

    return [catalogue()[options.known("scenario", name, catalogue())] for name in dict.fromkeys(names)]


@studied("narrow-phase")
def narrow_phase(
    pairs: Annotated[
        str, typer.Option(help="Number of random pairs over all families, or a file of pairs (JSON, TOML).")
    ] = "1000",
    seed: Annotated[int, typer.Option(min=0, help="Of the random poses.")] = 0,
) -> StudyRequest:
    """Send the same poses through every detector; compare with the explicit Minkowski difference."""
    from touchstone.adapters.detectors import DETECTORS
    from touchstone.reports.studies.narrow_phase import study as module

    if not re.fullmatch(r"[+-]?[0-9]+", pairs):
        given = _pairs_of(Path(pairs))
        return StudyRequest(len(given) * len(DETECTORS), partial(module.run_given, given), module.report)
    if (count := int(pairs)) > MOST:
        options.stop(f"--pairs {pairs}: expected at most {MOST}")
    return StudyRequest.of(module, count * len(DETECTORS), count, seed)


def _pairs_of(path: Path) -> list[GivenPair]:
    from touchstone.scenarios.files.pair_file import read_pairs
    from touchstone.scenarios.files.read import SceneFileError

    if path.suffix not in (".json", ".toml"):
        options.stop(f"--pairs {path}: expected a number of pairs, or a file .json or .toml")
    with options.refusing(SceneFileError):
        found = list(read_pairs(path))
    return found


@studied("ik")
def inverse_kinematics(
    goals: Annotated[int, typer.Option(max=MOST, help="Random reachable goals of the left arm.")] = 10_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the random postures.")] = 0,
) -> StudyRequest:
    """Solve inverse kinematics of an arm from near and from rest, beside a loop on pinocchio."""
    from touchstone.reports.studies import inverse_kinematics as module

    return StudyRequest.of(module, module.steps(goals), goals, seed)


@studied("calibration")
def calibration(
    engine: options.EngineOption = None,
    profile: Annotated[options.Names, typer.Option(help="Profiles (default: all).")] = None,
) -> StudyRequest:
    """Measure the restitution and friction that engines achieve, beside what they were asked for."""
    from touchstone.reports.studies import calibration as module

    columns = options.columns_for(engine, profile)
    return StudyRequest.of(module, len(module.tasks(columns, module.Requested())), columns)


@studied("agreement", judge=True)
def agreement(
    scenario: Annotated[
        list[str] | None, typer.Argument(help="Scenes (default: one or two per family, and push_box).")
    ] = None,
) -> StudyRequest:
    """Play scenes at ever smaller steps: errors of step and of model, the outlier, bands without a truth."""
    from touchstone.reports.studies import agreement as module

    chosen = scenes_named(scenario or module.SCENES)
    return StudyRequest.of(module, module.steps(chosen), chosen)


@studied("convergence")
def convergence(
    scenario: Annotated[
        options.Names, typer.Argument(help="Scenes with a truth (default: the curved and thirteen others).")
    ] = None,
    engine: options.EngineOption = None,
    jobs: options.JobsOption = None,
    store: options.StoreOption = options.STORE,
) -> StudyRequest:
    """Play scenes with a truth at seven steps: order of convergence and floor of every engine."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies.convergence import study as module

    names = [scene.name for scene in scenes_named(scenario or module.scenes())]
    cells = module.cells(names, options.engines_named(engine or ENGINES))
    return StudyRequest(len(cells), partial(module.run, cells, store, jobs=jobs), module.report, store)


@studied("ablation", judge=True)
def ablation(
    name: Annotated[
        options.Names, typer.Argument(help="Texts in names of constants and mechanisms (default: all).")
    ] = None,
    profile: Annotated[str, typer.Option(help="Profile of the reference.")] = "balanced",
    scenes: Annotated[int, typer.Option(min=0, max=MOST, help="Random scenes, from seed 0 on.")] = 16,
) -> StudyRequest:
    """Vary each constant of the reference, and leave out each mechanism: what it buys, what it costs."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies import ablation as module

    profile = options.known("profile", profile, ENGINES["reference"].profiles)
    asked = module.variations(name or (), profile, scenes)
    return StudyRequest.of(module, len(asked), asked)


@studied("effects")
def effects(
    scenario: Annotated[
        options.Names, typer.Argument(help="Scenes (default: the gallery and the probes).")
    ] = None,
    engine: options.EngineOption = None,
) -> StudyRequest:
    """Play scenes with their plan and with all effects, and toggle each: time saved, outcome changed."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies import effects as module

    chosen = scenes_named(scenario or ()) or module.scenes()
    engines = options.engines_named(engine or ENGINES)
    return StudyRequest.of(module, len(chosen) * len(engines), chosen, engines)


@studied("predictability", judge=True)
def predictability(
    scenario: Annotated[options.Names, typer.Argument(help="Scenes (default: five of all kinds).")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random directions.")] = 0,
) -> StudyRequest:
    """Perturb the start of scenes: by how much engines amplify it, beside the closed form."""
    from touchstone.reports.studies import predictability as module

    chosen = scenes_named(scenario or module.SCENES)
    return StudyRequest.of(module, module.steps(chosen), chosen, seed)


@studied("robustness", judge=True)
def robustness(
    scenes: Annotated[int, typer.Option(min=1, max=MOST, help="Random scenes, from --seed on.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Of the first scene.")] = 0,
    kind: Annotated[str, typer.Option(help="Kind of all scenes (default: each as its seed says).")] = "",
    perturbation: Annotated[float, typer.Option(min=0, max=1, help="Move bodies by so many metres.")] = 0.0,
    engine: Annotated[options.Names, typer.Option(help="Engines (default: reference).")] = None,
    profile: Annotated[options.Names, typer.Option(help="Profiles (default: the usual ones).")] = None,
) -> StudyRequest:
    """Play random scenes: energy, overlap, residual and time against limits, the worst ones listed."""
    from touchstone.reports.studies import robustness as module
    from touchstone.scenarios.random_scenes import ALL_KINDS

    columns = options.columns_for(engine or ["reference"], profile, module.PROFILES)
    chosen = options.known("kind", kind, ALL_KINDS) if kind else None
    asked = module.tasks(columns, scenes, seed, chosen, perturbation)
    return StudyRequest.of(module, len(asked), columns, asked)


@studied("paper", judge=True)
def paper(
    repeats: Annotated[int, typer.Option(min=1, help="Timed plays of every scene.")] = 15,
) -> StudyRequest:
    """Replay the experiments of the paper on the profile `paper`, and judge its claims one by one."""
    from touchstone.reports.studies import paper as module

    return StudyRequest.of(module, module.steps(repeats), repeats)


@studied("work-precision", judge=True)
def work_precision(
    scenario: Annotated[
        options.Names, typer.Argument(help="Scenes (default: the gallery, six probes and two mechanisms).")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Five scenes, three steps, two rounds.")] = False,
    engine: options.EngineOption = None,
    jobs: options.JobsOption = None,
    store: options.StoreOption = options.STORE,
) -> StudyRequest:
    """Measure error over wall time of every engine and setting: what accuracy costs."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies.work_precision import study as module
    from touchstone.reports.studies.work_precision.points import scenes

    names = [scene.name for scene in scenes_named(scenario or scenes(quick))]
    engines = options.engines_named(engine or ENGINES)
    cells = module.StudyCells(names, engines, quick)
    return StudyRequest(cells.size, partial(module.run, cells, store, jobs=jobs), module.report, store)


@studied("knobs", judge=True)
def knobs(
    engine: options.EngineOption = None,
    jobs: options.JobsOption = None,
    store: options.StoreOption = options.STORE,
) -> StudyRequest:
    """Change each setting of an engine alone: what it does to impacts, sliding, rolling and rest."""
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.studies import knobs as module

    if "reference" in (engine or ()):
        text = "study knobs: varies other engines; the reference's settings: touchstone study ablation"
        options.stop(text)
    engines = [name for name in options.engines_named(engine or ENGINES) if name != "reference"]
    steps = sum(len(module.cells_of(name)) for name in engines)
    return StudyRequest(steps, partial(module.run, engines, store, jobs=jobs), module.report, store)


@studied("stability", judge=True)
def stability(
    family: Annotated[
        options.Names, typer.Argument(help="Families of hard scenes (default: all).", show_default=False)
    ] = None,
    engine: options.EngineOption = None,
    profile: Annotated[options.Names, typer.Option(help="Profiles (default: the usual ones).")] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Three levels each, at the profiles' own steps.")
    ] = False,
    sheet: Annotated[
        int,
        typer.Option(min=0, help="Also draw pictures of this many cells at random, without their classes."),
    ] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the cells that --sheet draws.")] = 0,
    store: Annotated[Path, typer.Option(help="Store of measured cells, which are not played again.")] = Path(
        "runs/stability"
    ),
    jobs: options.JobsOption = None,
) -> StudyRequest:
    """Play hard scenes at growing difficulty and step: how far each engine goes, and how it fails."""
    from touchstone.reports.studies.stability import play
    from touchstone.reports.studies.stability import study as module
    from touchstone.scenarios.difficulty.family import families

    names = [options.known("family", name, families()) for name in family or ()]
    columns = options.columns_for(engine, profile, play.QUICK if quick else play.PROFILES)
    scope = play.Scope(columns, play.chosen(names), quick)
    run = partial(module.run, scope, store, jobs=jobs, sheet=sheet, seed=seed)
    return StudyRequest(len(scope.cells()) + sheet, run, module.report, store)


@studied("relations")
def relations(
    scenario: Annotated[
        options.Names, typer.Argument(help="Scenes (default: the smaller probes).", show_default=False)
    ] = None,
    engine: options.EngineOption = None,
    profile: options.UsualProfileOption = None,
    quick: Annotated[bool, typer.Option("--quick", help="Six scenes.")] = False,
) -> StudyRequest:
    """Turn, mirror, move, scale and split scenes: does the motion change accordingly, and not otherwise?"""
    from touchstone.reports.studies import relations as module
    from touchstone.scenarios.catalogue import all_names, catalogue, find

    valid, names = all_names(), dict.fromkeys(scenario or (module.QUICK if quick else ()))
    scenes = [find(name if name in valid else options.known("scenario", name, catalogue())) for name in names]
    scenes = scenes or module.default_scenes()
    columns = options.columns_for(engine, profile, options.USUAL)
    return StudyRequest.of(module, len(module.tasks_of(scenes, columns)), columns, scenes)


@studied("parity")
def parity(
    scenario: Annotated[options.Names, typer.Argument(help="Scenes (default: five of all kinds).")] = None,
    engine: options.EngineOption = None,
    profile: options.UsualProfileOption = None,
) -> StudyRequest:
    """Repeat scenes: other process, threads, order of bodies, batch, backend; what is equal to the bit?"""
    from touchstone.reports.studies import parity as module

    chosen = scenes_named(scenario or module.SCENES)
    columns = options.columns_for(engine, profile, options.USUAL)
    return StudyRequest.of(module, module.steps(columns, chosen), columns, chosen)


@studied("gradients")
def gradients(
    engine: options.EngineOption = None,
    profile: Annotated[
        options.Names,
        typer.Option(help="Profiles (default: balanced, recommended, the reference's accurate)."),
    ] = None,
) -> StudyRequest:
    """Take derivatives of end states by central differences, and compare them with closed forms."""
    from touchstone.reports.studies import gradients as module

    columns = options.columns_for(engine, profile, options.USUAL)
    if not profile and module.JUDGED[0] in dict(columns):
        columns = (columns[0], module.JUDGED[:2], *columns[1:])
    return StudyRequest.of(module, len(module.tasks(columns)), columns)


@studied("tosses", group=reality)
def tosses(
    folder: Annotated[Path, typer.Argument(help="Folder of tosses.npz, or of a CSV file per toss.")],
    most: Annotated[int, typer.Option("--tosses", min=2, help="Play at most so many, evenly chosen.")] = 100,
    engine: options.EngineOption = None,
    profile: options.UsualProfileOption = None,
) -> StudyRequest:
    """Play measured tosses of a box from their start: errors over time, identified e and mu, the floor."""
    from touchstone.reports.studies import tosses as module

    columns = options.columns_for(engine, profile, options.USUAL)
    box, found = module.read(folder)
    chosen = [found[k * len(found) // min(most, len(found))] for k in range(min(most, len(found)))]
    return StudyRequest.of(module, len(module.tasks(columns)) + 1, columns, box, chosen)


def bench(
    name: Annotated[str, typer.Argument(help="geometry, frame or scaling.")],
    scenario: Annotated[
        options.Names,
        typer.Argument(help="Scenes of `frame` (default: gallery, slide, stack, balls_box, dominoes)."),
    ] = None,
    restarts: Annotated[int, typer.Option(min=1, help="Starts of every engine in `frame`.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of the order of engines, scenes and columns.")] = 0,
    out: Annotated[Path | None, typer.Option(help="Folder (default: runs/bench-<name>-<time>).")] = None,
    output: options.FormatOption = options.Format.table,
    yes: options.YesOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Measure what the reference costs, over others in the same run: depth, frames, growth with size."""
    from touchstone.reports.bench import BENCHES, load
    from touchstone.reports.bench import frame as bench_frame

    chosen = load(options.known("bench", name, BENCHES))
    folder = out or options.folder_of_now(f"bench-{name}-")
    if name != "frame":
        if scenario:
            options.stop(f"bench {name}: takes no scenes, found {scenario[0]!r}")
        with options.measuring(chosen.steps(), quiet) as progress:
            found = chosen.run(folder, progress)
    else:
        played = scenes_named(scenario or ()) or bench_frame.scenes()
        with options.measuring(bench_frame.steps(played, restarts), quiet) as progress:
            found = bench_frame.run(folder, progress, played, restarts, seed)
    options.ended(found, chosen.report, folder, output, quiet)
