"""The scenes that a command's arguments name, of the catalogue or of files, and the commands on them:
`export`, `schema`, `reproduce`, `check-robot` and `import`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options

if TYPE_CHECKING:
    from touchstone.adapters.contract import Settings
    from touchstone.reports.verdict.limits import Limit
    from touchstone.scenarios.scenario import Scenario

AllowPathsOption = Annotated[
    bool, typer.Option("--allow-paths", help="Let scene files name files outside their own folder.")
]
LimitsOption = Annotated[
    Path | None, typer.Option("--limits", help="TOML or JSON file whose limits add to ours or replace them.")
]


def scenarios_for(
    names: Iterable[str], tag: str = "", hold_last: bool = False, allow_paths: bool = False
) -> list[Scenario]:
    """Scenes of names and files (none: those with the tag); what is invalid exits with one line per fault.

    A name that is not in the catalogue may be that of a file NAME.toml or NAME.json in this folder.
    """
    from touchstone.scenarios import catalogue as scenes
    from touchstone.scenarios.files.named import NoScene, scenes_named
    from touchstone.scenarios.files.read import SceneFileError

    wanted = list(dict.fromkeys(names))
    try:
        found = scenes_named(wanted, hold_last, allow_paths)
    except SceneFileError as error:
        options.stop(str(error))
    except NoScene as error:
        _tell(scenes.faults(hold_last))
        options.known("scenario", error.name, _nearest(error.name) or scenes.catalogue(hold_last))
    if not wanted:
        found = list(scenes.tagged(options.known("tag", tag, scenes.tags(hold_last)), hold_last))
        _tell(scenes.faults(hold_last))
    return found


def _nearest(name: str) -> list[str]:
    """Hard scenes whose names are nearest to the name of one; they are too many to list."""
    from difflib import get_close_matches

    from touchstone.scenarios.difficulty.family import TAG, hard_names

    return get_close_matches(name, list(hard_names()), n=8, cutoff=0.0) if name.startswith(f"{TAG}_") else []


def _tell(lines: Iterable[str]) -> None:
    for line in lines:
        print(f"touchstone: {line}", file=sys.stderr)


def scene_notes(scenarios: Iterable[Scenario]) -> Iterator[str]:
    """One line per tracker that holds its last valid sample, per path that leaves its keyframes, per scene
    in which bodies overlap at the start, per file whose scene has the name of one of the catalogue, and per
    value of a scene without tags that no body has."""
    from touchstone.reports.metrics.context import judge_faults
    from touchstone.scenarios.avatar.tracking import swings
    from touchstone.scenarios.files.named import hidden_by_catalogue
    from touchstone.scenarios.plausibility import implausible

    if measures := not judge_faults():
        from touchstone.adapters.oracles.overlap import overlaps_at_start
    for scenario in scenarios:
        if file := hidden_by_catalogue(scenario):
            yield f"{file}: {scenario.name!r} alone names another scene, of the catalogue"
        if measures and (pairs := overlaps_at_start(scenario)):
            a, b, depth = pairs[0]
            more = f", and {len(pairs) - 1} other pairs overlap" if len(pairs) > 1 else ""
            names = f"{scenario.bodies[a].name} and {scenario.bodies[b].name}"
            yield f"{scenario.name}: {names} overlap by {depth:.3g} m at the start{more}"
        for line in implausible(scenario) if not scenario.tags else ():  # some of the catalogue go beyond
            yield f"{scenario.name}: {line}"
        for i, tracker in enumerate(scenario.trackers):
            place = f"{scenario.name}: trackers[{i}]"
            if tracker.held:
                count = len(tracker.times)
                yield f"{place} holds its last good sample at {tracker.held} of {count} keyframes"
            yield from (f'{place}: {line}; interpolation = "pchip" does not' for line in swings(tracker))


def limits_for(path: Path | None, scenarios: Iterable[Scenario]) -> tuple[Limit, ...]:
    """Limits of a file; an invalid one, or a scene's limit on an unknown metric, exits with its line."""
    from touchstone.reports.verdict.limits import check_limits, limits_of_file
    from touchstone.scenarios.files.read import SceneFileError

    with options.refusing(SceneFileError):
        check_limits(scenarios)
        found = limits_of_file(path) if path else ()
    return found


