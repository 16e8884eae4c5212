"""Tables of a run on a terminal, and the first screen: a matrix, what is broken or new, and where to look."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd
from rich.text import Text

from touchstone.adapters.recording import Recording
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import NOT_RUN, UNJUDGED, Row, by_scene, rows_of
from touchstone.reports.runner.request import reproduce, script_command
from touchstone.reports.verdict.judge import WORST_LAST, Count, counted
from touchstone.reports.views.findings import loss_rows, losses_part
from touchstone.reports.views.frame_budget import budget_part
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
from touchstone.reports.views.tables import (
    APART,
    HIDDEN,
    LEGEND,
    MARKS,
    Column,
    TableCell,
    apart_table,
    cell_of,
    columns_of,
    grid,
    headlines,
    number,
    quantity,
    unit_of,
)
from touchstone.scenarios.files.named import argument_of
from touchstone.scenarios.plural import plural

NOT_MET = ("known", "fail", "error")
"""Verdicts that stand out, the worst last."""
RATIO = "ratio.time"
SHOWN_AS_ZERO = 1e-12
"""Value below which a figure counts as 0 [1] and is shown as 0."""
BODY = re.compile(r"^of \S+; ")
"""The remark that names the worst body, which precedes a reason."""


TOTALS = (
    *("limits", "met", "by construction", "known", "causes", "unjudged", "broken", "errors"),
    *("not applicable", "not run"),
)
"""Limits count per metric and scene; causes are those of the known failings; errors are failed runs."""


def overview(frame: pd.DataFrame) -> list[Part]:
    """Many scenes of a long table: limits met and figures that stand out, then TOTALS per column."""
    rows = [row for row in rows_of(frame) if row.engine != "all"]
    rows = [row for row in rows if row.verdict or not row.metric.startswith("ratio.")]
    columns = columns_of(rows)
    scenes = by_scene(rows)
    counts = {name: counted(part, list(columns)) for name, part in scenes.items()}
    figures = [line for name in scenes for line in _section(name, scenes[name], list(columns), counts[name])]
    totals = [[" ".join(c), *map(str, _total(scenes.values(), counts.values(), c))] for c in columns]
    remarks = _remarks(rows) + _not_applicable(counts.values())
    heads = [f"{engine}\n{profile}\n{step} s" for (engine, profile), step in columns.items()]
    return [
        Part("", ["scene", "unit", *heads], figures, OVERVIEW_LEGEND.splitlines(), words=2),
        Part("", ["engine", *TOTALS], totals, lines=remarks, wrap=True),
    ]


def _section(
    name: str, rows: list[Row], columns: list[Column], counts: Mapping[Column, Count]
) -> list[list[str | Text]]:
    found: dict[str, dict[Column, Row]] = {}
    for row in rows:
        best = found.setdefault(row.metric, {})
        column = (row.engine, row.profile)
        if column not in best or _weight(row) > _weight(best[column]):
            best[column] = row
    measured = [
        metric
        for metric in METRICS
        if metric not in HIDDEN and any(row.value == row.value for row in found.get(metric, {}).values())
    ]
    # Figures that stand out, and the first that is not 0: the distance from the truth, where there is one.
    figures = [metric for metric in measured if not metric.startswith("time.")]
    first = next((m for m in figures if any(abs(row.value) > SHOWN_AS_ZERO for row in found[m].values())), "")
    kept = [m for m in measured if m == first or any(row.verdict in NOT_MET for row in found[m].values())]
    # the limits met of those of the scene, or the reason why there are none
    outcome = {column: TableCell(count.text, count.worst) for column, count in counts.items()}
    for row in (row for row in reversed(rows) if row.metric == "run"):
        outcome[row.engine, row.profile] = TableCell(row.verdict, row.verdict)
    ends = (text_of(outcome.get(column, TableCell("-"))) for column in columns)
    lines: list[list[str | Text]] = [[], [Text(name, style="bold"), "", *ends]]
    for metric in kept:
        mine = found[metric]
        cells = (cell_of(mine[column]) if column in mine else TableCell("-") for column in columns)
        unit = unit_of(metric)
        lines.append([f"  {metric}", "" if unit == "1" else unit, *map(text_of, cells)])
    return lines


def _weight(row: Row) -> tuple[int, float]:
    """The worst verdict first, then the largest value."""
    grave = NOT_MET.index(row.verdict) if row.verdict in NOT_MET else -1
    return grave, abs(row.value) if row.value == row.value else 0


def _total(
    scenes: Iterable[list[Row]], counts: Iterable[Mapping[Column, Count]], column: Column
) -> list[int]:
    mine = [count[column] for count in counts if column in count]
    rows = [row for scene in scenes for row in scene if (row.engine, row.profile) == column]
    causes = {BODY.sub("", row.reason) for row in rows if row.verdict == "known"}
    verdicts = {verdict: sum(count.verdicts[verdict] for count in mine) for verdict in WORST_LAST}
    runs = [row.verdict for row in rows if row.metric == "run"]
    return [
        sum(count.limits for count in mine),
        verdicts["pass"],
        sum(count.by_construction for count in mine),
        verdicts["known"],
        len(causes),
        verdicts[UNJUDGED],
        verdicts["fail"],
        verdicts["error"] + runs.count("error"),
        sum(len(count.not_applicable) for count in mine),
        sum(verdict in NOT_RUN for verdict in runs),
    ]


def _not_applicable(counts: Iterable[Mapping[Column, Count]]) -> list[str]:
    """The reasons why limits do not apply, each once, with the metrics and counts."""
    found: dict[str, Counter[str]] = {}
    for count in (count for scene in counts for count in scene.values()):
        for metric, reason in count.not_applicable.items():
            found.setdefault(reason, Counter())[metric] += 1
    return [
        f"does not apply, {metrics.total()} times: {reason}: {', '.join(metrics)}"
        for reason, metrics in sorted(found.items(), key=lambda item: -item[1].total())
    ]


def _remarks(rows: list[Row]) -> list[str]:
    """Broken limits, skipped runs and known failings: each reason once per engine, with its figures."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.verdict in (*NOT_MET, UNJUDGED) or (row.verdict in NOT_RUN and row.metric == "run"):
            unit = "" if row.unit == "1" else f" {row.unit}"
            name = f"{row.metric} {row.subject}".strip()
            figure = row.scenario + (f" {name} {number(row.value)}{unit}" if row.metric != "run" else "")
            figure += f" (limit {row.limit:.2g})" if row.verdict == "fail" else ""
            who = f"{row.verdict}: {row.engine} {row.profile}"
            found.setdefault((who, BODY.sub("", row.reason)), []).append(figure)
    order = (*reversed(NOT_MET), UNJUDGED, *NOT_RUN)
    lines = [f"{who}: {reason}: {', '.join(figures)}" for (who, reason), figures in found.items()]
    lines.sort(key=lambda line: order.index(line.partition(":")[0]))
    if ratios := [row for row in rows if row.metric == RATIO and row.profile == "balanced"]:
        least, most = (pick(ratios, key=lambda row: row.value) for pick in (min, max))
        lines.append(
            f"ratio.time, one run: the reference takes {number(least.value)} ({least.scenario}) to "
            f"{number(most.value)} ({most.scenario}) of the fastest engine's mean frame with contact"
        )
    return lines


