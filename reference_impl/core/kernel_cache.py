"""Compile cache: the key of its folder, its location, the removal of old folders, and its files.

Numba's cache checks only the caller's own file: after an edit of a callee in another file, cached callers
would keep the old code. The key of the folder is therefore a hash of all sources of `reference_impl`, the
versions of numba and numpy, and the processor's name. The folder is chosen before the first decorator runs.
Comments, docstrings and layout do not change the key. This module does not import numba, which takes 0.5 s:
a process that only asks whether kernels are compiled does without.

Every file starts with a checksum: LLVM would execute what a full disk or a power failure has left of it.
"""

import ast
import errno
import hashlib
import os
import shutil
import sys
import tempfile
import zlib
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

from llvmlite.binding import get_host_cpu_name

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS_KEPT = 8
"""Cache folders kept when a new one is created [-]: several checkouts and branches in use, 30 MB each."""
SPACE = 100_000_000
"""Size of a folder with all kernels [B]: without as much space on its disk the next candidate is used."""
NOTE = "compile_seconds.txt"
"""File that stores the compilation time once all kernels are compiled."""
SUFFIX = ".nbc"
"""Suffix of files with compiled code."""
CHECKSUM_SIZE = 4
"""Size of the checksum at the start of such a file [B]."""
MARK = "sources-"
"""Name prefix of an empty file in a cache folder that records a hash of the source bytes: if they are
unchanged, the key is known without parsing them (0.3 s)."""


def note_import(module):
    """Check, at the first kernel of `module`, that the sources are still those of the key.

    A module imported after an edit contains code of another key.
    """
    if module not in _imported:
        _imported[module] = _stamps() == SOURCE_STAMPS


def is_key_valid():
    """Whether all kernels so far come from the sources of the cache folder's key."""
    return all(_imported.values())


def _stamps():
    return {source: _stamp(source) for source in PACKAGE.rglob("*.py")}


def _stamp(source):
    found = source.stat()
    return found.st_mtime_ns, found.st_size


def source_key(folder):
    """Hash of every source in `folder` without comments and docstrings, numba, numpy and the processor."""
    return _digest(folder, _code)


def choose_cache_folder():
    """First usable one of $TOUCHSTONE_CACHE, the user's cache and the temporary folder; None if none is.

    A folder is usable if it holds all kernels, or can be written and has space. REJECTED gets the others.
    """
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    candidates = [
        os.environ.get("TOUCHSTONE_CACHE"),
        f"{home}/touchstone",
        f"{tempfile.gettempdir()}/touchstone",
    ]
    mark = MARK + _digest(PACKAGE, bytes)
    for candidate in filter(None, candidates):
        root = Path(candidate) / "kernels"
        try:
            return _open_folder(root, mark)
        except OSError as error:
            REJECTED.append(f"{root}: {error.strerror}")
    return None


def _open_folder(root, mark):
    """Open or create the folder in `root` for the present sources; raises OSError if it is not usable."""
    known = next(root.glob(f"*/{mark}"), None)
    folder = known.parent if known else root / source_key(PACKAGE)
    if noted_seconds(folder) is not None:
        with suppress(OSError):
            os.utime(folder)  # its time of last use
        return folder
    if not folder.exists():
        folder.mkdir(parents=True, exist_ok=True)
        remove_old_folders(root, FOLDERS_KEPT)
    # the write also updates the folder's time of last use
    probe = folder / f".probe-{os.getpid()}"
    probe.touch()
    probe.unlink()
    if _stamps() == SOURCE_STAMPS:
        (folder / mark).touch()
    free = shutil.disk_usage(folder).free + _size(folder)
    if free < SPACE:
        raise OSError(errno.ENOSPC, f"{free / 1e6:.0f} MB free, {SPACE / 1e6:.0f} MB needed")
    return folder


def _size(folder):
    """Size of the files in a folder [B], which other processes may be writing."""
    size = 0
    for entry in os.scandir(folder):
        with suppress(OSError):
            size += entry.stat().st_size
    return size


def noted_seconds(folder):
    """Compilation time of all kernels [s]; None unless `folder` holds all of them."""
    try:
        seconds = float((folder / NOTE).read_text())
    except (OSError, ValueError):
        return None
    return seconds if 0 <= seconds < float("inf") else None


def read_entry(path):
    """Content of a file with compiled code; None if it is missing, unreadable or damaged.

    A damaged one is removed, and its kernel is compiled again.
    """
    try:
        data = path.read_bytes()
    except OSError:
        return None
    content = memoryview(data)[CHECKSUM_SIZE:]
    if content and data[:CHECKSUM_SIZE] == _checksum(content):
        return content
    with suppress(OSError):
        path.unlink()
    return None


def write_entry(path, content):
    """Write a file with compiled code."""
    write_whole(path, _checksum(content) + content)


def write_whole(path, data):
    """Write a file of the cache, all of it or nothing; one line for the first that fails in a process."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        part.replace(path)
    except OSError as error:
        with suppress(OSError):
            part.unlink()
        if not UNWRITTEN:
            told = (
                f"touchstone: kernel cache {path.parent}: {error.strerror}; kernels compile in every process"
            )
            print(told, file=sys.stderr)
        UNWRITTEN.append(path.name)


def _checksum(content):
    return zlib.crc32(content).to_bytes(CHECKSUM_SIZE, "little")


def damaged_count(folder):
    """Number of files in `folder` that are damaged or unreadable; removes them."""
    return sum(read_entry(path) is None for path in folder.glob(f"*{SUFFIX}"))


def remove_old_folders(root, kept):
    """Remove all but the `kept` most recently used folders of `root`.

    A process that still uses a removed folder recompiles its kernels.
    """
    dated = []
    for folder in root.iterdir():
        try:
            dated.append((folder.stat().st_mtime, folder))
        except OSError:  # another process removed it
            continue
    for _, folder in sorted(dated, reverse=True)[kept:]:
        shutil.rmtree(folder, ignore_errors=True)


def _digest(folder, content):
    """Hex hash of the name and `content(bytes)` of every source in `folder`, and of the compiler versions."""
    digest = hashlib.sha256()
    for source in sorted(Path(folder).rglob("*.py")):
        digest.update(
            source.relative_to(folder).as_posix().encode() + b"\0" + content(source.read_bytes()) + b"\0"
        )
    cpu = os.environ.get("NUMBA_CPU_NAME") or get_host_cpu_name()
    digest.update(f"{version('numba')} {version('numpy')} {cpu}".encode())
    return digest.hexdigest()[:16]


def _code(source):
    """The compiled part of a source; all of it if it does not parse, such as during an edit."""
    try:
        return ast.dump(_without_docstrings(ast.parse(source))).encode()
    except SyntaxError:
        return source


def _without_docstrings(tree):
    """Remove docstrings and other constant statements from `tree`, in place; returns it."""
    for node in ast.walk(tree):
        if isinstance(getattr(node, "body", None), list):
            node.body = [statement for statement in node.body if not _is_constant(statement)]
    return tree


def _is_constant(statement):
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


_imported = {}
"""By module: whether the sources were those of the key at its import."""
REJECTED = []
"""Candidates for the cache folder that are not usable, each with the reason."""
UNWRITTEN = []
"""Names of files of the cache that this process could not write."""
SOURCE_STAMPS = _stamps()
CACHE_FOLDER = choose_cache_folder()
