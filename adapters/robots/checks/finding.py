"""A finding about a robot, in one line."""

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["fault", "note"]
FAULT: Verdict = "fault"
NOTE: Verdict = "note"


@dataclass(frozen=True, slots=True)
class Finding:
    """What is wrong with a robot (`fault`) or worth knowing (`note`).

    Attributes:
        check: motion, hull, overlap, inertia, limit, drive or grip.
        subject: the part that it concerns.
        text: what was measured; `remedy`: what to change.
    """

    check: str
    subject: str
    text: str
    remedy: str
    verdict: Verdict = FAULT

    @property
    def line(self) -> str:
        """Subject, measurement and remedy."""
        return f"{self.subject}: {self.text}; {self.remedy}"
