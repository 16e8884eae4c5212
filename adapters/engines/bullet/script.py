"""Bullet scripts: the calls of pybullet that the adapter makes, as a plain program."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version

import numpy as np
import pybullet

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.bullet import bodies, engine, joints
from touchstone.adapters.scripts.script import Parts, literal, moving
from touchstone.adapters.scripts.trace import Trace, needed
from touchstone.adapters.scripts.writing import UNPACKING, Writer, commanded, driven_steps
from touchstone.scenarios.scenario import Scenario

HANDLES = {
    "createCollisionShape": "shape",
    "createCollisionShapeArray": "shape",
    "createMultiBody": "body",
}
"""Functions that return a number for what they make; the last one makes bodies."""
OF_SETTINGS = "setPhysicsEngineParameter"
"""The call that sets what holds for the whole scene."""
NAMES, HIDDEN = {"pybullet": "p"}, ("physicsClientId",)
BASE = -1
OF_LINKS = (
    "def place(number, link):  # of the centre of mass",
    "    if link < 0:",
    "        return p.getBasePositionAndOrientation(number)[0]",
    "    return p.getLinkState(number, link, computeForwardKinematics=1)[0]",
)


@contextmanager
def traced() -> Iterator[Trace]:
    """A trace of what the adapter calls meanwhile."""
    trace = Trace(pybullet, handles=HANDLES, reads=("connect", "disconnect", "stepSimulation"))
    try:
        engine.pybullet = bodies.pybullet = joints.pybullet = trace.module
        yield trace
    finally:
        engine.pybullet = bodies.pybullet = joints.pybullet = pybullet


def parts(scenario: Scenario, settings: Settings) -> Parts:
    """The parts of a scene's script; raises Unsupported if Bullet cannot represent it."""
    with traced() as trace:
        world = engine.BulletEngine().build(scenario, settings)
        built = len(trace.statements)
        steps = driven_steps(trace, world, scenario, settings)
    world.close()
    kept = needed(trace)
    every, moved = set(kept), moving(scenario)
    first = [k for k in kept if trace.statements[k].called == OF_SETTINGS]
    writer = Writer(trace, [k for k in kept if k < built and k not in first], NAMES, HIDDEN)
    commands, lines = commanded(trace, [[k for k in step if k in every] for step in steps], writer)
    colliders = [world._bodies.colliders[k][0] for k in moved]
    links = any(link != BASE for _, link in colliders)
    found = {
        scenario.bodies[k].name: literal((int(number), link) if links else int(number))
        for k, (number, link) in zip(moved, colliders)
    }
    numpy = UNPACKING if commands is not None else ()
    return Parts(
        f"pybullet=={version('pybullet')}",
        [*numpy, "import pybullet as p"],
        ["p.connect(p.DIRECT)", *Writer(trace, first, NAMES, HIDDEN).lines()],
        lambda width: [*writer.lines(width), *(OF_LINKS if links else ())],
        [*lines, "p.stepSimulation()"],
        found,
        "place(*body)" if links else "p.getBasePositionAndOrientation(body)[0]",
        commands=commands,
        of_mass=bool(np.any(world._arm[moved])),
    )


def settings_lines(scenario: Scenario, settings: Settings) -> list[str]:
    """Calls that set the settings: of the engine, then of the bases of bodies."""
    with traced() as trace:
        engine.BulletEngine().build(scenario, settings).close()
    found = [k for k, one in enumerate(trace.statements) if one.called == OF_SETTINGS]
    lines = Writer(trace, found, NAMES, HIDDEN).lines()
    for k, one in enumerate(trace.statements):
        if one.called == "changeDynamics" and "restitution" not in dict(one.arguments):
            lines += Writer(trace, [k], NAMES, HIDDEN).lines()
    return list(dict.fromkeys(lines))
