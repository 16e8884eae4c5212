"""Pages that follow from the code alone: commands, scenes, metrics, profiles, settings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from touchstone.reports.cli.listing import metric_rows, profile_rows, scenario_rows, setting_rows
from touchstone.reports.docs.markdown_table import NOTICE, table_text


def commands_page(command: Any) -> str:
    """Every command with its arguments and options, from the program's Typer `command`."""
    from typer import Context
    from typer.cli import get_docs_for_click

    context = Context(command, info_name="touchstone", **command.context_settings)
    text = get_docs_for_click(obj=command, ctx=context, name="touchstone", title="Commands")
    return f"{NOTICE}\n\n{text.rstrip()}\n"


def list_pages(pictures: Mapping[str, str]) -> dict[str, str]:
    """Pages of the lists, by file name; `pictures` gives the still of a scene, relative to its page."""
    return {
        "scenes.md": _scenes(pictures),
        "metrics.md": _page("Metrics", table_text(metric_rows(), code=("metric",))),
        "profiles.md": _page("Profiles and steps", table_text(profile_rows(), code=("profile",))),
        "settings.md": _page(
            "Settings of the reference", table_text(setting_rows(), code=("setting", "values"))
        ),
    }


def _page(title: str, *parts: str) -> str:
    return "\n\n".join([NOTICE, f"# {title}", *parts]) + "\n"


def _scenes(pictures: Mapping[str, str]) -> str:
    rows = {str(row["scenario"]): row for row in scenario_rows()}
    parts = []
    for name, picture in pictures.items():
        parts += [f"## {name}", f"![{name}]({picture})", f"{rows[name]['summary']}."]
    return _page(
        "Scenes",
        "Stills show what the reference plays (`balanced`), drawn from its recording by MuJoCo's renderer.",
        *parts,
        "## All scenes",
        table_text(list(rows.values()), code=("scenario",)),
    )
