"""Cells of the study `stability` drawn at random, played again and shown as pictures, to be judged by eye.

The pictures do not tell the classes: `sheet.csv` does, by number, with the command that plays each cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
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
from touchstone.reports.progress import Progress
from touchstone.reports.results import write_beside
from touchstone.reports.runner.cells import Cell
from touchstone.reports.studies.stability.play import KEPT, Played, file_of, play_all, recordings_in
from touchstone.reports.verdict.figures import rotations
from touchstone.reports.views.pictures import INK, NOTHING, axis, by, grid, log_axis, save
from touchstone.scenarios.difficulty.family import hard_scene
from touchstone.scenarios.scenario import Scenario

PER_SHEET = 20
"""Cells of one picture."""
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
"""Cells in a row of a sheet."""
MOMENTS = ("start", "middle", "end")
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
"""Colours of bodies, in turn (Okabe and Ito)."""
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
    shapes = [np.concatenate(_moving(scenario, run, moving, frame)) for frame in frames]
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


def _moving(scenario: Scenario, run: Recording, moving: Sequence[int], frame: int) -> list[Array]:
    """World points on the surfaces of moving bodies in a frame [m]."""
    return [run.position[frame, moving], *(p for k in moving for p in _pieces(scenario, run, k, frame))]


def _pieces(scenario: Scenario, run: Recording, body: int, frame: int) -> list[Array]:
    """World points (n, 3) [m] on the surface of each of a body's pieces in a frame."""
    turn = run.orientation[frame, body]
    usable = np.isfinite(turn).all() and np.linalg.norm(turn) > 0
    turned = Rotation.from_quat(turn, scalar_first=True) if usable else Rotation.identity()
    corners = (piece_mesh(piece)[0] for piece in scenario.bodies[body].pieces)
    return [turned.apply(own) + run.position[frame, body] for own in corners]
