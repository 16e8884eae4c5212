"""Commands on stored runs: `compare`, `failings measure`, `judge`, `tolerances`, `view`; and `versions`."""

from __future__ import annotations

import sys
import webbrowser
from enum import StrEnum
from math import isfinite
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes import (
    AllowPathsOption,
    LimitsOption,
    limits_for,
    metrics_for,
    scenarios_for,
)

PLACE = ("scenario", "engine", "profile", "metric", "subject")


Matching = StrEnum("Matching", "exact profile")


def compare(
    run_a: Annotated[Path, typer.Argument(help="Folder of the earlier run.")],
    run_b: Annotated[Path, typer.Argument(help="Folder of the later run.")],
    tolerance: Annotated[
        Path | None, typer.Option(help="TOML or JSON file of tolerances per metric, after the default ones.")
    ] = None,
    metric: Annotated[
        options.Names, typer.Option(help="Compare these metrics alone; patterns such as 'friction.*'.")
    ] = None,
    match: Annotated[
        Matching,
        typer.Option(
            help="Compare columns of equal profile, settings and step (exact), or of equal profile."
        ),
    ] = Matching.exact,
    allow_gone: Annotated[
        bool,
        typer.Option("--allow-gone", help="Accept that run B lacks scenes, engines or figures of run A."),
    ] = False,
    every: Annotated[
        bool, typer.Option("--all", help="Show changes within limits and new rows too.")
    ] = False,
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Show what changed beyond intervals, limits and tolerances; exit 1 if anything is worse or gone."""
    from touchstone.reports.changes import (
        FAILING,
        KINDS,
        SHOWN,
        RunError,
        changes,
        report,
        table_of,
        tolerances,
    )
    from touchstone.reports.run.study import families
    from touchstone.scenarios.files.read import SceneFileError
    from touchstone.scenarios.plural import plural

    with options.refusing(RunError, SceneFileError):
        one, two = table_of(run_a), table_of(run_b)
        if metric:
            wanted, there = metrics_for(metric), {*one.metric, *two.metric}
            if not there & set(wanted):
                valid = ", ".join(families(there - {"run"})) or "none"
                options.stop(f"--metric {', '.join(metric)}: in neither run (valid here: {valid})")
            one, two = (frame[frame.metric.isin(wanted) | (frame.metric == "run")] for frame in (one, two))
        found = changes(one, two, tolerances(tolerance), match is Matching.profile)
    counts = {kind: int((found.kind == kind).sum()) for kind in KINDS}
    failing = ["worse"] if allow_gone else FAILING
    with options.output_to(out):
        if not options.printed(found[SHOWN], output) and not quiet:
            shown = found if every else found[found.kind.isin([*FAILING, "better"])]
            listed = ", ".join(f"{count} {kind}" for kind, count in counts.items())
            options.show(report(shown), f"{len(one)} and {plural(len(two), 'row')}: {listed}")
    for row in found[found.kind.isin(failing)].to_dict("records") if quiet else ():
        place = " ".join(filter(None, (row[name] for name in PLACE)))
        print(f"{row['kind']}: {place}: {row['reason']}", file=sys.stderr)
    if counts["worse"] or (counts["gone"] and not allow_gone):
        raise typer.Exit(options.LIMIT_BROKEN)


failings = typer.Typer(no_args_is_help=True, help="Known failings.")


@failings.callback()
def _group() -> None:
    """Known failings: `touchstone list failings` counts them."""


@failings.command()
def measure(runs: Annotated[list[Path], typer.Argument(help="Folders of runs.")]) -> None:
    """Write the sizes of the known failings of runs to the table of failings, and print the difference."""
    from touchstone.reports.changes import RunError, table_of
    from touchstone.reports.results import rows_of
    from touchstone.reports.verdict.failings import FILE, FailingsError, read, write
    from touchstone.reports.verdict.judge import difference, measured
    from touchstone.scenarios.plural import plural

    with options.refusing(RunError, FailingsError):
        old = read(FILE)
        new = measured(old, (row for run in runs for row in rows_of(table_of(run))))
    changed = list(difference(old, new))
    if changed:
        write(new.values(), FILE)
    print("\n".join([*changed, f"{FILE}: {plural(len(new), 'line')}, {len(changed)} changed"]))


def judge(
    run: Annotated[Path, typer.Argument(help="Folder of a run, with its recordings.")],
    metric: Annotated[
        options.Names, typer.Option(help="Report these metrics alone; patterns such as 'friction.*'.")
    ] = None,
    limits: LimitsOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder of results (default: runs/judged-<time>).")] = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Judge the recordings of an earlier run with today's metrics and limits."""
    from touchstone.reports.changes import RunError
    from touchstone.reports.metrics.context import judge_faults
    from touchstone.reports.output_folder import OutputError
    from touchstone.reports.run.study import judge as judge_again
    from touchstone.reports.run.study import without_figures
    from touchstone.reports.views.terminal import report

    folder = out or options.folder_of_now("judged-")
    chosen, of_file = metrics_for(metric or []), limits_for(limits, ())
    count = len(list((run / "recordings").glob("*.npz")))
    command = " ".join(["touchstone", *sys.argv[1:]])
    with options.refusing(RunError, OutputError), options.progress_for(count, quiet) as progress:
        results = judge_again(run, folder, progress, chosen, of_file, command)
    for line in [] if quiet else judge_faults():
        print(line, file=sys.stderr)
    lacking = without_figures(chosen, results)
    options.ended(results.frame, (lambda _: []) if lacking else report, folder, output, quiet)
    if lacking:
        options.stop(f"--metric {', '.join(metric or [])}: {lacking}")


def tolerances(
    runs: Annotated[list[Path], typer.Argument(help="Folders of runs of one program on one machine.")],
    out: Annotated[
        Path | None, typer.Option(help="TOML file to write for `compare --tolerance` (default: none).")
    ] = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Measure how far apart times are between runs of one program: the tolerances of `compare` here."""
    from touchstone.reports.changes import RunError, differences, table_of, toml_of
    from touchstone.reports.docs.listing import show_rows

    names = [str(run) for run in dict.fromkeys(runs)]
    if len(names) < 2:
        options.stop(f"{names[0]}: name two runs or more")
    if out is not None:
        options.require_new(out)
    with options.refusing(RunError):
        found = differences({name: table_of(Path(name)) for name in names})
    if out is not None:
        options.write_file(out, lambda part: part.write_text(toml_of(found, names), "utf-8"))
    if not options.printed(found, output) and not quiet:
        for name in ("median", "largest", "tolerance"):
            found[name] = [f"{100 * one:.3g} %" if isfinite(one) else "not judged" for one in found[name]]
        rows = [{str(key): cell for key, cell in row.items()} for row in found.to_dict("records")]
        show_rows(rows, "table")
        if out is not None:
            print(out)


MOST = 6
"""Recordings that the player shows side by side [1]."""


def view(
    run: Annotated[Path, typer.Argument(help="Folder of a run, with its recordings.")],
    scenario: Annotated[str, typer.Argument(help="Scene of the run (default: its first).")] = "",
    engine: options.EngineOption = None,
    profile: Annotated[options.Names, typer.Option(help="Profiles (default: each engine's own).")] = None,
    out: Annotated[Path | None, typer.Option(help="Page to write (default: RUN/view-SCENE.html).")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = True,
) -> None:
    """Play a scene of a run: engines side by side, one clock, one camera, with contacts and overlap.

    Writes one page that needs no network, from the recordings, and opens it.
    """
    from touchstone.reports.changes import RunError
    from touchstone.reports.page.run_page import own_columns, scene_page, scenes_of

    if out is not None:
        options.require_new(out)
    with options.refusing(RunError):
        found = scenes_of(run)
        name = options.known("scenario", scenario, found) if scenario else next(iter(found))
        columns = found[name]
        for wanted, kind, place in ((engine, "engine", 0), (profile, "profile", 1)):
            names = {column[place] for column in columns}
            kept = [options.known(kind, one, names) for one in wanted or names]
            columns = {column: path for column, path in columns.items() if column[place] in kept}
        if not columns:
            options.stop(f"{run}: no recording of {name} fits --engine and --profile")
        if not profile:
            columns = own_columns(columns)
        options.require_judge()
        shown = dict(list(columns.items())[:MOST])
        if len(columns) > MOST:
            left = ", ".join(" ".join(column) for column in list(columns)[MOST:])
            print(f"not shown, more than {MOST}: {left} (--engine, --profile)", file=sys.stderr)
        text = scene_page(run, name, shown)
    path = out or run / f"view-{name}.html"
    options.write_file(path, lambda part: part.write_text(text, "utf-8"))
    if show and not webbrowser.open(f"{path.absolute().as_uri()}#play={name}"):
        print("no browser was found; open the page by hand", file=sys.stderr)
    print(path)


INSTALLED = "installed"
QUICK_SCENES = ("slide", "slip", "collide_oblique", "incline_holds", "cradle", "stack", "ball_snip")


def versions(
    scenario: Annotated[
        options.Names, typer.Argument(help="Scenes or files of scenes (default: seven of all kinds).")
    ] = None,
    engine: Annotated[str, typer.Option(help="Engine, from a package index: mujoco, bullet, dart.")] = "",
    version: Annotated[
        options.Names,
        typer.Option(help="Released version; repeat. The first is what others are compared with."),
    ] = None,
    profile: Annotated[options.Names, typer.Option(help="Profiles (default: recommended).")] = None,
    rounds: Annotated[int, typer.Option(min=1, help="How often all is played, for times.")] = 3,
    allow_paths: AllowPathsOption = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder of results (default: runs/versions-<time>).")
    ] = None,
    output: options.FormatOption = options.Format.table,
    yes: Annotated[bool, typer.Option("--yes", help="Play what takes more than an hour, too.")] = False,
    quiet: options.QuietOption = False,
) -> None:
    """Play scenes on released versions of an engine: did an update change physics or speed?

    Each version is installed by pip into an environment of its own, kept in ~/.cache/touchstone/engines.
    A single version is compared with the installed one (`--version installed`). Exit 1 if a figure is worse
    than in the first version or gone, 3 if a version cannot be had.
    """
    from touchstone.adapters.registry import profiles_of
    from touchstone.adapters.workers.environment import installed_version
    from touchstone.reports.changes import FAILING
    from touchstone.reports.output_folder import OutputError, output_folder
    from touchstone.reports.runner.request import Request, TooLargeError, check_memory, limited
    from touchstone.reports.studies.versions import Compared, compare, environments
    from touchstone.scenarios.plural import plural

    if not engine:
        options.stop("--engine: name the engine, such as --engine mujoco")
    (name,) = options.engines_named([engine])
    if name == "reference":
        options.stop(f"--engine {engine}: its versions are commits of this program (touchstone compare)")
    if not version:
        options.stop("--version: name released versions, such as --version 3.6.0 --version 3.17.0")
    asked = [*version, INSTALLED] if len(set(version)) == 1 and INSTALLED not in version else version
    here = installed_version(name)
    if INSTALLED in asked and not here:
        options.stop(f"--version {INSTALLED}: {name} is not installed; name two versions")
    wanted = list(dict.fromkeys(here if one == INSTALLED else one for one in asked))
    if len(wanted) < 2:
        options.stop(f"--version: {wanted[0]} is the one that is installed; name another one")
    profiles = profile or [next(iter(profiles_of(name)))]
    scenarios = tuple(scenarios_for(scenario or QUICK_SCENES, allow_paths=allow_paths))
    columns, folder = options.columns_for([name], profiles), out or options.folder_of_now("versions-")
    options.require_judge()
    command = " ".join(["touchstone", *sys.argv[1:]])
    request = Request(scenarios, columns, folder, command=command)
    with options.refusing(TooLargeError):
        check_memory(scenarios, len(columns))
    frames = sum(one.frame_count for one in scenarios) * len(columns) * len(wanted) * rounds
    found = Compared(name, {})
    with options.progress_for(len(wanted), quiet) as progress:
        folders, faults = environments(name, wanted, progress)
    for line in faults.values():
        print(f"touchstone: {line}", file=sys.stderr)
    with options.refusing(OutputError, TooLargeError):
        if len(folders) > 1:
            told = options.progress_for(frames, quiet, by_scene=True)
            with told as progress, output_folder(folder) as part:
                step = progress if yes else limited(progress, frames)
                found = compare(request, folders, rounds, part, step)
    if len(folders) < 2:
        said = f"{len(folders)} of {plural(len(wanted), 'version')} can play; nothing to compare"
        options.stop(said, options.ENGINE_MISSING)
    if not options.printed(found.frame, output) and not quiet:
        from touchstone.reports.studies.versions import report

        options.show(report(found), f"results: {folder}")
    worse = found.figures[found.figures.kind.isin(FAILING)]
    if quiet:
        for row in worse.to_dict("records"):
            what = f"{row['scenario']} {row['profile']} {row['metric']} {row['subject']}".rstrip()
            values = f"{row['a']:.4g} -> {row['b']:.4g}" if row["kind"] == "worse" else row["reason"]
            print(f"{row['kind']}: {row['version']} {what}: {values}", file=sys.stderr)
        for tried, results in found.results.items():
            failed = results.frame[results.frame.verdict == "error"]
            options.tell_failures(failed.assign(engine=f"{name} {tried}"))
    if len(worse):
        raise typer.Exit(options.LIMIT_BROKEN)
    if (found.frame.verdict == "error").any():
        raise typer.Exit(options.ENGINE_FAILED)
    if faults:
        raise typer.Exit(options.ENGINE_MISSING)
