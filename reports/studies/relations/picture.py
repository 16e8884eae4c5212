"""The picture of the study `relations`: deviation over size and amplification, one marker per scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from touchstone.adapters.registry import ENGINES
from touchstone.reports.studies.relations.play import NAMES
from touchstone.reports.views.pictures import INK, PALE

FLOOR, CEILING = 1e-18, 10.0
"""Smaller and larger deviations are drawn at these values [1]."""


def deviations_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw one row of markers per relation and engine, on a logarithmic axis."""
    rows = scaled(frame)
    engines = list(dict.fromkeys(rows.engine))
    with rc_context({"font.family": "DejaVu Sans", "font.size": 9}):
        figure = Figure(figsize=(8.6, 1.4 + 0.5 * len(NAMES)), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for k, name in enumerate(NAMES):
            for j, engine in enumerate(engines):
                mask = (rows.relation == name) & (rows.engine == engine)
                part = rows[mask].scaled.to_numpy(dtype=float)
                entry = ENGINES[engine]
                places = np.full(len(part), k + 0.17 * (j - len(engines) / 2 + 0.5))
                axes.plot(
                    np.clip(part, FLOOR, CEILING), places, entry.marker, color=entry.color, markersize=4,
                    alpha=0.7, markeredgewidth=0, label=engine if k == 0 else None,
                )  # fmt: skip
        axes.axvline(1e-9, color=PALE, linewidth=0.9, linestyle=":")
        axes.set_xscale("log")
        axes.set_xlim(FLOOR / 2, CEILING * 2)
        axes.set_yticks(range(len(NAMES)), NAMES)
        axes.set_ylim(len(NAMES) - 0.4, -0.6)
        axes.set_xlabel(
            "deviation over the scene's size and its amplification [1]; dotted: rounding", color=INK
        )
        axes.tick_params(colors=INK, length=3)
        axes.grid(axis="x", color="#eeeeee", linewidth=0.8)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        figure.suptitle(
            "Changed scenes: how far motions are from where they must be", x=0.01, ha="left", color=INK,
            fontsize=12, fontweight="bold",
        )  # fmt: skip
        figure.legend(loc="outside lower left", ncols=4, frameon=False)
        figure.savefig(path, format="png", facecolor="white")


def scaled(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of relations that apply, with their name and the deviation over the amplification."""
    key = ["scenario", "engine", "profile"]
    amplified = frame[frame.metric == "relations.amplification"].set_index(key).value
    rows = frame[frame.metric.isin([f"relations.{name}" for name in NAMES]) & frame.value.notna()].copy()
    rows["relation"] = rows.metric.str.removeprefix("relations.")
    factors = [float(amplified.get(tuple(one), 1.0)) for one in rows[key].to_numpy().tolist()]
    rows["scaled"] = rows.value / np.maximum(1.0, np.nan_to_num(factors, nan=1.0))
    return rows