def metrics_for(patterns: Iterable[str]) -> tuple[str, ...]:
    """Metrics of names and patterns such as `friction.*`; one that fits none exits with one line."""
    from fnmatch import fnmatchcase

    from touchstone.reports.verdict.limits import valid_metrics

    valid = valid_metrics()
    found: dict[str, None] = {}
    for pattern in patterns:
        fitting = [name for name in valid if fnmatchcase(name, pattern)]
        found |= dict.fromkeys(fitting or [options.known("metric", pattern, valid)])
    return tuple(found)


def schema(out: options.PrintedOutOption = None) -> None:
    """Print the JSON Schema of scene files, for editors and validators."""
    import json

    from touchstone.scenarios.files.schema import json_schema

    with options.output_to(out):
        print(json.dumps(json_schema(), indent=1))


ExportFormat = StrEnum("ExportFormat", "mjcf urdf toml json glb csv parquet")
OF_RECORDINGS = (ExportFormat.glb, ExportFormat.csv, ExportFormat.parquet)
RECORDING = ".npz"
ExportTable = StrEnum("ExportTable", "bodies joints contacts")


def export(
    scenario: Annotated[
        str, typer.Argument(help="Scene, file of a scene, or recording (RUN/recordings/*.npz).")
    ],
    form: Annotated[
        ExportFormat,
        typer.Option(
            "--format", help="Of a scene: mjcf, urdf, toml, json; of a recording: glb, csv, parquet."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            help="File to write (urdf: folder); default: standard output (urdf, glb, parquet: NAME)."
        ),
    ] = None,
    rows: Annotated[
        ExportTable, typer.Option("--table", help="Rows of a csv or parquet.")
    ] = ExportTable.bodies,
    allow_paths: AllowPathsOption = False,
) -> None:
    """Write a scene for an engine's own viewer or as a file, or a recording as animated 3D file or table."""
    from touchstone.reports.output_folder import OutputError, output_folder
    from touchstone.scenarios.files.write import scene_json, scene_toml
    from touchstone.scenarios.plural import plural

    if form in OF_RECORDINGS or scenario.endswith(RECORDING):
        _export_recording(Path(scenario), form, rows, out)
        return
    chosen = scenarios_for([scenario], allow_paths=allow_paths)[0]
    if chosen.body_joints and form in (ExportFormat.mjcf, ExportFormat.urdf):
        kept = "toml and json keep them"
        options.stop(f"--format {form}: joints between bodies ({chosen.name}) are not written; {kept}")
    if form is ExportFormat.urdf:
        from touchstone.adapters.robots.export_urdf import urdf_files

        files, folder = urdf_files(chosen), out or Path(chosen.name)
        with options.refusing(OutputError), output_folder(folder) as part:
            for name, text in files.items():
                (part / name).write_text(text, encoding="utf-8")
        robots = [name for name in files if name.endswith(".urdf")]
        print(f"{folder}: {', '.join(robots)}, and {plural(len(files) - len(robots), 'mesh')}")
        return
    if form is ExportFormat.mjcf:
        from touchstone.adapters.robots.export_mjcf import mjcf

        text = mjcf(chosen)
    else:
        text = scene_json(chosen) if form is ExportFormat.json else scene_toml(chosen)
    if out is None:
        print(text, end="")
        return
    options.require_new(out)
    _written(out, lambda part: part.write_text(text, encoding="utf-8"))


