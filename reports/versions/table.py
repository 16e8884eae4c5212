"""Versions of an engine on the terminal: differences per scene, changed figures, and one sentence each."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rich.console import Console
from rich.text import Text

from touchstone.reports.metrics import METRICS
from touchstone.reports.versions.study import Compared, Difference
from touchstone.reports.views.tables import number, unit_of
from touchstone.reports.views.terminal import print_notes, table_of

SLOWER = 1.05
"""Ratio of times beyond which an interval counts as a change of speed, or its inverse [1]."""
MOST_FIGURES = 20
"""Changed figures that the terminal shows; `changes.csv` has all."""
KINDS = ("worse", "gone", "better", "changed")
FIGURE = ["scenario", "profile", "metric", "subject"]
HEADS = ("scene", "version", "motion [mm]", "worse", "gone", "better", "other", "time", "95 %")
NOTE = (
    "motion: largest distance of a body from its place in the first version; = all states are the same to "
    "the bit. worse, better, other: figures that moved by more than 1 %; gone: figures that it lacks. "
    "time: mean frame over that of the first version"
)


def speed(one: Difference) -> str:
    """`faster`, `slower` or empty: whether the interval of the ratio lies beyond 5 %."""
    if one.time is None:
        return ""
    if one.time.low > SLOWER:
        return "slower"
    return "faster" if one.time.high < 1 / SLOWER else ""


def sentences(found: Compared) -> Iterator[str]:
    """Two lines per version: physics and speed against the first."""
    first, *others = found.results
    for version in others:
        mine = [one for one in found.differences if one.version == version]
        if not mine:
            yield f"{version}: nothing to compare"
            continue
        yield f"{version}: physics: {'; '.join(_physics(found, mine, first))}"
        ratios = [one.time.value for one in mine if one.time is not None]
        if ratios:
            words = [f"{word} in {', '.join(dict.fromkeys(names))}" for word, names in _speeds(mine) if names]
            middle = float(np.exp(np.mean(np.log(ratios))))
            remarks = "; ".join(words) or "no scene is clearly beyond 5 %"
            yield f"{version}: speed: frames take {middle:.2f} times as long as in {first}; {remarks}"


def _physics(found: Compared, mine: list[Difference], first: str) -> Iterator[str]:
    """What changed in the motion and the figures of a version."""
    ended = dict.fromkeys(one.scenario for one in mine if np.isnan(one.motion))
    moved = [one for one in mine if not one.same and one.scenario not in ended]
    yield f"{sum(one.same for one in mine)} of {len(mine)} runs are the same to the bit as in {first}"
    if moved:
        worst = max(moved, key=lambda one: one.motion)
        yield f"motion differs by up to {number(worst.motion * 1e3)} mm ({worst.scenario})"
    kinds = found.figures.kind[found.figures.version == mine[0].version]
    counts = [f"{int((kinds == kind).sum())} {kind}" for kind in KINDS if (kinds == kind).any()]
    if counts:
        yield f"figures: {', '.join(counts)}"
    if ended:
        yield f"did not play to the end: {', '.join(ended)}"


def _speeds(mine: list[Difference]) -> list[tuple[str, list[str]]]:
    return [(word, [one.scenario for one in mine if speed(one) == word]) for word in ("slower", "faster")]


def show(found: Compared, out: Console) -> None:
    """Print the differences, the figures that changed, and the sentences."""
    profiles = list(dict.fromkeys(one.profile for one in found.differences))
    for profile in profiles:
        rows = [one for one in found.differences if one.profile == profile]
        title = f"{found.engine} {profile} against {next(iter(found.results))}"
        table = table_of(title, HEADS, left=2, padding=(0, 0))
        before = ""
        for one in sorted(rows, key=lambda one: _order(rows, one)):
            table.add_row("" if one.scenario == before else one.scenario, *_line(found, one))
            before = one.scenario
        out.print(table)
    if profiles:
        print_notes([NOTE], out)
    _show_figures(found, out)
    for line in sentences(found):
        out.print(line, highlight=False, soft_wrap=True)


def _order(rows: list[Difference], one: Difference) -> int:
    """Place of the scene of a row."""
    return [row.scenario for row in rows].index(one.scenario)


def _line(found: Compared, one: Difference) -> list[Text | str]:
    mine = found.figures[
        (found.figures.version == one.version)
        & (found.figures.scenario == one.scenario)
        & (found.figures.profile == one.profile)
    ]
    counts = [int((mine.kind == kind).sum()) for kind in KINDS]
    motion = "=" if one.same else "ended" if np.isnan(one.motion) else number(one.motion * 1e3)
    style = {"slower": "red", "faster": "green", "": ""}[speed(one)]
    times = (
        (Text(f"{one.time.value:.2f}", style=style), f"{one.time.low:.2f}-{one.time.high:.2f}")
        if one.time
        else ("-", "-")
    )
    return [one.version, motion, *(str(count) if count else "" for count in counts), *times]


def _show_figures(found: Compared, out: Console) -> None:
    """Print the changed figures, the worst first, with the value of every version."""
    changed = found.figures[found.figures.kind.isin(KINDS)].copy()
    changed["order"] = changed.kind.map(KINDS.index)
    changed = changed.sort_values("order", kind="stable").drop_duplicates(FIGURE)
    if not len(changed):
        return
    versions = list(found.results)
    table = table_of("", ("", "scene", "figure", "unit", *versions), left=4, padding=(0, 0))
    table.columns[2].no_wrap = False
    values = found.frame.set_index([*FIGURE, "version"]).value
    for row in changed.head(MOST_FIGURES).to_dict("records"):
        key = tuple(row[name] for name in FIGURE)
        shown = [_shown(key[2], float(values.get((*key, version), np.nan))) for version in versions]
        unit = unit_of(key[2])
        name = f"{key[2]} {key[3]}".strip()
        table.add_row(row["kind"], key[0], name, "" if unit == "1" else unit, *shown)
    out.print(table)
    if len(changed) > MOST_FIGURES:
        print_notes([f"{len(changed) - MOST_FIGURES} more changed figures are in changes.csv"], out)


def _shown(metric: str, value: float) -> str:
    if np.isnan(value):
        return "-"
    shown = METRICS[metric].shown if metric in METRICS else None
    return number(value * (shown[1] if shown else 1.0))
