"""Named kernels: callers call a large kernel at its address instead of compiling a copy of it.

Numba links the code of a callee into each of its callers, and LLVM optimises and generates it again at every
call level. Here a kernel with more than `LINES_COPIED` lines of code has a symbol: its address is registered
under that symbol, and a caller only declares it, with Numba's calling convention.

A cache entry lists the symbols that its code calls. Loading the entry first loads these kernels and registers
their addresses, because LLVM terminates the process at an unknown symbol.
"""

import copy
import hashlib
import pickle
import sys
from pathlib import Path

import llvmlite.binding
from numba.core import base, caching, codegen, compiler, dispatcher, funcdesc, imputils, serialize

from touchstone.reference_impl.core.kernel_cache import (
    CACHE_FOLDER,
    PACKAGE,
    SUFFIX,
    is_key_valid,
    note_import,
    read_entry,
    write_entry,
)

LINES_COPIED = 200
"""Lines of optimised LLVM text up to which a kernel is linked into its callers [-]: LLVM does not inline
larger ones, except those that the sources mark as inlined."""

PARTS = (
    (caching, "FunctionCache"),
    (caching, "CompileResultCacheImpl"),
    (caching, "_CacheLocator"),
    (caching.CacheImpl, "locator"),
    (caching.CacheImpl, "check_cachable"),
    (caching.Cache, "_impl"),
    (caching.Cache, "_index_key"),
    (base.BaseContext, "declare_function"),
    (base.BaseContext, "insert_func_defn"),
    (base.BaseContext, "remove_user_function"),
    (codegen.JITCodeLibrary, "_final_module"),
    (codegen.JITCodeLibrary, "_get_module_for_linking"),
    (codegen.JITCodeLibrary, "get_pointer_to_function"),
    (compiler.CompileResult, "fndesc"),
    (compiler.CompileResult, "library"),
    (dispatcher.Dispatcher, "_cache"),
    (dispatcher.Dispatcher, "_compiling_counter"),
    (dispatcher.Dispatcher, "get_call_template"),
    (dispatcher.Dispatcher, "get_overload"),
    (dispatcher.Dispatcher, "overloads"),
    (funcdesc.FunctionDescriptor, "abi_tags"),
    (funcdesc.FunctionDescriptor, "mangled_name"),
    (imputils, "user_function"),
    (serialize, "dumps"),
)
"""Numba attributes outside its documented interface that this module uses: (owner, name)."""


def missing_parts(parts=PARTS):
    """Names of the parts missing in the installed Numba; attributes set in `__init__` count as present."""
    return [f"{owner.__name__}.{name}" for owner, name in parts if not _has(owner, name)]


def _has(owner, name):
    classes = getattr(owner, "__mro__", ())
    set_names = (getattr(one.__init__, "__code__", None) for one in classes)
    return hasattr(owner, name) or any(code and name in code.co_names for code in set_names)


if missing_parts():
    raise ImportError(f"numba has no {', '.join(missing_parts())}")

_kernels = {}
"""Kernels in the variant called from kernels, by (module, qualified name)."""
_owners = {}
"""Owner of each symbol: (module, qualified name, argument types, entry point)."""


def link_by_name(compiled, callee):
    """Let kernels call a large kernel at its address.

    Args:
        compiled: the variant called from Python.
        callee: the variant called from kernels, without the Python wrapper: only kernels call most kernels,
            and wrappers took a sixth of the compilation time.
    """
    note_import(compiled.py_func.__module__)
    if CACHE_FOLDER is not None:
        compiled._cache, callee._cache = _Cache(compiled.py_func), _CalleeCache(compiled.py_func)
    _kernels[_identity(callee)] = callee
    if _is_keyed(callee.py_func) and not callee.targetoptions.get("forceinline"):
        _name_when_called(callee)
    # Numba queries the kernel in the caller's source for its call template and for recursion
    compiled.get_call_template = callee.get_call_template
    compiled.get_overload = callee.get_overload
    callee._compiling_counter = compiled._compiling_counter


def _name_when_called(callee):
    """Register the symbol of a kernel after a caller has compiled it and before the caller calls it."""
    template = callee.get_call_template
    measured = set()

    def naming_template(args, kws):
        found = template(args, kws)
        for signature, result in callee.overloads.items():
            if signature not in measured:
                measured.add(signature)
                if _is_large(result):
                    _name(callee, signature)
        return found

    callee.get_call_template = naming_template


def _is_keyed(function):
    """Whether the key of the cache folder covers the source of a function.

    Only such kernels get a symbol: a caller's cache entry requires that its callees are unchanged.
    """
    source = Path(function.__code__.co_filename).resolve()
    return PACKAGE in source.parents and "<locals>" not in function.__qualname__


def _identity(compiled):
    return compiled.py_func.__module__, compiled.py_func.__qualname__


def _is_large(result):
    """Whether the optimised code of a kernel exceeds LINES_COPIED."""
    function = result.library._get_module_for_linking().get_function(result.fndesc.llvm_func_name)
    return str(function).count("\n") > LINES_COPIED


