"""Catalogue of scenarios by name, with tags; collects every function of `families/` marked `@scene`.

Hard scenes (`difficulty/`, tag `hard`) are built only where one is asked for by name or by their tag: `find`
and `tagged` know them, `catalogue` does not hold them.
"""

import importlib
import pkgutil
import traceback
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from types import ModuleType

from touchstone.scenarios.difficulty.family import TAG, hard_names, hard_scene
from touchstone.scenarios.scenario import HOLD_LAST, Scenario, ScenarioError

Scene = Callable[[], Scenario | tuple[Scenario, ...]]
_MARK = "is_touchstone_scene"
TAGS = {
    "belt": "a surface moves",
    "collective": "many contacts act at a time, so that metrics of a single pair tell nothing",
    "conservative": "energy is kept",
    "curved": "bodies roll, rock and slip with a truth",
    "driven": "hands and persons press, hold, lift and carry",
    "friction_laws": "static, rolling or torsional friction",
    "gallery": "what `touchstone run` plays",
    TAG: "hard cases, built when they are asked for",
    "headings": "equal bodies differ in their heading alone",
    "heap": "hundreds of pairs touch",
    "impact": "bodies meet",
    "isolated": "momentum is kept",
    "joints": "joints connect bodies",
    "large": "engines take minutes",
    "literature": "published values",
    "prescribed": "a prescribed body carries others",
    "probe": "what the invariants of tests run over",
    "seeded": "a seed draws speeds and friction",
    "settles": "all comes to rest",
    "symmetric": "the scene is its own mirror image at x = 0",
    "terrain": "height fields and meshes",
}
"""What the scenes of each tag have in common. Scene files may have others."""


def scene(function: Scene) -> Scene:
    """Mark a function of `families/` that builds a scenario, or several with different parameters."""
    setattr(function, _MARK, True)
    return function


def catalogue(hold_last: bool = False) -> dict[str, Scenario]:
    """All scenarios by name, in alphabetical order. With `hold_last`, trackers repeat their last good sample
    where one is not finite; otherwise such a tracker is refused. Broken scenes are left out: see `faults`."""
    return built(hold_last)[0]


def faults(hold_last: bool = False) -> tuple[str, ...]:
    """One line per file or function of `families/` that gives no scene, and why."""
    return built(hold_last)[1]


@cache
def built(hold_last: bool) -> tuple[dict[str, Scenario], tuple[str, ...]]:
    """Cached result of `catalogue` and `faults`."""
    token = HOLD_LAST.set(hold_last)
    try:
        found, broken = _collected()
        return dict(sorted(found.items())), tuple(broken)
    finally:
        HOLD_LAST.reset(token)


def _collected() -> tuple[dict[str, Scenario], list[str]]:
    import touchstone.scenarios.families as families

    found: dict[str, Scenario] = {}
    broken: list[str] = []
    for module_info in pkgutil.iter_modules(families.__path__):
        name = f"touchstone.scenarios.families.{module_info.name}"
        own, lines = scenes_of(partial(importlib.import_module, name), f"families/{module_info.name}.py")
        broken += lines
        for scenario in own.values():
            if scenario.name in found:
                broken.append(f"families/{module_info.name}.py: two scenes are called {scenario.name!r}")
            else:
                found[scenario.name] = scenario
    return found, broken


def scenes_of(
    load: Callable[[], ModuleType], file: str, also: tuple[type[BaseException], ...] = ()
) -> tuple[dict[str, Scenario], list[str]]:
    """Scenes by name of a module's functions marked `@scene`, and a line for each that gives none; `load`
    imports it, `file` is its name in these lines. Exceptions `also` are lines too."""
    caught: tuple[type[BaseException], ...] = (Exception, SystemExit, *also)
    try:
        values = list(vars(load()).values())
    except caught as error:
        return {}, [f"{file}{_place(error, file)}: {_one_line(error)}"]
    found: dict[str, Scenario] = {}
    broken: list[str] = []
    for function in values:
        if not (callable(function) and getattr(function, _MARK, False)):
            continue
        name = f"{file}: scene {getattr(function, '__name__', '?')}"
        try:
            result = function()
            several = tuple(result) if isinstance(result, tuple | list) else (result,)
        except ScenarioError as error:
            broken += [f"{name}: scenario {error.name!r}: {path}: {text}" for path, text in error.faults]
            continue
        except caught as error:
            broken.append(f"{name}{_place(error, file)}: {_one_line(error)}")
            continue
        for scenario in several:
            if not isinstance(scenario, Scenario):
                broken.append(f"{name} returns {type(scenario).__name__}, expected Scenario or several")
            elif scenario.name in found:
                broken.append(f"{name}: two scenes are called {scenario.name!r}")
            else:
                found[scenario.name] = scenario
    return found, broken


def _place(error: BaseException, file: str) -> str:
    """Line of the file at which an exception left it."""
    if isinstance(error, SyntaxError):
        return f":{error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if Path(frame.filename).name == Path(file).name]
    return f":{lines[-1]}" if lines else ""


def _one_line(error: BaseException) -> str:
    text = str(error).partition("\n")[0]
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


def all_names(hold_last: bool = False) -> tuple[str, ...]:
    """Names of all scenarios, hard ones included; builds none of these."""
    return (*catalogue(hold_last), *hard_names())


def find(name: str, hold_last: bool = False) -> Scenario:
    """Scenario by name, hard ones included; raises KeyError if there is none."""
    found = catalogue(hold_last).get(name)
    return found if found is not None else hard_scene(name)[0]


def tags(hold_last: bool = False) -> tuple[str, ...]:
    """All tags in use."""
    plain = {tag for scenario in catalogue(hold_last).values() for tag in scenario.tags}
    return tuple(sorted(plain | {TAG}))


def tagged(tag: str, hold_last: bool = False) -> Iterable[Scenario]:
    """Scenarios with the tag `tag`; hard ones only by the tag `hard`."""
    if tag == TAG:
        return [hard_scene(name)[0] for name in hard_names()]
    return [scenario for scenario in catalogue(hold_last).values() if tag in scenario.tags]
