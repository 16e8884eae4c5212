"""Findings over all scenes of a run: where the reference loses, figures in which an engine does better,
and what others published, beside what the reference and each engine give."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite

import pandas as pd

from touchstone.reports.bootstrap import RATIO
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import EVERY_ENGINE, MACHINE_PROFILE, REFERENCE
from touchstone.reports.views.comparison import SAME_SHARE, TOPICS
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import MARKS, number, scaled_number, unit_of
from touchstone.scenarios.scenario import Scenario

OURS = ("balanced", "paper")
ROUNDING = 1e-9
"""Difference that counts as none [SI], where no topic of the comparison names one."""
LIMIT_SHARE = 0.01
"""Difference that counts as none, as a share of the reference's limit [1]."""
SAME = {metric: same for topic in TOPICS for metric, same in topic.same.items()}
HEADS = ("metric", "unit", "scenes", "worst in", *OURS, "best engine")
TITLE = "where the reference loses"
NOTE = (
    "scenes: in how many of those compared an engine is better than balanced, by more than 2 % and 1 % of "
    "the limit; then the scene with the largest difference. Metrics whose truth is 0, and times"
)


@dataclass(frozen=True, slots=True)
class Loss:
    """A metric of one scene and subject in which an engine is better: rows of the reference's profiles, and
    the best engine's."""

    ours: dict[str, Row]
    best: Row

    @property
    def first(self) -> Row:
        """The row of `balanced`."""
        return self.ours[OURS[0]]

    @property
    def difference(self) -> float:
        """By how much the engine is better, over its own value [1] where that is not 0."""
        least = max(abs(self.best.value), SAME.get(self.best.metric, ROUNDING))
        return (abs(self.first.value) - abs(self.best.value)) / least


def losses_part(frame: pd.DataFrame) -> Part:
    """The metrics in which an engine does better, and the scenes."""
    rows = loss_rows(frame)
    lines = [*unmeasured_lines(frame), *(scene_lines(frame) if rows else [])]
    return Part(TITLE, HEADS, rows, [NOTE], lines, words=2, empty="In no figure of this run.")


def loss_rows(frame: pd.DataFrame) -> list[list[str]]:
    """One line per metric under HEADS: scenes lost of those compared, and the worst one with its figures."""
    compared: dict[str, set[str]] = {}
    lost: dict[str, list[Loss]] = {}
    for scene, metric, loss in _compared(frame):
        compared.setdefault(metric, set()).add(scene)
        if loss is not None:
            lost.setdefault(metric, []).append(loss)
    return [_line(metric, lost[metric], len(compared[metric])) for metric in METRICS if metric in lost]


def losses(frame: pd.DataFrame) -> dict[str, dict[str, Loss]]:
    """Scene -> metric in which an engine does better -> the subject with the largest difference. Scenes that
    are compared and lose in nothing have no metrics."""
    lost: dict[str, dict[str, Loss]] = {}
    for scene, metric, loss in _compared(frame):
        known = lost.setdefault(scene, {})
        if loss is not None and (metric not in known or loss.difference > known[metric].difference):
            known[metric] = loss
    return lost


def scene_lines(frame: pd.DataFrame) -> list[str]:
    """One line per scene in which an engine does better or is faster: every such metric with the worst
    figures of `balanced` and the engine's; then the scenes without one."""
    found = {
        scene: [
            f"{metric} {_figure(loss.first)}, {loss.best.engine} {_figure(loss.best)}"
            for metric, loss in some.items()
        ]
        for scene, some in losses(frame).items()
    }
    for row in rows_of(frame[(frame.metric == RATIO) & (frame.engine == REFERENCE) & (frame.value > 1)]):
        found.setdefault(row.scenario, []).append(
            f"{row.profile} takes {number(row.value)} of the time of {row.subject}"
        )
    lines = [f"{scene}: {'; '.join(texts)}" for scene, texts in found.items() if texts]
    none = [scene for scene, texts in found.items() if not texts]
    return [*lines, *([f"in nothing: {', '.join(none)}"] if none else [])]


def _figure(row: Row) -> str:
    unit = unit_of(row.metric)
    return _text(row) + ("" if unit == "1" else f" {unit}")


def _line(metric: str, lost: Sequence[Loss], compared: int) -> list[str]:
    worst = max(lost, key=lambda loss: loss.difference)
    scenes = len({loss.first.scenario for loss in lost})
    place = f"{worst.first.scenario} {worst.first.subject}".strip()
    ours = [_text(worst.ours.get(profile)) for profile in OURS]
    unit = "" if unit_of(metric) == "1" else unit_of(metric)
    return [metric, unit, f"{scenes} of {compared}", place, *ours, f"{worst.best.engine} {_text(worst.best)}"]