OVERVIEW_LEGEND = (
    f"n of m (k): limits met of all that the scene has, k do not apply;{MARKS['fail']} one is broken;"
    f"{MARKS['known']} the rest are known failings\n"
    "below: the first figure of the scene, and every one that misses a limit, of the worst body"
)


STYLES = {"fail": "bold red", "known": "yellow", "error": "bold red", "pass": ""}
STYLES |= dict.fromkeys((UNJUDGED, *NOT_RUN), "dim")
SCENES_IN_FULL = 8
"""Largest number of scenes that are shown as whole tables; more are shown as an overview."""


def text_of(cell: TableCell) -> Text:
    """A cell with its marks and the style of its verdict."""
    style = "bold" if cell.outlier and cell.verdict == "" else STYLES.get(cell.verdict, "")
    return Text(cell.marked, style=style)


def report(frame: pd.DataFrame) -> list[Part]:
    """A table per scene with its ratios, and every verdict other than pass; an overview if there are more
    than SCENES_IN_FULL scenes; where the reference loses."""
    if frame.scenario.nunique() > SCENES_IN_FULL:
        return [*overview(frame), _apart(frame), losses_part(frame)]
    scenes = (frame[frame.scenario == name] for name in dict.fromkeys(frame.scenario))
    return [*(part for scene in scenes for part in scene_parts(scene)), losses_part(frame)]


