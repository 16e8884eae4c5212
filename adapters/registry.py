"""Registry of the engines: implementing class (imported on demand), required package and profiles.

Engines are declared by entry points of the group `touchstone.engines`, ours too. Ours are listed here as
well, so that a source tree that is not installed has them, and no other package replaces one of them.
"""

import importlib
import importlib.util
import shlex
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import AdapterError, Engine, NotInstalled, Settings, Unsupported
from touchstone.adapters.engines.entry import (
    ACCURATE,
    DEFAULT,
    ENGINES,
    MAXIMAL,
    RECOMMENDED,
    SLEEPING,
    Entry,
)
from touchstone.adapters.engines.plugin import declared, distribution_of, entry_declared, entry_of
from touchstone.adapters.knobs import SettingError, Table
from touchstone.adapters.workers.own_environment import OwnEnvironment
from touchstone.scenarios.names import unknown

__all__ = ["ACCURATE", "DEFAULT", "ENGINES", "MAXIMAL", "RECOMMENDED", "SLEEPING", "Entry"]

DEFAULT_ENGINES = ("reference", "dart", "bullet", "mujoco")
"""Engines that play where none is named."""
OPTIONAL_ENGINES = ("drake", "mujoco_warp", "newton", "physx", "rapier")
"""Engines of ours that play where they are named."""
OURS = {name: f"touchstone.adapters.engines.{name}:ENTRY" for name in (*DEFAULT_ENGINES, *OPTIONAL_ENGINES)}
"""Engines of this project: name -> entry point, as in `pyproject.toml`."""


def entry_of_ours(name: str) -> Entry:
    """Entry of an engine of ours; registers nothing."""
    entry: Entry = _named(OURS[name])
    return entry


def _named(place: str) -> Any:
    """The object at "module:name" or "module:Class.name"."""
    module, _, attribute = place.partition(":")
    found = importlib.import_module(module)
    for part in attribute.split("."):
        found = getattr(found, part)
    return found


ENGINES.update({name: entry_of_ours(name) for name in DEFAULT_ENGINES if name not in ENGINES})


def available() -> tuple[str, ...]:
    """Names of all engines that can be asked for: ours, those of installed packages, those already named."""
    return tuple(dict.fromkeys((*OURS, *declared(), *ENGINES)))


def recalled(name: str) -> str:
    """The name of an engine of a stored run, which is registered if it is still known."""
    return registered(name) if name in OURS or name in declared() else name


def registered(name: str) -> str:
    """Name under which ENGINES has the engine; registers one that is asked for first.

    Args:
        name: of an engine of ours or of an installed package, or "module:Class" of one that is not installed.
    Raises:
        AdapterError: nothing has this name, or the plug-in cannot be loaded; one line.
    """
    if name in ENGINES:
        return name
    if name in OURS:
        ENGINES[name] = entry_of_ours(name)
    elif ":" in name:
        own_name, entry = entry_of(name)
        taken = ENGINES.get(own_name, entry).implementation
        if own_name in OURS or (own_name in available() and taken != name):
            other = f"that of {taken}" if ":" in taken and own_name not in OURS else "another engine's"
            raise AdapterError(
                f"engine {name!r}: its `name` is {own_name!r}, {other}; give it one of its own"
            )
        ENGINES[own_name] = entry
        return own_name
    elif name in declared():
        ENGINES[name] = entry_declared(name, declared()[name])
    else:
        raise AdapterError(unknown("engine", name, (*available(), "module:Class")))
    return name


def installed(name: str) -> bool:
    """Whether an engine's package can be found, by its child process at least; imports nothing."""
    return packages_of(name) is not None or _found(name)


def _found(name: str) -> bool:
    """Whether this process finds an engine's package, and not only a folder that its removal left."""
    entry = _known(name)
    spec = importlib.util.find_spec(entry.package)
    return spec is not None and (spec.origin is not None or not entry.requirement)


def own_environment(name: str) -> OwnEnvironment | None:
    """Environment of its own that an engine needs; None for one that is installed beside this program."""
    entry = _entry_or_none(name)
    return OwnEnvironment(name, entry.pins) if entry is not None and entry.pins else None


def backend_of(name: str) -> str:
    """Engine of which this is another backend; "" if of none."""
    entry = _entry_or_none(name)
    return entry.backend_of if entry is not None else ""


def _entry_or_none(name: str) -> Entry | None:
    return ENGINES.get(name) or (entry_of_ours(name) if name in OURS else None)


