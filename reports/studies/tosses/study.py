"""The study `reality tosses`: every engine plays measured tosses from their fitted start.

Half of the tosses identify e and mu of each engine, the other half judges it. Beside the engines stand the
noise of tracking, what an engine makes of the error of the fitted start, and the floor: what the reference
leaves if each toss may choose its own e and mu.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace
from math import ceil, nan
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import monotonic
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import ENGINES, installed
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.machine import machine, origin
from touchstone.reports.output_folder import output_folder
from touchstone.reports.page.html import Content
from touchstone.reports.page.page import page
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.request import EVERY_ENGINE
from touchstone.reports.runner.tasks import PROCESSES, played
from touchstone.reports.studies.study import Column, RefusedError, failures, kept, missing_rows, with_interval
from touchstone.reports.studies.tosses.measured import Box, Toss
from touchstone.reports.studies.tosses.playing import (
    NEAR_FRICTIONS,
    NEAR_RESTITUTIONS,
    ROUNDING,
    Errors,
    Flown,
    Identification,
    Identified,
    Motion,
    Table,
    drawn,
    first_impact,
    flights,
    play,
)
from touchstone.reports.views.matrix import GOOD, WARN
from touchstone.reports.views.pictures import (
    DASHES,
    DOTS,
    INK,
    NOTHING,
    PALE,
    axis,
    by,
    color_of,
    grid,
    log_axis,
    rule,
    save,
)
from touchstone.reports.views.render import Part, markdown
from touchstone.reports.views.tables import number

PANELS = (
    ("tosses.position", "error of position [widths]", 1.0),
    ("tosses.rotation", "error of rotation [degrees]", 180 / np.pi),
)
"""Metric, label and factor of a panel."""
BAND = "#d9e6f2"
FLOOR_NAME, START_NAME = "best e and mu of each toss", "reference, start off by its error"
OWN = ", start within its error"
"""Ending of the profile under which an engine is compared with itself from another start."""
BARS = 0.015
"""Distance of the bars of quartiles, over the width of a panel [1]."""


def errors_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw medians over the judged tosses, quartiles at rest; the floor; what an error of the start makes of
    the reference; and the noise of tracking."""
    panels = [_panel(frame[frame.metric == metric], label, factor) for metric, label, factor in PANELS]
    note = "median over tosses that identified neither e nor mu; bars: quartiles at rest; blue: tracking"
    save(grid(panels, 2), path, "Measured tosses: how far each engine is from what happened", note, size=10)


def _panel(rows: pd.DataFrame, label: str, factor: float) -> Any:
    rows = rows.assign(**{name: factor * rows[name] for name in ("low", "value", "high")})
    noise = float(rows[rows.engine == "tracking"].value.iloc[0])
    engines = [name for name in dict.fromkeys(rows.engine) if name in ENGINES]
    heads = {(name, False): name for name in engines}
    heads |= {("floor", False): FLOOR_NAME, ("reference", True): START_NAME}
    own = rows.profile.str.endswith(OWN)
    rows = rows.assign(engine=[heads.get(one, "") for one in zip(rows.engine, own)])
    lines = rows[(rows.subject != "") & (rows.engine != "")]
    lines = lines.assign(time=lines.subject.str.removesuffix(" s").astype(float))
    last = float(lines.time.max())
    bars = lines[(lines.time == last) & lines.engine.isin(engines)]
    bars = bars.assign(time=[last * (1 + BARS * k) for k in range(1, len(bars) + 1)])
    colors = {name: color_of(name) for name in engines} | {FLOOR_NAME: INK, START_NAME: PALE}
    dashes = {name: [1, 0] for name in engines} | {FLOOR_NAME: DASHES, START_NAME: DOTS}
    color, dash = by(alt.Color, "engine", colors), by(alt.StrokeDash, "engine", dashes)
    span = (float(lines.time.min()), last * (1 + BARS * (len(bars) + 1)))
    x = axis(alt.X, "time", "time after the first impact [s]", span, grid=False, tickCount=6)
    y = log_axis(alt.Y, "value", label, (noise / 3, float(lines.high.max())))
    spread = alt.Chart(bars).mark_rule(strokeWidth=4, strokeOpacity=0.4)
    drawn = (
        alt.Chart(NOTHING).mark_rect(color=BAND).encode(y=alt.datum(noise / 3), y2=alt.datum(noise))
        + alt.Chart(lines).mark_line(strokeWidth=2.2).encode(x=x, y=y, color=color, strokeDash=dash)
        + spread.encode(x=x, y="low:Q", y2="high:Q", color=color)
    )
    return (drawn + rule([], x=0)).properties(width=340, height=250)


