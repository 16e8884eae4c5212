"""Compilation of the reference's kernels: once per version of their sources, in two processes.

The first process begins with the driven loop. A second one compiles the contact solver, which uses none of
the driven loop's kernels, then the rest of the simulated loop, and profile `paper`. The first process finds
all of these in the kernel cache when it gets there. A lock keeps other processes from compiling the same
kernels at the same time.
"""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from time import perf_counter
from types import ModuleType
from typing import Any

from touchstone.adapters.engines.reference.compile_progress import LOCK
from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.adapters.engines.reference.settings import PAPER, configure
from touchstone.adapters.workers.orphans import end_with_parent
from touchstone.reference_impl import frame
from touchstone.reference_impl.core import kernel
from touchstone.reference_impl.core.kernel_cache import (
    CACHE_FOLDER,
    NOTE,
    UNWRITTEN,
    noted_seconds,
    write_whole,
)
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.paper import frame as paper_frame
from touchstone.scenarios.scenario import Body, PairCoefficients, Piece, Scenario, Sphere
from touchstone.scenarios.solids import sphere_inertia

HELPER = f"from {__name__} import compile_simulated_loop; compile_simulated_loop({{parent}})"
"""Program of the second process."""


@cache
def compile_seconds() -> float:
    """Compilation time of all kernels [s]; compiles them on a small world if the cache holds no time."""
    if CACHE_FOLDER is None or not kernel.JIT:
        return _compiled()
    seconds: float | None = noted_seconds(CACHE_FOLDER)
    if seconds is None:
        with _lock(CACHE_FOLDER / LOCK):
            seconds = noted_seconds(CACHE_FOLDER)
            if seconds is None:
                with _helper():
                    seconds = _compiled()
                if not UNWRITTEN:
                    write_whole(CACHE_FOLDER / NOTE, f"{seconds:.2f}".encode())
    return seconds


@contextmanager
def _lock(path: Path) -> Iterator[None]:
    """Hold a lock, whose file gets the present time; do without where the file system refuses it."""
    with ExitStack() as stack:
        with suppress(OSError):
            file = stack.enter_context(path.open("a"))
            fcntl.flock(file, fcntl.LOCK_EX)
            os.utime(file.fileno())
        yield


@kernel.kernel
def nothing(bodies, pieces, joints, drivers, vertices, pairs, contacts, state):  # type: ignore[no-untyped-def]
    """Do nothing: the call measures the cost of calling a kernel from Python."""


def frame_of(profile: str) -> ModuleType:
    """Module with `prepare` and `step` of a profile."""
    return paper_frame if profile == PAPER else frame


def _compiled() -> float:
    start = perf_counter()
    world = small_world()
    for module in (frame, paper_frame):
        module.prepare(*world)
        module.step(*world)
    nothing(*world)
    return perf_counter() - start


def small_world() -> World:
    """A world of one ball: the kernels compile for its arrays' types, which are those of every world."""
    inertia = sphere_inertia(1.0, 1.0)
    ball = Body("ball", "simulated", "m", (Piece("ball", Sphere(1.0)),), mass=1.0, inertia=inertia)
    world = translate(Scenario("compile", "", (), (ball,), 1 / 60, (PairCoefficients("m", "m", 0.0, 0.0),)))
    configure(world.state[0], "balanced")
    return world


@contextmanager
def _helper() -> Iterator[None]:
    """Run the second process meanwhile, where there are two processors and kernels are linked by name."""
    if len(os.sched_getaffinity(0)) < 2 or kernel.LINK_BY_NAME is None:
        yield
        return
    # -P: not from the working folder, which may be another checkout
    program = [sys.executable, "-P", "-c", HELPER.format(parent=os.getpid())]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    quiet = subprocess.DEVNULL
    helper = subprocess.Popen(program, stdin=quiet, stdout=quiet, stderr=quiet, env=environment)
    try:
        yield
    finally:
        helper.kill()
        helper.wait()


def compile_simulated_loop(parent: int) -> None:
    """Compile kernels of the simulated loop in this process, which ends with its parent."""
    end_with_parent(parent, by_kernel=False)
    world = small_world().of_stages()
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    _compile(frame.solve_resting_contacts, world, 0, 0.0, 0.0)
    _compile(frame.resolve_impacts, world, 0, 0.0, 0.0)
    _compile(frame.guard_energy, world, 0, True, 0, False, 0.01)
    _compile(frame.gather_contacts, world, 0.0)
    _compile(frame.separate_simulated, world, 0)
    _compile(frame.earliest_impact, world, 0, 0, 1.0, True, (-1, -1))
    # the first process is still in the driven loop, and comes to profile `paper` last
    _compile(paper_frame.update_driven_objects, world)
    _compile(paper_frame.update_simulated_objects, world)
    _compile(frame.update_fat_bounds, bodies, world.pieces, world.vertices, drivers, world.pairs, state)
    _compile(frame.is_isolated, bodies, world.pieces, drivers, state)
    _compile(frame.set_ways, bodies, joints, drivers, world.pairs, 0, 0.0, 0.0)
    _compile(frame.end_substep, bodies, joints, drivers, 0.0, 0.0, 0.0)
    _compile(frame.first_return, bodies, world.pairs, 0, state)


def _compile(compiled: Any, *arguments: object) -> None:
    """Compile the variant of a kernel that kernels call, for arguments of these types."""
    variants = [id(one) for one in kernel.KERNELS]
    callee = kernel.KERNELS[variants.index(id(compiled)) + 1]
    callee.compile(tuple(compiled.typeof_pyval(value) for value in arguments))
