"""Pictures of the study `stability`: outcomes over difficulty at each profile's own step, and over difficulty
and step per family."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from touchstone.reports.results import write_beside
from touchstone.reports.studies.stability.cells import levels_of, own_step
from touchstone.reports.studies.stability.rows import Results
from touchstone.reports.verdict.outcomes import HARD_CLASSES
from touchstone.reports.views.pictures import INK, PALE
from touchstone.scenarios.difficulty.family import Family, level_text

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
"""Classes whose letters are white."""
CELL = 1.0
RIGHT = 22.0
"""Width of the text on the right [cells]."""
LABEL = 4.9
"""Width of a column's heading [cells]."""
GAP = 0.9
"""Width of a cell, and of the space between columns [cells]."""


def envelope_picture(results: Results, path: Path) -> None:
    """Draw one row per family and one block of levels per column, easy levels at the left."""
    columns = _columns(results)
    quick, rows = results.plan.quick, results.plan.families
    width = max(len(levels_of(family, quick)) for family in rows)
    block = max(width * CELL, LABEL) + GAP
    with rc_context({"font.family": "DejaVu Sans", "font.size": 8}):
        figure = Figure(
            figsize=(0.17 * (10.0 + RIGHT + block * len(columns)), 1.7 + 0.2 * len(rows)), dpi=150
        )
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        left, top = -0.5, -2.6
        for y, family in enumerate(rows):
            levels = levels_of(family, quick)
            name = family.name.replace("_", " ") + (" =" if family.posed else "")
            axes.text(left, y + 0.5, name, ha="right", va="center", color=INK)
            easy, hard = level_text(levels[0]), level_text(levels[-1])
            unit = "" if family.unit == "1" else f" {family.unit}"
            axes.text(
                block * len(columns), y + 0.5, f"{family.quantity}, {easy} to {hard}{unit}",
                ha="left", va="center", color="#777777", fontsize=7,
            )  # fmt: skip
            for k, (engine, profile) in enumerate(columns):
                for j, level in enumerate(levels):
                    name = results.outcome(family, level, engine, profile, own_step(engine, profile))
                    _square(axes, block * k + CELL * j, y, name)
        for k, (engine, profile) in enumerate(columns):
            axes.text(block * k, -0.35, f"{engine}\n{profile}", ha="left", va="bottom", color=INK)
        axes.text(
            -9.5, top - 0.3, "How far each engine goes before it fails",
            ha="left", va="bottom", color=INK, fontsize=12, fontweight="bold",
        )  # fmt: skip
        axes.set_xlim(-10.0, block * len(columns) + RIGHT)
        axes.set_ylim(len(rows) + 3.4, top - 1.6)
        axes.axis("off")
        axes.legend(
            handles=_handles(results), loc="lower left", ncols=5, frameon=False, fontsize=7.5,
            bbox_to_anchor=(0.02, 0.0), handlelength=1.2, columnspacing=1.4,
        )  # fmt: skip
        figure.savefig(path, format="png", facecolor="white")


def step_pictures(results: Results, folder: Path) -> None:
    """Draw a map of difficulty over step per family, one panel per column, into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for family in results.plan.families if results.played else ():  # no engine is installed: nothing to draw
        write_beside(folder / f"{family.name}.png", partial(step_picture, results, family))


def step_picture(results: Results, family: Family, path: Path) -> None:
    """Draw the map of one family: difficulty from left to right, steps from the smallest up."""
    columns, levels = _columns(results), levels_of(family, results.plan.quick)
    steps = sorted({cell.settings.dt for cell in results.played})
    with rc_context({"font.family": "DejaVu Sans", "font.size": 8}):
        figure = Figure(figsize=(1.2 + 1.55 * len(columns), 3.0), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(1, len(columns), squeeze=False, sharey=True)[0]
        for axes, (engine, profile) in zip(grid, columns):
            for y, dt in enumerate(steps):
                for x, level in enumerate(levels):
                    _square(axes, x, y, results.outcome(family, level, engine, profile, dt))
            axes.set_title(f"{engine}\n{profile}", fontsize=8, color=INK, loc="left")
            axes.set_xlim(-0.1, len(levels) + 0.1)
            axes.set_ylim(-0.1, len(steps) + 0.1)
            axes.set_xticks(
                [x + 0.5 for x in range(len(levels))], [level_text(x) for x in levels], rotation=60
            )
            axes.set_yticks([y + 0.5 for y in range(len(steps))], [f"1/{round(1 / dt)} s" for dt in steps])
            axes.tick_params(length=0, labelsize=7, colors=INK)
            for side in axes.spines.values():
                side.set_color(PALE)
        unit = "" if family.unit == "1" else f" [{family.unit}]"
        figure.supxlabel(f"{family.quantity}{unit}", fontsize=8, color=INK)
        figure.suptitle(
            f"{family.name.replace('_', ' ')}: {family.summary}", fontsize=9, color=INK, x=0.01, ha="left"
        )
        figure.savefig(path, format="png", facecolor="white")


def _square(axes: Axes, x: float, y: float, name: str) -> None:
    color, letter = LOOKS[name]
    axes.add_patch(Rectangle((x + 0.05, y + 0.08), 0.9, 0.84, facecolor=color, edgecolor="none"))
    if letter:
        ink = "white" if name in DARK else INK
        axes.text(x + 0.5, y + 0.5, letter, ha="center", va="center", fontsize=6.5, color=ink)


def _handles(results: Results) -> list[Patch]:
    seen = {found.outcome.name for found in results.played.values()}
    return [
        Patch(color=LOOKS[name][0], label=f"{LOOKS[name][1]} {name}".strip())
        for name in reversed(HARD_CLASSES)
        if name in seen
    ]


def _columns(results: Results) -> list[tuple[str, str]]:
    return list(dict.fromkeys((cell.engine, cell.settings.profile) for cell in results.played))
