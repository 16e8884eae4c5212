"""The first screen of a run of several scenes: a matrix, what is broken or new, and where to look."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import pandas as pd
from rich.text import Text

from touchstone.reports.results import NOT_RUN, Row, rows_of
from touchstone.reports.runner.request import reproduce
from touchstone.reports.views.findings import loss_rows
from touchstone.reports.views.matrix import (
    LIMITS,
    TOPICS,
    Entry,
    Found,
    by_cause,
    entries,
    verdict_of,
    worst_of,
)
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import APART, MARKS, Column, apart_table, columns_of, quantity
from touchstone.reports.views.terminal import SCENES_IN_FULL, STYLES
from touchstone.scenarios.plural import plural

LINES, CROWDED = 40, 6
"""Lines of a scene and column each, and columns beside each other, that are read at a glance [1]."""
NAMED = 1
"""Metrics of a run that a line of the matrix names; those beyond are counted."""
BROKEN_SHOWN = 12
"""Causes of broken limits that are shown; those beyond are counted."""
PLACES = 3
"""Scenes that a line names beside the worst."""
UNMARKED = "\N{NO-BREAK SPACE}" * 2
"""Takes the place of a mark."""
OF_TOPICS = tuple(start for topic in TOPICS for start in topic.starts)
LETTERS = {topic.name: topic.name[0] for topic in TOPICS}
LEGEND = "met: limits met of those that apply   ✗ broken   † known failing   ? not judged   - not measured"
NOTE_OF_MANY = (
    "then topics whose limits are missed ("
    + ", ".join(f"{letter} {name}" for name, letter in LETTERS.items())
    + "), and the median frame [µs]"
)
NOTE_OF_WORST = "each figure with the scene in which it is worst; page and --details have all scenes"


def first_screen(frame: pd.DataFrame, folder: Path) -> list[Part]:
    """The first screen of the results `frame`, which are in `folder`."""
    rows = [row for row in rows_of(frame) if row.engine != "all"]
    scenes: dict[str, list[Row]] = {}
    for row in rows:
        scenes.setdefault(row.scenario, []).append(row)
    columns = list(columns_of(row for row in rows if not row.metric.startswith("ratio.")))
    found = {name: entries(mine, columns) for name, mine in scenes.items()}
    some = next(iter(scenes), "SCENE")
    tables = f"a scene's table: touchstone run {some}; all tables: --details"
    return [
        _matrix(found, columns),
        Part(lines=[Text(verdict_of(frame)[1], style="bold"), *_broken_lines(rows)], wrap=True),
        Part(lines=[*_known_lines(rows, columns), *_absent_lines(rows), *_lost_lines(frame), ""], wrap=True),
        Part(notes=[f"page: {folder / 'report.html'}; {tables}"]),
    ]


def _matrix(found: Found, columns: Sequence[Column]) -> Part:
    if len(found) <= SCENES_IN_FULL and len(found) * len(columns) <= LINES:
        return _scenes(found, columns)
    return (_many if len(columns) <= CROWDED else _worst)(found, columns)


def _scenes(found: Found, columns: Sequence[Column]) -> Part:
    """A line for each scene and column."""
    heads = ["scene", "engine", "met\n", *(f"{topic.name}\n{topic.unit}" for topic in TOPICS), "also misses"]
    rows: list[list[str | Text]] = []
    for scene, mine in found.items():
        rows.append([])
        for k, column in enumerate(columns):
            limits = mine.get((LIMITS, column))
            cells = [limits, *(mine.get((topic.name, column)) for topic in TOPICS)]
            missed = _names(limits.missed if limits else ())
            rows.append(["" if k else scene, " ".join(column), *map(_cell, cells), missed])
    return Part("", heads, rows, [LEGEND], words=2, last=1, tight=True)


def _many(found: Found, columns: Sequence[Column]) -> Part:
    """A line for each scene."""
    heads = ["scene", *(f"{engine}\n{profile}\nmet{'time':>12}" for engine, profile in columns)]
    rows: list[list[str | Text]] = [
        [scene, *(_summary(mine, column) for column in columns)] for scene, mine in found.items()
    ]
    return Part("", heads, rows, [LEGEND, NOTE_OF_MANY], tight=True)


def _worst(found: Found, columns: Sequence[Column]) -> Part:
    """A line for each column, with its worst scene in each topic."""
    heads = [
        "engine",
        "met\n",
        *(f"{topic.name}\n{topic.unit}" for topic in TOPICS[:-1]),
        "time over\nfastest",
    ]
    worst = worst_of(found, columns)
    rows: list[list[str | Text]] = []
    for column in columns:
        cells = [_cell(worst.get((LIMITS, column)))]
        for topic in TOPICS:
            entry = worst.get((topic.name, column))
            cells.append(_cell(entry).append(f" {entry.row.scenario}" if entry else "", style="dim"))
        rows.append([" ".join(column), *cells])
    return Part("", heads, rows, [LEGEND, NOTE_OF_WORST], tight=True)


def _cell(entry: Entry | None) -> Text:
    if entry is None:
        return Text(f"-{UNMARKED}")
    style = STYLES.get(entry.missed[0].verdict, "") if entry.missed else ""
    return Text(f"{entry.text} {entry.mark}" if entry.mark else entry.text + UNMARKED, style=style)


def _summary(mine: dict[tuple[str, Column], Entry], column: Column) -> Text:
    """Limits met, the letters of topics that miss one, and the time."""
    limits, time = mine.get((LIMITS, column)), mine.get((TOPICS[-1].name, column))
    if limits is None:
        return Text("-")
    style = STYLES.get(limits.verdict, "")
    if limits.row.metric == "run" or time is None:
        return Text(f"{limits.text} {limits.mark}", style=style)
    missed = (letter for name, letter in LETTERS.items() if (one := mine.get((name, column))) and one.missed)
    text = Text(f"{limits.text} {limits.mark or ' '}{''.join(missed):<3}", style=style)
    return text.append(f"{time.text:>5}", style="not bold default")


def _names(missed: Iterable[Row]) -> str:
    """Names of metrics of no topic that miss a limit, the gravest first."""
    others = [row.metric for row in missed if row.metric != "run" and not row.metric.startswith(OF_TOPICS)]
    names = list(dict.fromkeys(others))
    more = f" +{len(names) - NAMED}" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _broken_lines(rows: Sequence[Row]) -> Iterator[Text]:
    """Broken limits and failed runs a cause and its command each."""
    groups = by_cause(row for row in rows if row.verdict in ("fail", "error"))
    for group in groups[:BROKEN_SHOWN]:
        worst = group[0]
        others = list(dict.fromkeys(row.scenario for row in group if row.scenario != worst.scenario))
        also = f"; also in {', '.join(others[:PLACES])}" if others else ""
        also += f" and {len(others) - PLACES} more" if len(others) > PLACES else ""
        line = f"{MARKS[worst.verdict].strip()} {_figure(worst)}{also}: {worst.reason}"
        yield Text(line, style=STYLES["fail"])
        yield Text(f"  {reproduce(worst)}", style="dim")
    if len(groups) > BROKEN_SHOWN:
        yield Text(f"and {len(groups) - BROKEN_SHOWN} more (--details)")


def _figure(row: Row) -> str:
    place = f"{row.engine} {row.profile}, {row.scenario}"
    if row.metric == "run":
        return f"{place}: the run failed"
    value, unit = quantity(row.metric, row.value, row.unit)
    limit = quantity(row.metric, row.limit, row.unit)[0]
    return f"{place}: {row.metric} {row.subject}".rstrip() + f" {value} {unit}".rstrip() + f", limit {limit}"


def _known_lines(rows: Sequence[Row], columns: Iterable[Column]) -> Iterator[str]:
    """Numbers of known failings per column."""
    counts = []
    for column in columns:
        mine = [row for row in rows if row.verdict == "known" and (row.engine, row.profile) == column]
        if mine:
            causes = len({row.reason.rpartition("; ")[2] for row in mine})
            counts.append(f"{' '.join(column)} {len(mine)} of {plural(causes, 'cause')}")
    if counts:
        yield f"† known failings: {', '.join(counts)}"


def _absent_lines(rows: Sequence[Row]) -> Iterator[str]:
    """Runs that did not take place, a reason each."""
    found: dict[str, dict[str, None]] = {}
    for row in rows:
        if row.metric == "run" and row.verdict in NOT_RUN:
            found.setdefault(f"{row.verdict}: {row.reason}", {})[row.scenario] = None
    for reason, scenes in found.items():
        yield f"{reason} ({plural(len(scenes), 'scene')})"


def _lost_lines(frame: pd.DataFrame) -> Iterator[str]:
    """Where the reference loses, and what is farthest apart."""
    lost = [f"{metric} ({scenes})" for metric, _, scenes, *_ in loss_rows(frame)]
    if lost:
        yield f"the reference loses to an engine in: {', '.join(lost)} scenes"
    for scene, body, distance, text in apart_table(rows_of(frame))[:1]:
        yield f"{APART}: {body} of {scene}, {distance}: {text}"
