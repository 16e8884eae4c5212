"""`@kernel`: the decorator that compiles the functions of this package with Numba.

Only this module and `kernel_linking` import numba.
"""

import gc
import time
import warnings

import numba
from numba.core import config, types
from numba.core.compiler_lock import global_compiler_lock

from touchstone.reference_impl.core.kernel_cache import CACHE_FOLDER

if CACHE_FOLDER is not None:
    config.CACHE_DIR = str(CACHE_FOLDER)
JIT = not config.DISABLE_JIT
LINK_BY_NAME = None
"""Function that lets kernels call a kernel at its address; None if callers copy its code."""
if JIT:
    try:
        from touchstone.reference_impl.core.kernel_linking import link_by_name as LINK_BY_NAME
    except ImportError as error:
        warnings.warn(
            f"{error}: kernels are copied into their callers, and compile in three times the time",
            RuntimeWarning,
            stacklevel=1,
        )

OBJECTS_COLLECTED = 100_000, 50, 1000
"""Thresholds of the garbage collector during compilation [-]: with Python's defaults, collections take 8 s of
a cold compilation of 60 s and free little memory; without collections, memory doubles."""

KERNELS = []
"""Two dispatchers per kernel, for calls from Python and from kernels; used by `compile_count` and tests."""


def kernel(function):
    """Compile `function` to machine code: cached, no fastmath, x / 0 as in IEEE 754, not parallel.

    Kernels do not use Numba's runtime (`_nrt`): they own no memory, and reference counts of the arrays they
    pass took half of the time of a depth query. A kernel that allocates, or assigns an array to a slice, does
    not compile.
    """
    return _compiled(function)


def inlined_kernel(function):
    """Compile `function` as a kernel that callers inline: for a few lines in a hot loop."""
    return _compiled(function, forceinline=True)


def vectorised_kernel(function):
    """Compile `function` as a kernel whose straight-line arithmetic LLVM packs into vectors (SLP).

    Dense blocks take half of the time, to the same bits; frames of most scenes would take 5 % longer.
    """
    return _compiled(function, vectorised=True)


def _compiled(function, vectorised=False, **options):
    # no C wrapper: only Python and other kernels call a kernel
    options |= {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}
    options["cache"] = CACHE_FOLDER is not None and LINK_BY_NAME is None
    compiled = numba.njit(**options)(function)
    KERNELS.append(compiled)
    if JIT:
        _forget_literals(compiled)
        _collect_less(compiled)
        if vectorised:
            _vectorise(compiled)
    if LINK_BY_NAME is not None:
        callee = numba.njit(no_cpython_wrapper=True, **options)(function)
        KERNELS.append(callee)
        _forget_literals(callee)
        if vectorised:
            _vectorise(callee)
        LINK_BY_NAME(compiled, callee)
    return compiled


def _forget_literals(compiled):
    """Replace literal types by plain ones: Numba would recompile a kernel for every constant argument."""
    template = compiled.get_call_template

    def plain_template(args, kws):
        return template(tuple(map(types.unliteral, args)), {k: types.unliteral(v) for k, v in kws.items()})

    compiled.get_call_template = plain_template


def _collect_less(compiled):
    """Make garbage collections rare while a kernel and its callees compile."""
    compile_now = compiled.compile

    def compile_with_rare_collections(signature):
        with global_compiler_lock:
            usual = gc.get_threshold()
            gc.set_threshold(*OBJECTS_COLLECTED)
            try:
                return compile_now(signature)
            finally:
                gc.set_threshold(*usual)

    compiled.compile = compile_with_rare_collections


def _vectorise(compiled):
    """Enable LLVM's SLP vectorizer, which Numba disables, while a kernel and its callees compile."""
    compile_now = compiled.compile

    def compile_with_vectors(signature):
        with global_compiler_lock:
            usual, config.SLP_VECTORIZE = config.SLP_VECTORIZE, 1
            try:
                return compile_now(signature)
            finally:
                config.SLP_VECTORIZE = usual

    compiled.compile = compile_with_vectors


def entry_point(compiled, *arguments):
    """Compiled code of a kernel for arguments of these types, to be called from Python.

    A call of the kernel itself looks up the types of its arguments first: 0.8 us for the arrays of a world. A
    call of the entry point with arguments of other types is undefined.
    """
    if not JIT:
        return compiled
    return compiled.compile(tuple(compiled.typeof_pyval(value) for value in arguments))


def compile_count():
    """Number of kernels compiled in this process (cache misses of the dispatchers called from Python)."""
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
