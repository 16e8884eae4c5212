"""The output folder of a study: complete when all is done, or absent."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class OutputError(Exception):
    """The output folder cannot be used; the message says why."""


@contextmanager
def output_folder(out: Path) -> Iterator[Path]:
    """A temporary folder beside `out` that is renamed to it at the end."""
    if not out.name or out.name == "..":
        raise OutputError(f"--out {out}: give the folder a name of its own")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise OutputError(f"--out {out}: exists and is not an empty folder")
    part = out.with_name(f".{out.name}.part-{os.getpid()}")
    new_parent = not out.parent.exists()
    try:
        part.mkdir(parents=True)
        yield part
        if out.exists():
            out.rmdir()
        part.rename(out)
    except OSError as error:
        raise OutputError(f"--out {out}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
        if new_parent and out.parent.exists() and not any(out.parent.iterdir()):
            out.parent.rmdir()
