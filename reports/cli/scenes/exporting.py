"""`touchstone export`: a scene as MJCF, URDF, TOML or JSON; a recording as GLB, CSV or Parquet."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes.chosen import AllowPathsOption, scenarios_for


def schema(out: options.PrintedOutOption = None) -> None:
    """Print the JSON Schema of scene files, for editors and validators."""
    import json

    from touchstone.scenarios.files.schema import json_schema

    with options.output_to(out):
        print(json.dumps(json_schema(), indent=1))


ExportFormat = StrEnum("ExportFormat", "mjcf urdf toml json glb csv parquet")
"""Formats of scenes, then of recordings."""
OF_RECORDINGS = (ExportFormat.glb, ExportFormat.csv, ExportFormat.parquet)
RECORDING = ".npz"
ExportTable = StrEnum("ExportTable", "bodies joints contacts")
"""Tables of a recording."""


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
        options.stop(
            f"{path}: --format {form} is for recordings, such as runs/TIME/recordings/NAME{RECORDING}"
        )
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
