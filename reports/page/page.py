"""`report.html`: one file without requests. Its policy admits this style and this script, by their hashes."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from string import Template

from touchstone.reports.page import charts, matrix, sections
from touchstone.reports.page.html import Content, fold, rows_by_scene
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
        fold("Hard cases and studies", studies, "studies") if studies else "",
        *(_scene_parts(content, scenes) if scenes else ()),
        fold("Machine, program and command", sections.identity_part(content), "identity"),
    ]
    return Template(_asset("page.html")).substitute(
        policy=policy,
        style=style,
        script=script,
        title=escape(content.title),
        level=content.level,
        verdict=escape(content.verdict),
        changes=matrix.changes_part(content.changes, scenes),
        broken=matrix.broken_part(rows_of(content.frame), scenes),
        worst=matrix.worst_part(found, columns),
        matrix=_matrix(table) if scenes else "",
        playback=_player(playback) if playback else "",
        parts="".join(parts),
        cells=_data({"cells": cells, "colors": charts.colors()}),
        scenes=_data(playback),
    )


def _scene_parts(content: Content, scenes: dict[str, list[Row]]) -> tuple[str, ...]:
    return (
        matrix.known_part(rows_of(content.frame), scenes),
        fold("Where the reference loses", sections.reference_loses(content.frame, scenes), "loses"),
        sections.scene_parts(content, scenes),
        fold("Settings that each engine got", sections.settings_part(content.settings), "settings"),
    )


def _matrix(table: str) -> str:
    legend = "".join(f"<p>{escape(line)}</p>" for line in LEGEND.splitlines())
    return Template(_asset("matrix.html")).substitute(scale=escape(SCALE), legend=legend, matrix=table)


def _player(playback: Mapping[str, str]) -> str:
    names = "".join(f"<option>{escape(scene)}</option>" for scene in playback)
    return Template(_asset("player.html")).substitute(options=names, alarm=f"{1e3 * ALARM:g} mm")


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
