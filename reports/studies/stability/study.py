"""The study `stability`: how far each engine goes in each kind of difficulty before it fails, and how.

A sweep plays the cells: hard scenes (`scenarios.difficulty`) on every engine, profile and step. Its store
holds what was measured, so that an interrupted study goes on. Independent oracles judge each run
(`reports.verdict.outcomes`). `cells.csv` has one line per cell with the command that plays it; the store
keeps the recordings of failed runs in `output/failed/`. Cells drawn at random may be played again and shown
as pictures, to be judged by eye: these do not tell the classes, `sheet.csv` does, by number, with the
commands.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from math import nan
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.workers.scratch import scratch_folder
from touchstone.reports.exports import piece_mesh
from touchstone.reports.metrics.context import Context
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import CONSTRUCTION, Row, illustrate, rows_of, write_beside
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.tasks import own_step
from touchstone.reports.studies.stability.play import (
    KEPT,
    OUTCOME,
    Played,
    Scope,
    file_of,
    levels_of,
    play_all,
    recordings_in,
    steps_of,
)
from touchstone.reports.studies.study import Column, failures, kept, missing_rows
from touchstone.reports.verdict.figures import rotations
from touchstone.reports.verdict.outcomes import HARD_CLASSES, SILENT, SURVIVED
from touchstone.reports.views.pictures import INK, NOTHING, PALE, axis, by, grid, log_axis, save
from touchstone.reports.views.render import Part
from touchstone.scenarios.difficulty.family import Family, hard_names, hard_scene, level_text
from touchstone.scenarios.scenario import Scenario

PER_SHEET = 20
UNSEEN = ("skipped", "error")
"""Classes of cells that have no recording."""


def drawn(played: Mapping[Cell, Played], count: int, seed: int) -> list[Cell]:
    """Cells with a run, each as likely as any other."""
    seen = [cell for cell, found in played.items() if found.outcome.name not in UNSEEN]
    order = np.random.default_rng(seed).permutation(len(seen))
    return [seen[k] for k in order[:count].tolist()]


def write_sheets(
    played: Mapping[Cell, Played], count: int, seed: int, folder: Path, progress: Progress
) -> pd.DataFrame:
    """Play cells drawn at random again, and write `sheet-1.png`, ... and `sheet.csv` into `folder`.

    Returns:
        One row per cell: number, scene, engine, profile, step [s], class, reason and command.
    """
    cells = drawn(played, count, seed)
    shown, rows = [], []
    with scratch_folder() as scratch:
        with recordings_in(KEPT, scratch / "recordings"):
            again = play_all(cells, scratch / "store", progress)
        for number, cell in enumerate(cells, 1):
            path = scratch / "recordings" / file_of(cell)
            title = f"{number}  {cell.scenario.removeprefix('hard_')}, 1/{round(1 / cell.dt)} s"
            shown.append((title, hard_scene(cell.scenario)[0], load(path) if path.exists() else None))
            found, facts = again[cell].outcome, (number, cell.scenario, cell.engine, cell.profile, cell.dt)
            rows.append((*facts, found.name, found.reason, again[cell].line))
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(0, len(shown), PER_SHEET):
        part = shown[k : k + PER_SHEET]
        write_beside(folder / f"sheet-{k // PER_SHEET + 1}.png", partial(sheet_picture, part))
    columns = ["number", "scene", "engine", "profile", "dt", "outcome", "reason", "command"]
    frame = pd.DataFrame(rows, columns=columns)
    write_beside(folder / "sheet.csv", lambda part: frame.to_csv(part, index=False))
    return frame


ACROSS = 4
MOMENTS = ("start", "middle", "end")
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
FIXED = "#D9D9D9"
QUANTITIES = {"speed [m/s]": "#0072B2", "turn [rad/s]": "#009E73", "overlap [m]": "#D55E00"}
FLOOR, LEAST = 1e-12, 1e-10
"""Least value of a series, and the lower end of its axis."""
MOMENT = 90
"""Side of the picture of a moment [point]."""
MOST_WINDOW = 12.0
"""Width of a window that holds all of the motion, over that of the bodies at the start, at most [1]."""
TINY = 1e-12
"""Least size of what is drawn [m]."""


def sheet_picture(shown: Sequence[tuple[str, Scenario, Recording | None]], path: Path) -> None:
    """Draw runs by their title in rows of ACROSS: three moments above, overlap and speed over time below."""
    cells = []
    for title, scenario, recording in shown:
        if recording is None:
            cell = alt.Chart(NOTHING).mark_text().encode(text=alt.value("no recording"))
        else:
            moments = alt.hconcat(*_moments(scenario, recording), spacing=5)
            cell = alt.vconcat(moments, _series(Context(recording, scenario)), spacing=5)
        cells.append(cell.properties(title=title))
    save(grid(cells, ACROSS), path, size=6)


def _moments(scenario: Scenario, run: Recording) -> list[Any]:
    """Draw the bodies in the plane of z and the axis along which they move more.

    The window holds all of the motion; where it is too wide for that, each follows the bodies at its moment.
    """
    moving = [k for k, body in enumerate(scenario.bodies) if body.kind != "fixed"]
    last = len(run.time) - 1
    frames = (0, last // 2, last)
    shapes = [
        np.concatenate([run.position[f, moving], *(p for k in moving for p in _pieces(scenario, run, k, f))])
        for f in frames
    ]
    size = max(float(np.ptp(shapes[0], axis=0).max()), TINY)
    places = run.position[:, moving]
    seen = [shape[np.isfinite(shape).all(axis=1)] for shape in shapes]
    seen.append(places[np.isfinite(places).all(axis=2)])
    path = np.concatenate(seen)
    ways = np.ptp(path, axis=0)
    plane = [0 if ways[0] >= ways[1] else 1, 2]
    follows = ways.max() > MOST_WINDOW * size
    panels = []
    for frame, moment, shape in zip(frames, MOMENTS, seen):
        held = shape if follows and len(shape) else path
        x, z = (held.min(axis=0) + held.max(axis=0))[plane] / 2
        extent = float(np.ptp(held, axis=0)[plane].max())
        half = 0.6 * max(min(extent, MOST_WINDOW * size), 2 * size if follows else 0.0, TINY)
        below = f"{moment}, {run.time[frame]:.3g} s" + f" of {scenario.duration:.3g} s" * (moment == "end")
        above = [f"{2 * half:.2g} m wide"]
        if follows and len(shape):
            above.append("at {:+.2g}, {:+.2g} m".format(*(shape.mean(axis=0) - seen[0].mean(axis=0))[plane]))
        sides = ((alt.X, "x", (x - half, x + half)), (alt.Y, "z", (z - half, z + half)))
        across, up = (axis(*side[:2], None, side[2], labels=False, ticks=False, grid=False) for side in sides)
        hue, opacity = alt.Fill("color:N", scale=None), alt.FillOpacity("opacity:Q", scale=None)
        borders = alt.Chart(_borders(scenario, run, frame, plane))
        drawn = borders.mark_line(clip=True, interpolate="linear-closed", stroke=INK, strokeWidth=0.4).encode(
            x=across, y=up, detail="piece:N", order="corner:Q", fill=hue, fillOpacity=opacity
        )
        for text, place, look in (
            (below, (3, MOMENT - 3), {"align": "left", "baseline": "bottom"}),
            (above, (MOMENT - 3, 3), {"align": "right", "baseline": "top"}),
        ):
            words = alt.Chart(NOTHING).mark_text(color=INK, fontSize=6, text=text, **look)
            drawn += words.encode(x=alt.value(place[0]), y=alt.value(place[1]))
        panels.append(drawn.properties(width=MOMENT, height=MOMENT))
    return panels


def _borders(scenario: Scenario, run: Recording, frame: int, plane: Sequence[int]) -> pd.DataFrame:
    """Corners of the convex hull of every projected piece, in turn."""
    rows = []
    for k, body in enumerate(scenario.bodies):
        fixed = body.kind == "fixed"
        for j, piece in enumerate(_pieces(scenario, run, k, frame)):
            points = piece[:, plane]
            if not np.isfinite(points).all() or np.abs(points).max() > 1e9:
                continue
            with suppress(QhullError):
                points = points[ConvexHull(points).vertices]
            look = (f"{k} {j}", FIXED if fixed else COLORS[k % len(COLORS)], 1.0 if fixed else 0.55)
            rows += [(*look, corner, *point) for corner, point in enumerate(points.tolist())]
    return pd.DataFrame(rows, columns=["piece", "color", "opacity", "corner", "x", "z"])


def _series(context: Context) -> Any:
    """Draw the deepest overlap, the largest speed and the largest rate of rotation over time."""
    run = context.recording
    moving = [k for k, kind in enumerate(context.kind) if kind != "fixed"]
    with np.errstate(all="ignore"):
        lines = {
            "speed [m/s]": np.linalg.norm(run.linear_velocity[:, moving], axis=2).max(axis=1),
            "turn [rad/s]": np.linalg.norm(run.angular_velocity[:, moving], axis=2).max(axis=1),
        }
        usable = np.isfinite(run.position).all() and rotations(context)
        if usable and next(context.scenario.touching_pairs(), None) is not None:
            lines["overlap [m]"] = context.distances.overlap()
    table = pd.DataFrame({"time": run.time} | lines).melt("time", var_name="quantity")
    table["value"] = table.value.where(np.isfinite(table.value)).clip(FLOOR, 1e15)
    x = axis(alt.X, "time", None, (0, run.time[-1]), grid=False)
    y = log_axis(alt.Y, "value", None, (LEAST, max(1.0, float(table.value.max()))))
    drawn = alt.Chart(table).mark_line(strokeWidth=0.9)
    drawn = drawn.encode(x=x, y=y, color=by(alt.Color, "quantity", QUANTITIES))
    return drawn.properties(width=3 * MOMENT + 10, height=MOMENT / 2)


def _pieces(scenario: Scenario, run: Recording, body: int, frame: int) -> list[Array]:
    """World points (n, 3) [m] on the surface of each of a body's pieces in a frame."""
    turn = run.orientation[frame, body]
    usable = np.isfinite(turn).all() and np.linalg.norm(turn) > 0
    turned = Rotation.from_quat(turn, scalar_first=True) if usable else Rotation.identity()
    corners = (piece_mesh(piece)[0] for piece in scenario.bodies[body].pieces)
    return [turned.apply(own) + run.position[frame, body] for own in corners]


