"""`report.html`: one file without requests. Its policy admits this style and this script, by their hashes."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Mapping
from importlib.resources import files

from markupsafe import Markup

from touchstone.reports.page import charts, matrix, sections
from touchstone.reports.page.html import PARTS, TEMPLATES, Content, rows_by_scene
from touchstone.reports.page.playback import ALARM
from touchstone.reports.page.sections import studies_part
from touchstone.reports.results import Row, rows_of
from touchstone.reports.views.matrix import SCALE, entries
from touchstone.reports.views.tables import LEGEND

MOST_PLAYBACK = 3_500_000
"""Characters of recordings in a page: scenes beyond are listed without playback, so that a page stays under
5 MB."""


def pack_text(record: Mapping[str, object]) -> str:
    """A scene's recordings as text: JSON, deflated, in base64."""
    return base64.b64encode(zlib.compress(json.dumps(record, allow_nan=False).encode(), 9)).decode()


def within_budget(playback: Mapping[str, str]) -> dict[str, str]:
    """The first scenes whose recordings fit into MOST_PLAYBACK."""
    kept, size = {}, 0
    for scene, text in playback.items():
        if size + len(text) <= MOST_PLAYBACK:
            kept[scene] = text
            size += len(text)
    return kept


def page(content: Content) -> str:
    """The whole page."""
    scenes = rows_by_scene(content.frame)
    playback = within_budget(content.playback)
    columns = content.columns()
    found = {scene: entries(rows, columns) for scene, rows in scenes.items()}
    table, cells = matrix.table(found, columns)
    rows = rows_of(content.frame)
    style, script = _asset("page.css") + _colors(), _asset("player.js") + _asset("page.js")
    policy = (
        f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    studies = studies_part(content.studies) if content.studies is not None and len(content.studies) else ""
    parts = [
        sections.published_part(content),
        sections.measured_part(content),
        sections.charts_part(content),
        sections.nights_part(content),
        PARTS.fold("Hard cases and studies", studies, "studies") if studies else "",
        *(_scene_parts(content, rows, scenes) if scenes else ()),
        PARTS.fold("Machine, program and command", sections.identity_part(content), "identity"),
    ]
    return TEMPLATES.get_template("page.html").render(
        policy=policy,
        style=style,
        script=script,
        title=content.title,
        level=content.level,
        verdict=content.verdict,
        changes=matrix.changes_part(content.changes, scenes),
        broken=matrix.broken_part(rows, scenes),
        worst=matrix.worst_part(found, columns),
        matrix=table if scenes else "",
        scale=SCALE,
        legend=LEGEND.splitlines(),
        playback=playback,
        alarm=f"{1e3 * ALARM:g} mm",
        parts=Markup("").join(parts),
        cells=_data({"cells": cells, "colors": charts.colors()}),
        scenes=_data(playback),
    )


def _scene_parts(content: Content, rows: list[Row], scenes: dict[str, list[Row]]) -> tuple[str, ...]:
    return (
        matrix.known_part(rows, scenes),
        PARTS.fold("Where the reference loses", sections.reference_loses(content.frame, scenes), "loses"),
        sections.scene_parts(content, scenes),
        PARTS.fold("Settings that each engine got", sections.settings_part(content.settings), "settings"),
    )


def _data(record: object) -> str:
    """JSON that cannot end its script element."""
    return json.dumps(record).replace("<", "\\u003c")


def _asset(name: str) -> str:
    return files("touchstone.reports.page").joinpath("assets", name).read_text("utf-8")


def _colors() -> str:
    """Colours of the engines in the page; black becomes the colour of the text."""
    shown = {name: "var(--ink)" if color == "#000000" else color for name, color in charts.colors().items()}
    rules = [f"{charts.variable(name)}: {color};" for name, color in shown.items()]
    marks = [
        f'[data-engine="{name}"] {{ --engine: {color}; stroke: {color}; }}' for name, color in shown.items()
    ]
    return ":root { " + " ".join(rules) + " }\n" + "\n".join(marks) + "\n"


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
