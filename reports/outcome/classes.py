"""Classes of outcomes, and the record of one."""

from __future__ import annotations

from dataclasses import dataclass, field

CLASSES = {
    "skipped": "the engine cannot represent the scene, or is not installed",
    "error": "an exception, or a process that died",
    "slow": "the engine's steps take longer than the budget: the run was cut off",
    "gave up": "the run failed, and the engine said so",
    "non-finite": "a value that is not finite",
    "auto-reset": "the engine put the state back to the start by itself",
    "exploded": "more energy or speed than the scene has",
    "tunnelled": "a body is on the other side of another within a tenth of a second",
    "sink-through": "a body sinks into another by half of its inner radius or more",
    "creep": "a body that should rest drifts away",
    "jitter": "a body that should rest shakes",
    "inaccurate": "beyond the tolerances of the family",
    "ok": "within all tolerances",
}
"""Name and meaning, the worst first; a run belongs to the first that applies."""
SILENT = (
    "non-finite",
    "auto-reset",
    "exploded",
    "tunnelled",
    "sink-through",
    "creep",
    "jitter",
    "inaccurate",
)
"""Failures that the engine did not announce."""
SURVIVED = ("ok",)
"""Classes that count as survived."""
GROSS = ("non-finite", "exploded", "sink-through", "tunnelled")
"""Failures that the profile `balanced` must not show at 1/60 s."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Class of a run, its reason in one line, and the figures that decided it.

    `under` is the class that a run which gave up would have had; figures are those of `measures.py`.
    """

    name: str
    reason: str = ""
    under: str = ""
    figures: dict[str, float] = field(default_factory=dict)