def scene_parts(scene: pd.DataFrame) -> list[Part]:
    """The table of the scene with the rows `scene`, its ratios, and every verdict other than pass."""
    return [
        Part(lines=headlines(rows_of(scene))),
        grid_part(scene, scene.scenario.iloc[0]),
        _apart(scene),
        ratio_part(scene),
        Part(lines=remark_lines(scene), wrap=True),
    ]


def grid_part(frame: pd.DataFrame, name: str, code: bool = False) -> Part:
    """The values of one scene: metrics, as code if wanted, over columns."""
    cells = grid(frame, name)
    rows: list[list[str | Text]] = []
    family = ""
    for metric, subject, unit, row in cells.rows:
        if family and metric.split(".")[0] != family:
            rows.append([])
        family = metric.split(".")[0]
        figure = f"`{metric}`" if code else metric
        first = Text.assemble(figure, (f" {subject}" if subject else "", "dim"))
        rows.append([first, "" if unit == "1" else unit, *map(text_of, row)])
    heads = [f"{engine}\n{profile}\n{step} s" for engine, profile, step in cells.heads]
    return Part(name, ["metric", "unit", *heads], rows, LEGEND.splitlines(), words=2)


def _apart(frame: pd.DataFrame) -> Part:
    """How far columns are apart, of several bodies."""
    rows = apart_table(rows_of(frame))
    if len(rows) < 2:
        return Part()
    several = frame.scenario.nunique() > 1
    lines = (
        f"  {' '.join(filter(None, (scene * several, body)))}, {distance}" + f": {text}" * bool(text)
        for scene, body, distance, text in rows
    )
    return Part(lines=[f"{APART}:", *lines])


def budget_parts(recordings: Mapping[tuple[str, str, str], Recording]) -> list[Part]:
    """The cost of the reference's frames, if it played at least two scenes."""
    found = budget_part(recordings)
    return [found] if 1 < len({row[0] for row in found.rows}) <= SCENES_IN_FULL else []


RATIO_TITLE = "one run: the reference's frame over an engine's (ratio.time)"
RATIO_HEADS = ("reference", "over", "contact", "all", "median", "p99", "frames", "overlap", "limit")
RATIO_NOTE = (
    "contact: mean over the frames in which one of the two has a contact (frames), judged where it is clear; "
    "all, median, p99: over all frames. `touchstone bench frame` restarts the engines and judges all"
)


def ratio_part(scene: pd.DataFrame) -> Part:
    """`ratio.time` with its other statistics, one row per pair of columns."""
    ratios = rows_of(scene[scene.metric.str.startswith("ratio.")])
    found = {(row.profile, row.subject, row.metric): row for row in ratios}
    rows = []
    for (profile, over, metric), row in found.items():
        if metric == RATIO:
            others = (found.get((profile, over, f"{RATIO}.{name}")) for name in ("all", "median", "p99"))
            cells = [number(row.value), *("" if one is None else number(one.value) for one in others)]
            frames = found.get((profile, over, "ratio.frames"))
            cells += [f"{frames.value:.0f}" if frames and frames.value else "all"]
            limit = f"{row.verdict} {row.limit:.2g}" if row.verdict else ""
            rows.append([profile, over, *cells, row.reason_code.replace("-", " "), limit])
    return Part(RATIO_TITLE, RATIO_HEADS, rows, [RATIO_NOTE], words=2, empty="none")


