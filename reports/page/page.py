"""`report.html`: one file without requests. Its policy admits this style and this script, by their hashes."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from math import isfinite

import pandas as pd
from markupsafe import Markup

from touchstone.reports.metrics import METRICS, label
from touchstone.reports.page import charts
from touchstone.reports.page.html import PARTS, TEMPLATES, Change, Content, Inline, Linked, part_body
from touchstone.reports.page.playback import ALARM
from touchstone.reports.results import NOT_RUN, Row, by_scene, rows_of
from touchstone.reports.runner.request import REFERENCE, reproduce, script_command
from touchstone.reports.verdict.outcomes import CLASSES, SURVIVED
from touchstone.reports.views.findings import losses
from touchstone.reports.views.matrix import (
    LIMITS,
    SCALE,
    TOPICS,
    Entry,
    Found,
    by_cause,
    cause_of,
    entries,
    missed_line,
    shown,
    worst_of,
)
from touchstone.reports.views.tables import LEGEND, MARKS, Column, exact_number, grid, headlines, quantity
from touchstone.scenarios.plural import plural


def title(entry: Entry) -> str:
    """What a hover over a cell says: the figure and its subject, then every limit that is missed."""
    lines = [missed_line(row) for row in entry.missed]
    if entry.row.metric in (LIMITS, "run"):
        return "\n".join([f"limits met: {entry.text}", *lines] if entry.row.metric == LIMITS else lines)
    value, unit = quantity(entry.row.metric, entry.row.value, entry.row.unit)
    of = f" (worst of {entry.subjects})" if entry.subjects > 1 else ""
    head = f"{label(entry.row.metric)} {entry.row.subject}".strip()
    return "\n".join([f"{head}{of}: {value} {unit}".strip(), *lines])


def facts(entry: Entry) -> dict[str, object]:
    """Details of a cell for its dialog."""
    row = entry.row
    head = {"scene": row.scenario, "engine": row.engine, "profile": row.profile}
    missed = [("limit missed", f"{missed_line(one)}: {one.reason}") for one in entry.missed]
    if row.metric == LIMITS:
        again = reproduce(replace(row, metric="run"))
        script = script_command(row) if any(one.verdict == "known" for one in entry.missed) else ""
        scripts = [("as a script of the engine", script)] if script else []
        return {**head, "facts": [("limits met", entry.text), *scripts, *missed], "command": again}
    unit = quantity(row.metric, row.value, row.unit)[1]
    facts = [("metric", f"{row.metric} {row.subject}".strip()), ("value", f"{shown(row)} {unit}".strip())]
    if row.metric in METRICS:
        facts.append(("definition", METRICS[row.metric].formula))
    if isfinite(row.value):
        facts.append(("value [SI]", f"{row.value!r} {row.unit}"))
    facts += [("difference from the reference", f"{entry.apart}")]
    if isfinite(row.limit):
        facts.append(("limit [SI]", f"{row.limit:g} {row.unit}"))
    facts += [("verdict", row.verdict)] if row.verdict else []
    facts += [("reason", row.reason)] if row.reason else []
    if any(one.verdict == "known" for one in entry.missed) and (script := script_command(row)):
        facts.append(("as a script of the engine", script))
    others = [fact for one, fact in zip(entry.missed, missed) if one is not row]
    again = reproduce(entry.missed[0] if entry.missed else row)
    return {**head, "facts": [*facts, *others], "command": again}


HEADS = ((LIMITS, "met"), *((topic.name, topic.unit) for topic in TOPICS))
WORST_HEADS = ((LIMITS, ""), *HEADS[1:-1], ("time", "over the fastest"))


def matrix_table(found: Found, columns: Sequence[Column]) -> tuple[Markup, dict[str, dict[str, object]]]:
    """The matrix as HTML, and the details of its cells by their id."""
    keys = [(topic, column) for topic, _ in HEADS for column in columns]
    cells = (mine[key] for mine in found.values() for key in keys if key in mine)
    return PARTS.matrix(found, columns, HEADS, title), {entry.id: facts(entry) for entry in cells}


def worst_part(found: Found, columns: Sequence[Column]) -> Markup:
    """A row for each column with its worst scene in each topic; "" where the matrix has one row or column."""
    several = len(found) > 1 and len(columns) > 1
    return Markup(PARTS.worst(worst_of(found, columns), columns, WORST_HEADS, title) if several else "")


SHOWN = 8
MOST = 200
"""Rows of a table at most: an engine that is missing loses thousands of figures."""
PLACES = 6
"""Scenes that a line names beside the worst."""
BROKEN = ("fail", "error")


def changes_part(changes: Sequence[Change], scenes: Collection[str]) -> Markup:
    """A table of each kind of change, the gravest first; only that of the first kind is open."""
    kinds = list(dict.fromkeys(change.kind for change in changes))
    parts = []
    for number, kind in enumerate(kinds):
        mine = [change for change in changes if change.kind == kind]
        rows: list[list[Inline]] = []
        for one in mine[:MOST]:
            figure = metric_part(one.metric, one.subject)
            rows.append([scene_part(one.scene, scenes), one.engine, figure, one.moved, one.text])
        heads = ("scene", "engine", "figure", "before → after", "")
        more = [f"{len(mine) - MOST} more are stored."] if len(mine) > MOST else []
        words = f"{len(mine)} {kind}" if kind == "gone" else plural(len(mine), kind)
        body = PARTS.long_table(heads, rows, SHOWN, len(heads)) + PARTS.paragraphs(more)
        parts.append(PARTS.fold(words, body, f"changes-{kind}", not number, level=3))
    return Markup('<div class="changes">{}</div>').format(Markup("").join(parts)) if parts else Markup("")


def scene_part(scene: str, scenes: Collection[str]) -> Linked:
    """Name of a scene; a link where the page has its figures."""
    return Linked(scene, scene=scene if scene in scenes else "")


def metric_part(metric: str, subject: str = "") -> Linked:
    """A metric by its name for readers; a hover says its name and definition."""
    known = METRICS.get(metric)
    return Linked(f"{label(metric)} {subject}".strip(), f"{metric}: {known.formula}" if known else metric)


def broken_part(rows: Iterable[Row], scenes: Collection[str]) -> Markup:
    """Broken limits and failed runs, open; "" where there are none."""
    broken = [row for row in rows if row.verdict in BROKEN]
    failed = sum(row.verdict == "error" for row in broken)
    words = [(len(broken) - failed, "broken limit"), (failed, "failed run")]
    title = " and ".join(plural(count, word) for count, word in words if count)
    return Markup(PARTS.fold(title, causes_table(broken, scenes), "broken", True) if broken else "")


def causes_table(rows: Iterable[Row], scenes: Collection[str]) -> Markup:
    """Rows that miss a limit: one line per metric, engine and cause, with its worst place, the others, and a
    command."""
    lines = [_line(found, scenes) for found in by_cause(rows)]
    heads = ("", "engine", "figure", "worst in", "value", "limit", "also in", "why", "measure it again")
    return Markup(PARTS.long_table(heads, lines, SHOWN, len(heads)))


def _line(found: Sequence[Row], scenes: Collection[str]) -> list[Inline]:
    worst = found[0]
    others = list(dict.fromkeys(row.scenario for row in found if row.scenario != worst.scenario))
    also: list[str | Linked] = []
    for scene in others[:PLACES]:
        also += [", "] if also else []
        also.append(scene_part(scene, scenes))
    also += [f" and {len(others) - PLACES} more"] if len(others) > PLACES else []
    value, limit = valued(worst)
    return [
        MARKS[worst.verdict].strip(),
        f"{worst.engine} {worst.profile}",
        metric_part(worst.metric, worst.subject),
        scene_part(worst.scenario, scenes),
        value,
        limit,
        also,
        cause_of(worst),
        reproduce(worst),
    ]


def valued(row: Row) -> tuple[str, str]:
    """Value and limit of a row with their unit; a run has neither."""
    if row.metric == "run":
        return row.verdict, ""
    value, unit = quantity(row.metric, row.value, row.unit)
    if row.value != row.value:
        value, unit = "never" if row.verdict == "fail" else "-", ""
    limit = quantity(row.metric, row.limit, row.unit) if row.limit == row.limit else ("", "")
    return _joined(value, unit), _joined(*limit)


def _joined(value: str, unit: str) -> str:
    """Value and unit that no line break parts."""
    return f"{value}\N{NO-BREAK SPACE}{unit}" if unit else value


HARD = "stability"
REMARKS = ("fail", "error", "known", "unjudged")
MOST_REMARKS = 60


def studies_part(frame: pd.DataFrame) -> Markup:
    """All studies of the long table `frame`, as HTML."""
    parts = []
    for study in dict.fromkeys(frame.study):
        rows = rows_of(frame[frame.study == study])
        title, body = ("hard cases", _hard(rows)) if study == HARD else (str(study), _counts(rows))
        parts.append(Markup("<h3>{}</h3>{}").format(title, body))
    return Markup("").join(parts)


def _hard(rows: list[Row]) -> Markup:
    columns = list(dict.fromkeys((row.engine, row.profile) for row in rows))
    found = {(row.scenario, row.engine, row.profile): row for row in rows}
    survived = sum(row.reason.partition(":")[0] in SURVIVED for row in rows)
    lines = []
    for scene in dict.fromkeys(row.scenario for row in rows):
        cells = [found.get((scene, *column)) for column in columns]
        lines.append([scene, *(_class(cell) for cell in cells)])
    seen = {_class(row) for row in rows}
    words = "; ".join(f"{name}: {text}" for name, text in CLASSES.items() if name in seen)
    said = f"{survived} of {len(rows)} hard cases survived."
    plays = Markup(" <code>touchstone run SCENE --engine NAME</code> plays one.")
    cases = PARTS.table(("case", *map(" ".join, columns)), lines, len(columns) + 1)
    return Markup(PARTS.paragraphs([said + plays]) + cases + PARTS.paragraphs([words]))


def _class(row: Row | None) -> str:
    return "-" if row is None else row.reason.partition(":")[0]


def _counts(rows: list[Row]) -> Markup:
    judged = [row for row in rows if row.verdict]
    remarks = [row for row in judged if row.verdict in REMARKS]
    counts = pd.Series([row.verdict for row in judged]).value_counts()
    text = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    lines = [
        [row.verdict, row.scenario, f"{row.engine} {row.profile}", f"{row.metric} {row.subject}".strip(),
         exact_number(row.value), row.reason]
        for row in remarks[:MOST_REMARKS]
    ]  # fmt: skip
    heads = ("verdict", "scene", "engine", "figure", "value", "reason")
    said = PARTS.paragraphs([f"{plural(len(rows), 'figure')}; {text or 'none is judged'}."])
    rest = [f"{len(remarks) - MOST_REMARKS} more."] if len(remarks) > MOST_REMARKS else []
    return Markup(said + (PARTS.table(heads, lines, 6) if lines else "") + PARTS.paragraphs(rest))


CHARTS: tuple[tuple[str, str, float, float], ...] = (
    ("overlap.max", "deepest overlap [mm]", 1e3, 1e-7),
    ("energy.injected", "injected energy [mJ]", 1e3, 1e-7),
    ("friction.deficit", "missing or excess share of friction", 1.0, 1e-6),
    ("time.frame.median", "median time of a frame [µs]", 1e6, 1e-3),
)
"""Metric, title, factor to the unit of the chart, and least value drawn [that unit]."""
FORCES = "Contact force over time, mean of each frame; dashed: closed form"
MOST_TABLES = 1_000_000
"""Characters of tables of scenes in full: with MOST_PLAYBACK, a page stays under 5 MB."""


def charts_part(content: Content) -> Markup:
    """Charts over all scenes; "" where there is nothing to compare: with few scenes the matrix says it."""
    columns = content.first_columns()
    if len(columns) < 2 or content.frame.scenario.nunique() < charts.LEAST_SCENES:
        return Markup("")
    drawn = {"Work and precision: left and low is better": charts.work_precision(content.frame, columns)}
    for metric, title, factor, floor in CHARTS:
        drawn[label(metric)] = charts.dots(content.frame, columns, metric, factor, title, floor)
    return Markup(PARTS.fold("Charts", PARTS.charts(drawn), "charts", True) if any(drawn.values()) else "")


def measured_part(content: Content) -> Markup:
    """Measured motions with their picture, and how far engines are from them; "" where none was played."""
    part = content.measured
    if not part.rows:
        return Markup("")
    picture = Markup('<img alt="{}" src="data:image/png;base64,{}">').format(part.title, content.picture)
    drawn = PARTS.figure("", picture) if content.picture else Markup("")
    return Markup(PARTS.fold(part.title, drawn + part_body(part), "measured", True))


def scene_parts(content: Content, scenes: Mapping[str, Sequence[Row]]) -> Markup:
    """A fold for every scene: all links to scenes have their target. Tables are in full up to MOST_TABLES
    characters; those of later scenes have the figures that miss a limit."""
    parts, size = [], 0
    for scene, rows in scenes.items():
        part = _scene(content, scene, rows, True)
        size += len(part)
        parts.append(part if size <= MOST_TABLES else _scene(content, scene, rows, False))
    body = Markup("").join(parts)
    return Markup('<section class="scenes"><h2>Figures of each scene</h2>{}</section>').format(body)


def _scene(content: Content, scene: str, rows: Sequence[Row], full: bool) -> Markup:
    """Metrics of one scene in every column that played: all, or those that miss a limit."""
    cells = grid(content.frame, scene)
    heads = ["metric", "unit", *(f"{engine} {profile} {step} s" for engine, profile, step in cells.heads)]
    lines: list[list[Inline]] = [
        [metric_part(metric, subject), "" if unit == "1" else unit, *(cell.marked for cell in line)]
        for metric, subject, unit, line in cells.rows
        if full or any(cell.verdict in MARKS for cell in line)
    ]
    body = PARTS.scene(
        scene,
        summary=content.summaries.get(scene, ""),
        apart=headlines(rows),
        playable=scene in content.playback,
        remarks=[
            f"{row.verdict}: {row.engine} {row.profile}: {row.reason}"
            for row in rows
            if row.metric == "run" and row.verdict in (*NOT_RUN, "error", "known")
        ],
        drawn=content.forces.get(scene, ""),
        full=full,
        table=PARTS.table(heads, lines, 2) if lines else "",
        forces=FORCES,
    )
    return Markup(PARTS.fold(scene, body, f"scene-{scene}", level=3))


def reference_loses(frame: pd.DataFrame, scenes: Collection[str]) -> Markup:
    """Scenes and metrics in which another engine does better than the reference."""
    if not (frame.engine == REFERENCE).any():
        return Markup("<p>The reference did not play.</p>")
    lines: list[list[Inline]] = []
    for metric, loss in ((metric, loss) for lost in losses(frame).values() for metric, loss in lost.items()):
        mine, best = loss.first, loss.best
        ratio = f"{abs(mine.value / best.value):.3g} times" if best.value else ""
        texts = (valued(mine)[0], valued(best)[0], best.engine, ratio, reproduce(mine, best))
        lines.append([scene_part(mine.scenario, scenes), metric_part(metric, mine.subject), *texts])
    heads = ["scene", "figure", "reference", "best other", "engine", "ratio", "command"]
    if not lines:
        return Markup("<p>In no figure of these scenes.</p>")
    return Markup(PARTS.long_table(heads, lines, SHOWN, 7))


def settings_part(settings: Mapping[str, Mapping[str, object]]) -> Markup:
    """What each engine simulated with, read back from it: one table per engine and profile, by scene."""
    groups: dict[str, dict[str, dict[str, str]]] = {}
    for key, facts in settings.items():
        scene, engine, profile = key.split("/", 2)
        played_with = facts.get("settings", {})
        flat = {"version": facts.get("version", ""), "step [s]": facts.get("dt", "")}
        flat |= played_with if isinstance(played_with, dict) else {}
        texts = {name: str(value) for name, value in flat.items()}
        groups.setdefault(f"{engine} {profile}", {})[scene] = texts
    parts = []
    for head, scenes in groups.items():
        names = list(dict.fromkeys(name for facts in scenes.values() for name in facts))
        rows = []
        for name in names:
            values: dict[str, list[str]] = {}
            for scene, facts in scenes.items():
                values.setdefault(facts.get(name, "-"), []).append(scene)
            several = "; ".join(f"{value} ({', '.join(where)})" for value, where in values.items())
            rows.append([name, next(iter(values)) if len(values) == 1 else several])
        parts.append(Markup("<h3>{}</h3>{}").format(head, PARTS.table(["setting", "value"], rows, 2)))
    return Markup("").join(parts) or Markup("<p>None.</p>")


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
    rows = rows_of(content.frame)
    scenes = by_scene(rows)
    playback = within_budget(content.playback)
    columns = content.columns()
    found = {scene: entries(rows, columns) for scene, rows in scenes.items()}
    table, cells = matrix_table(found, columns)
    style, script = _asset("page.css") + _colors(), _asset("player.js") + _asset("page.js")
    policy = (
        f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
    published, times = content.published, PARTS.charts(content.history) if content.history else Markup("")
    times += part_body(content.times)  # a table of few nights, charts of more
    identity = [*map(list, content.identity), ["command", content.command]]
    studies = studies_part(content.studies) if content.studies is not None and len(content.studies) else ""
    parts = [
        PARTS.fold(published.title, part_body(published), "published", True) if published.rows else "",
        measured_part(content),
        charts_part(content),
        PARTS.fold("Times over nights", times, "nights") if times else "",
        PARTS.fold("Hard cases and studies", studies, "studies") if studies else "",
        *(_scene_parts(content, rows, scenes) if scenes else ()),
        PARTS.fold("Machine, program and command", PARTS.table(["", ""], identity, 2), "identity"),
    ]
    return TEMPLATES.get_template("page.html").render(
        policy=policy,
        style=style,
        script=script,
        title=content.title,
        level=content.level,
        verdict=content.verdict,
        changes=changes_part(content.changes, scenes),
        broken=broken_part(rows, scenes),
        worst=worst_part(found, columns),
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
    known = [row for row in rows if row.verdict == "known"]
    title = plural(len(known), "known failing")
    return (
        PARTS.fold(title, causes_table(known, scenes), "failings") if known else "",
        PARTS.fold("Where the reference loses", reference_loses(content.frame, scenes), "loses"),
        scene_parts(content, scenes),
        PARTS.fold("Settings that each engine got", settings_part(content.settings), "settings"),
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
    marks = [f'[data-engine="{one}"] {{ --engine: {c}; stroke: {c}; }}' for one, c in shown.items()]
    return ":root { " + " ".join(rules) + " }\n" + "\n".join(marks) + "\n"


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
