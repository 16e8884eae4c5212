"""The study `convergence`: errors against truths at seven steps, their order and floor per engine and scene.

Every scene with a truth plays at 30 frames per second at STEPS and at each engine's own step, and on the
reference once more with steps that it does not divide: they tell the order of its law. An engine that is
nearer to the truth than the reference at the same step is a row of its own (`convergence.nearer`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import nan
from pathlib import Path
from typing import Any, Literal

import altair as alt
import numpy as np
import pandas as pd
from rich.text import Text

from touchstone.adapters.registry import ACCURATE, ENGINES
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress, quietly
from touchstone.reports.results import COLUMNS, Row, rows_of, table
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.request import REFERENCE, step_text
from touchstone.reports.runner.sweep import DIVERGED, sweep
from touchstone.reports.runner.tasks import own_profile, own_step
from touchstone.reports.studies.agreement import require_truths, slope_of
from touchstone.reports.studies.convergence.measure import ERROR, FRAME_RATE, WHOLE
from touchstone.reports.studies.study import kept
from touchstone.reports.views.pictures import (
    DASHES,
    DOTS,
    NOTHING,
    PALE,
    Looks,
    by,
    color_of,
    encoded,
    grid,
    log_axis,
    marker_of,
    save,
)
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number
from touchstone.scenarios.catalogue import catalogue, tagged

STUDY = "convergence"
STEPS = tuple(1 / (FRAME_RATE * 2**k) for k in range(7))
"""Native steps of every engine [s]."""
BALANCED = "balanced"
UNDIVIDED = ("contact_turn=0.5",)
"""Settings with which the reference takes whole steps: the largest of the range."""
ORDER, FLOOR, NEARER = "convergence.order", "convergence.floor", "convergence.nearer"
NEAR = 1.02
"""Ratio of errors up to which two engines are equally near to the truth [1]."""
MEASURE = "touchstone.reports.studies.convergence.measure:convergence_error"
SOURCE = "touchstone.reports.studies.convergence.measure:at_frame_rate"
SMOOTH = ("fall", "tumble_unstable", "spring", "incline_slides", "turntable", "shaker_along", "belt")
EVENTS = ("bounce_e05", "collide_sticks", "slip", "slide", "platform_slip", "shaker_across")
"""Default scenes beside the curved ones: one or two of each family, without and with events."""


def scenes() -> tuple[str, ...]:
    """Default scenes; of seeded variants none."""
    curved = (scenario.name for scenario in tagged("curved") if "_seed" not in scenario.name)
    return (*curved, *SMOOTH, *EVENTS)


def columns_of(engines: Iterable[str]) -> list[tuple[str, str]]:
    """(engine, profile) of the study: the reference in two profiles, of which one also takes whole steps, the
    others in their first."""
    ours = (BALANCED, ACCURATE, ACCURATE + WHOLE)
    return [
        (engine, profile)
        for engine in engines
        for profile in (ours if engine == REFERENCE else (own_profile(engine),))
    ]


def _step(engine: str, profile: str) -> float:
    return own_step(engine, profile.removesuffix(WHOLE))


def cells(names: Sequence[str], engines: Sequence[str]) -> list[Cell]:
    """All cells, scene by scene."""
    require_truths((catalogue()[name] for name in names), "truth")
    return [
        Cell(name, engine, plain, dt, changes, effects=True, measure=MEASURE, source=SOURCE)
        for name in names
        for engine, profile in columns_of(engines)
        for plain, changes in [(profile.removesuffix(WHOLE), UNDIVIDED if profile.endswith(WHOLE) else ())]
        # all effects: at coarse steps bodies leave a plan's bounds
        for dt in dict.fromkeys((*STEPS, _step(engine, profile)))
    ]


EXACT = 1e-10
"""Error that counts as none, over the scene's size [1]: what the truths' integrations leave open."""
ABOVE = 3.0
"""Ratio to the floor above which an error tells an order [1]: at most a third of it is floor."""
LEAST_POINTS = 3
"""Steps that an order needs: with two there is no interval."""
FALLING = 0.25
"""Order between the two finest steps above which the error still falls [1]."""
Kind = Literal["order", "exact", "flat", "few"]


@dataclass(frozen=True, slots=True)
class Order:
    """Order of convergence with its interval, and the floor: the error at the finest step.

    kind: `exact`: no error is above EXACT. `order`: LEAST_POINTS errors or more are above the floor. `flat`:
    none is. `few`: too few are.
    """

    kind: Kind
    floor: float
    falls: bool  # whether the finest step still lowers the error
    value: float = nan
    low: float = nan
    high: float = nan


def order_of(steps: Sequence[float], errors: Sequence[float]) -> Order:
    """Least squares of log error over log step, over the steps above the floor, with Student's interval.

    Args:
        steps: two or more, in any order [s].
        errors: finite.
    """
    order = np.argsort(steps)[::-1]
    h, e = np.array(steps)[order], np.array(errors)[order]
    floor = float(e[-1])
    if e.max() <= ABOVE * EXACT:
        return Order("exact", floor, False)
    falls = bool(EXACT < floor < e[-2] * (h[-1] / h[-2]) ** FALLING)
    clear = e > ABOVE * max(floor, EXACT)
    if clear.sum() < LEAST_POINTS:
        return Order("few" if clear.any() else "flat", floor, falls)
    return Order("order", floor, falls, *slope_of(h[clear], e[clear]))


def run(
    asked: Sequence[Cell], store: Path, out: Path, progress: Progress = quietly, jobs: int | None = None
) -> pd.DataFrame:
    """Measure what the store lacks; the folder `out` appears complete or not at all."""
    with output_folder(out) as folder:
        measured = sweep(asked, store, jobs=jobs, progress=progress)
        # a run that diverges at a coarse step is a measurement, not a fault
        measured.loc[measured.outcome == DIVERGED, "verdict"] = ""
        errors = measured[measured.metric.isin((ERROR, "run"))][list(COLUMNS)].assign(study=STUDY)
        frame = pd.concat([errors, table(findings(errors))], ignore_index=True)
        facts = {"study": STUDY, "store": str(store), "steps": STEPS, "frame_rate": FRAME_RATE}
        return kept(frame, folder, facts, {"convergence.png": draw})


def findings(errors: pd.DataFrame) -> Iterator[Row]:
    """Order and floor of every engine and profile per scene, and where another is nearer to the truth."""
    for scenario, scene in errors[errors.metric == ERROR].groupby("scenario", sort=False):
        ladder = scene[scene.dt.isin(STEPS)]
        for (engine, profile), part in ladder.groupby(["engine", "profile"], sort=False):
            names = str(scenario), str(engine), str(profile)
            base = Row(STUDY, *names, _step(*names[1:]), ORDER)
            if len(part) < 2:
                continue
            found = order_of(part.dt.to_list(), part.value.to_list())
            base = replace(base, unit="1", reason_code=found.kind)
            yield replace(base, value=found.value, low=found.low, high=found.high)
            yield replace(base, metric=FLOOR, value=found.floor, reason="still falls" if found.falls else "")
        first = ladder[(ladder.engine == REFERENCE) & (ladder.profile == BALANCED)]
        for ours, theirs in product(rows_of(first), rows_of(ladder)):
            ratio = ours.value / max(theirs.value, EXACT)
            if theirs.dt == ours.dt and theirs.engine != REFERENCE and ratio > NEAR:
                numbers = f"{number(theirs.value)} beside {number(ours.value)} at {step_text(ours.dt)} s"
                yield replace(ours, metric=NEARER, subject=theirs.engine, value=ratio, reason=numbers)


HEADS = ("engine", "own step\n[s]", "error", "order\n(95 % interval)", "floor", "nearer than\nthe reference")
TOTALS = (
    *("engine", "scenes", "exact", "flat", "order: median\n(least to largest)", "median\nfloor"),
    *("largest\nfloor", "nearer in"),
)
NOTES = (
    "error: largest over bodies and frames at the own step, over the scene's size",
    f"order: over those of the steps {step_text(STEPS[0])} to {step_text(STEPS[-1])} s whose error exceeds "
    f"{ABOVE:g} floors; unclear: its interval is wider than 4",
    "= exact at every step   flat: no such step   few: one or two such steps",
    "floor: error at the finest step; < it still falls there",
    f"{WHOLE.strip()}: not divided where curved contacts turn far",
    "! nearer to the truth than the reference (balanced) at so many of the steps, by which factor at most",
)
UNCLEAR = 2.0
"""Half width of an order's interval above which no order is printed [1]."""


