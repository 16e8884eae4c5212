"""Parts of a page below its first screen, as HTML. Everything that comes from data is escaped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape

from touchstone.reports.page import charts
from touchstone.reports.page.content import Column, Content
from touchstone.reports.page.matrix import shown
from touchstone.reports.results import NOT_RUN, Row
from touchstone.reports.run.reproduce import reproduce
from touchstone.reports.run.request import REFERENCE
from touchstone.reports.views.tables import grid, unit_of

CHARTS: tuple[tuple[str, str, float, float], ...] = (
    ("overlap.max", "deepest overlap [mm]", 1e3, 1e-7),
    ("energy.injected", "energy from nowhere [mJ]", 1e3, 1e-7),
    ("friction.deficit", "missing or excess share of friction", 1.0, 1e-6),
    ("time.frame.median", "median time of a frame [µs]", 1e6, 1e-3),
)
"""Metric, title, factor to the unit of the chart, and least value drawn [that unit]."""
LARGER = 1.0 + 0.02
"""Ratio from which the reference counts as worse than another engine: the repeatability of a median."""
SAME_DEPTH = 1e-6
"""Overlap below which the reference loses to nobody [m]: the gap in which it handles contact."""


def fold(title: str, body: str, name: str = "", opened: bool = False) -> str:
    """A part that opens and closes."""
    link = f' id="{escape(name, quote=True)}"' if name else ""
    state = " open" if opened else ""
    return f"<details{link}{state}><summary><h2>{escape(title)}</h2></summary>{body}</details>"


def figure(title: str, svg: str) -> str:
    """A chart with its caption."""
    return f'<figure class="chart"><figcaption>{escape(title)}</figcaption>{svg}</figure>'


def plain_table(heads: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> str:
    """A table of texts; the first `left` columns hold words."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    lines = []
    for row in rows:
        cells = [
            f"<td{'' if k < left else ' class=number'}>{escape(text)}</td>" for k, text in enumerate(row)
        ]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    body = f"<thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody>"
    return f'<div class="wide"><table>{body}</table></div>'


def all_charts(content: Content) -> str:
    """Charts over all scenes; a sentence where the libraries are missing."""
    columns = content.columns()
    if len(columns) < 2:
        return ""
    try:
        drawn = {"Work and precision: left and low is better": charts.work_precision(content.frame, columns)}
        for metric, title, factor, floor in CHARTS:
            drawn[metric] = charts.dots(content.frame, columns, metric, factor, title, floor)
    except charts.ChartsMissing as error:
        return f"<p>{escape(str(error))}</p>"
    parts = [figure(title, svg) for title, svg in drawn.items() if svg]
    return f'<div class="charts">{"".join(parts)}</div>'


def scene_part(content: Content, scene: str, rows: Sequence[Row]) -> str:
    """All metrics of one scene in every column that played."""
    cells = grid(content.frame, scene)
    heads = ["metric", "unit", *(f"{engine} {profile} {step} s" for engine, profile, step in cells.heads)]
    body = []
    for metric, subject, unit, line in cells.rows:
        body.append(
            [f"{metric} {subject}".strip(), "" if unit == "1" else unit, *(cell.marked for cell in line)]
        )
    remarks = [
        f"{row.verdict}: {row.engine} {row.profile}: {row.reason}"
        for row in rows
        if row.metric == "run" and row.verdict in (*NOT_RUN, "error", "known")
    ]
    remark_text = "".join(f"<p class=remark>{escape(line)}</p>" for line in remarks)
    play = ""
    if scene in content.playback:
        play = (
            f'<p><button type="button" data-play="{escape(scene, quote=True)}">Play this scene</button></p>'
        )
    summary = f"<p>{escape(content.summaries.get(scene, ''))}</p>"
    again = f"<p class=again><code>touchstone run {escape(scene)}</code></p>"
    return fold(scene, summary + play + remark_text + plain_table(heads, body, 2) + again, f"scene-{scene}")