def _compared(frame: pd.DataFrame) -> Iterator[tuple[str, str, Loss | None]]:
    """Scene and metric of every comparison with an engine, and the loss, if it is one."""
    found: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows_of(frame):
        metric = METRICS.get(row.metric)
        if metric is not None and metric.better == "lower" and isfinite(row.value):
            found.setdefault((row.scenario, row.metric, row.subject), []).append(row)
    for (scene, name, _), rows in found.items():
        ours = {row.profile: row for row in rows if row.engine == REFERENCE}
        theirs = [row for row in rows if row.engine != REFERENCE and row.profile == MACHINE_PROFILE]
        if OURS[0] in ours and theirs:
            loss = Loss(ours, min(theirs, key=lambda row: abs(row.value)))
            yield scene, name, loss if _is_lost(loss) else None


def _is_lost(loss: Loss) -> bool:
    ours, best = abs(loss.first.value), abs(loss.best.value)
    least = SAME.get(loss.first.metric, 0.0 if loss.first.metric.startswith("time.") else ROUNDING)
    if isfinite(loss.first.limit):
        least = max(least, LIMIT_SHARE * loss.first.limit)
    return ours > max(best + least, best * (1 + SAME_SHARE))


def _text(row: Row | None) -> str:
    if row is None or not isfinite(row.value):
        return "-"
    return scaled_number(row.metric, row.value)


def unmeasured_lines(frame: pd.DataFrame) -> list[str]:
    """Metrics that the engines have and the reference has not, with the reason and the scenes."""
    theirs = {
        (row.scenario, row.metric)
        for row in rows_of(frame[(frame.engine != REFERENCE) & (frame.profile == MACHINE_PROFILE)])
        if isfinite(row.value)
    }
    found: dict[tuple[str, str], list[str]] = {}
    mine = frame[(frame.engine == REFERENCE) & (frame.profile == OURS[0]) & (frame.verdict == "skipped")]
    for row in rows_of(mine):
        if (row.scenario, row.metric) in theirs and row.metric in METRICS:
            found.setdefault((row.metric, row.reason), []).append(row.scenario)
    return [
        f"the engines only: {metric} ({', '.join(dict.fromkeys(scenes))}): {reason}"
        for (metric, reason), scenes in found.items()
    ]


PUBLISHED = "published.error"
PUBLISHED_TITLE = "Against published values"
PUBLISHED_NOTE = "± published tolerance; each engine in its first profile; numbers in brackets: sources"


def published_part(frame: pd.DataFrame, scenarios: Iterable[Scenario]) -> Part:
    """One line per published value of the scenes, and the sources; no row where none was measured."""
    rows = [row for row in rows_of(frame) if row.metric in (PUBLISHED, "run") and row.engine != EVERY_ENGINE]
    if not any(row.metric == PUBLISHED and row.subject for row in rows):
        return Part()
    own: dict[str, str] = {}
    for row in rows:
        own.setdefault(row.engine, row.profile)
    found = {
        (row.scenario, row.engine, row.metric, row.subject): row
        for row in rows
        if row.profile == own[row.engine]
    }
    sources: dict[str, int] = {}
    lines = []
    for scenario in scenarios:
        for one in scenario.published:
            cells = []
            for engine in own:
                measured = found.get((scenario.name, engine, PUBLISHED, one.name))
                if measured is None or not isfinite(measured.value):
                    run = measured or found.get((scenario.name, engine, "run", ""))
                    cells.append(run.verdict if run and run.verdict else "-")
                else:
                    value = one.value + measured.value * one.tolerance
                    text = " ".join((digits(value, one.tolerance), one.outcome(value))).strip()
                    cells.append(text + MARKS.get(measured.verdict, ""))
            number = sources.setdefault(one.source, len(sources) + 1)
            known = (digits(one.value, one.tolerance), f"{one.tolerance:.2g}")
            lines.append([scenario.name, f"{one.name} [{number}]", one.unit, *known, *cells])
    heads = ["scene", "value", "unit", "published", "±", *own]
    texts = [f"[{number}] {source}" for source, number in sources.items()]
    return Part(PUBLISHED_TITLE, heads, lines, [PUBLISHED_NOTE, *texts], words=3, tight=True)


def digits(value: float, tolerance: float) -> str:
    """A value to three digits, or to a tenth of its tolerance."""
    if abs(value) < tolerance / 1e3:
        return "0"
    return f"{value:.{max(3, len(f'{abs(value) / tolerance:.0f}') + 1)}g}"
