"""`touchstone challenge`: the column of a settings file beside the engine's `recommended`."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes import scenarios_for

if TYPE_CHECKING:
    from touchstone.reports.results import Row

MISSED = ("fail", "known", "error")
"""Verdicts of rows over their limits, and of runs that did not end. A known failing counts: it is one of
`recommended`, and new settings have none."""
TIME = "time.frame.median"


@dataclass(frozen=True, slots=True)
class SettingsFile:
    """A settings file.

    Attributes:
        settings: changes of the profile by name, as `--set` takes them.
        source: where the engine's documentation or maintainers recommend them.
        by: who answers for them.
    """

    engine: str
    settings: dict[str, str]
    source: str
    by: str
    profile: str = "recommended"
    dt: str = ""


def challenge(
    file: Annotated[Path, typer.Argument(help="Settings of an engine (TOML or JSON; docs/challenge.md).")],
    scenario: Annotated[options.Names, typer.Argument(help="Scenes (default: --tag).")] = None,
    tag: Annotated[str, typer.Option(help="Play every scene with this tag.")] = "probe",
    out: Annotated[
        Path | None, typer.Option(help="Folder of both runs (default: runs/challenge-TIME).")
    ] = None,
    quiet: options.QuietOption = False,
) -> None:
    """Play a settings file beside the engine's recommended profile: rows over their limits, and time.

    Exit code 1: more rows are over their limits than under `recommended`.
    """
    from touchstone.adapters.registry import ENGINES
    from touchstone.reports.results import rows_of
    from touchstone.reports.run.study import run
    from touchstone.reports.runner.request import MACHINE_PROFILE, Request

    given = settings_file(file)
    engine = options.engine_installed(given.engine)
    scenarios = tuple(scenarios_for(scenario or [], tag))
    profiles = list(ENGINES[engine].profiles)
    own, named = (engine, options.known("profile", given.profile, profiles)), f"{engine} {given.profile}"
    before = (engine, MACHINE_PROFILE if MACHINE_PROFILE in profiles else profiles[0])
    changes = options.changes_for([own], [f"{engine}.{key}={value}" for key, value in given.settings.items()])
    step = options.step_for(given.dt, list(scenarios)) if given.dt else None
    options.require_judge()
    folder = out or options.folder_of_now("challenge-")
    options.require_new(folder)
    command = " ".join(["touchstone", *sys.argv[1:]])
    requests = (
        Request(scenarios, (before,), folder / "before", command=command),
        Request(scenarios, (own,), folder / "settings", step, command=command, changes=changes),
    )
    tables, frames = [], sum(one.frame_count for one in scenarios)
    for request in requests:
        with options.progress_for(frames, quiet, by_scene=True) as progress:
            tables.append(rows_of(run(request, progress).frame))
    counts = [sum(1 for _ in missed(rows)) for rows in tables]
    if not quiet:
        print("\n".join(_lines(" ".join(before), f"{named} with {file}", tables)))
        print(f"settings: {'; '.join(changes) or 'as the profile'}; by {given.by}; {given.source}")
        print(f"results: {folder}")
    if counts[1] > counts[0]:
        raise typer.Exit(options.LIMIT_BROKEN)


def settings_file(path: Path) -> SettingsFile:
    """The settings of a file; a fault exits with a line that names its place."""
    from pydantic import create_model

    from touchstone.scenarios.files.read import SceneFileError, data_of_file

    texts = dict.fromkeys(("engine", "source", "by"), (str, ...)) | {"profile": (str, "recommended")}
    fields = {**texts, "dt": (str, ""), "settings": (dict[str, str], ...)}
    model = create_model("Settings", __config__={"extra": "forbid"}, **fields)  # type: ignore[call-overload]
    with options.refusing(SceneFileError):
        data, faults, message_of = data_of_file(path, model)
    if faults:
        options.stop(message_of(faults))
    return SettingsFile(**data)


def missed(rows: Iterable[Row]) -> Iterator[Row]:
    """Rows over their limits, and runs that did not end; ratios to the reference depend on the machine."""
    return (row for row in rows if row.verdict in MISSED and not row.metric.startswith("ratio."))


def _lines(before: str, after: str, tables: list[list[Row]]) -> Iterator[str]:
    """Counts and times of both columns, then the scenes whose counts differ."""
    from collections import Counter

    from touchstone.scenarios.plural import plural

    counts = [Counter(row.scenario for row in missed(rows)) for rows in tables]
    times = [sum(row.value for row in rows if row.metric == TIME) for rows in tables]
    for name, count, time in zip((before, after), counts, times):
        yield f"{name}: {plural(count.total(), 'row')} over limits; sum of median frames {time * 1e3:.3g} ms"
    yield "one run of each: times are no verdict (touchstone bench frame)"
    for word, sign in (("better", -1), ("worse", 1)):
        found = {name: counts[1][name] - counts[0][name] for name in {*counts[0], *counts[1]}}
        names = sorted((n for n in found if found[n] * sign > 0), key=lambda n: (-abs(found[n]), n))
        yield f"{word}: {', '.join(f'{name} {found[name]:+d}' for name in names) or 'nowhere'}"
