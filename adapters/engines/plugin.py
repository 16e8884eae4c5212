"""Engines of others: found by entry point or as "module:Class", and examined in a child process.

The module of a plug-in may raise, hang or crash when it is imported. It is therefore imported in child
processes only.
"""

import difflib
import importlib
import importlib.util
import re
import sys
import traceback
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.engines.entry import GROUP, Entry
from touchstone.adapters.workers.process import ChildProcess

PATIENCE = 60.0
"""Time after which the import of a plug-in counts as hung [s]; the slowest of ours takes three."""
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]*")
"""Names of engines: they become parts of file names."""
TARGET = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*:[A-Za-z_]\w*(\.[A-Za-z_]\w*)*")
METHODS = ("build", "version")


@cache
def declared() -> dict[str, EntryPoint]:
    """Entry points of installed packages by the name of their engine; the first of a name wins."""
    found: dict[str, EntryPoint] = {}
    for point in entry_points(group=GROUP):
        found.setdefault(point.name, point)
    return found


def entry_of(target: str, name: str = "") -> tuple[str, Entry]:
    """Name and entry of the engine at "module:Class" (or "module:ENTRY"), examined in a child process.

    Raises AdapterError in one line if it cannot be loaded or does not meet the contract.
    """
    if not TARGET.fullmatch(target):
        raise AdapterError(f"engine {target!r}: expected module:Class, such as mypkg.adapter:MyEngine")
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))  # child processes inherit it
    with TemporaryDirectory() as folder:
        child = ChildProcess(_Examiner, (), Path(folder, "output.txt"), PATIENCE)
        answer = child.ask("examine", target)
        child.stop()
    if child.failure is not None:
        raise AdapterError(f"engine {target!r}: {child.failure[1]}")
    own_name, entry = answer
    return name or own_name, entry


class _Examiner:
    """Child's end."""

    def handle(self, command: str, argument: Any) -> tuple[str, Entry]:
        return examined(argument)


def examined(target: str) -> tuple[str, Entry]:
    """Name and entry of a plug-in, imported in this process; raises AdapterError with what is wrong."""
    found = _attribute(target)
    if isinstance(found, Entry):
        _check_profiles(found.profiles)
        _attribute(found.implementation)
        return target.partition(":")[0].rpartition(".")[2], found
    missing = [method for method in METHODS if not callable(getattr(found, method, None))]
    missing += [field for field in ("name", "profiles") if not hasattr(found, field)]
    if missing:
        raise AdapterError(f"it is no engine: it has no {' and no '.join(missing)} (adapters/contract.py)")
    if not isinstance(found.name, str) or not NAME.fullmatch(found.name):
        raise AdapterError(f"its name is {found.name!r}; expected letters, digits and _ . + -")
    _check_profiles(found.profiles)
    profiles = {name: float(step) for name, step in found.profiles.items()}
    return found.name, Entry(target, target.partition(":")[0].partition(".")[0], profiles)


def _check_profiles(profiles: object) -> None:
    if not isinstance(profiles, Mapping) or not profiles:
        raise AdapterError(f"its profiles are {profiles!r}; expected {{'default': 1 / 240}} or the like")
    for name, step in profiles.items():
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise AdapterError(f"its profile {name!r}: expected letters, digits and _ . + -")
        if not isinstance(step, int | float) or not isfinite(step) or step <= 0:
            raise AdapterError(f"its profile {name!r} has the step {step!r}; expected seconds, such as 1/240")


def _attribute(target: str) -> Any:
    """What "module:attribute" names; raises AdapterError with the place of the fault."""
    module_name, _, path = target.partition(":")
    try:
        found: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name and (module_name + ".").startswith(error.name + "."):
            raise AdapterError(f"no module {error.name!r} on the path or in {Path.cwd()}") from error
        raise AdapterError(f"its import fails: {error}{_place(error)}") from error
    except Exception as error:
        message = f"{type(error).__name__}: {error}".partition("\n")[0]
        raise AdapterError(f"its import fails: {message}{_place(error)}") from error
    for part in path.split("."):
        if not hasattr(found, part):
            near = difflib.get_close_matches(part, dir(found), n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise AdapterError(f"module {module_name!r} has no {part!r}{hint}")
        found = getattr(found, part)
    return found


def _place(error: BaseException) -> str:
    """File and line of the last frame of an exception outside the import machinery."""
    if isinstance(error, SyntaxError) and error.filename:
        return f" ({error.filename}, line {error.lineno})"
    frames = [f for f in traceback.extract_tb(error.__traceback__) if "importlib" not in f.filename]
    return f" ({frames[-1].filename}, line {frames[-1].lineno})" if len(frames) > 1 else ""


def distribution_of(point: EntryPoint) -> str:
    """Name of the distribution that declares an entry point."""
    return point.dist.name if point.dist is not None else ""


def entry_declared(name: str, point: EntryPoint) -> Entry:
    """Entry of an installed plug-in."""
    _, entry = entry_of(point.value, name)
    return replace(entry, distribution=entry.distribution or distribution_of(point))