def report(frame: pd.DataFrame) -> list[Part]:
    """One block per scene, the totals per engine, and what did not end."""
    blocks: list[list[str | Text]] = []
    for scenario, scene in frame[frame.metric != "run"].groupby("scenario", sort=False):
        blocks.append([str(scenario)])
        for order in rows_of(scene[scene.metric == ORDER]):
            lost = _lost(scene, order.engine)
            style = "bold red" if len(lost) else ""
            blocks.append([Text(cell, style=style) for cell in _cells(order, scene, lost)])
    totals = []
    for engine, profile in columns_of(ENGINES):
        mine = frame[(frame.engine == engine) & (frame.profile == profile)]
        if orders := rows_of(mine[mine.metric == ORDER]):
            lost = _lost(frame, engine)
            totals.append([f"{engine} {profile}", *_totals(orders, mine[mine.metric == FLOOR], lost)])
    lines = []
    for _, part in frame[frame.metric == "run"].groupby(["scenario", "engine", "reason"], sort=False):
        row, steps = rows_of(part)[0], " ".join(map(step_text, sorted(set(part.dt), reverse=True)))
        verdict = f"{row.verdict}: " if row.verdict else ""
        lines.append(f"{verdict}{row.scenario}: {row.reason} ({row.engine} at {steps} s)")
    return [
        Part("convergence: errors against truths at seven steps", HEADS, blocks),
        Part("order and floor over all scenes", TOTALS, totals),
        Part(notes=NOTES, lines=lines),
    ]


def _lost(frame: pd.DataFrame, engine: str) -> pd.DataFrame:
    """Rows of the steps at which an engine is nearer to the truth than the reference's first profile."""
    return frame[(frame.metric == NEARER) & (frame.subject == engine)]


