"""Exceptions and named values go from one process to another, and are copied, as they are."""

import copy
import importlib
import pickle
import re
from enum import Enum
from pathlib import Path

import pytest

from touchstone.adapters.recording import RunEnded
from touchstone.reports.assertions.outcome import InvariantError
from touchstone.scenarios.files.named import NoScene
from touchstone.scenarios.scenario import ScenarioError
from touchstone.scenarios.truths.pair_names import PairName

ROOT = Path(__file__).resolve().parents[1]
LAYERS = ("scenarios", "adapters", "reports")
DERIVED = re.compile(r"^class \w+\(.*(Error|Exception|str)\):", re.MULTILINE)
VALUES = {
    PairName: [PairName("a-b", "c #1"), PairName("", "b", 12)],
    ScenarioError: [ScenarioError("fall", [("bodies[0].mass", "it is 0")])],
    NoScene: [NoScene("fal")],
    RunEnded: [RunEnded("it fell through", "its recording")],
    InvariantError: [InvariantError("it overlaps")],
}
"""Values of classes that are made otherwise than the class they derive from."""


def _classes():
    """Classes of exceptions and texts with a constructor of their own."""
    for path in sorted(path for layer in LAYERS for path in (ROOT / layer).rglob("*.py")):
        words = path.relative_to(ROOT).with_suffix("").parts
        if DERIVED.search(path.read_text("utf-8")):
            module = importlib.import_module(".".join(("touchstone", *words)).removesuffix(".__init__"))
            for value in vars(module).values():
                if isinstance(value, type) and value.__module__ == module.__name__:
                    own = {"__init__", "__new__"} & vars(value).keys()
                    if own and issubclass(value, (BaseException, str)) and not issubclass(value, Enum):
                        yield value


@pytest.mark.parametrize("value", [value for values in VALUES.values() for value in values], ids=repr)
def test_a_copy_is_equal(value):
    """Pickling and copying keep type, text and attributes."""
    for same in (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)):
        assert type(same) is type(value)
        assert (str(same), vars(same)) == (str(value), vars(value))


def test_no_class_is_left_out():
    """Every class with a constructor of its own is among those that are copied."""
    assert set(_classes()) == set(VALUES)
