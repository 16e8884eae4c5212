"""Parts of a page below its first screen, as HTML."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import pandas as pd
from markupsafe import Markup

from touchstone.reports.metrics import label
from touchstone.reports.page import charts
from touchstone.reports.page.html import PARTS, Content, Inline, part_body
from touchstone.reports.page.matrix import SHOWN, metric_part, scene_part, valued
from touchstone.reports.results import NOT_RUN, Row, rows_of
from touchstone.reports.runner.request import REFERENCE, reproduce
from touchstone.reports.verdict.outcomes import CLASSES, SURVIVED
from touchstone.reports.views.findings import losses
from touchstone.reports.views.tables import MARKS, exact_number, grid, headlines
from touchstone.scenarios.plural import plural

HARD = "stability"
REMARKS = ("fail", "error", "known", "unjudged")
"""Verdicts of rows that are listed."""
MOST = 60
"""Rows of a study that are listed."""


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
        for row in remarks[:MOST]
    ]  # fmt: skip
    heads = ("verdict", "scene", "engine", "figure", "value", "reason")
    said = PARTS.paragraphs([f"{plural(len(rows), 'figure')}; {text or 'none is judged'}."])
    rest = [f"{len(remarks) - MOST} more."] if len(remarks) > MOST else []
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


def published_part(content: Content) -> Markup:
    """Published values with their sources, and what was measured; "" where the scenes state none."""
    part = content.published
    return Markup(PARTS.fold(part.title, part_body(part), "published", True) if part.rows else "")


def measured_part(content: Content) -> Markup:
    """Measured motions with their picture, and how far engines are from them; "" where none was played."""
    part = content.measured
    if not part.rows:
        return Markup("")
    picture = Markup('<img alt="{}" src="data:image/png;base64,{}">').format(part.title, content.picture)
    drawn = PARTS.figure("", picture) if content.picture else Markup("")
    return Markup(PARTS.fold(part.title, drawn + part_body(part), "measured", True))


def nights_part(content: Content) -> Markup:
    """Times over nights, folded away: a table of few nights, charts of more."""
    body = PARTS.charts(content.history) if content.history else Markup("")
    body += part_body(content.times)
    return Markup(PARTS.fold("Times over nights", body, "nights") if body else "")


def scene_parts(content: Content, scenes: Mapping[str, Sequence[Row]]) -> Markup:
    """A fold for every scene: all links to scenes have their target. Tables are in full up to MOST_TABLES
    characters; those of later scenes have the figures that miss a limit."""
    parts, size = [], 0
    for scene, rows in scenes.items():
        part = _scene(content, scene, rows, True)
        size += len(part)
        parts.append(part if size <= MOST_TABLES else _scene(content, scene, rows, False))
    return Markup('<section class="scenes"><h2>Figures of each scene</h2>{}</section>').format(
        Markup("").join(parts)
    )


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
        parts.append(Markup("<h3>{}</h3>{}").format(head, PARTS.table(["setting", "value"], rows, 2)))
    return Markup("").join(parts) or Markup("<p>None.</p>")


def identity_part(content: Content) -> Markup:
    """Machine, program, libraries and command."""
    rows = [[name, value] for name, value in content.identity]
    return Markup(PARTS.table(["", ""], [*rows, ["command", content.command]], 2))
