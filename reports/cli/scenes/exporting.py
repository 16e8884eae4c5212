"""`touchstone export`: a scene as MJCF, URDF, TOML or JSON."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import BAD_INPUT, stop
from touchstone.reports.cli.scenes.chosen import AllowPathsOption, scenarios_for


class ExportFormat(StrEnum):
    """Formats of scenes."""

    mjcf = "mjcf"
    urdf = "urdf"
    toml = "toml"
    json = "json"


def export(
    scenario: Annotated[str, typer.Argument(help="Scene, or file of a scene.")],
    form: Annotated[ExportFormat, typer.Option("--format", help="mjcf, urdf, toml or json.")],
    out: Annotated[
        Path | None, typer.Option(help="File to write (urdf: folder); default: standard output (urdf: NAME).")
    ] = None,
    allow_paths: AllowPathsOption = False,
) -> None:
    """Write a scene for an engine's own viewer, or as a scene file."""
    from touchstone.reports.output_folder import OutputError, output_folder
    from touchstone.reports.results import write_beside
    from touchstone.scenarios.files.write import scene_json, scene_toml

    chosen = scenarios_for([scenario], allow_paths=allow_paths)[0]
    if form is ExportFormat.urdf:
        from touchstone.adapters.robots.export_urdf import urdf_files

        files, folder = urdf_files(chosen), out or Path(chosen.name)
        try:
            with output_folder(folder) as part:
                for name, text in files.items():
                    (part / name).write_text(text, encoding="utf-8")
        except OutputError as error:
            stop(str(error), BAD_INPUT)
        robots = [name for name in files if name.endswith(".urdf")]
        print(f"{folder}: {', '.join(robots)}, and {len(files) - len(robots)} meshes")
        return
    if form is ExportFormat.mjcf:
        from touchstone.adapters.robots.export_mjcf import mjcf

        text = mjcf(chosen)
    else:
        text = scene_json(chosen) if form is ExportFormat.json else scene_toml(chosen)
    if out is None:
        print(text, end="")
        return
    if out.exists():
        stop(f"--out {out}: exists", BAD_INPUT)
    write_beside(out, lambda part: part.write_text(text, encoding="utf-8"))
    print(out)