def remark_lines(scene: pd.DataFrame) -> list[str]:
    """Broken limits, failed and skipped runs, and known failings, with reasons."""
    lines = []
    for row in rows_of(scene[scene.verdict.isin(["fail", "error", "known"])]):
        name = f"{row.metric} {row.subject}".strip()
        unit = "" if row.unit == "1" else f" {row.unit}"
        value = f" {name} {number(row.value)}{unit}, limit {number(row.limit)}{unit}:" * (row.metric != "run")
        script = script_command(row) if row.verdict == "known" else ""
        again = ": " + " | ".join(filter(None, (row.reproduce, script))) if row.reproduce or script else ""
        lines.append(f"{row.verdict}: {row.engine} {row.profile}:{value} {row.reason}{again}")
    for row in rows_of(scene[scene.verdict.isin(NOT_RUN) & (scene.metric == "run")]):
        lines.append(f"{row.verdict}: {row.engine} {row.profile}: {row.reason}")
    for reason, part in scene[scene.verdict == UNJUDGED].groupby("reason", sort=False):
        lines.append(f"{UNJUDGED}: {', '.join(dict.fromkeys(part.metric))}: {reason}")
    return lines


LINES, CROWDED = 40, 6
"""Lines of a scene and column each, and columns beside each other, that are read at a glance [1]."""
NAMED = 1
"""Metrics of a run that a line of the matrix names; those beyond are counted."""
BROKEN_SHOWN = 12
"""Causes of broken limits that are shown; those beyond are counted."""
PLACES = 3
UNMARKED = "\N{NO-BREAK SPACE}" * 2
OF_TOPICS = tuple(start for topic in TOPICS for start in topic.starts)
LETTERS = {topic.name: topic.name[0] for topic in TOPICS}
MATRIX_LEGEND = (
    "met: limits met of those that apply   ✗ broken   † known failing   ? not judged   - not measured"
)
NOTE_OF_MANY = (
    "then topics whose limits are missed ("
    + ", ".join(f"{letter} {name}" for name, letter in LETTERS.items())
    + "), and the median frame [µs]"
)
NOTE_OF_WORST = "each figure with the scene in which it is worst; page and --details have all scenes"


def first_screen(frame: pd.DataFrame, folder: Path) -> list[Part]:
    """The first screen of the results `frame`, which are in `folder`."""
    rows = [row for row in rows_of(frame) if row.engine != "all"]
    scenes = by_scene(rows)
    columns = list(columns_of(row for row in rows if not row.metric.startswith("ratio.")))
    found = {name: entries(mine, columns) for name, mine in scenes.items()}
    some = argument_of(next(iter(scenes), "SCENE"))
    tables = f"a scene's table: touchstone run {some}; all tables: --details"
    few = len(found) <= SCENES_IN_FULL and len(found) * len(columns) <= LINES
    draw = _scenes if few else _many if len(columns) <= CROWDED else _worst
    return [
        draw(found, columns),
        Part(lines=[Text(verdict_of(frame)[1], style="bold"), *_broken_lines(rows)], wrap=True),
        Part(lines=[*_known_lines(rows, columns), *_absent_lines(rows), *_lost_lines(frame), ""], wrap=True),
        Part(notes=[f"page: {folder / 'report.html'}; {tables}"]),
    ]


