"""Scenes of a Python file: its functions marked `@scene`, as in `scenarios/families/`."""

from __future__ import annotations

import importlib.util
import sys
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType

from touchstone.scenarios.catalogue import scenes_of
from touchstone.scenarios.scenario import Scenario


def scenes_of_python(path: Path) -> tuple[dict[str, Scenario], list[str]]:
    """Scenes of a Python file by name, and a line for each function or import that fails. The file is
    executed; its own folder is on the import path meanwhile."""
    name, folder = f"touchstone_scene_{path.stem}", str(path.resolve().parent)

    def load() -> ModuleType:
        spec = importlib.util.spec_from_loader(name, SourceFileLoader(name, str(path)))
        module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
        SourceFileLoader(name, str(path)).exec_module(module)
        return module

    sys.path.insert(0, folder)
    try:
        return scenes_of(load, str(path))
    finally:
        sys.path.remove(folder)