def _export_recording(path: Path, form: ExportFormat, rows: ExportTable, out: Path | None) -> None:
    """Write a recording; what is none, and formats of scenes, exit with one line."""
    from touchstone.adapters.recording import RecordingError, load, scene_of_text
    from touchstone.reports.exports import TABLES, glb

    valid = ", ".join(OF_RECORDINGS)
    if form not in OF_RECORDINGS:
        options.stop(f"--format {form}: is for scenes; of a recording: {valid}")
    if path.suffix != RECORDING:
        such = f"runs/TIME/recordings/NAME{RECORDING}"
        options.stop(f"{path}: --format {form} is for recordings, such as {such}")
    target = out or (None if form is ExportFormat.csv else Path(f"{path.stem}.{form}"))
    if target is not None:
        options.require_new(target)
    with options.refusing(RecordingError):
        recording = load(path)
        scene = scene_of_text(recording.scenario)
    if form is ExportFormat.glb:
        data = glb(recording, scene)
        assert target is not None
        _written(target, lambda part: part.write_bytes(data))
        return
    table = TABLES[rows](recording, scene)
    if target is None:
        print(table.to_csv(index=False), end="")
    elif form is ExportFormat.csv:
        _written(target, lambda part: table.to_csv(part, index=False))
    else:
        _written(target, lambda part: table.to_parquet(part, index=False))


def _written(target: Path, write: Callable[[Path], object]) -> None:
    options.write_file(target, write)
    print(target)


def reproduce(
    scenario: Annotated[str, typer.Argument(help="Scene, or file of a scene.")],
    engine: Annotated[str, typer.Option(help="The engine: dart, bullet or mujoco.")],
    profile: Annotated[str, typer.Option(help="Profile (default: the first of the engine).")] = "",
    dt: Annotated[str, typer.Option(help="Native step, such as 1/240 (default: that of the profile).")] = "",
    change: Annotated[
        options.Names, typer.Option("--set", help="KEY=VALUE (touchstone list settings).")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="New file to write (default: standard output).")] = None,
    allow_paths: AllowPathsOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Write what an engine does in a scene as a script in the engine's own API, without touchstone.

    The script is run, and what it prints is compared with the recording of the adapter.
    """
    from touchstone.adapters.contract import AdapterError
    from touchstone.reports.run.reproducer import reproduced
    from touchstone.scenarios.plural import plural

    if out is not None:
        options.require_new(out)
    chosen, *others = scenarios_for([scenario], allow_paths=allow_paths)
    if others:
        options.stop(f"{scenario}: {1 + len(others)} scenes; name one of them")
    name = options.engines_named([engine])[0]
    settings = settings_for(chosen, name, profile, dt, change or [])
    try:
        with options.progress_for(chosen.frame_count, quiet, by_scene=True) as progress:
            found = reproduced(chosen, name, settings, progress)
    except AdapterError as error:
        options.stop(f"{chosen.name}: {error}")
    text = found.script.text
    if out is None:
        print(text, end="")
    else:
        options.write_file(out, lambda part: part.write_text(text, "utf-8"))
    same = "to the bit" if found.apart == 0 else f"up to {found.apart:.2g} m"
    if not quiet:
        for line in found.missed:
            print(f"misses {line}", file=sys.stderr)
        needs = f"{plural(len(text.splitlines()), 'line')}, needs {found.script.requirement}"
        said = f"{out or 'the script'}: {needs}; prints the positions of the recording {same}"
        print(said, file=sys.stderr)
    if not found.apart < EQUAL:
        said = f"{chosen.name}: the script is {found.apart:.2g} m from the recording"
        options.stop(said, options.LIMIT_BROKEN)


EQUAL = 1e-9
"""Difference of a script from a recording [m] beyond which it shows something else: rounding of positions
that are computed in another order."""


def settings_for(scenario: Scenario, engine: str, profile: str, dt: str, changes: list[str]) -> Settings:
    """Settings of one column; a wrong argument exits with one line."""
    from touchstone.adapters.contract import Settings
    from touchstone.adapters.registry import ENGINES, changes_of

    profiles = ENGINES[engine].profiles
    chosen = options.known("profile", profile, profiles) if profile else next(iter(profiles))
    step = options.step_for(dt, [scenario]) if dt else profiles[chosen]
    texts = options.changes_for([(engine, chosen)], changes)
    return Settings(chosen, step, changes_of(engine, chosen, texts))


def check_robot(
    robot: Annotated[Path, typer.Argument(help="File of a robot: URDF or MJCF.")],
    allow_paths: AllowPathsOption = False,
    out: options.PrintedOutOption = None,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Name what is wrong with a robot: hulls, overlap, inertia, limits, drives, grip; exit 1 on a fault.

    A line each, with what was measured and the remedy. `--quiet` prints faults only.
    """
    _require_mujoco("check-robot")
    options.require_judge()
    from touchstone.adapters.robots.checks.check import CHECKS, findings
    from touchstone.adapters.robots.checks.finding import FAULT
    from touchstone.adapters.robots.robot_error import RobotError
    from touchstone.reports.docs.listing import show_rows

    with options.refusing(RobotError):
        found = list(findings(robot, allow_paths))
    faults = [one for one in found if one.verdict == FAULT]
    if quiet:
        for one in faults:
            print(f"fault: {one.check}: {one.line}", file=sys.stderr)
    else:
        with options.output_to(out):
            if output is options.Format.table:
                for one in found:
                    print(f"{one.verdict:6}{one.check:9}{one.line}")
                for check in CHECKS:
                    if all(one.check != check for one in found):
                        print(f"{'ok':6}{check}")
            else:
                names = ("verdict", "check", "subject", "text", "remedy")
                show_rows([{name: getattr(one, name) for name in names} for one in found], output)
    if faults:
        raise typer.Exit(options.LIMIT_BROKEN)