def _scenes(found: Found, columns: Sequence[Column]) -> Part:
    heads = ["scene", "engine", "met\n", *(f"{topic.name}\n{topic.unit}" for topic in TOPICS), "also misses"]
    rows: list[list[str | Text]] = []
    for scene, mine in found.items():
        rows.append([])
        for k, column in enumerate(columns):
            limits = mine.get((LIMITS, column))
            cells = [limits, *(mine.get((topic.name, column)) for topic in TOPICS)]
            missed = _names(limits.missed if limits else ())
            rows.append(["" if k else scene, " ".join(column), *map(_cell, cells), missed])
    return Part("", heads, rows, [MATRIX_LEGEND], words=2, last=1, tight=True)


def _many(found: Found, columns: Sequence[Column]) -> Part:
    heads = ["scene", *(f"{engine}\n{profile}\nmet{'time':>12}" for engine, profile in columns)]
    rows: list[list[str | Text]] = [
        [scene, *(_summary(mine, column) for column in columns)] for scene, mine in found.items()
    ]
    return Part("", heads, rows, [MATRIX_LEGEND, NOTE_OF_MANY], tight=True)


def _worst(found: Found, columns: Sequence[Column]) -> Part:
    """A line for each column, with its worst scene in each topic."""
    heads = ["engine", "met\n", *(f"{one.name}\n{one.unit}" for one in TOPICS[:-1]), "time over\nfastest"]
    worst = worst_of(found, columns)
    rows: list[list[str | Text]] = []
    for column in columns:
        cells = [_cell(worst.get((LIMITS, column)))]
        for topic in TOPICS:
            entry = worst.get((topic.name, column))
            cells.append(_cell(entry).append(f" {entry.row.scenario}" if entry else "", style="dim"))
        rows.append([" ".join(column), *cells])
    return Part("", heads, rows, [MATRIX_LEGEND, NOTE_OF_WORST], tight=True)


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
        line = f"{MARKS[worst.verdict].strip()} {_figure_of(worst)}{also}: {worst.reason}"
        yield Text(line, style=STYLES["fail"])
        yield Text(f"  {reproduce(worst)}", style="dim")
    if len(groups) > BROKEN_SHOWN:
        yield Text(f"and {len(groups) - BROKEN_SHOWN} more (--details)")


def _figure_of(row: Row) -> str:
    place = f"{row.engine} {row.profile}, {row.scenario}"
    if row.metric == "run":
        return f"{place}: the run failed"
    value, unit = quantity(row.metric, row.value, row.unit)
    limit = quantity(row.metric, row.limit, row.unit)[0]
    return f"{place}: {row.metric} {row.subject}".rstrip() + f" {value} {unit}".rstrip() + f", limit {limit}"


def _known_lines(rows: Sequence[Row], columns: Iterable[Column]) -> Iterator[str]:
    counts = []
    for column in columns:
        mine = [row for row in rows if row.verdict == "known" and (row.engine, row.profile) == column]
        if mine:
            causes = len({row.reason.rpartition("; ")[2] for row in mine})
            counts.append(f"{' '.join(column)} {len(mine)} of {plural(causes, 'cause')}")
    if counts:
        yield f"† known failings: {', '.join(counts)}"


def _absent_lines(rows: Sequence[Row]) -> Iterator[str]:
    found: dict[str, dict[str, None]] = {}
    for row in rows:
        if row.metric == "run" and row.verdict in NOT_RUN:
            found.setdefault(f"{row.verdict}: {row.reason}", {})[row.scenario] = None
    for reason, scenes in found.items():
        yield f"{reason} ({plural(len(scenes), 'scene')})"


def _lost_lines(frame: pd.DataFrame) -> Iterator[str]:
    lost = [f"{metric} ({scenes})" for metric, _, scenes, *_ in loss_rows(frame)]
    if lost:
        yield f"the reference loses to an engine in: {', '.join(lost)} scenes"
    for scene, body, distance, text in apart_table(rows_of(frame))[:1]:
        yield f"{APART}: {body} of {scene}, {distance}: {text}"
