"""Commands on files of robots: `check-engine` of them, and `import`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes.chosen import AllowPathsOption


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
    from touchstone.adapters.registry import installed, missing_reason

    if not installed("mujoco"):
        options.stop(f"check-robot needs MuJoCo: {missing_reason('mujoco')}", options.ENGINE_MISSING)
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
    from touchstone.adapters.registry import installed, missing_reason

    if not installed("mujoco"):
        options.stop(f"import needs MuJoCo: {missing_reason('mujoco')}", options.ENGINE_MISSING)
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
    from touchstone.reports.metrics.oracles import judge_faults
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
    joints = (
        plural(len(scenario.body_joints), "joint") if simulated else plural(len(scenario.joints), "hinge")
    )
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
