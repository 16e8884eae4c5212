"""Catalogue of scenarios by name, with tags; collects every function of `families/` marked `@scene`."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable
from functools import cache

from touchstone.scenarios.scenario import HOLD_LAST, Scenario

Scene = Callable[[], Scenario | tuple[Scenario, ...]]
_MARK = "is_touchstone_scene"


def scene(function: Scene) -> Scene:
    """Mark a function of `families/` that builds a scenario, or several with different parameters."""
    setattr(function, _MARK, True)
    return function


def catalogue(hold_last: bool = False) -> dict[str, Scenario]:
    """All scenarios by name, in alphabetical order. With `hold_last`, trackers repeat their last good sample
    where one is not finite; otherwise such a tracker is refused."""
    return built(hold_last)


@cache
def built(hold_last: bool) -> dict[str, Scenario]:
    """Cached result of `catalogue`."""
    token = HOLD_LAST.set(hold_last)
    try:
        return dict(sorted(_collected().items()))
    finally:
        HOLD_LAST.reset(token)


def _collected() -> dict[str, Scenario]:
    import touchstone.scenarios.families as families

    found: dict[str, Scenario] = {}
    for module_info in pkgutil.iter_modules(families.__path__):
        module = importlib.import_module(f"touchstone.scenarios.families.{module_info.name}")
        for value in vars(module).values():
            if callable(value) and getattr(value, _MARK, False):
                built = value()
                for scenario in (built,) if isinstance(built, Scenario) else built:
                    if scenario.name in found:
                        raise ValueError(f"two scenes are called {scenario.name!r}")
                    found[scenario.name] = scenario
    return found


def tags(hold_last: bool = False) -> tuple[str, ...]:
    """All tags in use."""
    return tuple(sorted({tag for scenario in catalogue(hold_last).values() for tag in scenario.tags}))


def tagged(tag: str, hold_last: bool = False) -> Iterable[Scenario]:
    """Scenarios with the tag `tag`."""
    return [scenario for scenario in catalogue(hold_last).values() if tag in scenario.tags]
