"""The output folder of a study: complete when all is done, or absent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from touchstone.adapters.workers.scratch import Claimed, claimed_folder, sweep

PART = "touchstone-part"
"""Ending of folders that are not complete."""


class OutputError(Exception):
    """The output folder cannot be used; the message says why."""


@contextmanager
def output_folder(out: Path) -> Iterator[Path]:
    """A temporary folder beside `out` that is renamed to it at the end.

    What a killed run left of it is removed; a run that is alive and has the same `out` is an OutputError.
    """
    if not out.name or out.name == "..":
        raise OutputError(f"--out {out}: give the folder a name of its own")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise OutputError(f"--out {out}: exists and is not an empty folder")
    new_parent = not out.parent.exists()
    try:
        sweep(out.parent, f".*.{PART}")
        with claimed_folder(out.with_name(f".{out.name}.{PART}")) as part:
            yield part
            if out.exists():
                out.rmdir()
            part.rename(out)
    except Claimed as error:
        raise OutputError(f"--out {out}: another run that is still alive writes it") from error
    except OSError as error:
        raise OutputError(f"--out {out}: {error.strerror or error}") from error
    finally:
        if new_parent and out.parent.exists() and not any(out.parent.iterdir()):
            out.parent.rmdir()
