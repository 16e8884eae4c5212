"""`@kernel`: the only import of numba in the repository, and the home of the compile cache.

Numba's cache checks the caller's own file alone: an inner kernel edited elsewhere would leave cached
callers on the old code. The cache folder is therefore keyed by a hash of every source of this package, the
versions of numba and numpy and the processor's name, and is chosen before the first decorator runs.
"""

import hashlib
import os
import tempfile
import time
from pathlib import Path

import numba
import numpy as np
from numba.core import config, types

JIT = not config.DISABLE_JIT


def source_key(folder):
    """Hash of every source in `folder`, numba, numpy and the processor (hexadecimal)."""
    digest = hashlib.sha256()
    for source in sorted(Path(folder).glob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    cpu = config.CPU_NAME or numba.core.codegen.ll.get_host_cpu_name()
    digest.update(f"{numba.__version__} {np.__version__} {cpu}".encode())
    return digest.hexdigest()[:16]


def choose_cache_folder():
    """The first writable of $TOUCHSTONE_CACHE, the user's cache and the temporary folder; None if none is."""
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    candidates = [
        os.environ.get("TOUCHSTONE_CACHE"),
        f"{home}/touchstone",
        f"{tempfile.gettempdir()}/touchstone",
    ]
    for candidate in filter(None, candidates):
        folder = Path(candidate) / "kernels" / source_key(Path(__file__).parent)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / f".probe-{os.getpid()}"
            probe.touch()
            probe.unlink()
        except OSError:
            continue
        return folder
    return None


CACHE_FOLDER = choose_cache_folder()
if CACHE_FOLDER is not None:
    config.CACHE_DIR = str(CACHE_FOLDER)

KERNELS = []
"""Every kernel of the package, for the test that each was compiled for one signature alone."""


def kernel(function):
    """Compile `function` to machine code: cached, no fastmath, x / 0 as in IEEE 754, no parallel parts.

    Without Numba's runtime (`_nrt`): kernels own no memory, and counting references to the arrays they pass
    on took half of a depth's time. One that allocates, or assigns an array to a slice, does not compile.
    """
    return _compiled(function)


def inlined_kernel(function):
    """A kernel that is copied into its callers: for a few lines that are called in a hot loop."""
    return _compiled(function, forceinline=True)


def _compiled(function, **options):
    options |= {"cache": CACHE_FOLDER is not None, "error_model": "numpy", "_nrt": False}
    compiled = numba.njit(**options)(function)
    if JIT:
        _forget_literals(compiled)
    KERNELS.append(compiled)
    return compiled


def _forget_literals(compiled):
    """Let callers share one signature: Numba would compile a kernel again for every constant handed to it."""
    template = compiled.get_call_template

    def plain_template(args, kws):
        return template(tuple(map(types.unliteral, args)), {k: types.unliteral(v) for k, v in kws.items()})

    compiled.get_call_template = plain_template


def compile_count():
    """Kernels compiled in this process (cache misses of the dispatchers called from Python)."""
    return sum(sum(k.stats.cache_misses.values()) for k in KERNELS if hasattr(k, "stats"))


if JIT:
    _clock_gettime = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.voidptr))
    CLOCK_MONOTONIC = 1

    @kernel
    def clock(out_time):
        """Monotonic time [s]; `out_time` is a scratch array of two int64."""
        _clock_gettime(CLOCK_MONOTONIC, out_time.ctypes)
        return out_time[0] + 1e-9 * out_time[1]

else:

    def clock(out_time):
        """Monotonic time [s]."""
        return time.perf_counter()
