"""Tables of engines' settings: named choices and numbers, their values in every profile, and their checks.

A table imports no engine, so the command line can check `--set KEY=VALUE` quickly.
"""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import AdapterError
from touchstone.scenarios.avatar.number_checks import number_of


class SettingError(AdapterError):
    """Unknown setting or invalid value; the message names the valid ones."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Setting with named values, and its value in each profile of its engine ("": depends on the scene)."""

    name: str
    values: Mapping[str, int]
    profiles: tuple[str, ...]
    summary: str

    @property
    def valid(self) -> str:
        """Description of the valid values."""
        return "|".join(self.values)

    def number(self, text: str) -> int:
        """Value in the engine for a named value."""
        if text not in self.values:
            near = difflib.get_close_matches(text, self.values, n=1, cutoff=0.5)
            raise SettingError(f"found {text!r}" + (f"; did you mean {near[0]!r}?" if near else ""))
        return self.values[text]

    def word(self, number: float) -> str:
        """Named value for a value in the engine."""
        return {value: name for name, value in self.values.items()}[int(number)]


@dataclass(frozen=True, slots=True)
class Range:
    """Numeric setting [unit] between `least` and `most`, integer if `whole`, and its value in each profile of
    its engine ("": depends on the scene or the step)."""

    name: str
    least: float
    most: float
    unit: str
    profiles: tuple[str, ...]
    summary: str
    whole: bool = True

    @property
    def valid(self) -> str:
        """Description of the valid values."""
        kind = "whole, " if self.whole else ""
        return f"{kind}{self.least:g} to {self.most:g} {self.unit}".rstrip()

    def number(self, text: str) -> float:
        """Value in the engine for a number given as text."""
        try:
            number = number_of(text)
        except ValueError:
            number = inf
        if not self.least <= number <= self.most or (self.whole and number % 1):
            raise SettingError(f"found {text!r}")
        return int(number) if self.whole else number

    def word(self, number: float) -> float:
        """Number for a value in the engine."""
        return int(number) if self.whole else float(number)


@dataclass(frozen=True, slots=True)
class Numbers:
    """Setting of several numbers, written with colons between them, and its value in each profile."""

    name: str
    bounds: tuple[tuple[float, float], ...]
    profiles: tuple[str, ...]
    summary: str

    @property
    def valid(self) -> str:
        """Description of the valid values."""
        return ":".join(f"[{least:g} to {most:g}]" for least, most in self.bounds)

    def number(self, text: str) -> tuple[float, ...]:
        """Values in the engine for numbers given as text."""
        try:
            found = tuple(map(float, text.split(":")))
        except ValueError:
            found = ()
        if len(found) != len(self.bounds) or not all(
            least <= x <= most for x, (least, most) in zip(found, self.bounds)
        ):
            raise SettingError(f"found {text!r}")
        return found

    def word(self, number: Sequence[float]) -> str:
        """Text for values in the engine."""
        return ":".join(f"{float(x):g}" for x in number)


Setting = Choice | Range | Numbers


