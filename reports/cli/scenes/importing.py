"""`touchstone import`: a robot of others as a scene file."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import BAD_INPUT, ENGINE_MISSING, stop, write_file
from touchstone.reports.cli.scenes.chosen import AllowPathsOption


def import_robot(
    robot: Annotated[Path, typer.Argument(help="File of a robot: URDF or MJCF.")],
    name: Annotated[str, typer.Option("--as", help="Name of the scene.")],
    out: Annotated[
        Path | None, typer.Option(help="File to write, .toml or .json (default: NAME.toml).")
    ] = None,
    allow_paths: AllowPathsOption = False,
    force: Annotated[bool, typer.Option("--force", help="Write over an existing file.")] = False,
) -> None:
    """Write a robot as a scene, held in its start posture by a tracker; name what could not be kept."""
    from touchstone.adapters.registry import installed, missing_reason

    if not installed("mujoco"):
        stop(f"import needs MuJoCo: {missing_reason('mujoco')}", ENGINE_MISSING)
    from touchstone.adapters.robots.robot_error import RobotError
    from touchstone.adapters.robots.robot_scene import imported
    from touchstone.scenarios.files.read import NAME
    from touchstone.scenarios.files.write import scene_json, scene_toml

    path = out or Path(f"{name}.toml")
    if not NAME.fullmatch(name):
        stop(f"--as {name}: expected letters, digits and -_ .,+= after a letter", BAD_INPUT)
    if path.suffix not in (".toml", ".json"):
        stop(f"--out {path}: expected a file .toml or .json", BAD_INPUT)
    if path.exists() and not force:
        stop(f"{path}: exists; write over it by --force", BAD_INPUT)
    try:
        found = imported(robot, name, allow_paths)
    except RobotError as error:
        stop(str(error), BAD_INPUT)
    scenario = found.scenario
    comment = "\n".join([f"{robot.name}, imported by touchstone", *found.notes])
    text = scene_json(scenario) if path.suffix == ".json" else scene_toml(scenario, comment)
    write_file(path, lambda part: part.write_text(text, encoding="utf-8"))
    for line in found.notes:
        print(f"note: {line}", file=sys.stderr)
    pieces = sum(len(body.pieces) for body in scenario.bodies)
    mass = sum(body.mass for body in scenario.bodies if body.kind != "fixed")
    counts = f"{len(scenario.bodies)} bodies, {len(scenario.joints)} hinges, {pieces} pieces"
    print(f"{path}: {counts}, {mass:.6g} kg")
    card = " --model-card" if scenario.trackers else ""
    print(f"next: touchstone show {path}{card}; touchstone run {path}")
