"""Files that a scene or a model names: read only from its own folder, unless the user allows others."""

import errno
import json
import stat
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

DAMAGED = (
    OSError,
    ValueError,
    TypeError,
    EOFError,
    KeyError,  # zipfile: a name that the archive lists and lacks
    MemoryError,  # an array that claims a huge shape
    NotImplementedError,  # zipfile: an unknown method of compression
    OverflowError,
    RuntimeError,  # zipfile: an encrypted file
    SyntaxError,  # a damaged header of an array is parsed as Python
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""Exceptions of numpy and zipfile on damaged files or files of another format."""
KINDS = (
    (stat.S_ISDIR, "a folder"),
    (stat.S_ISFIFO, "a FIFO"),
    (stat.S_ISSOCK, "a socket"),
    (lambda mode: True, "a device"),
)
"""What is no regular file: a test of its mode, and its name."""


class PathRefused(ValueError):
    """The file lies outside the folder; the message says how to allow it."""


def regular(path: Path) -> Path:
    """The path of a file that a user named. All readers of such files go through here.

    Raises:
        OSError: it is absent, or a folder, FIFO, socket or device, whose reading may never end.
    """
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode):
        kind = next(name for is_kind, name in KINDS if is_kind(mode))
        raise OSError(errno.EINVAL, f"is {kind}, expected a file", str(path))
    return path


def json_value(text: str | bytes) -> Any:
    """Value of a JSON text; raises ValueError if it is none, or one that cannot be read."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("JSON of too many levels") from error


def json_of(path: Path) -> Any:
    """Value of a JSON file; raises OSError or ValueError."""
    return json_value(regular(path).read_text("utf-8"))


def fault_line(error: Exception) -> str:
    """What a file lacks, in one line of at most 100 characters."""
    first = error.errors()[0] if isinstance(error, ValidationError) else None
    text = f"{'.'.join(map(str, first['loc']))}: {first['msg']}" if first else str(error)
    return text.partition("\n")[0][:100]


def allowed(folder: Path, name: str, allow_paths: bool) -> Path:
    """Path of a file that a document in `folder` names; symbolic links are followed first.

    Raises:
        PathRefused: the file lies outside `folder`, and `allow_paths` is not set.
    """
    path = (folder / name).resolve()
    if not allow_paths and not path.is_relative_to(folder.resolve()):
        raise PathRefused(f"{name!r} lies outside the folder {folder}; allow it by --allow-paths")
    return path
