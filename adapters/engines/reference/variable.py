"""The reference with its constants in memory and its mechanisms behind switches, for ablations.

Numba compiles a constant into each kernel that uses it: to vary one means to compile the reference again.
Here the sources are compiled once more, with every constant read from memory and every mechanism's function
behind a switch (`install`, before the reference is imported); then one process plays any values (`vary`).
Sources and kernels of the reference stay as they are: these kernels have a cache folder of their own.
"""

from __future__ import annotations

import ast
import ctypes
import hashlib
import importlib.abc
import importlib.machinery
import mmap
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

PACKAGE = "touchstone.reference_impl"
ROOT = Path(__file__).resolve().parents[3] / "reference_impl"
ADAPTER = Path(__file__).resolve().parent
LEFT_OUT = ("paper.", "core.kernel")
"""Modules that are compiled as they are: the method as printed, and the compiler itself."""
DECORATORS = ("kernel", "inlined_kernel", "vectorised_kernel")
LARGEST = 1e200
"""Size from which a value means never or nowhere, and is not varied."""
CODES = ("INSIDE", "NEXT", "LAST", "HASH_Y", "HASH_Z", "HASH_LEVEL", "RANDOM_FACTOR", "RANDOM_PRIME")
"""Numbers that are no quantities: sets of bits, offsets of a list, factors of hashes and random numbers."""
ADDRESS = 0x6F00_0000_0000
"""Where the values stand in every process [B]: compiled code is cached with it."""
ROOM = 1 << 16
"""Size of the memory of values [B]: floats in its first half, integers in its second."""


@dataclass(frozen=True, slots=True)
class Constant:
    """A number of the reference: a plain assignment of a module, read by kernels."""

    module: str
    name: str
    value: float
    whole: bool
    """Whether it is an integer."""

    def times(self, factor: float) -> float:
        """The value varied by a factor: a share just below 1 by its distance from 1, a count by whole
        numbers."""
        if 0.9 <= self.value < 1:
            return max(0.0, 1 - factor * (1 - self.value))
        varied = factor * self.value
        return float(max(1, round(varied))) if self.whole else varied


@dataclass(frozen=True, slots=True)
class Mechanism:
    """A function of the reference that can be switched off; `instead` is what it returns then."""

    name: str
    module: str
    function: str
    instead: str = ""


MECHANISMS: tuple[Mechanism, ...] = (
    Mechanism("stiff couplings by the radian", "frame", "_until_swing", "1.0"),
    Mechanism("fat bounds", "broad_phase.fat_bounds", "inside_fat_bounds", "False"),
    Mechanism("frames without contact", "broad_phase.fat_bounds", "is_isolated", "False"),
    Mechanism("cached box faces", "geometry.depth_warm_start", "_on_box_face", "False"),
    Mechanism("segments in closed form", "geometry.capsule_distance", "have_segments", "False"),
    Mechanism("internal edges", "contact.internal_edges", "align_internal_edges"),
    Mechanism("impacts of an island at once", "contact.island_impact", "strike_together"),
    Mechanism("impacts wait for contact", "contact.speculative_contacts", "_drop_impacts_ahead", "count"),
    Mechanism("stop of sliding as event", "contact.contact_events", "first_stop", "2.0"),
    Mechanism("return of contact as event", "contact.contact_events", "first_return", "1.0"),
    Mechanism("spin of free islands", "contact.island_motion", "keep_spin"),
    Mechanism("curved contacts", "continuous.contact_motion", "is_curved", "False"),
    Mechanism("end correction", "contact.end_correction", "correct_ends", "0.0"),
    Mechanism("motion under solved forces", "continuous.mechanism_motion", "follow_forces", "0.0"),
    Mechanism("stiff joints implicitly", "continuous.mechanism_flow", "_is_stiff", "False"),
    Mechanism("faces without prediction", "contact.resting_contact", "_except_faces"),
    Mechanism("law of positions", "contact.resting_contact", "_solve_positions"),
    Mechanism("limits of hinges as rows", "contact.resting_contact", "_find_limits", "False"),
    Mechanism("energy guard", "contact.energy_guard", "guard_energy"),
    Mechanism("separation", "contact.separation", "separate_simulated", "first"),
    Mechanism("separation of limbs", "contact.separation", "_turn_apart"),
    Mechanism("separation along all points", "contact.separation", "_move_together", "False"),
    Mechanism("warm start of impulses", "solver.warm_start", "load_impulse"),
    Mechanism("even load of faces", "solver.face_load", "find_faces"),
    Mechanism("Newton's method", "solver.contact_newton", "newton"),
    Mechanism("interior point", "solver.contact_interior", "interior"),
    Mechanism("interior point from afar", "solver.interior_start", "begin_afar"),
    Mechanism("passive impulses", "solver.contact_rows", "make_passive"),
    Mechanism("reversal of slip", "solver.contact_rows", "reverse_slip"),
    Mechanism("rebounds lowered", "solver.contact_solver", "_stop_rebound"),
    Mechanism("sweep of drivers", "posture.driven_time_of_impact", "sweep_drivers"),
)