def _symbol(compiled, args):
    """Symbol of a kernel's code for the argument types.

    It replaces Numba's mangled name, which contains counters of the compiling process.
    """
    described = f"{args} {compiled.overloads[args].fndesc.abi_tags}"
    return ".".join((*_identity(compiled), hashlib.sha256(described.encode()).hexdigest()[:16]))


def _name(compiled, args, symbol=None):
    """Register the address of a kernel's code, and let callers declare it; False if that is impossible."""
    result = compiled.overloads[args]
    symbol = symbol or _symbol(compiled, args)
    owner = (*_identity(compiled), args, result.entry_point)
    if symbol in _owners:
        return _owners[symbol] == owner
    address = result.library.get_pointer_to_function(result.fndesc.llvm_func_name)
    if not address:
        return False
    llvmlite.binding.add_symbol(symbol, address)
    _owners[symbol] = owner
    call = _declared_call(result, symbol)
    compiled.targetctx.remove_user_function(result.entry_point)
    compiled.targetctx.insert_func_defn([(call, result.entry_point, call.signature)])
    return True


def _declared_call(result, symbol):
    """Code generator that declares a kernel under its symbol and calls it.

    The declaration repeats the attributes that LLVM inferred, such as read-only arguments. Without them a
    frame takes 1 % longer.
    """
    declared = copy.copy(result.fndesc)
    declared.mangled_name = symbol
    function = result.library._get_module_for_linking().get_function(result.fndesc.llvm_func_name)
    found = [[one.decode() for one in value.attributes] for value in (function, *function.arguments)]
    del found[0][1:]  # sets of attributes: the function's, then those of its result and arguments
    call = imputils.user_function(declared, ())  # without a library to link

    def declare_and_call(context, builder, signature, args):
        function = context.declare_function(builder.module, declared)
        for value, attributes in zip((function, *function.args), found):
            set.update(value.attributes, attributes)  # `add` refuses attributes newer than its list
        return call(context, builder, signature, args)

    declare_and_call.signature, declare_and_call.libs = call.signature, call.libs
    return declare_and_call


def _load_named(symbol, module, name, args):
    """Load or compile the kernel of a symbol, and register it; False if it is not available."""
    compiled = _kernels.get((module, name))
    if compiled is None:
        return False
    compiled.compile(args)
    return args in compiled.overloads and _name(compiled, args, symbol)


class _Locator(caching._CacheLocator):
    """Cache locator: all kernels are in the cache folder.

    Its key covers the sources of this package. Numba's own locators add the file's time stamp and the
    kernel's line, which change with comments.
    """

    def __init__(self, py_func, py_file):
        self._stamp = "" if _is_keyed(py_func) else hashlib.sha256(Path(py_file).read_bytes()).hexdigest()

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_func, py_file) if Path(py_file).exists() else None

    def get_cache_path(self):
        return str(CACHE_FOLDER)

    def get_source_stamp(self):
        return self._stamp

    def get_disambiguator(self):
        return "kernel"


class _Entry(caching.CompileResultCacheImpl):
    """Cache entry that starts with the list of symbols that its code calls."""

    _locator_classes = (_Locator,)

    def reduce(self, result):
        called = [one.name for one in result.library._final_module.functions if one.name in _owners]
        return [(symbol, *_owners[symbol][:3]) for symbol in called], super().reduce(result)

    def rebuild(self, target_context, payload):
        named, usual = payload
        if not all(_load_named(*one) for one in named):
            return None  # a miss: the kernel is compiled
        return super().rebuild(target_context, usual)


class _Cache(caching.FunctionCache):
    """Cache of a kernel called from Python: a file for every signature, without Numba's index.

    Unlike Numba's, the files have a checksum, and one that cannot be read or written ends no run.
    """

    _impl_class = _Entry
    _caller = "python"

    def load_overload(self, sig, target_context):
        if not is_key_valid():
            return None
        target_context.refresh()
        content = read_entry(self._path(sig, target_context.codegen()))
        return None if content is None else self._impl.rebuild(target_context, pickle.loads(content))

    def save_overload(self, sig, data):
        if is_key_valid() and self._impl.check_cachable(data):
            write_entry(self._path(sig, data.codegen), serialize.dumps(self._impl.reduce(data)))

    def _path(self, sig, codegen):
        """File of a signature; "-kernel" in the name ends that of the kernel."""
        stamp = self._impl.locator.get_source_stamp()
        described = f"{sys.implementation.cache_tag} {stamp} {self._index_key(sig, codegen)}"
        digest = hashlib.sha256(described.encode()).hexdigest()[:16]
        function = self._py_func
        name = f"{function.__module__}.{function.__qualname__}.{digest}.{self._caller}{SUFFIX}"
        return CACHE_FOLDER / name


class _CalleeCache(_Cache):
    """Cache of a kernel called from kernels."""

    _caller = "kernel"
