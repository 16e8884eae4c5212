"""`touchstone view`: a scene of a stored run in the browser, all its engines side by side."""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import BAD_INPUT, known, require_judge, require_new, stop, write_file

MOST = 6
"""Recordings that the player shows side by side [1]."""


def view(
    run: Annotated[Path, typer.Argument(help="Folder of a run, with its recordings.")],
    scenario: Annotated[str, typer.Argument(help="Scene of the run (default: its first).")] = "",
    engine: Annotated[list[str] | None, typer.Option(help="Engines (default: all).")] = None,
    profile: Annotated[list[str] | None, typer.Option(help="Profiles (default: each engine's own).")] = None,
    out: Annotated[Path | None, typer.Option(help="Page to write (default: RUN/view-SCENE.html).")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in a browser.")] = True,
) -> None:
    """Play a scene of a run: engines side by side, one clock, one camera, with contacts and overlap.

    Writes one page that needs no network, from the recordings, and opens it.
    """
    from touchstone.reports.compare.stored import RunError
    from touchstone.reports.page.scene_page import own_columns, scene_page, scenes_of

    if out is not None:
        require_new(out)
    try:
        found = scenes_of(run)
        name = known("scenario", scenario, found) if scenario else next(iter(found))
        columns = found[name]
        for wanted, kind, place in ((engine, "engine", 0), (profile, "profile", 1)):
            names = {column[place] for column in columns}
            kept = [known(kind, one, names) for one in wanted or names]
            columns = {column: path for column, path in columns.items() if column[place] in kept}
        if not columns:
            stop(f"{run}: no recording of {name} fits --engine and --profile", BAD_INPUT)
        if not profile:
            columns = own_columns(columns)
        require_judge()
        shown = dict(list(columns.items())[:MOST])
        if len(columns) > MOST:
            left = ", ".join(" ".join(column) for column in list(columns)[MOST:])
            print(f"not shown, more than {MOST}: {left} (--engine, --profile)", file=sys.stderr)
        text = scene_page(run, name, shown)
    except RunError as error:
        stop(str(error), BAD_INPUT)
    path = out or run / f"view-{name}.html"
    write_file(path, lambda part: part.write_text(text, "utf-8"))
    if show and not webbrowser.open(f"{path.absolute().as_uri()}#play={name}"):
        print("no browser was found; open the page by hand", file=sys.stderr)
    print(path)