STUDY = "stability"
LEVELS, STEP, CONTAINED = (f"{STUDY}.{name}" for name in ("survived", "largest_step", "contained"))
REFERENCE = "reference"
JUDGED = ("balanced", "accurate")
"""Profiles of the reference that must not fail silently."""
SHOWN = ("default", "recommended")
LEAST_CONTAINED = 0.8
"""Share of the families in which the reference's envelope must contain that of every engine [1]."""


@dataclass(frozen=True)
class Envelope:
    """Cells of a study with their outcomes."""

    scope: Scope
    played: dict[Cell, Played]

    @cached_property
    def names(self) -> dict[tuple[str, str, str, float], str]:
        """Classes by scene, engine, profile and step."""
        return {(c.scenario, c.engine, c.profile, c.dt): p.outcome.name for c, p in self.played.items()}

    @property
    def columns(self) -> list[Column]:
        """Columns that were played."""
        return list(dict.fromkeys((cell.engine, cell.profile) for cell in self.played))

    @cached_property
    def shown(self) -> dict[Column, str]:
        """Columns that are shown, with their heads."""
        quick, families = self.scope.quick, self.scope.families
        cells = [(family, level) for family in families for level in levels_of(family, quick)]
        ok = {one: sum(self.outcome(*cell, one) in SURVIVED for cell in cells) for one in self.columns}
        return shown_columns(ok)

    def outcome(self, family: Family, level: float, column: Column, dt: float = 0.0) -> str:
        """Class of a cell at a step, or at the profile's own one; empty if it was not played."""
        return self.names.get((family.scene_name(level), *column, dt or own_step(*column)), "")

    def survived(self, family: Family, column: Column) -> tuple[float | None, str]:
        """Last level before the first failure at the profile's own step, None if the easiest fails; and the
        class of that failure, empty if there is none."""
        last: float | None = None
        for level in levels_of(family, self.scope.quick):
            name = self.outcome(family, level, column)
            if name not in SURVIVED:
                return last, name
            last = level
        return last, ""


