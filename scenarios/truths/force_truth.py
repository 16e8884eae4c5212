"""The truth of a contact force."""

from dataclasses import dataclass
from math import ceil, floor
from typing import Literal

from touchstone.scenarios.truths.pair_names import PairName

QUANTITIES = ("force", "impulse")
FRAME_ROUNDING = 1e-9
"""Share of a frame by which rounding may move the ends of a window [1]."""


@dataclass(frozen=True, slots=True)
class ForceTruth:
    """Normal force between `body` and `other` by closed form, in the displayed frames that lie entirely
    between `start` and `end` [s]. The root of a driven body stands for all of its links.

    `value` is the mean `force` over these frames [N], or its `impulse`: the integral over them [N s].
    """

    body: str
    other: str
    start: float
    end: float
    value: float
    quantity: Literal["force", "impulse"] = "force"

    def frames(self, frame_rate: float) -> tuple[int, int]:
        """The first frame of the window, and the first after it [1]; frames count from 0 at the start."""
        return ceil(self.start * frame_rate - FRAME_ROUNDING), floor(self.end * frame_rate + FRAME_ROUNDING)

    def is_of(self, pair: str) -> bool:
        """Whether a subject of a pair, such as `floor-box`, names the two bodies, in either order."""
        return pair in (PairName(self.body, self.other), PairName(self.other, self.body))
