"""The study `knobs`: ratios of errors in words, and the cheapest setting within a tolerance."""

from math import inf

import pandas as pd
import pytest

from touchstone.adapters.registry import installed
from touchstone.reports.studies.knobs import KEPT, best_of, cells_of, effects_of, errors_by_label

ROWS = [
    # label, scene, quantity, value
    ("recommended", "slide", "error.position", 2e-2),
    ("recommended", "slide", "error.friction", 1e-2),
    ("recommended", "slide", "time.frame", 1e-4),
    ("recommended, cone=a", "slide", "error.position", 5e-3),
    ("recommended, cone=a", "slide", "error.friction", 1.1e-2),
    ("recommended, cone=a", "slide", "time.frame", 3e-4),
    ("recommended, cone=b", "slide", "error.position", inf),
    ("accurate", "slide", "error.position", 8e-3),
    ("accurate", "slide", "error.friction", 1e-3),
    ("accurate", "slide", "time.frame", 2e-4),
]


def test_effects_and_the_best():
    """A change says by what it multiplies an error; the cheapest within 10 mm is not the most accurate."""
    frame = pd.DataFrame([("mujoco", label, *rest) for label, *rest in ROWS], columns=list(KEPT))
    errors = errors_by_label(frame, "mujoco")
    assert errors_by_label(frame, "bullet") == {}
    assert {text: said["sliding"] for text, said in effects_of(errors).items()} == {
        "cone=a": "position x 0.25",
        "cone=b": "position fails",
    }
    found = {(kind, tolerance): label for kind, tolerance, label, *_ in best_of(errors)}
    assert found["sliding", 1e-2] == "accurate"
    assert found["sliding", 1e-3] == found["rest", 1e-2] == ""


@pytest.mark.parametrize("engine", ["mujoco", "bullet", "dart"])
def test_every_setting_that_does_something_is_changed(engine):
    """Each profile, and each setting of the first one alone, in every scene."""
    if not installed(engine):
        pytest.skip(f"{engine} is not installed")
    cells = cells_of(engine)
    assert len(set(cells)) == len(cells)
    assert {len(cell.changes) for cell in cells} == {0, 1}
