"""Parts of a page below its first screen, as HTML. Everything that comes from data is escaped."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from html import escape

import pandas as pd

from touchstone.reports.metrics import label
from touchstone.reports.page import charts
from touchstone.reports.page.html import Content, Inline, figure, fold, long_table, part_body, plain_table
from touchstone.reports.page.matrix import SHOWN, metric_part, remarks, scene_part, valued
from touchstone.reports.results import NOT_RUN, Row, rows_of
from touchstone.reports.runner.request import REFERENCE, reproduce
from touchstone.reports.verdict.outcomes import CLASSES, SURVIVED
from touchstone.reports.views.losses import losses
from touchstone.reports.views.tables import MARKS, exact_number, grid, headlines
from touchstone.scenarios.plural import plural

HARD = "stability"
REMARKS = ("fail", "error", "known", "unjudged")
"""Verdicts of rows that are listed."""
MOST = 60
"""Rows of a study that are listed."""


def studies_part(frame: pd.DataFrame) -> str:
    """All studies of the long table `frame`, as HTML."""
    parts = []
    for study in dict.fromkeys(frame.study):
        rows = rows_of(frame[frame.study == study])
        title, body = ("hard cases", _hard(rows)) if study == HARD else (str(study), _counts(rows))
        parts.append(f"<h3>{escape(title)}</h3>{body}")
    return "".join(parts)


def _hard(rows: list[Row]) -> str:
    columns = list(dict.fromkeys((row.engine, row.profile) for row in rows))
    found = {(row.scenario, row.engine, row.profile): row for row in rows}
    survived = sum(row.reason.partition(":")[0] in SURVIVED for row in rows)
    lines = []
    for scene in dict.fromkeys(row.scenario for row in rows):
        cells = [found.get((scene, *column)) for column in columns]
        lines.append([scene, *(_class(cell) for cell in cells)])
    seen = {_class(row) for row in rows}
    words = "; ".join(f"{name}: {text}" for name, text in CLASSES.items() if name in seen)
    return (
        f"<p>{survived} of {len(rows)} hard cases survived. <code>touchstone run SCENE --engine NAME</code> "
        f"plays one.</p>{plain_table(('case', *(' '.join(one) for one in columns)), lines, len(columns) + 1)}"
        f"<p>{escape(words)}</p>"
    )


def _class(row: Row | None) -> str:
    return "-" if row is None else row.reason.partition(":")[0]


def _counts(rows: list[Row]) -> str:
    judged = [row for row in rows if row.verdict]
    remarks = [row for row in judged if row.verdict in REMARKS]
    counts = pd.Series([row.verdict for row in judged]).value_counts()
    text = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    lines = [
        [row.verdict, row.scenario, f"{row.engine} {row.profile}", f"{row.metric} {row.subject}".strip(),
         exact_number(row.value), row.reason]
        for row in remarks[:MOST]
    ]  # fmt: skip
    heads = ("verdict", "scene", "engine", "figure", "value", "reason")
    listed = plain_table(heads, lines, 6) if lines else ""
    rest = f"<p>{len(remarks) - MOST} more.</p>" if len(remarks) > MOST else ""
    return f"<p>{plural(len(rows), 'figure')}; {text or 'none is judged'}.</p>{listed}{rest}"


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


def charts_part(content: Content) -> str:
    """Charts over all scenes; "" where there is nothing to compare: with few scenes the matrix says it."""
    columns = content.first_columns()
    if len(columns) < 2 or content.frame.scenario.nunique() < charts.LEAST_SCENES:
        return ""
    drawn = {"Work and precision: left and low is better": charts.work_precision(content.frame, columns)}
    for metric, title, factor, floor in CHARTS:
        drawn[label(metric)] = charts.dots(content.frame, columns, metric, factor, title, floor)
    parts = [figure(title, svg) for title, svg in drawn.items() if svg]
    return fold("Charts", f'<div class="charts">{"".join(parts)}</div>', "charts", True) if parts else ""


def published_part(content: Content) -> str:
    """Published values with their sources, and what was measured; "" where the scenes state none."""
    part = content.published
    return fold(part.title, part_body(part), "published", True) if part.rows else ""


def measured_part(content: Content) -> str:
    """Measured motions with their picture, and how far engines are from them; "" where none was played."""
    part = content.measured
    if not part.rows:
        return ""
    drawn = figure("", f'<img alt="{escape(part.title)}" src="data:image/png;base64,{content.picture}">')
    return fold(part.title, drawn * bool(content.picture) + part_body(part), "measured", True)


def nights_part(content: Content) -> str:
    """Times over nights, folded away: a table of few nights, charts of more."""
    drawn = "".join(figure(title, svg) for title, svg in content.history.items())
    body = f'<div class="charts">{drawn}</div>' if drawn else ""
    body += part_body(content.times)
    return fold("Times over nights", body, "nights") if body else ""


def scene_parts(content: Content, scenes: Mapping[str, Sequence[Row]]) -> str:
    """A fold for every scene: all links to scenes have their target. Tables are in full up to MOST_TABLES
    characters; those of later scenes have the figures that miss a limit."""
    parts, size = [], 0
    for scene, rows in scenes.items():
        part = _scene(content, scene, rows, True)
        size += len(part)
        parts.append(part if size <= MOST_TABLES else _scene(content, scene, rows, False))
    return f'<section class="scenes"><h2>Figures of each scene</h2>{"".join(parts)}</section>'


def _scene(content: Content, scene: str, rows: Sequence[Row], full: bool) -> str:
    """Metrics of one scene in every column that played: all, or those that miss a limit."""
    cells = grid(content.frame, scene)
    heads = ["metric", "unit", *(f"{engine} {profile} {step} s" for engine, profile, step in cells.heads)]
    lines: list[list[Inline]] = [
        [metric_part(metric, subject), "" if unit == "1" else unit, *(cell.marked for cell in line)]
        for metric, subject, unit, line in cells.rows
        if full or any(cell.verdict in MARKS for cell in line)
    ]
    text = remarks(r for r in rows if r.metric == "run" and r.verdict in (*NOT_RUN, "error", "known"))
    apart = "".join(f"<p>{escape(line)}</p>" for line in headlines(rows))
    play = ""
    if scene in content.playback:
        play = f'<p><button type="button" data-play="{escape(scene)}">Play this scene</button></p>'
    summary = f"<p>{escape(content.summaries.get(scene, ''))}</p>"
    drawn = figure(FORCES, content.forces[scene]) if scene in content.forces else ""
    rest = "" if full else "<p>Figures that miss a limit; the command prints all.</p>"
    again = f"<p class=again><code>touchstone run {escape(scene)}</code></p>"
    body = (
        summary + apart + play + text + drawn + rest + (plain_table(heads, lines, 2) if lines else "") + again
    )
    return fold(scene, body, f"scene-{scene}", level=3)


def reference_loses(frame: pd.DataFrame, scenes: Collection[str]) -> str:
    """Scenes and metrics in which another engine does better than the reference."""
    if not (frame.engine == REFERENCE).any():
        return "<p>The reference did not play.</p>"
    lines: list[list[Inline]] = []
    for metric, loss in ((metric, loss) for lost in losses(frame).values() for metric, loss in lost.items()):
        mine, best = loss.first, loss.best
        ratio = f"{abs(mine.value / best.value):.3g} times" if best.value else ""
        texts = (valued(mine)[0], valued(best)[0], best.engine, ratio, reproduce(mine, best))
        lines.append([scene_part(mine.scenario, scenes), metric_part(metric, mine.subject), *texts])
    heads = ["scene", "figure", "reference", "best other", "engine", "ratio", "command"]
    return long_table(heads, lines, SHOWN, 7) if lines else "<p>In no figure of these scenes.</p>"


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
            several = "; ".join(f"{value} ({', '.join(where)})" for value, where in values.items())
            rows.append([name, next(iter(values)) if len(values) == 1 else several])
        parts.append(f"<h3>{escape(head)}</h3>{plain_table(['setting', 'value'], rows, 2)}")
    return "".join(parts) or "<p>None.</p>"


def identity_part(content: Content) -> str:
    """Machine, program, libraries and command."""
    rows = [[name, value] for name, value in content.identity]
    return plain_table(["", ""], [*rows, ["command", content.command]], 2)