@cache
def constants() -> tuple[Constant, ...]:
    """Every number that kernels read, but codes, enumerations and sizes of memory."""
    values, read, outside = _values(), set(), set()
    for module, tree in _trees().items():
        for node in tree.body:
            if _is_kernel(node):
                read |= {_owner(module, name) for name in _names(node)}
            elif not isinstance(node, ast.ImportFrom) and not _assigned(node, values, module):
                outside |= {_owner(module, name) for name in _names(node)}
    for source in ADAPTER.glob("*.py"):
        tree = ast.parse(source.read_text())
        origins = _origins(tree)
        outside |= {origins[name] for name in _names(tree) if name in origins}
    for module, tree in _trees().items():
        for node in tree.body:
            if any((module, name) in outside for name in _assigned(node, values, module)):
                outside |= {_owner(module, name) for name in _names(node)}
    found = []
    for module, tree in _trees().items():
        for node in tree.body:
            for name in _assigned(node, values, module):
                value, place = values[module, name], (module, name)
                if place in read and place not in outside and name not in CODES and 0 < abs(value) < LARGEST:
                    found.append(Constant(module, name, float(value), isinstance(value, int)))
    return tuple(found)


@cache
def _trees() -> Mapping[str, ast.Module]:
    """Syntax of every module of the reference whose constants may vary."""
    found = {}
    for source in sorted(ROOT.rglob("*.py")):
        module = ".".join(source.relative_to(ROOT).with_suffix("").parts)
        if not module.startswith(LEFT_OUT):
            found[module] = ast.parse(source.read_text())
    return found


@cache
def _values() -> Mapping[tuple[str, str], float]:
    """Value of every constant, by module and name: of expressions of numbers and of constants above it."""
    found: dict[tuple[str, str], float] = {}
    trees = dict(_trees())
    while trees:  # modules after those from which they import
        ready = [
            m for m, tree in trees.items() if not {o for o, _ in _origins(tree).values()} & (set(trees) - {m})
        ]
        for module in ready:
            for node in trees.pop(module).body:
                if isinstance(node, ast.Assign):
                    found |= _evaluated(node, module, found)
        if not ready:
            raise RuntimeError(f"modules import each other: {', '.join(trees)}")
    return found


def _evaluated(
    node: ast.Assign, module: str, values: Mapping[tuple[str, str], float]
) -> dict[tuple[str, str], float]:
    """Values that an assignment gives to names; none where it is no arithmetic."""
    known = {name: values[_owner(module, name)] for name in _names(node) if _owner(module, name) in values}
    if any(isinstance(part, ast.Call | ast.Attribute) for part in ast.walk(node)):
        return {}
    try:
        value = eval(compile(ast.Expression(node.value), module, "eval"), {"__builtins__": {}, **known})
    except NameError:
        return {}
    targets = node.targets[0]
    names = targets.elts if isinstance(targets, ast.Tuple) else [targets]
    several = value if isinstance(targets, ast.Tuple) else [value]
    return {
        (module, name.id): one
        for name, one in zip(names, several)
        if isinstance(name, ast.Name) and name.id.isupper() and type(one) in (int, float)
    }


