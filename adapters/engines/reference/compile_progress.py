"""How far a compilation of the reference is, in words; `compiling.py` compiles."""

from __future__ import annotations

import re
from pathlib import Path
from time import time

from touchstone.reference_impl.core.kernel_cache import (
    CACHE_FOLDER,
    NOTE,
    PACKAGE,
    SUFFIX,
    noted_seconds,
)

LOCK = "compiling"
"""File in the kernel cache that is locked while its kernels compile; its time stamp is the start."""
USUAL_SECONDS = 60.0
"""Compilation time where this machine has not compiled an earlier version [s]."""
KNOWN_SHARE = 0.1
"""Share of the kernels from which on the compilation's own pace counts [1]."""
ROUNDED = 5
"""Unit of the time that is left [s]."""
ANNOUNCED = "compiling the reference, once per version of it"
UNCACHED = (
    f"compiling the reference in every process, about {USUAL_SECONDS:.0f} s: no folder for the kernel cache"
)
DECORATOR = re.compile(r"^ *@(?:inlined_)?kernel$", re.MULTILINE)


def is_compiled() -> bool:
    """Whether the cache holds all kernels of this version."""
    return CACHE_FOLDER is not None and noted_seconds(CACHE_FOLDER) is not None


def announcement() -> str:
    """What is about to be compiled, and how long it may take; "" if nothing is."""
    if CACHE_FOLDER is None:
        return UNCACHED
    if is_compiled():
        return ""
    return f"{ANNOUNCED}: about {usual_seconds(CACHE_FOLDER.parent):.0f} s"


def compile_progress() -> str:
    """How far a compilation that runs now is, and how long it may still take; "" if none runs."""
    if CACHE_FOLDER is None:
        return UNCACHED
    if is_compiled() or not (CACHE_FOLDER / LOCK).exists():
        return ""
    kernels = sum(len(DECORATOR.findall(source.read_text("utf-8"))) for source in PACKAGE.rglob("*.py"))
    # a kernel has a file for calls from Python and one for calls from kernels
    done = min(kernels, len({entry.name.rsplit(".", 3)[0] for entry in CACHE_FOLDER.glob(f"*{SUFFIX}")}))
    elapsed = time() - (CACHE_FOLDER / LOCK).stat().st_mtime
    left = time_left(done / kernels, elapsed, usual_seconds(CACHE_FOLDER.parent))
    return f"{ANNOUNCED}: {done} of {kernels} kernels, about {left} s left"


def time_left(share: float, elapsed: float, usual: float) -> int:
    """Time until a compilation ends that has compiled a share of all kernels [s, rounded].

    Kernels take equal times on average. Until KNOWN_SHARE of them are done, the usual time counts.
    """
    left = elapsed * (1 / share - 1) if share > KNOWN_SHARE else max(usual - elapsed, 0.0)
    return ROUNDED * max(1, round(left / ROUNDED))


def usual_seconds(root: Path) -> float:
    """Compilation time of the version that was compiled last, of those in the folder `root` [s]."""
    notes = sorted(root.glob(f"*/{NOTE}"), key=lambda note: note.stat().st_mtime)
    known = (noted_seconds(note.parent) for note in reversed(notes))
    return next((seconds for seconds in known if seconds is not None), USUAL_SECONDS)
