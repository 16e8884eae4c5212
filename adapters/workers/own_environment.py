"""Environments of engines whose requirements conflict with those of this program.

An environment is a folder of pinned packages in the user's cache. Child processes that play its engine find
packages there first and all others, numpy and scipy too, among those of this program: they run on the same
interpreter. Its folder is named by a hash of the pins and of the interpreter, and is complete or absent.
"""

import csv
import hashlib
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import distributions
from multiprocessing import spawn
from pathlib import Path
from typing import Any

from touchstone.adapters.workers.pip_calls import cache_folder, pip_fault
from touchstone.adapters.workers.scratch import Claimed, claimed_folder, sweep


class OwnEnvironmentError(Exception):
    """An environment cannot be made or removed; one line."""


@dataclass(frozen=True, slots=True)
class OwnEnvironment:
    """Environment of an engine; `pins` are all of its packages, each "name==version"."""

    engine: str
    pins: tuple[str, ...]

    @property
    def folder(self) -> Path:
        """Where its packages are, or would be."""
        content = sys.implementation.cache_tag, sysconfig.get_platform(), sorted(self.pins)
        digest = hashlib.sha256(repr(content).encode()).hexdigest()
        return cache_folder("environments") / f"{self.engine}-{digest[:8]}"

    def add(self) -> None:
        """Install its packages; raises OwnEnvironmentError."""
        place = self.folder
        python = ".".join(map(str, sys.version_info[:2]))
        sweep(place.parent, ".*.part")
        try:
            with claimed_folder(place.with_name(f".{place.name}.part")) as part:
                wanted = ["--no-deps", "--only-binary", ":all:", "--target", str(part), *self.pins]
                if fault := pip_fault(wanted, f"{self.engine} for Python {python}"):
                    raise OwnEnvironmentError(f"{self.engine}: {fault}")
                part.rename(place)
        except Claimed as error:
            raise OwnEnvironmentError(f"{self.engine}: another process installs it; try again") from error
        except OSError as error:
            raise OwnEnvironmentError(f"{self.engine}: {place}: {error.strerror or error}") from error

    def remove(self) -> list[Path]:
        """Remove its folder and those of earlier pins, which it returns; raises OwnEnvironmentError."""
        home, digest = cache_folder("environments"), "[0-9a-f]" * 8
        found = sorted(home.glob(f"{self.engine}-{digest}"))
        for place in found:
            # what an interrupted removal leaves is removed by the next one, or by `add`
            try:
                place.rename(place.with_name(f".{place.name}.removed.part"))
            except OSError as error:
                raise OwnEnvironmentError(f"{self.engine}: {place}: {error.strerror or error}") from error
        sweep(home, ".*.part")
        return found

    def fault(self) -> str:
        """What is wrong with its folder, in words; "" if all files of all its packages are there."""
        found = {one.name: one for one in distributions(path=[str(self.folder)])}
        for pin in self.pins:
            name, _, version = pin.partition("==")
            one = found.get(name)
            if one is None or one.version != version:
                return f"{pin} is missing"
            # `one.files` leaves out what is missing, in some versions
            for file, _, size in csv.reader((one.read_text("RECORD") or "").splitlines()):
                if not size or ".." in Path(file).parts:  # compiled code, and scripts
                    continue
                path = self.folder / file
                if not path.exists() or path.stat().st_size != int(size):
                    return f"{name}: {file} is missing or changed"
        return ""

    def size(self) -> int:
        """Sizes of its files [bytes]."""
        return sum(path.lstat().st_size for path in self.folder.rglob("*") if not path.is_dir())


@contextmanager
def found_first(packages: Path | None) -> Iterator[None]:
    """Let processes that start meanwhile find packages in a folder first, before they import any."""
    prepared = spawn.get_preparation_data

    def preparation(name: str) -> dict[str, Any]:
        data: dict[str, Any] = prepared(name)
        data["sys_path"] = [str(packages), *data["sys_path"]]
        return data

    if packages is not None:
        spawn.get_preparation_data = preparation
    try:
        yield
    finally:
        spawn.get_preparation_data = prepared