def _assigned(node: ast.AST, values: Mapping[tuple[str, str], float], module: str) -> list[str]:
    """Names to which a statement gives numbers that are no enumeration (consecutive whole ones)."""
    if not isinstance(node, ast.Assign):
        return []
    parts = node.targets[0].elts if isinstance(node.targets[0], ast.Tuple) else node.targets
    names = [part.id for part in parts if isinstance(part, ast.Name) and (module, part.id) in values]
    several = [values[module, name] for name in names]
    steps = {later - one for one, later in pairwise(several)}
    return [] if steps == {1} and all(isinstance(one, int) for one in several) else names


def _is_kernel(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and any(
        isinstance(one, ast.Name) and one.id in DECORATORS for one in node.decorator_list
    )


def _names(node: ast.AST) -> set[str]:
    """Names that are read in a statement."""
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Load)}


@cache
def _origins_of(module: str) -> Mapping[str, tuple[str, str]]:
    return _origins(_trees()[module])


def _origins(tree: ast.Module) -> dict[str, tuple[str, str]]:
    """Module and name of everything that is imported from the reference."""
    return {
        alias.asname or alias.name: (node.module.removeprefix(f"{PACKAGE}."), alias.name)
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(f"{PACKAGE}.")
        for alias in node.names
    }


def _owner(module: str, name: str) -> tuple[str, str]:
    """Module and name where a name of a module is defined."""
    return _origins_of(module).get(name, (module, name))


class _Reading(ast.NodeTransformer):
    """Let the kernels of a module read constants from memory, and ask the switches of its mechanisms."""

    def __init__(self, module: str) -> None:
        self._module = module
        self._floats = {(one.module, one.name): k for k, one in enumerate(constants()) if not one.whole}
        self._ints = {(one.module, one.name): k for k, one in enumerate(constants()) if one.whole}
        self._switches = {(one.module, one.function): (k, one) for k, one in enumerate(MECHANISMS)}

    def visit_Module(self, node: ast.Module) -> ast.Module:
        """Change the kernels alone."""
        node.body = [self._kernel(one) if isinstance(one, ast.FunctionDef) else one for one in node.body]
        return node

    def _kernel(self, node: ast.FunctionDef) -> ast.FunctionDef:
        if not _is_kernel(node):
            return node
        node.body = [self.visit(statement) for statement in node.body]
        number, mechanism = self._switches.get((self._module, node.name), (0, None))
        if mechanism is not None:
            place = len(constants()) + number
            off = ast.parse(f"if constant_whole({place}) != 0:\n    return {mechanism.instead}").body
            node.body[1:1] = off  # behind the docstring
        return node

    def visit_Name(self, node: ast.Name) -> ast.expr:
        """Replace the name of a constant by the memory in which it stands."""
        place = _owner(self._module, node.id)
        for read, places in (("constant", self._floats), ("constant_whole", self._ints)):
            if place in places and isinstance(node.ctx, ast.Load):
                return ast.parse(f"{read}({places[place]})", mode="eval").body
        return node


class _Loader(importlib.machinery.SourceFileLoader):
    """Compiles a module of the reference with its constants in memory."""

    def get_code(self, fullname: str) -> CodeType:
        """Code of the changed source; byte code on disk is of the plain one."""
        module = fullname.removeprefix(f"{PACKAGE}.")
        tree = ast.parse(self.get_data(self.path))
        tree = ast.fix_missing_locations(_Reading(module).visit(tree))
        code: CodeType = compile(tree, self.path, "exec")
        return code

    def exec_module(self, module: ModuleType) -> None:
        """Run the module, which knows how to read the memory."""
        module.__dict__.update(zip(("constant", "constant_whole"), _readers()))
        super().exec_module(module)


