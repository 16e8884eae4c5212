"""`touchstone versions`: the same scenes on released versions of an engine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes.chosen import AllowPathsOption, scenarios_for

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
            with (
                options.progress_for(frames, quiet, by_scene=True) as progress,
                output_folder(folder) as part,
            ):
                step = progress if yes else limited(progress, frames)
                found = compare(request, folders, rounds, part, step)
    if len(folders) < 2:
        options.stop(
            f"{len(folders)} of {plural(len(wanted), 'version')} can play; nothing to compare",
            options.ENGINE_MISSING,
        )
    if not options.printed(found.frame, output) and not quiet:
        from touchstone.reports.studies.versions import report
        from touchstone.reports.views.render import console, print_parts

        print_parts(report(found), console())
        print(f"results: {folder}")
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
