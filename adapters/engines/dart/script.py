"""DART scripts: the calls of dartpy that the adapter makes, as a plain program."""

import inspect
import re
from collections.abc import Iterator
from contextlib import contextmanager

import dartpy

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.dart import engine, model
from touchstone.adapters.scripts.script import Parts, moving
from touchstone.adapters.scripts.trace import Trace, expression, needed, references
from touchstone.adapters.scripts.writing import UNPACKING, Writer, commanded, driven_steps
from touchstone.scenarios.scenario import Scenario

VALUES = re.compile(r"Isometry3|Quaternion|Inertia|Uri|[A-Z]\w+Shape|[A-Z]\w+Detector")
"""Functions whose results are values."""
READS = ("translation", "rotation", "quaternion", "wxyz", "step")
OF_SCENE = "Skeleton"
"""The call after which the lines that set the settings end."""
NO_SETTINGS = ("World", "setGravity")
"""Calls before it that set no settings."""
STARTS = (OF_SCENE, "setInertia", "createShapeNode", "addBodyNodePairToBlackList")
"""Calls with which loops may begin."""


@contextmanager
def traced() -> Iterator[Trace]:
    """A trace of what the adapter calls meanwhile."""
    trace = Trace(dartpy, values=lambda name: bool(VALUES.fullmatch(name)), reads=READS)
    own = model.mesh_shape
    try:
        engine.dartpy = model.dartpy = trace.module
        model.mesh_shape = trace.helper("mesh_shape", own)
        yield trace
    finally:
        engine.dartpy = model.dartpy = dartpy
        model.mesh_shape = own


def parts(scenario: Scenario, settings: Settings) -> Parts:
    """The parts of a scene's script; raises Unsupported if DART cannot represent it."""
    with traced() as trace:
        world = engine.DartEngine().build(scenario, settings)
        built = len(trace.statements)
        steps = driven_steps(trace, world, scenario, settings)
        moved = moving(scenario)
        nodes = {scenario.bodies[k].name: expression(world._nodes[k]) for k in moved}
        own = next(references(expression(world._world)))
    kept = needed(trace, [own, *nodes.values()])
    every = set(kept)
    order = [k for k in kept if k < built]
    first = _of_settings(trace, order)
    used = [one for k in kept if k >= built for one in references(trace.statements[k].function)]
    writer = Writer(
        trace, order[len(first) :], {}, kept=[*nodes.values(), *used], before=first, starts=STARTS
    )
    commands, lines = commanded(trace, [[k for k in step if k in every] for step in steps], writer)
    numpy = UNPACKING if commands is not None else ()
    hulls = any("mesh_shape" in text for text in writer.lines())
    helper = inspect.getsource(model.mesh_shape).splitlines() if hulls else []
    files = ["import tempfile", "from pathlib import Path", "from typing import Any", ""] if hulls else []
    return Parts(
        f"dartpy=={dartpy.__version__}",
        [*files, *numpy, "import dartpy"],
        Writer(trace, first, {}, kept=[own]).lines(),
        lambda width: [*helper, *writer.lines(width)],
        [*lines, f"{writer.reference(own, None)}.step()"],
        {name: writer.reference(one, None) for name, one in nodes.items()},
        "body.getWorldTransform().translation().tolist()",
        commands=commands,
    )


def _of_settings(trace: Trace, order: list[int]) -> list[int]:
    """Statements before the first that belongs to the scene."""
    found = []
    for k in order:
        if trace.statements[k].called == OF_SCENE:
            break
        found.append(k)
    return found


def settings_lines(scenario: Scenario, settings: Settings) -> list[str]:
    """Calls that set the settings of a world."""
    with traced() as trace:
        engine.DartEngine().build(scenario, settings)
    every = _of_settings(trace, needed(trace))
    found = [k for k in every if trace.statements[k].called not in NO_SETTINGS]
    return Writer(trace, found, {}).lines()