STUDY, TOSSES, PICTURE = "reality tosses", "tosses", "tosses.png"
POSITION, ROTATION, IMPACT = f"{TOSSES}.position", f"{TOSSES}.rotation", f"{TOSSES}.impact"
FACE, CORNERS = f"{TOSSES}.face", f"{TOSSES}.corners"
TIMES = (f"{TOSSES}.wall", f"{TOSSES}.processor")
"""Time that all engines take together, and that of their processes [s]."""
REFERENCE: Column = ("reference", "balanced")
"""Column whose floor is measured."""
FLOOR, TRACKING = "floor", "tracking"
"""Names, beside the engines, of the floor and of what is measured."""
BEFORE, GRID = 0.05, 0.01
"""Time before the first impact from which errors are reported, and their steps [s]."""
AFTER_REST = 0.1
"""Time for which a toss at rest is compared [s]."""
CELLS = (1 + len(NEAR_RESTITUTIONS)) * len(NEAR_FRICTIONS)
DEGREES = 180 / np.pi
SHOWN = 0.1
"""Time after the first impact whose errors the table shows [s]."""


def tasks(columns: Sequence[Column]) -> list[Column]:
    """The columns of installed engines."""
    return [column for column in columns if installed(column[0])]


def run(
    columns: Sequence[Column], box: Box, tosses: Sequence[Toss], out: Path, progress: Progress
) -> pd.DataFrame:
    """Identify and judge all engines; the folder appears complete or not at all."""
    table, flown, rows = prepared(box, tosses)
    training, judged = flown[::2], flown[1::2]
    if not judged:
        raise RefusedError(f"tosses with a flight and an impact: {len(flown)}, expected 2 or more")
    asked = [
        Identification(one[0], settings(one, table.rate), table, training, judged, floor=one == REFERENCE)
        for one in tasks(columns)
    ]
    with output_folder(out) as folder:
        began = monotonic(), getrusage(RUSAGE_CHILDREN).ru_utime
        found = played(play, asked, folder / "output", progress)
        taken = monotonic() - began[0], getrusage(RUSAGE_CHILDREN).ru_utime - began[1]
        base = Row(STUDY, TOSSES, EVERY_ENGINE, "", nan, "run")
        rows += [replace(base, metric=name, value=value, unit="s") for name, value in zip(TIMES, taken)]
        for task, one in zip(asked, found):
            rows += rows_of_task(task, one)
        facts = {
            "study": STUDY,
            "tosses": [toss.name for toss in tosses],
            "body": {"half_extents": box.half_extents, "mass": box.mass, "inertia": box.inertia},
            "table height [m]": table.floor,
        }
        return kept(
            [*missing_rows(STUDY, columns), *rows],
            folder,
            facts,
            {PICTURE: errors_picture, "report.md": text, "report.html": page_of} if asked else {},
        )


def prepared(box: Box, tosses: Sequence[Toss], seed: int = 0) -> tuple[Table, list[Flown], list[Row]]:
    """What all plays share, the tosses from their flight on, and rows of what tracking shows: its noise, as
    the length of a vector, and tosses without an impact."""
    found, noise = flights(box, tosses)
    base = Row(STUDY, TOSSES, TRACKING, "", nan, "run")
    rng, flown, rows = np.random.default_rng(seed), [], []
    for toss, flight in zip(tosses, found):
        end = int(np.searchsorted(toss.time, toss.time[toss.rest - 1] + AFTER_REST))
        part = slice(flight.first, end)
        time = toss.time[part] - toss.time[flight.first]
        tracked = Motion(time, toss.position[part], toss.orientation[part])
        impact = first_impact(time, tracked.position[:, 2], flight.start, noise[0])
        if impact == impact:
            flown.append(Flown(flight.start, drawn(box, flight, noise, rng), tracked, impact))
        else:
            reason = f"toss {toss.name}: its height shows no impact"
            rows.append(replace(base, verdict="skipped", reason=reason))
    for metric, value, unit in ((POSITION, noise[0] / box.width, "1"), (ROTATION, noise[1], "rad")):
        rows.append(replace(base, metric=metric, value=float(np.sqrt(3) * value), unit=unit))
    halves = [np.abs(toss.orientation[-1].as_matrix()[2]) @ box.half_extents for toss in tosses]
    floor = float(np.median([toss.position[-1, 2] - half for toss, half in zip(tosses, halves)]))
    rate = max(round(1 / float(np.median(np.diff(toss.time)))) for toss in tosses)
    return Table(box, floor, float(noise[0]), rate), flown, rows


def settings(column: Column, rate: int) -> Settings:
    """Settings of a column at the largest step that divides a frame and is no larger than its own."""
    engine, profile = column
    own = ENGINES[engine].profiles[profile]
    return Settings(profile, 1 / rate / ceil(1 / rate / own - ROUNDING))


def rows_of_task(task: Identification, found: Identified | Ended) -> list[Row]:
    """Rows of an engine, of its plays from the drawn starts, and of the floor."""
    base = Row(STUDY, TOSSES, task.engine, task.settings.profile, task.settings.dt, "run")
    if isinstance(found, Ended):
        return [replace(base, verdict=found.status, reason=found.reason)]
    width = task.table.box.width
    numbers = (("e", found.cell[0]), ("mu", found.cell[1]), ("training", found.distance / width))
    rows = [replace(base, metric=f"{TOSSES}.{name}", value=value, unit="1") for name, value in numbers]
    rows += error_rows(base, found.errors, width)
    rows += error_rows(replace(base, profile=base.profile + OWN), found.drawn, width)
    return rows + (
        error_rows(replace(base, engine=FLOOR, profile=""), found.floor, width) if found.floor else []
    )