def shown_columns(survived: Mapping[Column, int]) -> dict[Column, str]:
    """Columns of the table and the picture with their heads: the reference once, of every engine `default`,
    `recommended` and the best of its profiles; all of an engine that plays only some of these.

    Args:
        survived: cells at the profile's own step that are ok, by column, as they were played.
    """
    found: dict[Column, str] = {}
    for engine in dict.fromkeys(engine for engine, _ in survived):
        mine, best = [profile for name, profile in survived if name == engine], ""
        if engine == REFERENCE and mine[0] == JUDGED[0]:
            mine = mine[:1]
        elif set(SHOWN) <= set(mine):
            best = max(mine, key=lambda profile: survived[engine, profile])
            mine = list(dict.fromkeys((*SHOWN, best)))
        found |= {(engine, name): f"best: {name}" if name == best else name for name in mine}
    return found


def run(
    scope: Scope,
    store: Path,
    out: Path,
    progress: Progress,
    jobs: int | None = None,
    sheet: int = 0,
    seed: int = 0,
) -> pd.DataFrame:
    """Play all cells that the store does not hold, in `jobs` processes (None: one per core), and draw
    `sheet` of them at random; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        found = Envelope(scope, play_all(scope.cells(), store, progress, jobs))
        facts = {"study": STUDY, "quick": scope.quick, "families": [f.name for f in scope.families]}
        frame = kept([*missing_rows(STUDY, scope.columns), *rows_of_envelope(found)], folder, facts)
        cells = table_of_cells(found)
        write_beside(folder / "cells.csv", lambda part: cells.to_csv(part, index=False))
        illustrate(folder / "stability.png", partial(envelope_picture, found))
        if not scope.quick:
            (folder / "steps").mkdir()
            for family in scope.families:
                illustrate(folder / "steps" / f"{family.name}.png", partial(step_picture, found, family))
        if sheet:
            write_sheets(found.played, sheet, seed, folder / "sheet", progress)
    return frame


def rows_of_envelope(found: Envelope) -> list[Row]:
    """All rows: cells, then what each column survives per family, then the containment."""
    rows = [_cell_row(cell, one) for cell, one in found.played.items()]
    for family in found.scope.families:
        for column in found.columns:
            rows += _survival_rows(found, family, column)
    return rows + _contained_rows(found)


def _cell_row(cell: Cell, found: Played) -> Row:
    family, level = hard_names()[cell.scenario]
    verdict = ""
    if cell.engine == REFERENCE and cell.profile in JUDGED:
        verdict = "fail" if found.outcome.name in SILENT else "pass"
    return Row(
        *(STUDY, cell.scenario, cell.engine, cell.profile, cell.dt, OUTCOME, level, family.unit),
        subject=found.outcome.name,
        verdict=verdict,
        basis=_basis(family, cell.engine),
        reason=found.outcome.reason,
        reproduce=found.line,
    )


def _basis(family: Family, engine: str) -> str:
    return CONSTRUCTION if engine == REFERENCE and family.posed else ""


def _survival_rows(found: Envelope, family: Family, column: Column) -> list[Row]:
    key = (STUDY, family.name, *column, own_step(*column))
    last, failure = found.survived(family, column)
    text, basis = f"the most difficult {family.quantity} before the first failure", _basis(family, column[0])
    level = nan if last is None else last
    levels = Row(*key, LEVELS, level, family.unit, failure or "all", basis=basis, reason=text)
    if found.scope.quick:
        return [levels]
    easiest = family.levels[0]
    steps = [dt for dt in steps_of(*column, False) if found.outcome(family, easiest, column, dt) in SURVIVED]
    text = f"the largest step of those played that survives {family.quantity} {easiest:g}"
    return [levels, Row(*key, STEP, max(steps, default=nan), "s", reason=text)]


def _contained_rows(found: Envelope) -> list[Row]:
    """Per profile of the reference, the share of families in which it survives every level at its own step
    that any engine survives at its own."""
    rows = []
    for profile in JUDGED if any(engine != REFERENCE for engine, _ in found.columns) else ():
        if (REFERENCE, profile) in found.columns:
            missed = [family.name for family in found.scope.families if is_beaten(found, family, profile)]
            share = 1 - len(missed) / len(found.scope.families)
            verdict = "pass" if share >= LEAST_CONTAINED else "fail"
            key = (STUDY, "all", REFERENCE, profile, own_step(REFERENCE, profile), CONTAINED, share, "1")
            reason = f"not in {', '.join(missed)}" if missed else ""
            rows.append(Row(*key, limit=LEAST_CONTAINED, verdict=verdict, reason=reason))
    return rows


def is_beaten(found: Envelope, family: Family, profile: str) -> bool:
    """Whether an engine survives a level of a family, at its own step, that the reference does not."""
    return any(
        found.outcome(family, level, column) in SURVIVED
        and found.outcome(family, level, (REFERENCE, profile)) not in SURVIVED
        for column in found.columns
        if column[0] != REFERENCE
        for level in levels_of(family, found.scope.quick)
    )


def table_of_cells(found: Envelope) -> pd.DataFrame:
    """One line per cell, with its figures and its command."""
    lines = []
    for cell, one in found.played.items():
        family, level = hard_names()[cell.scenario]
        line = {"family": family.name, "quantity": family.quantity, "level": level, "unit": family.unit}
        line |= {"engine": cell.engine, "profile": cell.profile, "dt": cell.dt}
        line |= {"outcome": one.outcome.name, "under": one.outcome.under, "reason": one.outcome.reason}
        line |= {**one.outcome.figures, "seconds": one.seconds, "state_hash": one.state_hash}
        lines.append(line | {"command": one.line})
    return pd.DataFrame(lines)


LOOKS: dict[str, tuple[str, str]] = {
    # class: colour and letter
    "ok": ("#BFE3C8", ""),
    "inaccurate": ("#F6D55C", "i"),
    "jitter": ("#F2A65A", "j"),
    "creep": ("#E8871E", "c"),
    "sink-through": ("#E4572E", "s"),
    "tunnelled": ("#C1292E", "t"),
    "exploded": ("#8F2D56", "x"),
    "auto-reset": ("#5E3A87", "r"),
    "non-finite": ("#1D1D1F", "n"),
    "gave up": ("#4F8FCB", "g"),
    "error": ("#7B5C45", "e"),
    "slow": ("#9AA5B1", "o"),
    "skipped": ("#ECECEC", "-"),
    "": ("#FFFFFF", ""),
}
"""Colour and letter of each class; empty: not played."""
DARK = ("non-finite", "auto-reset", "exploded", "tunnelled", "error", "gave up", "sink-through")
SQUARE = 13
"""Side of a cell [point]."""
Sided = tuple[Sequence[str] | None, Any]
"""Order of the values along a side of a map, and its axis."""


def envelope_picture(found: Envelope, path: Path) -> None:
    """Draw one row per family and one block of levels per column, easy levels at the left."""
    families = found.scope.families
    names = {family: family.name.replace("_", " ") + " =" * family.posed for family in families}
    panels: list[Any] = []
    for column, head in found.shown.items():
        cells = [
            (k, names[family], found.outcome(family, level, column))
            for family in families
            for k, level in enumerate(levels_of(family, found.scope.quick))
        ]
        y = alt.Axis(ticks=False, domain=False) if not panels else None
        panels.append(_squares(cells, (list(names.values()), y), (None, None), [column[0], *head.split(" ")]))
    texts = []
    for family, name in names.items():
        levels, unit = levels_of(family, found.scope.quick), "" if family.unit == "1" else f" {family.unit}"
        texts.append((name, f"{family.quantity}, {level_text(levels[0])} to {level_text(levels[-1])}{unit}"))
    right = alt.Chart(pd.DataFrame(texts, columns=["y", "text"])).mark_text(align="left", color=PALE)
    right = right.encode(y=alt.Y("y:N", sort=list(names.values()), axis=None), x=alt.value(0), text="text:N")
    panels.append(right.properties(width=150, height=alt.Step(SQUARE)))
    save(alt.hconcat(*panels, spacing=10), path, "How far each engine goes before it fails", size=8)


def step_picture(found: Envelope, family: Family, path: Path) -> None:
    """Draw the map of one family: difficulty from left to right, steps from the smallest up."""
    levels = {level: level_text(level) for level in levels_of(family, found.scope.quick)}
    steps = {dt: f"1/{round(1 / dt)} s" for dt in sorted({cell.dt for cell in found.played}, reverse=True)}
    unit = "" if family.unit == "1" else f" [{family.unit}]"
    across = (list(levels.values()), alt.Axis(ticks=False, title=f"{family.quantity}{unit}", labelAngle=-60))
    panels: list[Any] = []
    for column in found.columns:
        cells = [(levels[x], steps[y], found.outcome(family, x, column, y)) for x in levels for y in steps]
        left = alt.Axis(ticks=False) if not panels else None
        panels.append(_squares(cells, (list(steps.values()), left), across, list(column)))
    save(alt.hconcat(*panels, spacing=10), path, family.name.replace("_", " "), family.summary, size=8)


def _squares(cells: Sequence[tuple[object, str, str]], y: Sided, x: Sided, title: list[str]) -> Any:
    """A square per cell (x, y, class) in the colour and with the letter of its class."""
    table = pd.DataFrame(cells, columns=["x", "y", "class"])
    table["letter"] = [LOOKS[name][1] for name in table["class"]]
    table["ink"] = ["white" if name in DARK else INK for name in table["class"]]
    heads = {name: f"{LOOKS[name][1]} {name}".strip() for name in reversed(HARD_CLASSES)}
    table["class"] = table["class"].map(heads)
    legend = alt.Legend(columns=5, symbolType="square")
    color = by(alt.Color, "class", {heads[name]: LOOKS[name][0] for name in heads}, legend=legend)
    rows = alt.Y("y:N", sort=y[0], axis=y[1], title=None)
    base = alt.Chart(table).encode(x=alt.X("x:O", sort=x[0], axis=x[1]), y=rows)
    drawn = base.mark_rect(stroke="white").encode(color=color)
    drawn += base.mark_text(fontSize=7).encode(text="letter:N", color=alt.Color("ink:N", scale=None))
    return drawn.properties(title=title, width=alt.Step(SQUARE), height=alt.Step(SQUARE))


NOTES = (
    "the most difficult level before the first failure at the profile's own step, and how that failed;",
    "-: the easiest fails; all: every level survives; =: no body is simulated, the reference poses it.",
    "best: the profile of an engine with most cells that are ok; counts below are of all that were played.",
)
LISTED = 20


def report(frame: pd.DataFrame) -> list[Part]:
    """What each column survives per family, counts of classes, and silent failures of the reference."""
    survived, rows = frame[frame.metric == LEVELS], []
    columns = list(dict.fromkeys(zip(survived.engine, survived.profile)))
    shown = shown_columns({column: _ok(frame, column) for column in columns})
    heads = ["\n".join((engine, *head.split(" "))) for (engine, _), head in shown.items()]
    for name, part in survived.groupby("scenario", sort=False):
        cells = {(row.engine, row.profile): _cell(row) for row in rows_of(part)}
        rows.append([str(name), *(cells.get(column, "") for column in shown)])
    lines = [
        f"reference {row.profile} survives all that any engine does in {row.value:.0%} of "
        f"{len(survived.scenario.unique())} families {row.reason}"
        for row in rows_of(frame[frame.metric == CONTAINED])
    ]
    failed = frame[(frame.metric == OUTCOME) & (frame.verdict == "fail")]
    lines += [f"{row.subject}: {row.reproduce}: {row.reason}" for row in rows_of(failed[:LISTED])]
    lines += [f"and {len(failed) - LISTED} more in cells.csv"] if len(failed) > LISTED else []
    title, seen = "stability: the most difficult level survived", set(frame[frame.metric == OUTCOME].subject)
    letters = "; ".join(f"{one}: {name}" for name, (_, one) in LOOKS.items() if one and name in seen)
    return [
        Part(title, ["family", *heads], rows, (*NOTES, letters)),
        _counts(frame, columns),
        Part(lines=lines),
        failures(frame[frame.metric == "run"]),
    ]


def _ok(frame: pd.DataFrame, column: Column) -> int:
    mine = frame[(frame.metric == OUTCOME) & (frame.engine == column[0]) & (frame.profile == column[1])]
    return int((mine.subject.isin(SURVIVED) & np.isclose(mine["dt"], own_step(*column))).sum())


def _cell(row: Row) -> str:
    posed = " =" if row.basis == CONSTRUCTION else ""
    if row.subject == "all":
        return f"all{posed}"
    return f"{'-' if row.value != row.value else level_text(row.value)} {LOOKS[row.subject][1]}{posed}"


def _counts(frame: pd.DataFrame, columns: list[tuple[str, str]]) -> Part:
    cells = frame[frame.metric == OUTCOME]
    names = [name for name in LOOKS if name in set(cells.subject)]
    letters = [LOOKS[name][1] or name for name in names]
    rows = []
    for engine, profile in columns:
        mine = cells[(cells.engine == engine) & (cells.profile == profile)].subject
        silent = int(mine.isin(SILENT).sum())
        counts = [str(int((mine == name).sum()) or "") for name in names]
        rows.append([f"{engine} {profile}", *counts, str(silent)])
    return Part("cells per class, all steps", ["", *letters, "silent"], rows)