class _Finder(importlib.abc.MetaPathFinder):
    """Finds the modules of the reference in which constants vary."""

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> Any:
        """Their place, with the loader that changes them."""
        module = fullname.removeprefix(f"{PACKAGE}.")
        found = importlib.machinery.PathFinder.find_spec(fullname, path)
        if found is not None and fullname != module and module in _trees() and found.origin:
            if found.submodule_search_locations is None:
                found.loader = _Loader(fullname, found.origin)
            return found
        return None


@cache
def _readers() -> tuple[Any, Any]:
    """Functions of kernels that read a float and an integer at a place of the memory."""
    from llvmlite import ir
    from numba.core import config, types
    from numba.extending import intrinsic

    if config.DISABLE_JIT:
        return (lambda place: _floats()[place]), (lambda place: _wholes()[place])

    def reader(numba_type: Any, llvm_type: ir.Type, start: int) -> Any:
        def read(typing_context: Any, place: Any) -> Any:
            def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
                base = ir.Constant(ir.IntType(64), start)
                pointer = builder.inttoptr(base, llvm_type.as_pointer())
                value = builder.load(builder.gep(pointer, [arguments[0]]))
                # nothing changes it while a kernel runs
                value.set_metadata("invariant.load", builder.module.add_metadata([]))
                return value

            return numba_type(types.int64), code

        return intrinsic(read)

    half = ROOM // 2
    return (
        reader(types.float64, ir.DoubleType(), ADDRESS),
        reader(types.int64, ir.IntType(64), ADDRESS + half),
    )


def install() -> None:
    """Prepare this process so that the reference, imported from now on, reads its constants from memory.

    Raises:
        RuntimeError: the reference is imported already, or the memory is not free.
    """
    if any(name.startswith(f"{PACKAGE}.core.kernel") for name in sys.modules):
        raise RuntimeError("the reference is imported already")
    layout = ADDRESS, ROOM, MECHANISMS, [(one.module, one.name, one.whole) for one in constants()]
    key = hashlib.sha256(repr(layout).encode()).hexdigest()[:8]
    usual = os.environ.get("TOUCHSTONE_CACHE") or Path(
        os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "touchstone"
    )
    os.environ["TOUCHSTONE_CACHE"] = str(Path(usual) / f"variable-{key}")
    _floats(), _wholes()
    vary({})
    sys.meta_path.insert(0, _Finder())


@cache
def _memory() -> int:
    """Address of the memory of values, which stays as long as the process."""
    library = ctypes.CDLL(None, use_errno=True)
    library.mmap.restype = ctypes.c_void_p
    library.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    protection, flags = mmap.PROT_READ | mmap.PROT_WRITE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
    found = library.mmap(ADDRESS, ROOM, protection, flags, -1, 0)
    if found != ADDRESS:
        raise RuntimeError("the memory in which constants stand is not free")
    return ADDRESS


@cache
def _floats() -> ctypes.Array[ctypes.c_double]:
    return (ctypes.c_double * len(constants())).from_address(_memory())


@cache
def _wholes() -> ctypes.Array[ctypes.c_int64]:
    count = len(constants()) + len(MECHANISMS)
    return (ctypes.c_int64 * count).from_address(_memory() + ROOM // 2)


def vary(values: Mapping[str, float], off: Sequence[str] = ()) -> None:
    """Give constants values, by "module.NAME", and all others their own; switch mechanisms off, by name."""
    for k, one in enumerate(constants()):
        value = values.get(f"{one.module}.{one.name}", one.value)
        if one.whole:
            _wholes()[k] = int(value)
        else:
            _floats()[k] = value
    for k, mechanism in enumerate(MECHANISMS):
        _wholes()[len(constants()) + k] = mechanism.name in off
