"""`touchstone`: the only module that imports every layer. Heavy imports are deferred until a command needs
them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.challenge import challenge
from touchstone.reports.cli.cheapest import cheapest, tune
from touchstone.reports.cli.docs import docs
from touchstone.reports.cli.doctor import check_engine, doctor, env
from touchstone.reports.cli.doctor import install as install_environments
from touchstone.reports.cli.guard import guarded
from touchstone.reports.cli.nightly import accept, nightly
from touchstone.reports.cli.runs import compare, failings, judge, tolerances, versions, view
from touchstone.reports.cli.scenes import (
    AllowPathsOption,
    LimitsOption,
    check_robot,
    export,
    import_robot,
    limits_for,
    metrics_for,
    reproduce,
    scenarios_for,
    scene_notes,
    schema,
)
from touchstone.reports.cli.studies import bench, reality, study
from touchstone.reports.cli.sweep import soak, sweep
from touchstone.reports.progress import Progress, stepping_aside

if TYPE_CHECKING:
    import pandas as pd

    from touchstone.scenarios.scenario import Scenario

HELP = "Contact handling of avatars: a reference, and what DART, Bullet and MuJoCo make of its scenes."
app = typer.Typer(
    help=HELP,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
)
app.add_typer(study, name="study")
app.add_typer(reality, name="reality")
app.add_typer(failings, name="failings")
app.add_typer(env, name="env")
COMMANDS: tuple[Callable[..., None], ...] = (
    *(bench, soak, nightly, accept, sweep, cheapest, tune, challenge, docs, schema, import_robot),
    *(export, reproduce, compare, tolerances, judge, versions, view),
)
for command in COMMANDS:
    app.command("import" if command is import_robot else None)(command)


Listing = StrEnum("Listing", "scenarios tags engines metrics profiles settings failings")


def main() -> None:
    """Entry point: every expected failure ends in one line on standard error."""
    if bad := [word for word in sys.argv[1:] if not word.isprintable()]:
        # they would break the lines of messages
        options.stop(f"found {bad[0]!r}, expected printable characters")
    guarded(lambda: app(prog_name="touchstone", standalone_mode=False))


def _version(wanted: bool) -> None:
    if wanted:
        print(f"touchstone {options.version()}")
        raise typer.Exit


@app.callback(help=HELP)
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Options before the command."""


