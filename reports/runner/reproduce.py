"""The command that measures rows of a run again."""

from __future__ import annotations

from touchstone.adapters.registry import ENGINES
from touchstone.reports.results import Row
from touchstone.reports.runner.request import EVERY_ENGINE, MACHINE_PROFILE, step_text
from touchstone.reports.verdict.limits import valid_metrics
from touchstone.scenarios.catalogue import catalogue

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
        return f"touchstone {first.study} {first.scenario}"
    engine, _, version = first.engine.partition("==")
    sides = list(dict.fromkeys(side for row in rows for side in _sides(row)))
    engines = dict.fromkeys(name for name, _ in sides if name != EVERY_ENGINE)
    words = ["touchstone run", first.scenario, *(f"--engine {name}" for name in engines)]
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


def script_command(row: Row) -> str:
    """The command that writes what a row's column does in the engine's own API; "" without one."""
    entry = ENGINES.get(row.engine)
    if entry is None or not entry.script or row.scenario not in catalogue():
        return ""
    profile, *changes = row.profile.split(", ")
    if any(change.partition("=")[0] in OPTIONS for change in changes):
        return ""
    words = ["touchstone reproduce", row.scenario, f"--engine {row.engine} --profile {profile}"]
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