def error_rows(base: Row, several: Sequence[Errors], width: float) -> list[Row]:
    """Median and quartiles over tosses of each error: over time, of the rest pose, of the impact; the mean of
    the corners' distance; positions over the box' width."""
    grid = np.arange(round(-BEFORE / GRID), round(max(one.time[-1] for one in several) / GRID) + 1) * GRID
    rows = []
    for metric, unit, size, values in (
        (POSITION, "1", width, [one.position for one in several]),
        (ROTATION, "rad", 1.0, [one.rotation for one in several]),
    ):
        over = [np.interp(grid, one.time, value, left=nan) / size for one, value in zip(several, values)]
        row = replace(base, metric=metric, unit=unit)
        rows += [
            with_interval(replace(row, subject=f"{t:.2f} s"), _quartiles(column))
            for t, column in zip(grid, np.transpose(over))
        ]
        rest = replace(row, metric=f"{metric}.rest")
        rows.append(with_interval(rest, _quartiles([value[-1] / size for value in values])))
    rows.append(
        with_interval(replace(base, metric=IMPACT, unit="s"), _quartiles([one.delay for one in several]))
    )
    for metric, value in (
        (FACE, np.mean([one.same_face for one in several])),
        (CORNERS, np.mean([one.corners for one in several]) / width),
    ):
        rows.append(replace(base, metric=metric, unit="1", value=float(value)))
    return rows


def _quartiles(values: ArrayLike) -> tuple[float, float, float]:
    """Median and quartiles of the finite values."""
    low, middle, high = np.nanquantile(np.asarray(values, dtype=float), (0.25, 0.5, 0.75)).tolist()
    return middle, low, high


HEADS = ("", "e", "mu", "fit", "judged", "0.1 s", "[deg]", "rest", "[deg]", "start", "face", "impact [ms]")
NOTES = (
    "e, mu: identified on one half of the tosses. fit, judged: mean distance of the corners after the first "
    "impact, there and on the other half. Medians over that half: error of position and rotation 0.1 s after "
    "the impact and at rest; start: distance at rest of a play from another start that fits the flight as "
    "well; delay of the impact. face: share of tosses that rest on the right face. Lengths are in widths.",
    f"floor: the reference, for each toss with the best of {CELLS} e and mu. tracking: noise in free flight.",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per engine, the floor and the noise."""
    rows = []
    values = {(row.engine, row.profile, row.metric, row.subject): row.value for row in rows_of(frame)}
    columns = dict.fromkeys(
        (engine, profile) for engine, profile, _, _ in values if not profile.endswith(OWN)
    )

    for column in columns:
        at = f"{SHOWN:.2f} s" if column[0] != TRACKING else ""
        drawn = (column[0], column[1] + OWN)
        wanted = (
            *((column, f"{TOSSES}.{name}", "", 1) for name in ("e", "mu", "training", "corners")),
            (column, POSITION, at, 1),
            (column, ROTATION, at, DEGREES),
            (column, f"{POSITION}.rest", "", 1),
            (column, f"{ROTATION}.rest", "", DEGREES),
            (drawn, f"{POSITION}.rest", "", 1),
            (column, FACE, "", 1),
            (column, IMPACT, "", 1e3),
        )
        found = [factor * values.get((*key, metric, at), nan) for key, metric, at, factor in wanted]
        if not np.isnan(found).all():
            rows.append([" ".join(column), *("" if one != one else number(one) for one in found)])
    engines = {engine for engine, *_ in values if engine in ENGINES}
    wall, own = (values.get((EVERY_ENGINE, "", name, ""), nan) for name in TIMES)
    took = (
        f"{len(engines)} engines took {wall:.0f} s, {own:.0f} s of processor time in {PROCESSES} processes."
    )
    return [Part("Against measurements", HEADS, rows, (*NOTES, took), picture=PICTURE), failures(frame)]


def text(frame: pd.DataFrame, path: Path) -> None:
    """Write `report.md`."""
    lines = [f"# touchstone {STUDY}", *(line for part in report(frame) for line in markdown(part))]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def page_of(frame: pd.DataFrame, path: Path) -> None:
    """Write `report.html`, with the picture beside `path`."""
    (measured, rest), facts = report(frame), origin()
    ends = [row for row in rows_of(frame[frame.metric == f"{POSITION}.rest"]) if row.engine in ENGINES]
    found = [f"{one.engine} {number(one.value)}" for one in ends if not one.profile.endswith(OWN)]
    content = Content(
        f"touchstone {STUDY}",
        WARN if rest.lines else GOOD,
        f"Widths from where the box came to rest, median: {', '.join(found)}.",
        frame[:0],
        command=facts.pop("command"),
        identity=[*machine().items(), *facts.items()],
        measured=measured,
        picture=base64.b64encode((path.parent / PICTURE).read_bytes()).decode(),
    )
    path.write_text(page(content), "utf-8")
