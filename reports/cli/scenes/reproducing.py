"""`touchstone reproduce`: what an engine does in a scene, as a script in the engine's own API."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli import options
from touchstone.reports.cli.scenes.chosen import AllowPathsOption, scenarios_for

if TYPE_CHECKING:
    from touchstone.adapters.contract import Settings
    from touchstone.scenarios.scenario import Scenario


def reproduce(
    scenario: Annotated[str, typer.Argument(help="Scene, or file of a scene.")],
    engine: Annotated[str, typer.Option(help="The engine: dart, bullet or mujoco.")],
    profile: Annotated[str, typer.Option(help="Profile (default: the first of the engine).")] = "",
    dt: Annotated[str, typer.Option(help="Native step, such as 1/240 (default: that of the profile).")] = "",
    change: Annotated[
        options.Names, typer.Option("--set", help="KEY=VALUE (touchstone list settings).")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="New file to write (default: standard output).")] = None,
    allow_paths: AllowPathsOption = False,
    quiet: options.QuietOption = False,
) -> None:
    """Write what an engine does in a scene as a script in the engine's own API, without touchstone.

    The script is run, and what it prints is compared with the recording of the adapter.
    """
    from touchstone.adapters.contract import AdapterError
    from touchstone.reports.run.reproducer import reproduced
    from touchstone.scenarios.plural import plural

    if out is not None:
        options.require_new(out)
    chosen, *others = scenarios_for([scenario], allow_paths=allow_paths)
    if others:
        options.stop(f"{scenario}: {1 + len(others)} scenes; name one of them")
    name = options.engines_named([engine])[0]
    settings = settings_for(chosen, name, profile, dt, change or [])
    try:
        with options.progress_for(chosen.frame_count, quiet, by_scene=True) as progress:
            found = reproduced(chosen, name, settings, progress)
    except AdapterError as error:
        options.stop(f"{chosen.name}: {error}")
    text = found.script.text
    if out is None:
        print(text, end="")
    else:
        options.write_file(out, lambda part: part.write_text(text, "utf-8"))
    same = "to the bit" if found.apart == 0 else f"up to {found.apart:.2g} m"
    if not quiet:
        for line in found.missed:
            print(f"misses {line}", file=sys.stderr)
        needs = f"{plural(len(text.splitlines()), 'line')}, needs {found.script.requirement}"
        said = f"{out or 'the script'}: {needs}; prints the positions of the recording {same}"
        print(said, file=sys.stderr)
    if not found.apart < EQUAL:
        options.stop(
            f"{chosen.name}: the script is {found.apart:.2g} m from the recording", options.LIMIT_BROKEN
        )


EQUAL = 1e-9
"""Difference of a script from a recording [m] beyond which it shows something else: rounding of positions
that are computed in another order."""


def settings_for(scenario: Scenario, engine: str, profile: str, dt: str, changes: list[str]) -> Settings:
    """Settings of one column; a wrong argument exits with one line."""
    from touchstone.adapters.contract import Settings
    from touchstone.adapters.registry import ENGINES, changes_of

    profiles = ENGINES[engine].profiles
    chosen = options.known("profile", profile, profiles) if profile else next(iter(profiles))
    step = options.step_for(dt, [scenario]) if dt else profiles[chosen]
    texts = options.changes_for([(engine, chosen)], changes)
    return Settings(chosen, step, changes_of(engine, chosen, texts))