def table_of(module: str, profiles: Iterable[str]) -> Table:
    """The table in `settings.csv` beside a module (its `__file__`), a row a setting.

    `values`: names with their numbers in the engine (`off=0 on=1`), bounds (`0 to 1`, `whole 1 to 9`), or the
    bounds of several numbers (`0 to 1: 0 to 9`). A column for each profile. `idle`, where there is one:
    another setting and its values with which this one does nothing (`integrator=discrete`).
    """
    profiles = tuple(profiles)
    with open(Path(module).with_name("settings.csv"), encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    idle = {row["setting"]: re.split("[=|]", row["idle"]) for row in rows if row.get("idle")}
    settings = [_setting(row, tuple(row[profile] for profile in profiles)) for row in rows]
    return Table(profiles, settings, {name: tuple(words) for name, words in idle.items()})


def _setting(row: Mapping[str, str], profiles: tuple[str, ...]) -> Setting:
    name, values, summary = row["setting"], row["values"], row["summary"]
    if "=" in values:
        words = dict(word.split("=") for word in values.split())
        return Choice(name, {word: int(number) for word, number in words.items()}, profiles, summary)
    ends = [tuple(map(float, ends.split(" to "))) for ends in values.removeprefix("whole ").split(":")]
    bounds = tuple((least, most) for least, most in ends)
    if len(bounds) > 1:
        return Numbers(name, bounds, profiles, summary)
    return Range(name, *bounds[0], row["unit"], profiles, summary, whole=values.startswith("whole"))


class Table(Mapping[str, Setting]):
    """Settings of an engine by name, in the order of the table; `profiles`: columns, then those of `bare`.

    `idle`: setting -> another setting and its values with which the first does nothing. `bare`: profile that
    has none of the settings -> what it has instead.
    """

    def __init__(
        self,
        profiles: Iterable[str],
        rows: Iterable[Setting],
        idle: Mapping[str, tuple[str, ...]] | None = None,
        bare: Mapping[str, str] | None = None,
    ) -> None:
        self._bare = bare or {}
        self.profiles = (*profiles, *self._bare)
        self._rows = {row.name: row for row in rows}
        self._idle = idle or {}

    def __getitem__(self, name: str) -> Setting:
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def is_bare(self, profile: str) -> bool:
        """Whether a profile has none of the settings."""
        return profile in self._bare

    def column(self, profile: str) -> int:
        """Index of a profile; raises SettingError with the valid ones."""
        if profile not in self.profiles:
            raise SettingError(f"no profile {profile!r}; valid: {', '.join(self.profiles)}")
        return self.profiles.index(profile)

    def is_idle(self, name: str, values: Mapping[str, Any]) -> bool:
        """Whether a setting does nothing among these values of all settings."""
        other, *idle = self._idle.get(name, ("",))
        return bool(other) and values[other] in idle

    def values_of(self, profile: str) -> dict[str, str]:
        """Values in a profile of the settings that do something there."""
        if self.is_bare(profile):
            return {}
        column = self.column(profile)
        values = {name: setting.profiles[column] for name, setting in self.items()}
        return {name: value for name, value in values.items() if not self.is_idle(name, values)}

    def parse(self, text: str) -> tuple[Setting, str]:
        """Parse "key=value" into its setting and the same text in normal form; raises SettingError."""
        key, value = split(text)
        if key not in self:
            near = difflib.get_close_matches(key, self, n=1, cutoff=0.5)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise SettingError(f"unknown setting {key!r}{hint} (valid: {', '.join(self)})")
        setting = self[key]
        try:
            return setting, f"{key}={setting.word(setting.number(value))}"  # type: ignore[arg-type]
        except SettingError as error:
            raise SettingError(f"{key}: {error} (valid: {setting.valid})") from None

    def changes(self, profile: str, wanted: Iterable[str]) -> tuple[str, ...]:
        """Requested "key=value" that differ from a profile, in the table's order; raises SettingError."""
        if self.is_bare(profile):
            for key, _ in map(split, wanted):
                raise SettingError(f"{key}: profile {profile} has no such setting: {self._bare[profile]}")
            return ()
        found: dict[str, str] = {}
        for setting, text in map(self.parse, wanted):
            if found.setdefault(setting.name, text) != text:
                raise SettingError(f"{setting.name}: given as {found[setting.name]} and {text}")
        column = self.column(profile)
        plain = {
            name: self.parse(f"{name}={setting.profiles[column]}")[1] if setting.profiles[column] else ""
            for name, setting in self.items()
        }
        values = {name: split(found.get(name, plain[name]))[1] for name in self}
        for name in found:
            if self.is_idle(name, values):
                other = self._idle[name][0]
                raise SettingError(
                    f"{name}: does nothing with {other}={values[other]}, as in profile {profile}"
                )
        return tuple(found[name] for name in self if name in found and found[name] != plain[name])

    def in_force(self, profile: str, changed: Iterable[str]) -> dict[str, Any]:
        """Values in the engine of a profile with its changes, by the setting's name; those that depend on the
        scene or the step are missing."""
        plain = [f"{name}={value}" for name, value in self.values_of(profile).items() if value]
        return self.numbers(plain) | self.numbers(changed)

    def numbers(self, changed: Iterable[str]) -> dict[str, Any]:
        """Values in the engine of "key=value" texts, by the setting's name."""
        return {setting.name: setting.number(split(text)[1]) for setting, text in map(self.parse, changed)}


def split(text: str) -> tuple[str, str]:
    """Key and value of "key=value"; the value is empty if "=" is missing."""
    key, _, value = text.partition("=")
    return key.strip(), value.strip()
