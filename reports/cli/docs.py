"""`touchstone docs`: write the generated pages."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from touchstone.reports.cli.options import refusing, stop

GALLERY = "gallery"


def docs(
    context: typer.Context,
    results: Annotated[
        list[Path] | None,
        typer.Argument(help="Folders of runs, studies and benches to show (default: none)."),
    ] = None,
    stills: Annotated[bool, typer.Option("--stills", help="Draw the gallery's scenes again.")] = False,
    out: Annotated[Path, typer.Option(help="Folder of the documentation.")] = Path("docs"),
) -> None:
    """Write the generated pages of the documentation: commands, lists, measurements, stills."""
    from touchstone.adapters.contract import AdapterError
    from touchstone.reports.docs.reference import (
        EFFECTS,
        NoResults,
        commands_page,
        engines_page,
        list_pages,
        page_of,
        settings_pages,
    )
    from touchstone.reports.results import write_beside, write_text
    from touchstone.scenarios.catalogue import tagged

    if not (out / "index.md").is_file():
        stop(f"--out {out}: no documentation here (index.md is missing); run in a checkout")
    with refusing(NoResults):
        pages = [page_of(folder) for folder in results or ()]
    folder = out / "generated"
    for needed in (folder / "pictures", out / "settings"):
        needed.mkdir(parents=True, exist_ok=True)
    if stills:
        from touchstone.reports.docs.reference import draw

        with refusing(AdapterError):
            for name in draw(tagged(GALLERY), folder / "pictures"):
                print(f"drew {name}")
    drawn = {
        scene.name: f"pictures/{scene.name}.png"
        for scene in tagged(GALLERY)
        if (folder / "pictures" / f"{scene.name}.png").is_file()
    }
    texts = {"commands.md": commands_page(context.find_root().command), **list_pages(drawn)}
    for given, (name, text, pictures) in zip(results or (), pages):
        if name == "knobs.md":  # the pages of settings show it
            stored = out / "settings" / EFFECTS
            write_beside(stored, partial(_keep, given, stored))
            continue
        texts[name] = text + (_stored(given, folder / "bench-frame") if name == "bench-frame.md" else "")
        for target, source in pictures.items():
            write_beside(folder / "pictures" / target, partial(shutil.copy, source))
    texts |= {f"../settings/{name}": text for name, text in settings_pages(out / "settings").items()}
    texts["../engines.md"] = engines_page(out.resolve().parent)
    for name, text in texts.items():
        write_text(folder / name, text)
        print(out / name.removeprefix("../") if name.startswith("..") else folder / name)


def _stored(run: Path, folder: Path) -> str:
    """Keep the intervals of a run of `bench frame`; what the stored runs of two days share, as a section."""
    from touchstone.reports.bench.repeatability import store, stored_lines
    from touchstone.reports.changes import table_of
    from touchstone.scenarios.files.safe_paths import json_of

    store(table_of(run), json_of(run / "manifest.json"), folder)
    return "\n".join(["", "## Two days", "", *stored_lines(folder), ""])


def _keep(run: Path, stored: Path, path: Path) -> None:
    """What the pages of settings need of a run of `study knobs`, beside what is stored of other engines."""
    import pandas as pd

    from touchstone.reports.changes import table_of
    from touchstone.reports.studies.knobs import KEPT

    new = table_of(run)[list(KEPT)]
    old = pd.read_csv(stored) if stored.is_file() else new
    pd.concat([old[~old.engine.isin(new.engine)], new]).to_csv(path, index=False, float_format="%.4g")
