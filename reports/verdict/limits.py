"""Limits: those of `limits.toml`, and those that scenes bring along or a file gives.

A scene without one of the catalogue's tags is foreign: our limits and known failings say nothing of it. A
limit of its own, or of a file, replaces ours in the rows that it covers.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from touchstone.adapters.registry import ENGINES
from touchstone.reports.bootstrap import RATIOS
from touchstone.reports.metrics import HORIZON, METRICS, PARITY, SPREAD
from touchstone.reports.results import Row
from touchstone.scenarios.catalogue import tags
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.files.read import SceneFileError, data_of_file, placed
from touchstone.scenarios.scenario import MetricLimit, Scenario

if TYPE_CHECKING:
    from pydantic import BaseModel


@dataclass(frozen=True, slots=True)
class Limit:
    """Largest allowed absolute value [SI unit] of a metric (inf: any), for an engine, scenario or tag,
    profile and subject ("" = every one). The most specific limit wins; among equals the last.
    `by_construction`: the method meets it whatever it simulates, so meeting it says little."""

    metric: str
    largest: float
    reason: str
    engine: str = ""
    scenario: str = ""
    profile: str = ""
    subject: str = ""
    by_construction: bool = False


SCOPE = ("metric", "engine", "profile", "scenario", "subject")


def _each(entries: Iterable[Mapping[str, Any]]) -> Iterator[Limit]:
    """Limits of entries whose fields of SCOPE may be lists."""
    for entry in entries:
        scopes = [(name, entry[name]) for name in SCOPE if name in entry]
        choices = ([value] if isinstance(value, str) else value for _, value in scopes)
        for chosen in product(*choices):
            yield Limit(**{**entry, **dict(zip((name for name, _ in scopes), chosen))})


FILE = Path(__file__).with_name("limits.toml")
LEFT_OUT = "what a plan leaves out changes nothing"
LIMITS = (
    *_each(tomllib.loads(FILE.read_text("utf-8"))["limits"]),
    *(Limit("effects.changed", 0, LEFT_OUT, "reference", subject=f"+{effect}") for effect in PLANNED),
)


def limit_of(row: Row, tags: tuple[str, ...], among: Iterable[Limit] | None = None) -> Limit | None:
    """The most specific limit of a row among LIMITS or others, the last of equals; None if there is none."""
    among = LIMITS if among is None else among
    scopes: dict[str, tuple[str, ...]] = {"engine": (row.engine,), "scenario": (row.scenario, *tags)}
    scopes |= {"profile": (row.profile,), "subject": (row.subject,)}
    mine = (limit for limit in among if limit.metric == row.metric)
    fitting = [one for one in mine if all(getattr(one, name) in ("", *own) for name, own in scopes.items())]
    return max(reversed(fitting), key=lambda one: sum(bool(getattr(one, s)) for s in scopes), default=None)


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
    return (*METRICS, *spreads, SPREAD, HORIZON, PARITY, *RATIOS)


def check_limits(scenarios: Iterable[Scenario]) -> None:
    """Raise SceneFileError with a line per limit of a scene that names no metric, engine or profile, or whose
    `largest` bounds nothing."""
    faults = [
        f"{scenario.name}: limits[{i}].{field}: {text}"
        for scenario in scenarios
        for i, limit in enumerate(scenario.limits)
        for field, text in _faults(limit)
    ]
    if faults:
        raise SceneFileError("\n".join(faults))


def _faults(limit: Limit | MetricLimit) -> Iterator[tuple[str, str]]:
    """Fields of a limit that name nothing, or bound nothing, and what is wrong."""
    profiles = dict.fromkeys(name for entry in ENGINES.values() for name in entry.profiles)
    for field, valid in (("metric", valid_metrics()), ("engine", ENGINES), ("profile", profiles)):
        name = getattr(limit, field)
        of_others = field == "engine" and ":" in name  # a class that is not registered
        if name not in valid and (name or field == "metric") and not of_others:
            near = difflib.get_close_matches(name, list(valid), n=3, cutoff=0.5)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            yield field, f"unknown {field} {name!r}{hint}"
    if not limit.largest >= 0:  # NaN too
        yield "largest", f"found {limit.largest:g}, expected a number from 0 on"


def file_model() -> type[BaseModel]:
    """Model of a file of limits."""
    from pydantic import Field, Strict, create_model  # import on demand: runs without such a file need none

    names = str | tuple[str, ...]
    fields: dict[str, Any] = {name: (names, ... if name == "metric" else "") for name in SCOPE}
    fields |= {
        "largest": (Annotated[float, Strict(), Field(ge=0)], ...),
        "reason": (str, ""),
        "by_construction": (bool, False),
    }
    forbid = {"extra": "forbid"}
    one = create_model("Limit", __config__=forbid, **fields)  # type: ignore
    return create_model("Limits", __config__=forbid, limits=(tuple[one, ...], ...))  # type: ignore


def limits_of_file(path: Path) -> tuple[Limit, ...]:
    """Limits of a TOML or JSON file: an array `limits` with the fields of `Limit`, lists as in `limits.toml`.

    Raises:
        SceneFileError: the file is not valid; one line per fault.
    """
    data, faults, message_of = data_of_file(path, file_model())
    found = [tuple(_each([{"reason": OF_FILE, **entry}])) for entry in data.get("limits", ())]
    for i, of_entry in enumerate(found):
        unknown = [fault for one in of_entry for fault in _faults(one)]
        faults += [(placed(f"limits[{i}].{field}"), text) for field, text in dict.fromkeys(unknown)]
    if faults:
        raise SceneFileError(message_of(faults))
    return tuple(limit for of_entry in found for limit in of_entry)
