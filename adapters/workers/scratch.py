"""Temporary folders with a lock. The system frees it when a process dies, so that folders of dead processes
are found and removed."""

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX = "touchstone-scratch-"


class Claimed(Exception):
    """Another process that is alive uses the folder."""


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A temporary folder that is removed at the end; folders of processes that were killed are removed
    first."""
    sweep(Path(tempfile.gettempdir()), f"{PREFIX}*")
    folder = Path(tempfile.mkdtemp(prefix=PREFIX))
    lock = locked(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


@contextmanager
def claimed_folder(folder: Path) -> Iterator[Path]:
    """Create a folder and hold its lock; what a dead process left there is removed first.

    Raises:
        Claimed: a living process holds the folder.
        OSError: the folder cannot be created.
    """
    lock = None
    while lock is None:
        try:
            folder.mkdir(parents=True)
        except FileExistsError:
            if not removed(folder):
                raise Claimed(str(folder)) from None
            continue
        lock = locked(folder)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def locked(folder: Path) -> int | None:
    """Lock a folder; returns its descriptor, or None if another process locked or removed it."""
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(descriptor).st_ino == os.stat(folder).st_ino:
            return descriptor
    except OSError:
        pass
    os.close(descriptor)
    return None


def removed(folder: Path) -> bool:
    """Remove a folder whose process is dead; False if a living process holds it, or if it cannot be
    removed."""
    lock = locked(folder)
    if lock is None:
        return not folder.exists()
    try:
        shutil.rmtree(folder, ignore_errors=True)
        return not folder.exists()
    finally:
        os.close(lock)


def sweep(parent: Path, pattern: str) -> None:
    """Remove folders of dead processes that match a pattern."""
    with suppress(OSError):
        for folder in parent.glob(pattern):
            if folder.is_dir():
                removed(folder)
