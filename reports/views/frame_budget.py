"""Cost of the reference's frames per scene and stage, as in the results section of the paper.

Counts are per displayed frame; posture QPs, joints and pairs are over the frames that have any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import altair as alt
import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.adapters.workers.children import SLICE
from touchstone.reports.views.pictures import INK, axis, by, grid, save
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number
from touchstone.scenarios.plural import plural

ENGINE, PROFILES = "reference", ("balanced", "paper")
HEADS = (
    *("scene", "frame\nus", "p99\nus", "colli-\nsion", "removal"),
    *("QPs,\npasses", "peak", "joints", "peak", "pairs", "peak"),
)
"""Split into lines so that whole names of scenes fit a table of 80 columns."""
NOTE = (
    f"{ENGINE} {' and '.join(PROFILES)}, by cost. Median and 99th percentile of the frame time; shares of "
    "all stages; means and peaks of a frame's posture QPs (balanced) or passes of CCD (paper), joints in "
    "them and contacting pairs, over frames that have any."
)
BUDGET_PICTURE = "frame_budget.png"
SOLVES, IK_JOINTS, PAIRS = "solves", "ik.joints", "pairs.contacting"
QP_SOLVES, CCD_PASSES = "posture_qp.solves", "ccd.passes"
"""Counters that make up SOLVES: a profile has one of them."""


@dataclass(frozen=True, slots=True)
class Budget:
    """Series over the frames of one scene: time [s], seconds of each stage, counts of solves and pairs."""

    scene: str
    profile: str
    time: Array  # ends of the frames [s]
    frame: Array
    stages: Mapping[str, Array]
    counts: Mapping[str, Array]

    @property
    def cost(self) -> float:
        """Median time of a frame [s]."""
        return float(np.median(self.frame))

    def share(self, stage: str) -> float:
        """Share of a stage in the time of all stages [1]."""
        total = sum(float(seconds.sum()) for seconds in self.stages.values())
        return float(self.stages[stage].sum()) / total if total > 0 else 0.0


def budgets(recordings: Mapping[tuple[str, str, str], Recording]) -> list[Budget]:
    """The budget of every recording of the reference in PROFILES, the cheapest first."""
    found = []
    for (scene, engine, profile), one in recordings.items():
        if engine == ENGINE and profile in PROFILES:
            stages = {str(name): one.stage_seconds[:, k] for k, name in enumerate(one.stage_names)}
            work = {str(name): one.work[:, k] for k, name in enumerate(one.work_names)}
            none = np.zeros(len(one.time_frame))
            work[SOLVES] = work.get(QP_SOLVES, none) + work.get(CCD_PASSES, none)
            counts = {name: work.get(name, none) for name in (SOLVES, IK_JOINTS, PAIRS)}
            found.append(Budget(scene, profile, one.time[1:], one.time_frame, stages, counts))
    return sorted(found, key=lambda budget: budget.cost)


def budget_part(recordings: Mapping[tuple[str, str, str], Recording]) -> Part:
    """A line per scene that the reference played."""
    rows = []
    for budget in budgets(recordings):
        times = [number(1e6 * budget.cost), number(1e6 * float(np.percentile(budget.frame, 99)))]
        shares = [f"{100 * budget.share(stage):.0f} %" for stage in ("collision", "removal")]
        counts = [cell for name in (SOLVES, IK_JOINTS, PAIRS) for cell in _told(budget.counts[name])]
        name = budget.scene if budget.profile == PROFILES[0] else f"{budget.scene}, {budget.profile}"
        rows.append([name, *times, *shares, *counts])
    return Part("frame budget of the scenes", HEADS, rows, [NOTE], tight=True, picture=BUDGET_PICTURE)


def _told(counts: Array) -> tuple[str, str]:
    """Texts of the mean over the frames that have any, and of the peak."""
    some = counts[counts > 0]
    return (f"{some.mean():.1f}", f"{some.max():.0f}") if len(some) else ("", "")


TIME = "time in the scene [s]"
COLUMNS, WIDTH = 2, 330
"""Panels side by side, and the width of one [point]."""
STAGES = (("collision", "#0072B2"), ("removal", "#D55E00"), ("impulses", "#009E73"), ("other", "#c9c9c9"))
"""Colours of Okabe and Ito, safe for colour-blind readers; `removal` includes inverse kinematics."""
NAMES = {"removal": "overlap removal", "other": "all else"}
COLORS = {NAMES.get(name, name): color for name, color in STAGES}
COLORS |= {"posture QPs": "#e3b489", "contacting pairs": INK}
COLOR = by(alt.Color, "part", COLORS)
HEADROOM, CUT = 1.5, 98.0
"""A panel ends at this factor times this percentile of its frames: single frames that the operating system
interrupted would hide all others."""
COLD = 2
"""First frames of a turn, which do not count for that end: other engines have used the caches [1]."""


def write_picture(recordings: Mapping[tuple[str, str, str], Recording], folder: Path) -> None:
    """Draw the scenes that the reference played, if any, to a file in the results folder."""
    found = [budget for budget in budgets(recordings) if budget.profile == PROFILES[0]]
    if found:
        frame_budget(found, folder / BUDGET_PICTURE)


def frame_budget(found: list[Budget], path: Path) -> None:
    """Draw the scenes in rows of two panels."""
    note = "the reference's frames by stage, and what collision detection and overlap removal had to do"
    busy = [any(counts.any() for counts in budget.counts.values()) for budget in found]
    panels = [_stages(b, False) & _work(b) if some else _stages(b, True) for b, some in zip(found, busy)]
    save(grid(panels, COLUMNS), path, "What a frame costs", note)


def _stages(budget: Budget, labels: bool) -> Any:
    named = [name for name, _ in STAGES[:-1]]
    seconds = {name: budget.stages.get(name, np.zeros_like(budget.time)) for name in named}
    seconds["other"] = np.maximum(0.0, budget.frame - sum(seconds.values()))
    table = 1e6 * pd.DataFrame(seconds, index=pd.Index(budget.time, name="time"))
    table = table.rename(columns=NAMES).reset_index().melt("time", var_name="part", value_name="us")
    warm = budget.frame[np.arange(len(budget.frame)) % SLICE >= min(COLD, len(budget.frame) - 1)]
    top = HEADROOM * 1e6 * float(np.percentile(warm, CUT))
    cut = int((1e6 * budget.frame > top).sum())
    head = f"{budget.scene}: median {1e6 * budget.cost:.0f} µs"
    title = {"text": head, "subtitle": f"{plural(cut, 'frame')} higher" if cut else ""}
    x = axis(alt.X, "time", TIME if labels else None, (0, budget.time[-1]), labels=labels, grid=False)
    y = axis(alt.Y, "us", "frame [µs]", (0, top), grid=False)
    table["order"] = table.part.map(list(COLORS).index)
    drawn = alt.Chart(table).mark_area(clip=True).encode(x=x, y=y, color=COLOR, order="order:Q")
    return drawn.properties(title=title, width=WIDTH, height=110)


def _work(budget: Budget) -> Any:
    solves, pairs = budget.counts[SOLVES], budget.counts[PAIRS]
    table = pd.DataFrame({"time": budget.time, "solves": solves, "pairs": pairs})
    x = axis(alt.X, "time", TIME, (0, budget.time[-1]), grid=False)
    top = max(4.0, 1.15 * float(max(solves.max(), pairs.max())))
    y = axis(alt.Y, "solves", "count", (0, top), grid=False)
    bars = alt.Chart(table[table.solves > 0].assign(part="posture QPs")).mark_rule()
    line = alt.Chart(table.assign(part="contacting pairs")).mark_line(interpolate="step", strokeWidth=1.4)
    bars = bars.encode(x=x, y=y, y2=alt.datum(0), color=COLOR)
    return (bars + line.encode(x=x, y="pairs:Q", color=COLOR)).properties(width=WIDTH, height=55)
