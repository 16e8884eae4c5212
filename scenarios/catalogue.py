"""Name -> Scenario, with tags. Finds every function marked `@scene` in `families/` by itself."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable
from functools import cache

from scenarios.scenario import Scenario

Scene = Callable[[], Scenario | tuple[Scenario, ...]]
_MARK = "is_touchstone_scene"


def scene(function: Scene) -> Scene:
    """Mark a function of `families/` that builds a scenario, or several that differ in their numbers."""
    setattr(function, _MARK, True)
    return function


@cache
def catalogue() -> dict[str, Scenario]:
    """All scenarios by name, in alphabetical order."""
    import scenarios.families as families

    found: dict[str, Scenario] = {}
    for module_info in pkgutil.iter_modules(families.__path__):
        module = importlib.import_module(f"scenarios.families.{module_info.name}")
        for value in vars(module).values():
            if callable(value) and getattr(value, _MARK, False):
                built = value()
                for scenario in (built,) if isinstance(built, Scenario) else built:
                    if scenario.name in found:
                        raise ValueError(f"two scenes are called {scenario.name!r}")
                    found[scenario.name] = scenario
    return dict(sorted(found.items()))


def tags() -> tuple[str, ...]:
    """All tags in use."""
    return tuple(sorted({tag for scenario in catalogue().values() for tag in scenario.tags}))


def tagged(tag: str) -> Iterable[Scenario]:
    """The scenarios that carry `tag`."""
    return [scenario for scenario in catalogue().values() if tag in scenario.tags]