def _require_mujoco(command: str) -> None:
    from touchstone.adapters.registry import installed, missing_reason

    if not installed("mujoco"):
        options.stop(f"{command} needs MuJoCo: {missing_reason('mujoco')}", options.ENGINE_MISSING)


def import_robot(
    robot: Annotated[Path | None, typer.Argument(help="File of a robot: URDF or MJCF.")] = None,
    name: Annotated[str, typer.Option("--as", help="Name of the scene.")] = "",
    check: Annotated[
        list[Path] | None,
        typer.Option(help="Compare every robot below a folder with its file; write no scene."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="File to write, .toml or .json (default: NAME.toml); with --check, a folder."),
    ] = None,
    free: Annotated[
        bool, typer.Option("--free", help="Simulated bodies with joints, under gravity; no tracker.")
    ] = False,
    fixed_base: Annotated[
        bool, typer.Option("--fixed-base", help="With --free: the root stands still (URDF: by default free).")
    ] = False,
    hold: Annotated[bool, typer.Option("--hold", help="With --free: servos hold the start posture.")] = False,
    allow_paths: AllowPathsOption = False,
    force: Annotated[bool, typer.Option("--force", help="Write over an existing file.")] = False,
    output: options.FormatOption = options.Format.table,
    quiet: options.QuietOption = False,
) -> None:
    """Write a robot as a scene, driven by a tracker or (--free) simulated; name what could not be kept.

    An independent reader of the file (pinocchio for URDF, MuJoCo for MJCF) confirms mass, centre, inertia,
    axes and limits.
    """
    _require_mujoco("import")
    if (fixed_base or hold) and not free:
        options.stop("--fixed-base and --hold are options of --free")
    from touchstone.adapters.robots.mechanism import Simulated

    simulated = Simulated(hold, fixed_base) if free else None
    if check:
        if robot is not None or name:
            options.stop("--check takes folders; leave out the robot's file and --as")
        _check(check, out or options.folder_of_now("import-"), allow_paths, simulated, output, quiet)
    elif robot is None or not name:
        options.stop("expected a robot's file and --as NAME, or --check FOLDER")
    else:
        path = out or Path(f"{name}.toml")
        if path.suffix not in (".toml", ".json"):
            options.stop(f"--out {path}: expected a file .toml or .json")
        if path.exists() and not force:
            options.stop(f"{path}: exists; write over it by --force")
        _import(robot, name, path, allow_paths, simulated, quiet)


