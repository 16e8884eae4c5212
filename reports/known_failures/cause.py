"""A documented failing, and a cause that several scenes share."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain

EVERY = "recommended equal-step default accurate"
"""All profiles of DART, Bullet and MuJoCo."""
NOISY = ", tracker=noisy"
"""What the profile of a row with noisy trackers has in it; in a cause a profile has `+noisy` for it."""
Places = Mapping[str, Mapping[str, str]]
"""Profiles -> metric -> scenes, each with `:subject` where not all are meant; several in one text."""


@dataclass(frozen=True, slots=True)
class Known:
    """A documented failing of an engine. Strict: where the limit is met after all, the row fails; where it is
    missed by more than its bound (`known_bounds`), too."""

    metric: str
    engine: str
    reason: str
    scenario: str = ""
    profile: str = ""
    subject: str = ""
    never: bool = False  # the failing is that an event never happens


@dataclass(frozen=True, slots=True)
class Cause:
    """Why an engine fails, once, and where that shows; `never`: where it keeps an event from happening."""

    engine: str
    reason: str
    seen: Places
    never: Places = field(default_factory=dict)

    def known(self) -> Iterator[Known]:
        """One entry per profile, metric and scene, each with the line that shows it."""
        shown = ((places, False) for places in self.seen.items())
        hidden = ((places, True) for places in self.never.items())
        for (profiles, metrics), never in chain(shown, hidden):
            for profile in profiles.split():
                for metric, places in metrics.items():
                    for place in places.split():
                        yield self._entry(profile, metric, place, never)

    def _entry(self, profile: str, metric: str, place: str, never: bool) -> Known:
        scene, _, subject = place.partition(":")
        plain, noise, _ = profile.partition("+noisy")
        shows = f"touchstone run {scene} --engine {self.engine} --profile {plain}"
        if noise:
            shows += " --tracker noisy"
        if metric != "run":  # the failing is that the run ends before the scene does
            shows += f" --metric {metric}"
        label = plain + (NOISY if noise else "")
        return Known(metric, self.engine, f"{self.reason}: {shows}", scene, label, subject, never)