@app.command()
def run(
    scenario: Annotated[
        options.Names, typer.Argument(help="Scenes or files of scenes (default: --tag).")
    ] = None,
    tag: Annotated[
        str | None, typer.Option(help="Play every scene with this tag (default: gallery).")
    ] = None,
    engine: Annotated[options.Names, typer.Option(help="Engines (default: all installed).")] = None,
    profile: Annotated[
        options.Names, typer.Option(help="Profiles (default: balanced, paper, recommended).")
    ] = None,
    metric: Annotated[
        options.Names, typer.Option(help="Report these metrics alone; patterns such as 'friction.*'.")
    ] = None,
    dt: Annotated[str | None, typer.Option(help="Native step of every engine, such as 1/240, in s.")] = None,
    change: Annotated[
        options.Names, typer.Option("--set", help="KEY=VALUE or ENGINE.KEY=VALUE (touchstone list settings).")
    ] = None,
    effects: Annotated[
        str, typer.Option(help="auto: those that a scene needs; all (without sleeping); or names.")
    ] = "auto",
    drive: Annotated[
        str, typer.Option(help="Of engines: native (implicit coupling, own servos), torque or posed.")
    ] = "native",
    tracker: Annotated[
        str, typer.Option(help="ideal, or noisy: jitter, lost samples, 60 samples a second that are held.")
    ] = "ideal",
    hold_last: Annotated[
        bool, typer.Option("--hold-last", help="Repeat a tracker's last good sample where one is not finite.")
    ] = False,
    install: Annotated[
        bool, typer.Option("--install", help="Add the environments that named engines need (touchstone env).")
    ] = False,
    limits: LimitsOption = None,
    allow_paths: AllowPathsOption = False,
    yes: Annotated[bool, typer.Option("--yes", help="Play what takes more than an hour, too.")] = False,
    out: Annotated[Path | None, typer.Option(help="Folder of results (default: runs/<time>).")] = None,
    details: Annotated[
        bool, typer.Option("--details", help="Print the tables of several scenes, not one matrix.")
    ] = False,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Play scenes, of the catalogue or of files (.toml, .json, .py), and show where engines differ."""
    if scenario and tag is not None:
        options.stop(f"--tag {tag}: scenes are named too; give one of both")
    named = scenarios_for(scenario or [], "gallery" if tag is None else tag, hold_last, allow_paths)
    scenarios = _tracked(named, tracker, drive)
    options.engines_named(engine or ())
    # what plays takes longer to import than a wrong name to find
    from touchstone.adapters.contract import DRIVES
    from touchstone.reports.metrics.context import judge_faults
    from touchstone.reports.output_folder import OutputError
    from touchstone.reports.run.study import run as run_study
    from touchstone.reports.run.study import without_figures
    from touchstone.reports.runner.request import (
        DEFAULT_PROFILES,
        Request,
        TooLargeError,
        check_memory,
        limited,
    )
    from touchstone.reports.views.terminal import SCENES_IN_FULL

    if install:
        install_environments(engine or [])
    columns = options.columns_for(engine, profile, DEFAULT_PROFILES)
    step = options.step_for(dt, scenarios) if dt is not None else None
    metrics = metrics_for(metric or [])
    # `paper` has no settings: it plays beside a changed `balanced` only where it is named
    columns = columns if profile else options.with_settings(columns, change or [])
    request = Request(
        tuple(scenarios),
        columns,
        out or options.folder_of_now(),
        step,
        metrics,
        " ".join(["touchstone", *sys.argv[1:]]),
        changes=options.changes_for(columns, change or []),
        effects=options.effects_for(effects),
        drive=options.known("drive", drive, DRIVES),
        tracker=tracker,
        limits=limits_for(limits, scenarios),
    )
    for line in [] if quiet else scene_notes(scenarios):
        print(line, file=sys.stderr)
    broken: list[BaseException] = []
    in_full = details or bool(metric) or len(scenarios) == 1
    at_once = output is options.Format.table and not quiet and in_full and len(scenarios) <= SCENES_IN_FULL
    with options.refusing(OutputError, TooLargeError):
        check_memory(request.scenarios, len(request.columns))
        frames = sum(s.frame_count for s in request.scenarios) * len(request.columns)
        with options.progress_for(frames, quiet, by_scene=True) as progress:
            shown = _show_at_once(progress, broken) if at_once else lambda frame: None
            # heaps end by their budget
            bounded = yes or all("heap" in one.tags for one in request.scenarios)
            results = run_study(request, progress if bounded else limited(progress, frames), shown)
    if broken:
        raise broken[0]
    for line in [] if quiet else [*judge_faults(), *results.warnings]:
        print(line, file=sys.stderr)
    lacking = without_figures(request.metrics, results)
    if not options.printed(results.frame, output) and not quiet and not lacking:
        from touchstone.reports.views.findings import losses_part, published_part
        from touchstone.reports.views.terminal import budget_parts, first_screen, report

        if in_full:
            parts = [losses_part(results.frame)] if at_once else report(results.frame)
            parts += budget_parts(results.recordings)
        else:
            parts = first_screen(results.frame, request.out)
        parts += [published_part(results.frame, request.scenarios)]
        options.show(parts, f"results: {request.out}")
    if quiet:
        options.tell_failures(results.frame, bool(engine))
    for line in results.faults:
        print(line, file=sys.stderr)
    options.exit_for(results.frame.verdict, bool(engine), bool(results.faults))
    if lacking:
        options.stop(f"--metric {', '.join(metric or [])}: {lacking}")


def _show_at_once(progress: Progress, broken: list[BaseException]) -> Callable[[pd.DataFrame], None]:
    """A function that prints the table of a scene, while the bar of the progress steps aside.

    Results come first: if standard output is closed or full, `broken` gets the error and no more is printed.
    """
    from touchstone.reports.views.terminal import scene_parts

    def show(frame: pd.DataFrame) -> None:
        if broken or ((frame.verdict == "skipped") & (frame.metric != "run")).all():
            return
        try:
            with stepping_aside(progress):
                options.show(scene_parts(frame))
                sys.stdout.flush()
        except (OSError, SystemExit) as error:  # rich turns a closed pipe into an exit
            broken.append(error)

    return show


def _tracked(scenarios: list[Scenario], tracker: str, drive: str) -> list[Scenario]:
    """The scenes with the requested trackers; an impossible request exits with one line."""
    from touchstone.scenarios.avatar.noisy_tracker import TRACKERS, noisy

    if options.known("tracker", tracker, TRACKERS) == TRACKERS[0]:
        return scenarios
    if not any(scenario.trackers for scenario in scenarios):
        options.stop(f"--tracker {tracker}: no scene of this run has a tracker")
    if drive == "posed":
        options.stop(f"--tracker {tracker}: kinematic links would jump; choose --drive native or torque")
    return [noisy(scenario) for scenario in scenarios]


@app.command("list")
def list_things(
    what: Listing, out: options.PrintedOutOption = None, output: options.FormatOption = options.Format.table
) -> None:
    """List scenarios, their tags, engines, metrics, profiles, settings of every engine, or known failings."""
    from touchstone.reports.docs.listing import LISTS, show_rows

    with options.output_to(out):
        show_rows(LISTS[what](), output)


@app.command()
def show(
    scenario: str,
    effects: Annotated[bool, typer.Option("--effects", help="Which effects it needs, and why.")] = False,
    cost: Annotated[
        bool, typer.Option("--cost", help="With --effects, what each costs of a frame of the reference here.")
    ] = False,
    model_card: Annotated[
        bool, typer.Option("--model-card", help="The driven bodies as every engine holds them.")
    ] = False,
    file: Annotated[
        Path | None, typer.Option(help="With --model-card, compare the scene with the robot's file.")
    ] = None,
    allow_paths: AllowPathsOption = False,
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
) -> None:
    """Show what a scenario is made of."""
    if file is not None and not model_card:
        options.stop("--file is compared by --model-card; name both")
    if cost and not effects:
        options.stop("--cost is a column of --effects; name both")
    chosen, *others = scenarios_for([scenario], allow_paths=allow_paths)
    for line in scene_notes([chosen]):
        print(line, file=sys.stderr)
    if others:
        options.stop(f"{scenario}: {1 + len(others)} scenes; import the file and choose one")
    with options.output_to(out):
        if effects:
            from touchstone.reports.docs.listing import effect_rows, show_rows

            show_rows(effect_rows(chosen, cost), output)
        else:
            _show(chosen, model_card, file, output)


def _show(chosen: Scenario, model_card: bool, file: Path | None, output: options.Format) -> None:
    from touchstone.reports.docs.listing import joint_rows, loop_line, show_rows, surface_lines, truth_lines
    from touchstone.scenarios.scenario import UNMOVED

    if model_card:
        from touchstone.adapters.robots.robot_error import RobotError
        from touchstone.reports.views.model_card import NotDriven, card_rows

        with options.refusing(NotDriven, RobotError):
            show_rows(card_rows(chosen, file), output)
        return
    if output is options.Format.json:
        from touchstone.scenarios.files.write import scene_json

        print(scene_json(chosen), end="")
        return
    rows: list[dict[str, object]] = [
        {
            "body": body.name,
            "kind": body.kind,
            "material": body.material,
            "mass [kg]": f"{body.mass:.4g}" if body.kind not in UNMOVED else "",
            "pieces": len(body.pieces),
        }
        for body in chosen.bodies
    ]
    if output is options.Format.table:
        print(f"{chosen.name}: {chosen.summary}")
        declared = ", ".join(chosen.effects)
        print(f"{chosen.duration:g} s at {chosen.frame_rate} frames per second, effects {declared}")
        for e in chosen.expectations:
            print(f"expects {e.event} {e.body}-{e.other} from {e.earliest:g} to {e.latest:g} s")
        for line in (*surface_lines(chosen), *truth_lines(chosen)):
            print(line)
    show_rows(rows, output)
    if chosen.body_joints and output is options.Format.table:
        print()
        show_rows(joint_rows(chosen), output)
        if line := loop_line(chosen):
            print(line)


app.command("check-engine")(check_engine)
app.command("check-robot")(check_robot)
app.command()(doctor)
