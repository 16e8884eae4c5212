"""The scenes that a command's arguments name: of the catalogue, or of files."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from touchstone.reports.cli.options import known, refusing, stop

if TYPE_CHECKING:
    from touchstone.reports.verdict.limits import Limit
    from touchstone.scenarios.scenario import Scenario

AllowPathsOption = Annotated[
    bool, typer.Option("--allow-paths", help="Let scene files name files outside their own folder.")
]
LimitsOption = Annotated[
    Path | None, typer.Option("--limits", help="TOML or JSON file whose limits add to ours or replace them.")
]


def scenarios_for(
    names: Iterable[str], tag: str = "", hold_last: bool = False, allow_paths: bool = False
) -> list[Scenario]:
    """Scenes of names and files (none: those with the tag); what is invalid exits with one line per fault.

    A name that is not in the catalogue may be that of a file NAME.toml or NAME.json in this folder.
    """
    from touchstone.scenarios import catalogue as scenes
    from touchstone.scenarios.files.named import NoScene, scenes_named
    from touchstone.scenarios.files.read import SceneFileError

    wanted = list(dict.fromkeys(names))
    try:
        found = scenes_named(wanted, hold_last, allow_paths)
    except SceneFileError as error:
        stop(str(error))
    except NoScene as error:
        _tell(scenes.faults(hold_last))
        known("scenario", error.name, _nearest(error.name) or scenes.catalogue(hold_last))
    if not wanted:
        found = list(scenes.tagged(known("tag", tag, scenes.tags(hold_last)), hold_last))
        _tell(scenes.faults(hold_last))
    return found


def _nearest(name: str) -> list[str]:
    """Hard scenes whose names are nearest to the name of one; they are too many to list."""
    from difflib import get_close_matches

    from touchstone.scenarios.difficulty.family import TAG, hard_names

    return get_close_matches(name, list(hard_names()), n=8, cutoff=0.0) if name.startswith(f"{TAG}_") else []


def _tell(lines: Iterable[str]) -> None:
    for line in lines:
        print(f"touchstone: {line}", file=sys.stderr)


def scene_notes(scenarios: Iterable[Scenario]) -> Iterator[str]:
    """One line per tracker that holds its last valid sample, per path that leaves its keyframes, and per
    scene in which bodies overlap at the start."""
    from touchstone.reports.metrics.oracles import judge_faults
    from touchstone.scenarios.avatar.tracking import swings

    measures = not judge_faults()
    for scenario in scenarios:
        if measures and (pairs := _overlaps(scenario)):
            a, b, depth = pairs[0]
            more = f", and {len(pairs) - 1} other pairs overlap" if len(pairs) > 1 else ""
            names = f"{scenario.bodies[a].name} and {scenario.bodies[b].name}"
            yield f"{scenario.name}: {names} overlap by {depth:.3g} m at the start{more}"
        for i, tracker in enumerate(scenario.trackers):
            place = f"{scenario.name}: trackers[{i}]"
            if tracker.held:
                count = len(tracker.times)
                yield f"{place} holds its last good sample at {tracker.held} of {count} keyframes"
            yield from (f'{place}: {line}; interpolation = "pchip" does not' for line in swings(tracker))


def _overlaps(scenario: Scenario) -> list[tuple[int, int, float]]:
    from touchstone.adapters.oracles.overlap import overlaps_at_start

    return overlaps_at_start(scenario)


def limits_for(path: Path | None, scenarios: Iterable[Scenario]) -> tuple[Limit, ...]:
    """Limits of a file; an invalid one, or a scene's limit on an unknown metric, exits with its line."""
    from touchstone.reports.verdict.limits import check_limits, limits_of_file
    from touchstone.scenarios.files.read import SceneFileError

    with refusing(SceneFileError):
        check_limits(scenarios)
        found = limits_of_file(path) if path else ()
    return found


def metrics_for(patterns: Iterable[str]) -> tuple[str, ...]:
    """Metrics of names and patterns such as `friction.*`; one that fits none exits with one line."""
    from fnmatch import fnmatchcase

    from touchstone.reports.verdict.limits import valid_metrics

    valid = valid_metrics()
    found: dict[str, None] = {}
    for pattern in patterns:
        fitting = [name for name in valid if fnmatchcase(name, pattern)]
        found |= dict.fromkeys(fitting or [known("metric", pattern, valid)])
    return tuple(found)