def failings(rows: Iterable[Row]) -> str:
    """Broken limits, failed runs and known failings: one line per cause, with its places and a command."""
    order = {"fail": 0, "error": 1, "known": 2}
    groups: dict[tuple[int, str, str], list[Row]] = {}
    for row in rows:
        if row.verdict in order:
            cause = row.reason.rpartition(": touchstone ")[0] or row.reason
            # The remark of a row comes before its cause.
            groups.setdefault((order[row.verdict], row.engine, cause.rpartition("; ")[2]), []).append(row)
    lines = []
    for (_, engine, _), found in sorted(groups.items(), key=lambda item: item[0][:2]):
        largest = max(found, key=lambda row: abs(row.value) / row.limit if row.limit > 0 else 0.0)
        cause = largest.reason.rpartition(": touchstone ")[0] or largest.reason
        lines.append([largest.verdict, engine, cause, _places(found), reproduce(largest)])
    if not lines:
        return "<p>None.</p>"
    return plain_table(["verdict", "engine", "cause", "where", "command of the largest"], lines, 5)


def _places(found: Iterable[Row]) -> str:
    """Per metric and profile, the scenes with their values."""
    groups: dict[str, list[str]] = {}
    for row in found:
        unit = unit_of(row.metric).replace("1", "") if row.metric != "run" else ""
        name = f"{row.metric} ({row.profile})"
        groups.setdefault(name, []).append(f"{row.scenario} {shown(row)} {unit}".strip())
    return "; ".join(f"{name}: {', '.join(places)}" for name, places in groups.items())


def reference_loses(scenes: Mapping[str, Sequence[Row]], columns: Sequence[Column]) -> str:
    """Scenes and topics in which another engine does better than the reference."""
    ours = next((column for column in columns if column[0] == REFERENCE), None)
    if ours is None:
        return "<p>The reference did not play.</p>"
    lines = []
    for scene, rows in scenes.items():
        for metric, least in (
            ("time.frame.median", 0.0),
            ("overlap.max", SAME_DEPTH),
            ("contact.gap", SAME_DEPTH),
        ):
            values: dict[tuple[str, str], list[Row]] = {}
            for row in rows:
                if row.metric == metric and (row.engine, row.profile) in columns and row.value == row.value:
                    values.setdefault((row.engine, row.profile), []).append(row)
            if ours not in values or len(values) < 2:
                continue
            worst = {column: max(found, key=lambda row: abs(row.value)) for column, found in values.items()}
            mine = worst.pop(ours)
            best = min(worst.values(), key=lambda row: abs(row.value))
            if abs(mine.value) > max(abs(best.value) * LARGER, least):
                unit = unit_of(metric)
                ratio = f"{abs(mine.value / best.value):.3g} times" if best.value else ""
                lines.append(
                    [
                        scene,
                        metric,
                        f"{shown(mine)} {unit}",
                        f"{shown(best)} {unit}",
                        best.engine,
                        ratio,
                        reproduce(mine, best),
                    ]
                )
    if not lines:
        return "<p>In none of these scenes: no engine is faster, overlaps less or hovers less.</p>"
    return plain_table(["scene", "metric", "reference", "best other", "engine", "ratio", "command"], lines, 1)


def settings_part(settings: Mapping[str, Mapping[str, object]]) -> str:
    """What each engine simulated with, read back from it: one table per engine and profile, by scene."""
    groups: dict[str, dict[str, dict[str, str]]] = {}
    for key, facts in settings.items():
        scene, engine, profile = key.split("/", 2)
        played_with = facts.get("settings", {})
        flat = {"version": facts.get("version", ""), "step [s]": facts.get("dt", "")}
        flat |= played_with if isinstance(played_with, dict) else {}
        groups.setdefault(f"{engine} {profile}", {})[scene] = {
            name: str(value) for name, value in flat.items()
        }
    parts = []
    for head, scenes in groups.items():
        names = list(dict.fromkeys(name for facts in scenes.values() for name in facts))
        rows = []
        for name in names:
            values: dict[str, list[str]] = {}
            for scene, facts in scenes.items():
                values.setdefault(facts.get(name, "-"), []).append(scene)
            one = len(values) == 1
            rows.append(
                [
                    name,
                    next(iter(values))
                    if one
                    else "; ".join(f"{v} ({', '.join(s)})" for v, s in values.items()),
                ]
            )
        parts.append(f"<h3>{escape(head)}</h3>{plain_table(['setting', 'value'], rows, 2)}")
    return "".join(parts) or "<p>None.</p>"


def identity_part(content: Content) -> str:
    """Machine, program, libraries and command."""
    rows = [[name, value] for name, value in content.identity]
    return plain_table(["", ""], [*rows, ["command", content.command]], 2)