def packages_of(name: str) -> Path | None:
    """Folder that a child process of an engine finds first: its own environment, if that has been added."""
    own = own_environment(name)
    return own.folder if own is not None and own.folder.exists() else None


def missing_reason(name: str) -> str:
    """Why an engine is skipped if it is not installed."""
    entry = _known(name)
    requirement, last = entry.requirement, entry.last_wheel
    if entry.pins:
        return f"not installed (touchstone env add {name})"
    if not requirement:
        return f"not installed (no module {entry.package!r})"
    compiled = ""
    if last is not None and sys.version_info[:2] > last:
        newest, mine = ".".join(map(str, last)), ".".join(map(str, sys.version_info[:2]))
        compiled = f"; wheels end with Python {newest}, on {mine} pip compiles it for minutes in silence"
    return f"not installed (pip install {shlex.quote(requirement)}{compiled})"


def load(name: str) -> Engine:
    """Load the engine called `name`; raises NotInstalled with the package that pip installs, and ImportError
    with what is wrong with its environment."""
    place = packages_of(name)
    try:
        if not _found(name):
            reason = f"not found in this process, but in {place}" if place else missing_reason(name)
            raise NotInstalled(reason)
        engine: Engine = _named(_entry(name).implementation)()
    except (ImportError, NotInstalled) as error:
        own = own_environment(name)
        if place is None or own is None or not (fault := own.fault()):
            raise
        raise ImportError(f"its environment is broken: {fault} (touchstone env add {name})") from error
    return engine


def waiting_note(name: str) -> str:
    """What an engine that does not answer yet compiles, and how long it may take; "" if it does not."""
    place = ENGINES[name].compiles if name in ENGINES else ""
    return str(_named(place)()) if place else ""


def profiles_of(name: str, profile: str = "") -> Mapping[str, float]:
    """Profiles of an engine with their native steps [s]; raises AdapterError with the valid names if the
    engine or the profile is unknown."""
    valid = _entry(name).profiles
    if profile and profile not in valid:
        raise AdapterError(f"{name}: no profile {profile!r}; valid: {', '.join(valid)}")
    return valid


def settings_of(name: str) -> Table:
    """Table of an engine's settings; imports no engine. An engine of others has an empty one."""
    place = _known(name).settings
    found: Table = _named(place) if place else Table(profiles_of(name), ())
    return found


def changes_of(name: str, profile: str, texts: Iterable[str]) -> tuple[str, ...]:
    """Those of "key=value" and "engine.key=value" texts that concern an engine and differ from its profile.

    Raises:
        SettingError: the engine has no such setting or value, or gets two values of one; the message names
            the valid ones.
    """
    mine = []
    for text in texts:
        key, equals, value = text.partition("=")
        engine, dot, own = key.partition(".")
        if dot and engine.strip() not in available():
            raise SettingError(unknown("engine", engine.strip(), available()))
        if not dot or engine.strip() == name:
            mine.append((own if dot else key) + equals + value)
        else:
            _require_setting(engine.strip(), own + equals + value)
    try:
        return settings_of(name).changes(profile, mine)
    except SettingError as error:
        raise SettingError(f"{name}: {error}") from error


def _require_setting(name: str, text: str) -> None:
    """Raise SettingError, which names the engine, unless it has the setting and the value of "key=value"."""
    try:
        settings_of(name).parse(text)
    except SettingError as error:
        raise SettingError(f"{name}: {error}") from error


def require_profile(name: str, settings: Settings) -> None:
    """Raise Unsupported if an engine lacks the profile, and SettingError if it lacks a changed setting."""
    valid = _entry(name).profiles
    if settings.profile not in valid:
        raise Unsupported(f"{name}: no profile {settings.profile!r}; valid: {', '.join(valid)}")
    for text in settings.changes:
        _require_setting(name, text)


def distribution(name: str) -> str:
    """Name of the distribution that holds an engine; the package's where none is stated."""
    if name in declared() and name not in OURS:
        return distribution_of(declared()[name])
    entry = _known(name)
    return entry.distribution or entry.package


def asked_as(name: str) -> str:
    """What to give as an engine's name in another process: itself, or "module:Class" of a plug-in that is not
    installed."""
    if name in OURS or name in declared() or name not in ENGINES:
        return name
    return ENGINES[name].implementation


def _known(name: str) -> Entry:
    return _entry_or_none(name) or _entry(name)


def _entry(name: str) -> Entry:
    return ENGINES[registered(name)]
