"""Cost of the reference's frames per scene and stage, as in the results section of the paper.

Counts are per displayed frame; posture QPs, joints and pairs are over the frames that have any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
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