def _check(  # type: ignore[no-untyped-def]
    folders: list[Path], out: Path, allow_paths: bool, simulated, output: options.Format, quiet: bool
) -> None:
    options.require_judge()
    from touchstone.reports.studies.robots import SUFFIXES, report, robots_below, run

    for folder in folders:
        if not folder.is_dir():
            options.stop(f"--check {folder}: no such folder")
    robots = robots_below(folders)
    if not robots:
        options.stop(f"--check: no robots ({', '.join(SUFFIXES)}) below {', '.join(map(str, folders))}")
    with options.measuring(len(robots), quiet) as progress:
        frame = run(robots, out, allow_paths, simulated, progress)
    options.ended(frame, report, out, output, quiet)


def _import(  # type: ignore[no-untyped-def]
    robot: Path, name: str, path: Path, allow_paths: bool, simulated, quiet: bool
) -> None:
    from touchstone.adapters.robots.robot_error import RobotError
    from touchstone.adapters.robots.robot_scene import imported
    from touchstone.reports.metrics.context import judge_faults
    from touchstone.scenarios.files.read import NAME
    from touchstone.scenarios.files.write import scene_json, scene_toml
    from touchstone.scenarios.plural import plural

    if not NAME.fullmatch(name):
        options.stop(f"--as {name}: expected letters, digits and -_ .,+= after a letter")
    with options.refusing(RobotError):
        found = imported(robot, name, allow_paths, simulated)
    scenario = found.scenario
    comment = "\n".join([f"{robot.name}, imported by touchstone", *found.notes])
    text = scene_json(scenario) if path.suffix == ".json" else scene_toml(scenario, comment)
    options.write_file(path, lambda part: part.write_text(text, encoding="utf-8"))
    for line in found.notes if not quiet else ():
        print(f"note: {line}", file=sys.stderr)
    pieces = sum(len(body.pieces) for body in scenario.bodies)
    mass = sum(body.mass for body in scenario.bodies if body.kind != "fixed")
    held, word = (scenario.body_joints, "joint") if simulated else (scenario.joints, "hinge")
    joints = plural(len(held), word)
    coupled = sum(bool(joint.mimics) for joint in scenario.body_joints)
    joints += f", {plural(coupled, 'coupling')}" if coupled else ""
    counts = f"{plural(len(scenario.bodies), 'body')}, {joints}, {plural(pieces, 'piece')}"
    if not quiet:
        print(f"{path}: {counts}, {mass:.6g} kg")
    if faults := judge_faults():
        print(f"note: not compared with the file: {'; '.join(faults)}", file=sys.stderr)
    else:
        _tell_check(robot, found, allow_paths, quiet)
    card = " --model-card" if scenario.trackers else ""
    if not quiet:
        print(f"next: touchstone show {path}{card}; touchstone run {path}")


def _tell_check(robot: Path, found, allow_paths: bool, quiet: bool) -> None:  # type: ignore[no-untyped-def]
    """Say whether an independent reader has the same robot; one that differs exits with 1."""
    from touchstone.adapters.oracles.robot_file import EQUAL
    from touchstone.adapters.robots.robot_error import RobotError
    from touchstone.adapters.robots.source import compiled
    from touchstone.reports.studies.robots import checked, verdict_line

    try:
        off = checked(robot, found, allow_paths)
    except RobotError as error:
        print(f"note: not compared with the file: {error}", file=sys.stderr)
        return
    line = verdict_line(compiled(robot, allow_paths).form, off)
    if max(off.values()) > EQUAL:
        options.stop(line, options.LIMIT_BROKEN)
    if not quiet:
        print(line)
