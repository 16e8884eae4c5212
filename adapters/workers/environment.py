"""Virtual environments with released versions of an engine, kept in the user's cache folder.

An environment holds the engine and what this program lacks; everything else comes from the environment of
this program by a path file. Child processes run on the same interpreter and put the environment first on
their path, so that only the engine differs.
"""

import hashlib
import importlib.util
import os
import re
import sys
import sysconfig
import venv
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, distributions
from importlib.metadata import version as version_of
from pathlib import Path

from touchstone.adapters.contract import AdapterError, Engine, NotInstalled
from touchstone.adapters.registry import ENGINES, distribution, load, own_environment, packages_of
from touchstone.adapters.workers.pip_calls import cache_folder, pip_fault
from touchstone.adapters.workers.scratch import Claimed, claimed_folder

SHARED = ("numpy", "scipy")
"""Libraries that every version shares with this program: results depend on them."""
VERSION = re.compile(r"[0-9][0-9A-Za-z.!+_-]*")


class VersionError(Exception):
    """A version of an engine cannot be had; one line."""


def environment(engine: str, version: str) -> Path | None:
    """Folder on the path that holds a version of an engine; None for one installed with this program.

    Raises:
        VersionError: there is no such version, or it cannot be installed here.
    """
    name = distribution(engine)
    if not VERSION.fullmatch(version):
        raise VersionError(f"{name} {version}: not a version; expected numbers such as 3.6.0")
    if version == installed_version(engine):
        return packages_of(engine)
    shared = {library: version_of(library) for library in SHARED}
    digest = hashlib.sha256(repr((sys.version, sorted(shared.items()), _own_paths())).encode()).hexdigest()
    place = cache_folder("engines") / f"{name}-{version}-{digest[:8]}"
    if not place.exists():
        try:
            # Scripts of a virtual environment would name the temporary folder; nothing here runs them.
            with claimed_folder(place.with_name(f".{place.name}.part")) as part:
                _install(part, name, version, shared)
                part.rename(place)
        except Claimed as error:
            raise VersionError(f"{name} {version}: another process is installing it; try again") from error
        except OSError as error:
            raise VersionError(f"{name} {version}: {place}: {error.strerror or error}") from error
    return _packages(place)


def installed_version(engine: str) -> str:
    """Version of an engine in its own environment, or in that of this program; empty if it is in neither."""
    if own_environment(engine) is not None:
        folder = packages_of(engine)
        found = distributions(name=distribution(engine), path=[str(folder)]) if folder else ()
        return next((one.version for one in found), "")
    try:
        return version_of(distribution(engine))
    except PackageNotFoundError:
        return ""


def _install(folder: Path, name: str, version: str, shared: Mapping[str, str]) -> None:
    venv.create(folder, symlinks=os.name != "nt")
    (_packages(folder) / "touchstone-libraries.pth").write_text("\n".join(_own_paths()) + "\n", "utf-8")
    held = folder / "shared.txt"
    held.write_text("".join(f"{library}=={number}\n" for library, number in shared.items()), "utf-8")
    wanted = ["--prefer-binary", "--constraint", str(held), f"{name}=={version}"]
    if fault := pip_fault(wanted, name, folder / "bin" / "python"):
        raise VersionError(f"{name} {version}: {fault}")


def _own_paths() -> list[str]:
    """Folders of this interpreter's installed packages."""
    return list(dict.fromkeys(sysconfig.get_path(name) for name in ("purelib", "platlib")))


def _packages(folder: Path) -> Path:
    base = {"base": str(folder), "platbase": str(folder)}
    return Path(sysconfig.get_path("purelib", "venv", base)).absolute()


@dataclass(frozen=True, slots=True)
class VersionLoader:
    """Loader of engines called by labels such as "mujoco==3.6.0", for child processes (`Children`).

    Attributes:
        engine: name in the registry.
        folders: label -> folder of packages; None: those of this program.
        home: folder to work in: older engines write logs there.
    """

    engine: str
    folders: Mapping[str, Path | None] = field(default_factory=dict)
    home: Path = Path()

    def __call__(self, label: str) -> Engine:
        """Load the engine of a label.

        Raises:
            NotInstalled: the package is not in the environment.
            AdapterError: the adapter cannot use this version.
        """
        os.chdir(self.home)
        folder = self.folders[label]
        if folder is not None:
            sys.path.insert(0, str(folder))
            importlib.invalidate_caches()
            found = importlib.util.find_spec(ENGINES[self.engine].package)
            if found is None or not found.origin or not Path(found.origin).is_relative_to(folder):
                raise NotInstalled(f"{label}: no module {ENGINES[self.engine].package!r} in {folder}")
        try:
            return load(self.engine)
        except AttributeError as error:
            raise AdapterError(f"{label}: our adapter needs what it lacks: {error}") from error
