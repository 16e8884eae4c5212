"""Bands of codes whose paths are known: who agrees, who is off, and where there is no truth."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from touchstone.reports.studies.work_precision.errors import (
    CellRun,
    Code,
    band_of,
    errors_of,
    outside,
    truth_of,
)
from touchstone.scenarios.catalogue import catalogue

WAY = np.linspace(0, 1, 11)[:, None, None] * np.array([1.0, 0.0, 0.0])
"""One body that moves by a metre in ten frames: codes agree within 5 cm."""


def code(aside, change=0.0):
    """A code whose path is off to the side [m], and at twice the step by `change` more."""
    aside = np.array([0.0, aside, 0.0])
    return Code(WAY + aside + [0.0, 0.0, change], WAY + aside)


def banded(**codes):
    return band_of(codes, 10, 1e-3)


def test_the_outlier_is_outside_of_the_band_of_the_others():
    """Three of four agree; the reference has no say of its own."""
    band = banded(reference=code(0.1), dart=code(0.0), bullet=code(0.03), mujoco=code(0.01))
    assert band.codes == ("dart", "bullet", "mujoco")
    assert band.width == pytest.approx(0.03)
    assert band.outliers == pytest.approx({"reference": 0.07})
    assert band.words == "dart, bullet, mujoco agree to 30 mm; reference is 70 mm off"
    assert outside(WAY + [0.0, 0.02, 0.0], band.low, band.high, 10) == 0
    assert outside(WAY + [0.0, -0.3, 0.4], band.low, band.high, 10) == pytest.approx(0.5)


def test_a_code_that_has_not_converged_does_not_count():
    """Its place is no evidence, wherever it is."""
    band = banded(dart=code(0.0), bullet=code(0.0, change=0.06), mujoco=code(0.04))
    assert band.codes == ("dart", "mujoco")
    assert "bullet changes by 60 mm with half the step" in band.words


@pytest.mark.parametrize("places", [(0.0, 0.01, 0.3, 0.31), (0.0, 0.1, 0.2, 0.3)])
def test_codes_of_different_models_have_no_band(places):
    """Two against two, or each for itself: nothing says who is right."""
    band = banded(**{f"code{k}": code(place) for k, place in enumerate(places)})
    assert band.codes == ()
    assert band.words.startswith("codes converge to different models, more than 50 mm apart")


def test_one_code_is_no_band():
    """A lone code is not its own truth."""
    assert banded(reference=code(0.0)).codes == ()
    assert "fewer than two codes converge" in banded(reference=code(0.0)).words


def test_of_equal_groups_that_share_a_code_the_narrowest_counts():
    """A chain: its ends do not agree."""
    band = banded(a=code(0.0), b=code(0.04), c=code(0.07))
    assert band.codes == ("b", "c")


def run_at(path, events):
    rows = [("events.meet", name, time, "") for name, time in events.items()]
    return CellRun(
        pd.DataFrame(rows, columns=["metric", "subject", "value", "verdict"]), path, np.ones(len(path))
    )


def test_errors_are_distances_to_the_band():
    """Of positions and of times; an event that some code lacks is no truth; without a band there are none."""
    scene = catalogue()["ball_snip"]
    path = np.linspace(0, 1, scene.frame_count + 1)[:, None, None] * np.array([1.0, 0.0, 0.0])
    one = run_at(path, {"a": 1.0, "b": 2.0})
    other = run_at(path + [0.0, 0.02, 0.0], {"a": 1.1})
    truth = truth_of(scene, {"dart": (one, one), "mujoco": (other, other)}, None, ())
    late = errors_of(run_at(path + [0.0, 0.05, 0.0], {"a": 1.25}), truth)
    assert late == pytest.approx({"position": 0.03, "events": 0.15})
    assert errors_of(run_at(path, {}), truth) == {"position": 0.0, "events": np.inf}
    alone = truth_of(scene, {"dart": (one, one)}, None, ())
    assert errors_of(one, alone) == {}
