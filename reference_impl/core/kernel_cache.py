"""Compile cache folder: its key, its location and the removal of old folders.

Numba's cache checks only the caller's own file: after an edit of a callee in another file, cached callers
would keep the old code. The key of the folder is therefore a hash of all sources of `reference_impl`, the
versions of numba and numpy, and the processor's name. The folder is chosen before the first decorator runs.
Comments, docstrings and layout do not change the key. This module does not import numba, which takes 0.5 s:
a process that only asks whether kernels are compiled does without.
"""

import ast
import hashlib
import os
import shutil
import tempfile
from importlib.metadata import version
from pathlib import Path

from llvmlite.binding import get_host_cpu_name

PACKAGE = Path(__file__).resolve().parents[1]
FOLDERS_KEPT = 8
"""Cache folders kept when a new one is created [-]: several checkouts and branches in use, 30 MB each."""
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
    """First writable of $TOUCHSTONE_CACHE, the user's cache and the temporary folder; None if none is."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    candidates = [
        os.environ.get("TOUCHSTONE_CACHE"),
        f"{home}/touchstone",
        f"{tempfile.gettempdir()}/touchstone",
    ]
    mark = MARK + _digest(PACKAGE, bytes)
    for candidate in filter(None, candidates):
        try:
            return _open_folder(Path(candidate) / "kernels", mark)
        except OSError:
            continue
    return None


def _open_folder(root, mark):
    """Open or create the folder in `root` for the present sources; raises OSError if it is not writable."""
    known = next(root.glob(f"*/{mark}"), None)
    folder = known.parent if known else root / source_key(PACKAGE)
    if not folder.exists():
        folder.mkdir(parents=True, exist_ok=True)
        remove_old_folders(root, FOLDERS_KEPT)
    # the write also updates the folder's time of last use
    probe = folder / f".probe-{os.getpid()}"
    probe.touch()
    probe.unlink()
    if _stamps() == SOURCE_STAMPS:
        (folder / mark).touch()
    return folder


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
SOURCE_STAMPS = _stamps()
CACHE_FOLDER = choose_cache_folder()
