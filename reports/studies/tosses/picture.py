"""Picture of the errors of played tosses over time, with the noise of tracking."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from touchstone.reports.studies.charts import figure, headline, open_axes
from touchstone.reports.views.pictures import INK, PALE, color_of

PANELS = (
    ("tosses.position", "error of position [widths]", 1.0),
    ("tosses.rotation", "error of rotation [deg]", 180 / np.pi),
)
"""Metric, label and factor of a panel."""
BAND = "#d9e6f2"
OWN = ", start within its error"
"""Ending of the profile under which an engine is compared with itself from another start."""


def errors_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw medians over the judged tosses, with quartiles; the floor; what an error of the start makes of the
    reference; and the noise of tracking."""
    with figure(path, 10.5, 5.0, 10) as drawn:
        for axes, (metric, label, factor) in zip(drawn.subplots(1, 2), PANELS):
            _panel(axes, frame[frame.metric == metric], factor)
            axes.set_ylabel(label, color=INK)
            axes.set_xlabel("time after the first impact [s]", color=INK)
        handles, labels = axes.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
        headline(drawn, "Measured tosses: how far each engine is from what happened")
        note = (
            "line: median over the judged tosses    shade: quartiles    e and mu identified on other tosses"
        )
        drawn.text(0.01, 1 - 0.36 / drawn.get_figheight(), note, color=PALE, fontsize=9, va="top")


def _panel(axes: Axes, rows: pd.DataFrame, factor: float) -> None:
    noise = factor * float(rows[rows.engine == "tracking"].value.iloc[0])
    axes.axhspan(noise / 3, noise, color=BAND, label="noise of tracking", zorder=0)
    for names, part in rows[rows.subject != ""].groupby(["engine", "profile"], sort=False):
        engine, profile = map(str, names)
        time = part.subject.str.removesuffix(" s").astype(float).to_numpy()
        low, value, high = (factor * part[name].to_numpy(dtype=float) for name in ("low", "value", "high"))
        if engine == "floor":
            axes.plot(
                time, value, "--", color=INK, linewidth=1.5, label="reference, own e and mu for each toss"
            )
        elif profile.endswith(OWN):
            if engine == "reference":
                axes.plot(time, value, ":", color=PALE, linewidth=2, label=f"reference{OWN}")
        else:
            color, name = color_of(engine), f"{engine} {profile}"
            axes.plot(time, value, color=color, linewidth=1.9, label=name, zorder=3)
            axes.fill_between(time, low, high, color=color, alpha=0.08, linewidth=0)
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}"))
    axes.set_xlim(time[0], time[-1])
    axes.set_ylim(noise / 3, None)
    axes.axvline(0, color=PALE, linewidth=0.8)
    open_axes(axes, "y")
