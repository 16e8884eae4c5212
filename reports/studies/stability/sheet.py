"""Cells of the study `stability` drawn at random, played again and shown as pictures, to be judged by eye.

The pictures do not tell the classes: `sheet.csv` does, by number, with the command that plays each cell.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
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
from touchstone.reports.views.pictures import INK, figure
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
FLOOR = 1e-12
"""Least value on a logarithmic axis."""
MOST_WINDOW = 12.0
"""Width of a window that holds all of the motion, over that of the bodies at the start, at most [1]."""
TINY = 1e-12
"""Least size of what is drawn [m]."""


def sheet_picture(shown: Sequence[tuple[str, Scenario, Recording | None]], path: Path) -> None:
    """Draw runs by their title in rows of ACROSS: three moments above, overlap and speed over time below."""
    rows = -(-len(shown) // ACROSS)
    height = 2.4 * rows + 0.5
    margins = {"left": 0.02, "right": 0.995, "top": 1 - 0.25 / height, "bottom": 0.22 / height}
    with figure(path, 4.2 * ACROSS, height, font=6, dpi=110, layout=None) as sheet:
        grid = sheet.add_gridspec(rows, ACROSS, **margins, wspace=0.12, hspace=0.28)
        for k, (title, scenario, recording) in enumerate(shown):
            inner = grid[k // ACROSS, k % ACROSS].subgridspec(2, 3, height_ratios=(2.2, 1), wspace=0.05)
            panels = [sheet.add_subplot(inner[0, j]) for j in range(3)]
            panels[0].set_title(title, loc="left", fontsize=7.5, color=INK, fontweight="bold")
            if recording is None:
                panels[0].text(0.1, 0.5, "no recording", transform=panels[0].transAxes)
                continue
            _moments(panels, scenario, recording)
            _series(sheet.add_subplot(inner[1, :]), Context(recording, scenario))


def _moments(panels: Sequence[Axes], scenario: Scenario, run: Recording) -> None:
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
    for axes, frame, moment, shape in zip(panels, frames, MOMENTS, seen):
        for k, body in enumerate(scenario.bodies):
            color = FIXED if body.kind == "fixed" else COLORS[k % len(COLORS)]
            for piece in _pieces(scenario, run, k, frame):
                _fill(axes, piece[:, plane], color, body.kind == "fixed")
        held = shape if follows and len(shape) else path
        middle = (held.min(axis=0) + held.max(axis=0))[plane] / 2
        extent = float(np.ptp(held, axis=0)[plane].max())
        half = 0.6 * max(min(extent, MOST_WINDOW * size), 2 * size if follows else 0.0, TINY)
        axes.set_xlim(middle[0] - half, middle[0] + half)
        axes.set_ylim(middle[1] - half, middle[1] + half)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        text = f"{moment}, {run.time[frame]:.3g} s"
        if moment == "end":
            text += f" of {scenario.duration:.3g} s"
        axes.text(0.03, 0.03, text, transform=axes.transAxes, color="#555555")
        width = f"{2 * half:.2g} m wide"
        if follows and len(shape):
            x, z = (shape.mean(axis=0) - seen[0].mean(axis=0))[plane]
            width += f"\nat {x:+.2g}, {z:+.2g} m"
        axes.text(0.97, 0.97, width, transform=axes.transAxes, ha="right", va="top", color="#555555")


def _moving(scenario: Scenario, run: Recording, moving: Sequence[int], frame: int) -> list[Array]:
    """World points on the surfaces of moving bodies in a frame [m]."""
    return [run.position[frame, moving], *(p for k in moving for p in _pieces(scenario, run, k, frame))]


def _fill(axes: Axes, points: Array, color: str, fixed: bool) -> None:
    """Fill the convex hull of projected points."""
    if not np.isfinite(points).all() or np.abs(points).max() > 1e9:
        return
    try:
        border = points[ConvexHull(points).vertices]
    except QhullError:
        border = points
    axes.add_patch(
        Polygon(border, facecolor=color, edgecolor=INK, linewidth=0.4, alpha=1.0 if fixed else 0.55)
    )


def _pieces(scenario: Scenario, run: Recording, body: int, frame: int) -> list[Array]:
    """World points (n, 3) [m] on the surface of each of a body's pieces in a frame."""
    turn = run.orientation[frame, body]
    usable = np.isfinite(turn).all() and np.linalg.norm(turn) > 0
    turned = Rotation.from_quat(turn, scalar_first=True) if usable else Rotation.identity()
    corners = (piece_mesh(piece)[0] for piece in scenario.bodies[body].pieces)
    return [turned.apply(own) + run.position[frame, body] for own in corners]


def _series(axes: Axes, context: Context) -> None:
    """Draw the deepest overlap, the largest speed and the largest rate of rotation over time."""
    run = context.recording
    moving = [k for k, kind in enumerate(context.kind) if kind != "fixed"]
    with np.errstate(all="ignore"):
        lines = {
            "speed [m/s]": (np.linalg.norm(run.linear_velocity[:, moving], axis=2).max(axis=1), "#0072B2"),
            "turn [rad/s]": (np.linalg.norm(run.angular_velocity[:, moving], axis=2).max(axis=1), "#009E73"),
        }
        usable = np.isfinite(run.position).all() and rotations(context)
        if usable and next(context.scenario.touching_pairs(), None) is not None:
            lines["overlap [m]"] = (context.distances.overlap(), "#D55E00")
    for name, (values, color) in lines.items():
        kept = np.where(np.isfinite(values), np.clip(values, FLOOR, 1e15), np.nan)
        axes.semilogy(run.time, kept, color=color, linewidth=0.9, label=name)
    axes.set_ylim(bottom=1e-10)
    axes.tick_params(length=1.5, labelsize=5, colors="#555555")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.92), fontsize=5, frameon=False, ncols=3, borderpad=0.1
    )
    axes.spines[["top", "right"]].set_visible(False)
