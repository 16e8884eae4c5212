"""The request of a run, its results, and the command that shows a row again."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from time import monotonic

import pandas as pd

from touchstone.adapters.contract import DRIVES, Settings
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, changes_of
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.time_series import Course
from touchstone.reports.progress import ABOUT, Progress
from touchstone.reports.results import Row
from touchstone.reports.runner.cells import Cell
from touchstone.reports.verdict.limits import Limit, valid_metrics
from touchstone.reports.verdict.rows import warning
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.files.named import argument_of
from touchstone.scenarios.scenario import Scenario, ShortRepr

NUMBERS_OF_A_BODY = 13
"""Numbers per body and frame in a recording [1]: pose and velocities."""
FIRST_SECONDS = 10.0
"""Time of the first frames, by which the whole run is estimated [s]."""
TOLD = 60.0
"""Time of a run above which its estimate is said [s]."""
LONGEST = 3600.0
"""Time of a run above which it must be asked for [s]: the catalogue takes minutes."""
STUDY_LONGEST = 12 * 3600.0
"""The same of a study, a sweep or a bench [s]: a night."""
UNITS = (("years", 365 * 86400.0), ("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0), ("seconds", 1.0))


class TooLargeError(ValueError):
    """A run takes more time or memory than was asked for; the message says how much."""


def check_memory(scenarios: Sequence[Scenario], columns: int) -> None:
    """Raise TooLargeError if the recordings of a scene do not fit into this machine's memory.

    Args:
        columns: number of engines and profiles that play at a time.
    """
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    for scenario in scenarios:
        needed = 8 * NUMBERS_OF_A_BODY * len(scenario.bodies) * scenario.frame_count * columns
        if needed > memory:
            raise TooLargeError(
                f"{scenario.name}: {columns} recordings of {scenario.frame_count} frames take "
                f"{needed / 1e9:.3g} GB, and this machine has {memory / 1e9:.3g} GB; shorten its duration"
            )


def limited(progress: Progress, total: int, longest: float | None = None, unit: str = "frames") -> Progress:
    """A progress over `total` frames, or other units, which says an estimate of their time after the first;
    raises TooLargeError where they would take more than `longest` [s] (LONGEST) on an idle machine."""
    most = LONGEST if longest is None else longest
    began, done, judged = 0.0, 0, False

    def step(label: str, frames: int) -> None:
        nonlocal began, done, judged
        progress(label, frames)
        if judged or not frames:
            return
        if not began:  # the first frames compile kernels
            began = monotonic()
            return
        done += frames
        elapsed = monotonic() - began
        if elapsed >= FIRST_SECONDS:
            judged = True
            # a machine that others load now may be idle later
            crowd = max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
            left = elapsed / done * (total - done) / crowd
            if left > most:
                raise TooLargeError(f"{total} {unit} would take about {_words(left)}; --yes plays them")
            if left > TOLD:
                progress(f"{ABOUT}{_words(left)} for {total} {unit}", 0)

    return step


def _words(seconds: float) -> str:
    unit, size = next((one for one in UNITS if seconds >= one[1]), UNITS[-1])
    return f"{seconds / size:.3g} {unit}"


STUDY = "run"
REFERENCE = "reference"
EVERY_ENGINE = "all"
"""Engine of a row that is about all of them."""
MACHINE_PROFILE, EQUAL_PROFILE = "recommended", "equal-step"
DEFAULT_PROFILES = ("balanced", "paper", "recommended")


@dataclass(frozen=True, slots=True, repr=False)
class Request(ShortRepr):
    """What to run: scenes, (engine, profile) columns, an optional native step [s], and the output folder.

    Changed settings apply to the engines that they name ("mujoco.cone=elliptic"), or to all.
    """

    scenarios: tuple[Scenario, ...]
    columns: tuple[tuple[str, str], ...]
    out: Path
    dt: float | None = None
    metrics: tuple[str, ...] = ()
    command: str = ""
    changes: tuple[str, ...] = ()  # "key=value" in the reference's profiles
    effects: tuple[str, ...] | None = None  # to run in every scene; None: what each scene needs
    drive: str = "native"  # of driven bodies
    tracker: str = "ideal"  # the variant of the trackers that the scenes have
    limits: tuple[Limit, ...] = ()  # of a file; they come before the scenes' own and ours

    def settings(self, engine: str, profile: str) -> Settings:
        """The settings of a column."""
        dt = self.dt or ENGINES[engine].profiles[profile]
        changed = changes_of(engine, profile, self.changes)
        # the reference has one servo of its own
        drive = DRIVES[0] if engine == REFERENCE and self.drive == "torque" else self.drive
        return Settings(profile, dt, changed, self.effects, drive=drive, tracker=self.tracker)


@dataclass
class Results:
    """Results of a run: the long table; per (scenario, engine, profile) the recording (of a failed run, up to
    the failure) and the time series; a warning per run that left contacts unresolved."""

    frame: pd.DataFrame
    recordings: dict[tuple[str, str, str], Recording] = field(default_factory=dict)
    ended: dict[tuple[str, str, str], Recording] = field(default_factory=dict)
    courses: dict[tuple[str, str, str], Course] = field(default_factory=dict)
    playback: dict[str, str] = field(default_factory=dict)  # per scene, recordings packed for the page
    warnings: list[str] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)  # pages that could not be written, and why

    def __repr__(self) -> str:
        """Scenes, columns, rows and verdicts, by their numbers."""
        frame = self.frame
        verdicts = frame.verdict[frame.verdict != ""].value_counts()
        counts = ", ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
        columns = frame[frame.engine != EVERY_ENGINE][["engine", "profile"]].drop_duplicates()
        return (
            f"<Results: scenes {frame.scenario.nunique()}, columns {len(columns)}, rows {len(frame)}, "
            f"recordings {len(self.recordings)}; {counts or 'no verdicts'}>"
        )

    def write(self, what: str, page: Callable[[], object]) -> None:
        """Write a page or a picture; what was measured survives one that fails."""
        try:
            page()
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".splitlines()[0]
            self.faults.append(f"{what} could not be written; results are stored: {reason}")

    def warn(self, base: Row, context: Context) -> None:
        """Store the warning of a run, if it has one."""
        line = warning(base, context)
        self.warnings += [line] if line else []


def step_text(dt: float) -> str:
    """A step as a fraction of a second: 1/240."""
    return str(Fraction(dt).limit_denominator(100_000)) if dt == dt else "-"


def columns_of(engines: Iterable[str], profiles: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """(engine, profile) columns: each engine in those of the profiles that it has. With DEFAULT_PROFILES, an
    engine that has none of them plays its first."""
    wanted, columns = tuple(profiles), []
    for engine in engines:
        valid = ENGINES[engine].profiles
        mine = [profile for profile in wanted if profile in valid]
        if not mine and wanted == DEFAULT_PROFILES:
            mine = [next(iter(valid))]
        columns += [(engine, profile) for profile in mine]
    return tuple(columns)


RATIO = "ratio."
"""Start of the metrics of a row whose subject is another column."""
BENCH = "bench "
"""Start of the name of a study that starts every engine several times."""

OPTIONS = ("drive", "tracker", "effects")
"""Parts of a column's label that are options of their own; the others are changed settings."""


