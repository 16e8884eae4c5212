"""Pages that follow from the code alone: commands, scenes, metrics, profiles, settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from touchstone.reports.cli.listing import metric_rows, profile_rows, scenario_rows, setting_rows

NOTICE = "<!-- written by `touchstone docs`; do not edit -->"


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
        "metrics.md": _page("Metrics", _table(metric_rows(), code=("metric",))),
        "profiles.md": _page("Profiles and steps", _table(profile_rows(), code=("profile",))),
        "settings.md": _page("Settings of the reference", _table(setting_rows(), code=("setting", "values"))),
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
        _table(list(rows.values()), code=("scenario",)),
    )


def _table(rows: Sequence[Mapping[str, object]], code: Sequence[str]) -> str:
    """A table in Markdown; columns `code` are set as code."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for row in rows:
        cells = [f"{row[head]}".replace("|", "\\|") for head in heads]
        cells = [f"`{cell}`" if head in code and cell else cell for head, cell in zip(heads, cells)]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
