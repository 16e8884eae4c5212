"""Cost of the reference's frames per scene and stage, as in the results section of the paper.

Counts are per displayed frame; posture QPs, joints and pairs are over the frames that have any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.views.pictures import INK, PALE, figure
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number

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
    found = (
        _budget(scene, profile, recording)
        for (scene, engine, profile), recording in recordings.items()
        if engine == ENGINE and profile in PROFILES
    )
    return sorted(found, key=lambda budget: budget.cost)


def _budget(scene: str, profile: str, recording: Recording) -> Budget:
    stages = {str(name): recording.stage_seconds[:, k] for k, name in enumerate(recording.stage_names)}
    counts = {str(name): recording.work[:, k] for k, name in enumerate(recording.work_names)}
    none = np.zeros(len(recording.time_frame))
    counts[SOLVES] = counts.get(QP_SOLVES, none) + counts.get(CCD_PASSES, none)
    return Budget(
        scene,
        profile,
        recording.time[1:],
        recording.time_frame,
        stages,
        {name: counts.get(name, none) for name in (SOLVES, IK_JOINTS, PAIRS)},
    )


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


COLUMNS = 2
STAGES = (("collision", "#0072B2"), ("removal", "#D55E00"), ("impulses", "#009E73"), ("other", "#c9c9c9"))
"""Colours of Okabe and Ito, safe for colour-blind readers; `removal` includes inverse kinematics."""
NAMES = {"removal": "overlap removal", "other": "all else"}
SOLVES_COLOR, CONTACTS_COLOR = "#e3b489", "#0072B2"
HEADROOM, CUT = 1.5, 97.0
"""A panel ends at this factor times this percentile of its frames: single frames that the operating system
interrupted would hide all others."""


def write_picture(recordings: Mapping[tuple[str, str, str], Recording], folder: Path) -> None:
    """Draw the scenes that the reference played, if any, to a file in the results folder."""
    found = [budget for budget in budgets(recordings) if budget.profile == PROFILES[0]]
    if found:
        frame_budget(found, folder / BUDGET_PICTURE)


def frame_budget(found: list[Budget], path: Path) -> None:
    """Draw the scenes in rows of two panels."""
    lines = ceil(len(found) / COLUMNS)
    with figure(path, 11, 0.6 + 2.6 * lines, 9.5) as drawn:
        heights = {"height_ratios": [3, 1.5] * lines}
        panels = drawn.subplots(2 * lines, COLUMNS, squeeze=False, gridspec_kw=heights)
        for axes in panels.flat:
            axes.set_axis_off()
        for place, budget in enumerate(found):
            line, column = divmod(place, COLUMNS)
            _draw_stages(panels[2 * line, column], budget)
            _draw_work(panels[2 * line + 1, column], budget)
            last = place + COLUMNS >= len(found)
            panels[2 * line + 1, column].set_xlabel("time in the scene [s]" if last else "")
        stages, work = (panels[k, 0].get_legend_handles_labels() for k in (0, 1))
        handles, labels = (one + other for one, other in zip(stages, work))
        drawn.legend(handles, labels, loc="outside upper center", ncols=6, frameon=False)


def _draw_stages(axes: Axes, budget: Budget) -> None:
    time = budget.time
    named = [name for name, _ in STAGES[:-1]]
    none = np.zeros_like(time)
    seconds = [budget.stages.get(name, none) for name in named]
    seconds.append(np.maximum(0.0, budget.frame - np.sum(seconds, axis=0)))
    axes.stackplot(
        time,
        [1e6 * row for row in seconds],
        labels=[NAMES.get(name, name) for name, _ in STAGES],
        colors=[colour for _, colour in STAGES],
        linewidth=0,
    )
    _plain(axes, time)
    top = HEADROOM * 1e6 * float(np.percentile(budget.frame, CUT))
    cut = int((1e6 * budget.frame > top).sum())
    axes.set_ylim(0, top)
    axes.tick_params(labelbottom=False)
    axes.set_ylabel("frame [us]")
    axes.set_title(f"{budget.scene}: median {1e6 * budget.cost:.0f} us", loc="left", color=INK, fontsize=10.5)
    if cut:
        axes.set_title(f"{cut} frame{'s' if cut > 1 else ''} higher", loc="right", color=PALE, fontsize=9.5)


def _draw_work(axes: Axes, budget: Budget) -> None:
    time = budget.time
    solves, pairs = budget.counts[SOLVES], budget.counts[PAIRS]
    axes.vlines(time, 0, solves, color=SOLVES_COLOR, linewidth=1.0, label="posture QPs")
    axes.step(time, pairs, where="mid", color=CONTACTS_COLOR, linewidth=1.4, label="contacting pairs")
    _plain(axes, time)
    axes.set_ylim(0, max(4.0, 1.15 * float(max(solves.max(), pairs.max()))))
    axes.set_ylabel("count")


def _plain(axes: Axes, time: Array) -> None:
    axes.set_axis_on()
    axes.set_xlim(0, float(time[-1]))
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(color=PALE)