def reproduce(*rows: Row) -> str:
    """The command that measures rows of one scene again, side by side; for a ratio, both of its engines; for
    `ENGINE==VERSION` that version."""
    first = rows[0]
    if first.study.startswith(BENCH):
        return f"touchstone {first.study} {argument_of(first.scenario)}"
    engine, _, version = first.engine.partition("==")
    sides = list(dict.fromkeys(side for row in rows for side in _sides(row)))
    engines = dict.fromkeys(name for name, _ in sides if name != EVERY_ENGINE)
    words = ["touchstone run", argument_of(first.scenario), *(f"--engine {name}" for name in engines)]
    words += dict.fromkeys(f"--profile {label.split(', ')[0]}" for _, label in sides)
    if version:
        words[0], words[2] = "touchstone versions", f"--engine {engine}"
        return " ".join([*words, f"--version {version}"])
    words += dict.fromkeys(
        _option(change, f"{name}." * (len(engines) > 1))
        for name, label in sides
        for change in label.split(", ")[1:]
    )
    words += dict.fromkeys(f"--dt {step_text(row.dt)}" for row in rows if _is_changed_step(row))
    words += dict.fromkeys(f"--metric {row.metric}" for row in rows if row.metric in valid_metrics())
    return " ".join(words)


def line_of(cell: Cell, all_effects: bool = False) -> str:
    """The command that plays a cell's scene; with `all_effects` as after a run that left its plan."""
    changed = "".join(f" --set {change}" for change in cell.changes)
    effects = " --effects all" if cell.effects or all_effects else ""
    column = f"--engine {cell.engine} --profile {cell.profile} --dt {step_text(cell.dt)}"
    return f"touchstone run {cell.scenario} {column}{changed}{effects}"


def script_command(row: Row) -> str:
    """The command that writes what a row's column does in the engine's own API; "" without one."""
    entry = ENGINES.get(row.engine)
    if entry is None or not entry.script or row.scenario not in catalogue():
        return ""
    profile, *changes = row.profile.split(", ")
    if any(change.partition("=")[0] in OPTIONS for change in changes):
        return ""
    words = ["touchstone reproduce", argument_of(row.scenario), f"--engine {row.engine} --profile {profile}"]
    words += [f"--set {change}" for change in changes]
    words += [f"--dt {step_text(row.dt)}"] if _is_changed_step(row) else []
    return " ".join(words)


def _sides(row: Row) -> list[tuple[str, str]]:
    """Engines and labels of the columns behind a row."""
    if row.engine == EVERY_ENGINE:
        return [(row.engine, "balanced"), (row.engine, MACHINE_PROFILE)]
    other, _, label = row.subject.partition(" ")
    both = row.metric.startswith(RATIO) and other in ENGINES
    return [(row.engine, row.profile), *([(other, label)] if both else [])]


def _option(change: str, engine: str) -> str:
    key, _, value = change.partition("=")
    return f"--{key} {value.replace('+', ',')}" if key in OPTIONS else f"--set {engine}{change}"


def _is_changed_step(row: Row) -> bool:
    """Whether the step is not that of the profile."""
    entry = ENGINES.get(row.engine)
    own = entry.profiles.get(row.profile.split(", ")[0]) if entry else None
    return own is not None and row.dt == row.dt and abs(own - row.dt) > 1e-9 * row.dt
