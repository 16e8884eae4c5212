"""Content hash of a cell or a run: over everything that decides its result, and nothing else.

Equal on every machine and in any order; for timing cells the processor belongs to it. For an engine of
others, the files of its package or folder belong to it, and the versions of all installed packages.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Iterable
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import scenario_json
from touchstone.adapters.registry import ENGINES, OURS
from touchstone.reports.machine import machine, package_version
from touchstone.reports.runner.cells import SCENES_KEPT, TIMING, Cell, scene_of
from touchstone.scenarios.scenario import Scenario

FORMAT = 1
"""Version of the hash and of the store; a store of another version is refused."""
ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("numpy", "scipy", "coal", "pin")
"""Libraries that all results depend on: linear algebra and the judges."""
SHARED = (
    # folder and whether its subfolders belong to it
    ("adapters", False),
    ("adapters/oracles", False),
    ("scenarios", False),
    ("scenarios/avatar", False),
    ("scenarios/truths", False),
    ("reports/metrics", True),
)
"""Sources that every cell depends on. Scenes themselves are hashed as data."""
PLAYED = (("adapters", False), ("adapters/workers", False), ("scenarios", False), ("scenarios/avatar", False))
"""Sources that every recording depends on, and whether subfolders belong to them."""
PLAYED_WITH = ("numpy", "scipy")
EXECUTED = (".py", ".so", ".pyd", ".dylib", ".dll")
"""Suffixes of files that may decide what an engine of others does."""


_scenes: dict[int, tuple[Scenario, str]] = {}


def hash_of(cell: Cell) -> str:
    """Hexadecimal hash of a cell (32 digits)."""
    inputs = [
        FORMAT,
        _scene(cell.source, cell.scenario, cell.seed),
        cell.engine,
        cell.profile,
        float(cell.dt).hex(),
        cell.seed,
        sorted(cell.changes),
        cell.effects,
        cell.measure,
        sorted(cell.options),
        cell.repeat,
        _engine(cell.engine),
        _sources(cell.measure, cell.source),
    ]
    if cell.measure == TIMING:
        inputs.append(_processor())
    return hashlib.sha256(json.dumps(inputs).encode()).hexdigest()[:32]


def hash_of_run(scenario: Scenario, engine: str, settings: Settings, repeat: int = 0) -> str:
    """Hexadecimal hash of what decides a recording (32 digits)."""
    sources = [*map(_version, PLAYED_WITH), _tree(PLAYED), *_engine(engine)]
    inputs = [FORMAT, scenario_json(scenario), engine, repr(settings), repeat, sources]
    return hashlib.sha256(json.dumps(inputs).encode()).hexdigest()[:32]


def _scene(source: str, name: str, seed: int) -> str:
    """Digest of a scene's data; a source may return one object for many seeds."""
    scenario = scene_of(source, name, seed)
    known = _scenes.get(id(scenario))
    if known is None or known[0] is not scenario:
        if len(_scenes) >= SCENES_KEPT:
            _scenes.clear()
        known = _scenes[id(scenario)] = scenario, _digest([scenario_json(scenario).encode()])
    return known[1]


@cache
def _engine(name: str) -> list[str]:
    """Versions of an engine and its compiler, and the digest of its sources."""
    entry = ENGINES[name]
    if name not in OURS:
        return [entry.implementation, _package(entry.package), _installed()]
    folders = [(f"adapters/engines/{name}", True)]
    versions = [_version(entry.distribution or entry.package)]
    if name == "reference":
        folders.append(("reference_impl", True))
        versions.append(_version("numba"))
    return [*versions, _tree(tuple(folders))]


@cache
def _sources(measure: str, source: str) -> list[str]:
    """Digests of shared sources and of the modules that measure and build scenes; versions of libraries."""
    modules = {path.partition(":")[0] for path in (measure, source)}
    return [*map(_version, LIBRARIES), _tree(SHARED), *map(_module, sorted(modules))]


@cache
def _processor() -> str:
    return machine()["processor"]


def _package(name: str) -> str:
    """Digest of an importable package, or of a module and those beside it; imports nothing."""
    found = importlib.util.find_spec(name)
    if found is None or not found.origin or not Path(found.origin).exists():
        return "not found"
    module = Path(found.origin)
    paths = {module}
    if found.submodule_search_locations:
        paths |= set(module.parent.rglob("*"))
    elif not any(module.parent.glob("*.dist-info")):
        paths |= set(module.parent.glob("*"))
        for package in module.parent.glob("*/__init__.py"):
            paths |= set(package.parent.rglob("*"))
    own = [path for path in sorted(paths) if path.suffix in EXECUTED and not path.name.startswith("test_")]
    names = (path.relative_to(module.parent).as_posix().encode() for path in own)
    return _digest(part for name, path in zip(names, own) for part in (name, path.read_bytes()))


@cache
def _installed() -> str:
    """Digest of the names and versions of all installed packages."""
    found = sorted({f"{one.name} {one.version}" for one in distributions()})
    return _digest([json.dumps(found).encode()])


@cache
def _version(distribution: str) -> str:
    return package_version(distribution, "not installed")


@cache
def _tree(folders: tuple[tuple[str, bool], ...]) -> str:
    """Digest of the sources of folders, by their paths below the project."""
    patterns = [f"{folder}/{'**/' * below}*.py" for folder, below in folders]
    named = {path.relative_to(ROOT).as_posix(): path for one in patterns for path in ROOT.glob(one)}.items()
    return _digest(part for name, path in sorted(named) for part in (name.encode(), _text(path)))


@cache
def _module(name: str) -> str:
    found = importlib.util.find_spec(name)
    if found is None or not found.origin:
        raise ValueError(f"no module {name!r} to measure with")
    return _digest([_text(Path(found.origin))])


def _text(path: Path) -> bytes:
    """Source with the same line ends on every machine."""
    return path.read_text(encoding="utf-8").encode()


def _digest(parts: Iterable[bytes]) -> str:
    found = hashlib.sha256()
    for part in parts:
        found.update(len(part).to_bytes(8, "little"))
        found.update(part)
    return found.hexdigest()
