"""Settings that a search may try: profiles, native steps, and other values of every setting of an engine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.knobs import Choice, Numbers, Range, Setting, split
from touchstone.adapters.recorder import substeps
from touchstone.adapters.registry import ENGINES, settings_of
from touchstone.scenarios.scenario import Scenario

FACTORS = (0.1, 0.25, 0.5, 2.0, 4.0, 10.0)
"""What a number of a profile is multiplied by [1]."""
SHARES = (0.1, 0.01, 1e-4, 1e-6)
"""Shares of the largest value of a number that is zero in every profile [1]."""
COUNTS = (1, 3, 10, 30, 100, 300)
"""Values of a whole number that is zero, or depends on the scene, in every profile."""
SMALL = (1e-4, 1e-6, 1e-8, 1e-10)
"""Values of a number that depends on the scene in every profile."""
TOWARDS = 0.8
"""Share of the way to a bound by which one of several numbers is moved [1]."""
LADDER = (1, 2, 4, 8, 16, 32, 64)
"""Steps of a frame of 1/60 s that are tried; a scene of another rate has as many a frame."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A setting of an engine: profile, native step [s], and changes as `Settings.changes`."""

    profile: str
    dt: float
    changes: tuple[str, ...] = ()

    @property
    def settings(self) -> Settings:
        """How to run the engine."""
        return Settings(self.profile, self.dt, self.changes)


class Space:
    """Candidates of an engine in scenes."""

    def __init__(self, engine: str, scenarios: Sequence[Scenario]) -> None:
        self.engine, self._table = engine, settings_of(engine)
        self._profiles = ENGINES[engine].profiles
        self.steps = [
            1 / (60 * k) for k in LADDER if all(_divides(scenario, 1 / (60 * k)) for scenario in scenarios)
        ]
        self._texts = [text for one in self._table.values() for text in values_of(one)]

    def profiles(self) -> list[Candidate]:
        """Every profile at its own step."""
        return list(dict.fromkeys(Candidate(name, dt) for name, dt in self._profiles.items()))

    def first(self, rng: np.random.Generator) -> list[Candidate]:
        """Every profile at its step, then in drawn order: every profile at every step, and after each two
        settings changed alone in the first profile. `equal-step` is another profile at one step."""
        name, dt = next(iter(self._profiles.items()))
        steps = [Candidate(one, step) for one in self._profiles if one != "equal-step" for step in self.steps]
        alone = [one for text in self._texts if (one := self.changed(Candidate(name, dt), text))]
        for several in (steps, alone):
            rng.shuffle(several)
        found = self.profiles()
        while steps or alone:
            found += [*steps[:1], *alone[:2]]
            del steps[:1], alone[:2]
        return list(dict.fromkeys(found))

    def changed(self, candidate: Candidate, text: str) -> Candidate | None:
        """A candidate with one more change, or another value of a changed one; None if it does nothing."""
        others = [one for one in candidate.changes if split(one)[0] != split(text)[0]]
        try:
            changes = self._table.changes(candidate.profile, (*others, text))
        except AdapterError:
            return None
        found = Candidate(candidate.profile, candidate.dt, changes)
        return None if found == candidate else found

    def near(self, candidate: Candidate, others: Iterable[Candidate], rng: np.random.Generator) -> Candidate:
        """A candidate that differs in one thing: a change of another good one, a value, or the step."""
        known = list(others)
        for _ in range(20):
            kind = int(rng.integers(4))
            found: Candidate | None = None
            if kind == 0 and self.steps:
                found = Candidate(
                    candidate.profile, self.steps[int(rng.integers(len(self.steps)))], candidate.changes
                )
            elif kind == 1 and known:
                found = self._joined(candidate, known[int(rng.integers(len(known)))])
            elif kind == 2 and candidate.changes:
                text = candidate.changes[int(rng.integers(len(candidate.changes)))]
                values = values_about(self._table[split(text)[0]], split(text)[1])
                found = self.changed(candidate, values[int(rng.integers(len(values)))]) if values else None
            elif self._texts:
                found = self.changed(candidate, self._texts[int(rng.integers(len(self._texts)))])
            if found is not None and found != candidate:
                return found
        return candidate

    def _joined(self, candidate: Candidate, other: Candidate) -> Candidate | None:
        """A candidate with the changes of another too."""
        found: Candidate | None = candidate
        for text in other.changes:
            found = (found and self.changed(found, text)) or found
        return found


def values_of(setting: Setting) -> list[str]:
    """Values of a setting as "key=value": all of a choice; of a number, around those of the profiles."""
    plain = list(dict.fromkeys(value for value in setting.profiles if value))
    if isinstance(setting, Choice):
        return [f"{setting.name}={value}" for value in setting.values]
    found = [text for value in plain for text in values_about(setting, value)]
    if isinstance(setting, Range) and not any(float(value) for value in plain):
        if setting.whole:
            values: Sequence[float] = COUNTS
        else:
            values = SMALL if not plain else [share * setting.most for share in SHARES]
        found += _valid(setting, values)
    return list(dict.fromkeys((*found, *(f"{setting.name}={value}" for value in plain))))


def values_about(setting: Setting, value: str) -> list[str]:
    """Values near one of a number, or of several numbers; other choices."""
    if isinstance(setting, Choice):
        return [f"{setting.name}={one}" for one in setting.values if one != value]
    if isinstance(setting, Range):
        return _valid(setting, [float(value) * factor for factor in FACTORS])
    assert isinstance(setting, Numbers)
    numbers, found = setting.number(value), []
    for k, (least, most) in enumerate(setting.bounds):
        for bound in (least, most):
            if isfinite(bound):
                moved = [*numbers]
                moved[k] = min(max(float(f"{numbers[k] + TOWARDS * (bound - numbers[k]):.4g}"), least), most)
                found.append(f"{setting.name}={setting.word(moved)}")
    return found


def _valid(setting: Range, values: Iterable[float]) -> list[str]:
    inside = [min(max(value, setting.least), setting.most) for value in values]
    rounded = [round(one) if setting.whole else float(f"{one:.4g}") for one in inside]
    return [f"{setting.name}={setting.word(one)}" for one in dict.fromkeys(rounded)]


def _divides(scenario: Scenario, dt: float) -> bool:
    try:
        substeps(scenario, dt)
    except ValueError:
        return False
    return True
