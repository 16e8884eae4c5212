"""The reference with its constants in memory: the same motion, and other values without compilation."""

import importlib
import json
import os
import subprocess
import sys

import pytest

from touchstone.adapters.engines.reference.variable import MECHANISMS, constants, install, vary

PLAY = """
import json
from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference import variable
from touchstone.adapters.recorder import build, frame_seconds
from touchstone.adapters.registry import load
from touchstone.scenarios.catalogue import catalogue

variable.install()
engine, scene, settings = load("reference"), catalogue()["slide"], Settings("balanced", 1 / 60)
def end(values={}, off=()):
    variable.vary(values, off)
    world = build(engine, scene, settings)[0]
    for frame in range(2):
        frame_seconds(world, scene, settings, frame)
    return world._world.bodies["position"].tolist()
first = end()
print(json.dumps({
    "plain": first,
    "varied": end({"core.conventions.TOUCH_DISTANCE": -1.0}),
    "switched": end(off=[one.name for one in variable.MECHANISMS]),
    "again": end(),
}))
"""


def test_constants_are_those_of_their_modules() -> None:
    """Every constant has the value that its module gives it, and a type that varying keeps."""
    assert len(constants()) > 100
    for one in constants():
        value = getattr(importlib.import_module(f"touchstone.reference_impl.{one.module}"), one.name)
        assert (one.value, one.whole) == (value, isinstance(value, int))
        assert not one.whole or one.times(0.25) == int(one.times(0.25)) >= 1


def test_mechanisms_are_kernels() -> None:
    """Every mechanism names a function of the reference, and no two have one name."""
    for one in MECHANISMS:
        assert hasattr(importlib.import_module(f"touchstone.reference_impl.{one.module}"), one.function)
    assert len({one.name for one in MECHANISMS}) == len(MECHANISMS)


@pytest.mark.slow
def test_values_in_memory_play_as_the_reference_does_and_can_be_varied() -> None:
    """With its own values the motion is the reference's to the bit; another value or a switch changes it."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PLAY], capture_output=True, text=True, check=True, env=environment
    )
    found = json.loads(done.stdout)
    plain = PLAY.replace("variable.install()", "").replace("    variable.vary(values, off)\n", "")
    usual = subprocess.run(
        [sys.executable, "-c", plain], capture_output=True, text=True, check=True, env=environment
    )
    assert found["plain"] == found["again"] == json.loads(usual.stdout)["plain"]
    assert found["plain"] not in (found["varied"], found["switched"])


def test_a_reference_that_is_imported_stays() -> None:
    """Constants cannot be moved to memory once kernels are compiled with them."""
    importlib.import_module("touchstone.reference_impl.core.kernel")
    with pytest.raises(RuntimeError, match="imported already"):
        install()
    vary({})