def _cells(order: Row, scene: pd.DataFrame, lost: pd.DataFrame) -> list[str]:
    mine = scene[(scene.engine == order.engine) & (scene.profile == order.profile)]
    own = mine[(mine.metric == ERROR) & (mine.dt == order.dt)].value
    floor = rows_of(mine[mine.metric == FLOOR])[0]
    return [
        f"{order.engine} {order.profile}",
        step_text(order.dt),
        _number(own.iloc[0]) if len(own) else "-",
        _order(order),
        ("< " if floor.reason else "") + _number(floor.value),
        f"! {len(lost)} of {len(STEPS)}, {number(lost.value.max())}" if len(lost) else "",
    ]


def _totals(orders: list[Row], floors: pd.DataFrame, lost: pd.DataFrame) -> list[str]:
    clear = pd.Series([row.value for row in orders if row.reason_code == "order" and not _wide(row)])
    return [
        str(len(orders)),
        *(str(sum(row.reason_code == kind for row in orders)) for kind in ("exact", "flat")),
        _range(clear.median(), clear.min(), clear.max()) if len(clear) else "-",
        _number(floors.value.median()),
        _number(floors.value.max()),
        str(lost.scenario.nunique() or ""),
    ]


def _order(row: Row) -> str:
    if row.reason_code != "order":
        return "=" if row.reason_code == "exact" else row.reason_code
    return "unclear" if _wide(row) else _range(row.value, row.low, row.high)


def _range(*values: float) -> str:
    """A value and its range; rounded to 0, it has no sign."""
    value, low, high = (round(x, 2) + 0.0 for x in values)
    return f"{value:.2f} ({low:.2f} to {high:.2f})"


def _wide(row: Row) -> bool:
    return row.high - row.low > 2 * UNCLEAR


def _number(value: float) -> str:
    return "0" if value <= EXACT else number(value)


ACROSS = 5
BOTTOM, TOP = 1e-11, 10.0
"""Errors beyond are drawn at these values, over the scene's size [1]: rounding; the motion is lost."""
GUIDE = 0.3
"""Error at the coarsest step from which the lines of slopes 1 and 2 start [1]."""


def draw(frame: pd.DataFrame, path: Path) -> None:
    """Draw errors over steps: large at the engine's own step, grey below EXACT."""
    errors = frame[frame.metric == ERROR]
    lines = list(dict.fromkeys(zip(errors.engine, errors.profile)))
    own = [dt == _step(*line) for *line, dt in errors[["engine", "profile", "dt"]].to_numpy().tolist()]
    names = errors.engine + " " + errors.profile
    errors = errors.assign(line=names, own=own, drawn=errors.value.clip(BOTTOM, TOP))
    colors, markers = ([look(engine) for engine, _ in lines] for look in (color_of, marker_of))
    looks = encoded(colors, markers, list(map(" ".join, lines)), "line")
    patterns = {ACCURATE: DASHES, ACCURATE + WHOLE: DOTS}
    dashes = {" ".join(line): patterns.get(line[1], [1, 0]) for line in lines}
    dash = by(alt.StrokeDash, "line", dashes, legend=alt.Legend(symbolStrokeWidth=0))
    scenes = list(dict.fromkeys(errors.scenario))
    panels = [_panel(errors[errors.scenario == scene], str(scene), looks, dash) for scene in scenes]
    note = f"large: own step; dashed: {ACCURATE}, dotted: in whole steps; thin: slopes 1, 2; grey: exact"
    save(grid(panels, ACROSS), path, "Error over the step", note)


def _panel(part: pd.DataFrame, scenario: str, looks: Looks, dash: Any) -> Any:
    low, high = STEPS[-1], STEPS[0]
    text = {"values": STEPS[::2], "labelExpr": "'1/' + round(1 / datum.value)"}
    x = log_axis(alt.X, "dt", "step [s]", (low / 1.3, high * 1.3), **text)
    y = log_axis(alt.Y, "drawn", "error over the scene's size", (BOTTOM / 3, TOP * 3))
    feet = [(dt, GUIDE * (dt / high) ** slope, slope) for slope in (1, 2) for dt in (low, high)]
    guides = pd.DataFrame(feet, columns=["dt", "drawn", "slope"])
    ladder, own = alt.Chart(part[part.dt.isin(STEPS)]).encode(x=x, y=y), alt.Chart(part[part.own])
    drawn = (
        alt.Chart(NOTHING).mark_rect(color="#f3f3f3").encode(y=alt.datum(BOTTOM / 3), y2=alt.datum(EXACT))
        + alt.Chart(guides).mark_line(color=PALE, strokeWidth=0.7).encode(x=x, y=y, detail="slope:N")
        + ladder.mark_line(strokeWidth=1.1).encode(color=looks["color"], strokeDash=dash)
        + ladder.mark_point(filled=True, size=9, opacity=1).encode(**looks)
        + own.mark_point(size=45, fill="white", opacity=1).encode(x=x, y=y, **looks)
    )
    return drawn.properties(title=scenario, width=140, height=120)
