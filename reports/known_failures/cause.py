"""A documented failing, and a cause that is shared by several scenes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain

EVERY = "recommended equal-step default accurate"
"""All profiles of DART, Bullet and MuJoCo."""
NOISY = ", tracker=noisy"
"""Suffix of the profile in rows with noisy trackers; a cause writes `+noisy` after the profile instead."""
Places = Mapping[str, Mapping[str, str]]
"""Profiles -> metric -> scenes, several in one text; `:subject` restricts a scene to one subject."""


@dataclass(frozen=True, slots=True)
class Known:
    """A documented failing of an engine. It is strict: a row that meets the limit after all fails, and so
    does a row beyond its bound (`bounds.csv`).

    In a chaotic scene rounding, and with it the processor, decides which pairs fail and by how much: one
    bound, of another order of magnitude, holds for all of them, and any of them may meet the limit.
    """

    metric: str
    engine: str
    reason: str
    scenario: str = ""
    profile: str = ""
    subject: str = ""
    never: bool = False  # the failing is that an event never happens
    reproduce: str = ""  # the command that shows it
    harness: bool = False  # our drive causes it
    chaotic: bool = False


@dataclass(frozen=True, slots=True)
class Cause:
    """The cause of an engine's failings, and the places where it shows; `never`: it prevents an event.
    `harness`: our drive is the cause, such as the gains of our servo. `chaotic`: scenes in which it is
    (`Known`)."""

    engine: str
    reason: str
    seen: Places
    never: Places = field(default_factory=dict)
    harness: bool = False
    chaotic: str = ""

    def known(self) -> Iterator[Known]:
        """One entry per profile, metric and scene, each with the command that shows it."""
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
        chaotic = scene in self.chaotic.split()
        return Known(
            *(metric, self.engine, self.reason, scene, label, subject, never, shows),
            harness=self.harness,
            chaotic=chaotic,
        )
