"""Limits that scenes bring along or a file gives, beside our own.

A scene without one of the catalogue's tags is foreign: our limits and known failings say nothing of it. A
limit of its own, or of a file, replaces ours in the rows that it covers.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from touchstone.adapters.registry import ENGINES
from touchstone.reports.bootstrap import RATIOS
from touchstone.reports.metrics import HORIZON, METRICS, SPREAD
from touchstone.reports.verdict.limits import Limit
from touchstone.scenarios.catalogue import tags
from touchstone.scenarios.files.read import SceneFileError, data_of_file, placed
from touchstone.scenarios.scenario import Scenario

OWN, OF_FILE = "the scene's own limit", "limit of the file"


def is_foreign(scenario: Scenario) -> bool:
    """Whether a scene has none of the catalogue's tags."""
    return not scenario.tags or not set(scenario.tags) & set(tags())


def own_limits(scenario: Scenario, of_file: Iterable[Limit] = ()) -> tuple[Limit, ...]:
    """Limits of a scene and of a file, whose later ones win among equals."""
    own = (
        Limit(one.metric, one.largest, one.reason or OWN, one.engine, "", one.profile, one.subject)
        for one in scenario.limits
    )
    return (*own, *of_file)


def valid_metrics() -> tuple[str, ...]:
    """Names of all metrics of a run, those that compare engines included."""
    spreads = (f"{name}.spread" for name in METRICS if name.startswith("events."))
    return (*METRICS, *spreads, SPREAD, HORIZON, *RATIOS)


def check_limits(scenarios: Iterable[Scenario]) -> None:
    """Raise SceneFileError with a line per limit of a scene that names no metric, engine or profile."""
    faults = [
        f"{scenario.name}: limits[{i}].{field}: {text}"
        for scenario in scenarios
        for i, limit in enumerate(scenario.limits)
        for field, text in _unknown(limit.metric, limit.engine, limit.profile)
    ]
    if faults:
        raise SceneFileError("\n".join(faults))


def _unknown(metric: str, engine: str, profile: str) -> Iterable[tuple[str, str]]:
    profiles = dict.fromkeys(name for entry in ENGINES.values() for name in entry.profiles)
    asked = (("metric", metric, valid_metrics()), ("engine", engine, ENGINES), ("profile", profile, profiles))
    for field, name, valid in asked:
        of_others = field == "engine" and ":" in name  # a class that is not registered
        if name not in valid and (name or field == "metric") and not of_others:
            near = difflib.get_close_matches(name, list(valid), n=3, cutoff=0.5)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            yield field, f"unknown {field} {name!r}{hint}"


def limits_of_file(path: Path) -> tuple[Limit, ...]:
    """Limits of a TOML or JSON file: an array `limits` with the fields of `Limit`.

    Raises:
        SceneFileError: the file is not valid; one line per fault.
    """
    from pydantic import Strict, create_model  # import on demand: runs without such a file need none

    number = Annotated[float, Strict()]
    names = dict.fromkeys(("reason", "engine", "scenario", "profile", "subject"), (str, ""))
    forbid = {"extra": "forbid"}
    one = create_model("Limit", __config__=forbid, metric=(str, ...), largest=(number, ...), **names)  # type: ignore
    model = create_model("Limits", __config__=forbid, limits=(tuple[one, ...], ...))  # type: ignore
    data, faults, message_of = data_of_file(path, model)
    found = data.get("limits", ())
    for i, entry in enumerate(found):
        unknown = _unknown(entry["metric"], entry.get("engine", ""), entry.get("profile", ""))
        faults += [(placed(f"limits[{i}].{field}"), text) for field, text in unknown]
    if faults:
        raise SceneFileError(message_of(faults))
    return tuple(Limit(**{"reason": OF_FILE, **entry}) for entry in found)
