"""Scenes by name: of the catalogue, of a file, or of a file NAME.toml or NAME.json in the working folder."""

import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from touchstone.scenarios.catalogue import all_names, catalogue, find
from touchstone.scenarios.files.python_file import scenes_of_python
from touchstone.scenarios.files.read import SceneFileError, read_scene
from touchstone.scenarios.files.safe_paths import regular
from touchstone.scenarios.names import unknown
from touchstone.scenarios.scenario import HOLD_LAST, Scenario

SUFFIXES = (".toml", ".json", ".py")
"""Endings of scene files."""
_FILES: dict[str, str] = {}
"""The file of each scene that this process has read from one, as it was named."""


class NoScene(ValueError):
    """There is no scene of this name."""

    def __init__(self, name: str) -> None:
        self.name = name
        super().__init__(f"unknown scenario {name!r}")

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.name,)


def scenes_named(names: Iterable[str], hold_last: bool = False, allow_paths: bool = False) -> list[Scenario]:
    """Scenes of names and paths, in order; those of a file all together.

    Raises:
        NoScene: a name is neither in the catalogue nor a file's.
        SceneFileError: a file is not valid, or two scenes have the same name.
    """
    found: dict[str, Scenario] = {}
    for name in names:
        path = path_of(name)
        if path is not None:
            several = scenes_of_file(path, hold_last, allow_paths)
        elif name in all_names(hold_last):
            several = [find(name, hold_last)]
        elif Path(name).is_file():
            said = f"{name}: expected a scene file that ends in {', '.join(SUFFIXES)}"
            raise SceneFileError(f"{said}; touchstone import makes one of a robot's")
        else:
            raise NoScene(name)
        for scenario in several:
            if scenario.name in found:
                raise SceneFileError(f"{name}: two scenes of this run are called {scenario.name!r}")
            found[scenario.name] = scenario
            _FILES.pop(scenario.name, None)
            if path is not None:
                _FILES[scenario.name] = f"{path}"
    return list(found.values())


def scenes_called(scene: str | Path | Scenario) -> list[Scenario]:
    """Scenes of one name or path; raises ValueError, for an unknown name with the nearest valid ones."""
    if isinstance(scene, Scenario):
        return [scene]
    try:
        return scenes_named([f"{scene}"])
    except NoScene as error:
        raise ValueError(unknown("scene", error.name, catalogue())) from None


def hidden_by_catalogue(scenario: Scenario) -> str:
    """The file of a scene whose name alone stands for another one, of the catalogue; "" for others."""
    hidden = scenario.name in all_names() and find(scenario.name) != scenario
    return _FILES.get(scenario.name, "") if hidden else ""


def argument_of(scenario: str) -> str:
    """What names a scene on a command line: its file, where this process has read it from one."""
    return shlex.quote(_FILES.get(scenario, scenario))


def path_of(name: str) -> Path | None:
    """The file that a name stands for; None for a scene of the catalogue."""
    path = Path(name)
    if path.suffix.lower() in SUFFIXES:
        return path
    if name in all_names():
        return None
    near = (path.with_name(f"{path.name}{suffix}") for suffix in SUFFIXES[:2]) if path.name else ()
    return next((file for file in near if file.is_file()), None)


def scenes_of_file(path: Path, hold_last: bool = False, allow_paths: bool = False) -> list[Scenario]:
    """Scenes of a file; raises SceneFileError."""
    token = HOLD_LAST.set(hold_last)
    try:
        if path.suffix.lower() != ".py":
            return [read_scene(path, allow_paths)]
        found, broken = scenes_of_python(regular(path))
        if broken or not found:
            raise SceneFileError("\n".join(broken) or f"{path}: no function marked @scene")
        return list(found.values())
    except OSError as error:
        raise SceneFileError(f"{path}: {error.strerror or error}") from error
    finally:
        HOLD_LAST.reset(token)
