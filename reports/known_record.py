"""A documented failing, and a cause that several scenes share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

EVERY = "recommended equal-step default accurate"
"""All profiles of DART, Bullet and MuJoCo."""


@dataclass(frozen=True, slots=True)
class Known:
    """A documented failing of an engine. Strict: where the limit is met after all, the row fails."""

    metric: str
    engine: str
    reason: str
    scenario: str = ""
    profile: str = ""
    subject: str = ""
    never: bool = False  # the failing is that an event never happens


@dataclass(frozen=True, slots=True)
class Cause:
    """Why an engine fails in some probes: metric -> scenes, each with `:subject` where not all are meant."""

    engine: str
    reason: str
    seen: Mapping[str, str]
    profiles: str = "recommended equal-step default"

    def known(self) -> Iterator[Known]:
        """One entry per profile, metric and scene, each with the line that shows it."""
        for profile, (metric, places) in product(self.profiles.split(), self.seen.items()):
            for place in places.split():
                scene, _, subject = place.partition(":")
                shows = f"touchstone run {scene} --engine {self.engine} --profile {profile} --metric {metric}"
                yield Known(metric, self.engine, f"{self.reason}: {shows}", scene, profile, subject)
