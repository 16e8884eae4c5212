"""How far a box coasts that a driven body lets go, on recordings with a known answer."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reports.metrics.context import NotMeasured
from touchstone.scenarios.scenario import Body, Piece, Scenario, Sphere
from touchstone.scenarios.solids import sphere_inertia

MU, G, SPEED, RELEASE = 0.3, 9.81, 1.2, 10
"""The box is pushed until the end of frame RELEASE."""


@pytest.fixture
def pushed(lab: SimpleNamespace) -> Scenario:
    """A floor, a box on it and a driven ball beside it."""
    tip = (Piece("tip", Sphere(0.01)),)
    hand = Body("hand", "driven", "wood", tip, mass=1.0, inertia=sphere_inertia(1.0, 0.01))
    box = lab.block("box", (0.1, 0.1, 0.1), (0.0, 0.0, 0.1))
    return lab.scene(lab.ground(), box, hand, mu=MU, trackers=(lab.still("hand", (-0.5, 0.0, 0.1)),))


@pytest.fixture
def coasting(pushed: Scenario, recordings, known):
    """The box slides at SPEED until it is let go, and then with `mu` to rest."""

    def build(mu: float = MU, turned: float = 0.0, driven: bool = True):
        t = np.arange(pushed.frame_count + 1) / pushed.frame_rate
        since = np.clip(t - RELEASE / pushed.frame_rate, 0.0, SPEED / (mu * G))
        x = SPEED * np.minimum(t, RELEASE / pushed.frame_rate) + SPEED * since - mu * G * since**2 / 2
        zero = np.zeros_like(t)
        columns = known.path(
            pushed,
            1,
            np.column_stack((x, zero, zero + 0.1)),
            np.column_stack((SPEED - mu * G * since, zero, zero)),
        )
        rows = [{"time": k / 60, "body_a": 0, "body_b": 1, "normal": (0, 0, 1)} for k in range(60)]
        push = {"body_a": 1, "body_b": 2, "normal": (-1, 0, 0), "impulse": (-1, 0, 0)}
        rows += [{"time": (RELEASE - 0.5) / 60, **push}] if driven else []
        recording = recordings.recording(pushed, contacts=recordings.contacts(*rows), **columns)
        orientation = recording.orientation.copy()
        half = turned / 2 * np.linspace(0, 1, len(t))
        orientation[:, 1, 0], orientation[:, 1, 3] = np.cos(half), np.sin(half)
        return replace(recording, orientation=orientation)

    return build


def test_a_box_that_obeys_coulomb_coasts_as_it_should(pushed, coasting, known):
    """Find no error where the way is v^2 / (2 mu g), and mu's own error where it is not."""
    assert known.value("friction.coast", coasting(), pushed)["box"] == pytest.approx(
        0.0, abs=1e-9
    )  # rounding
    found = known.value("friction.coast", coasting(mu=0.9 * MU), pushed)["box"]
    assert found == pytest.approx(1 / 0.9 - 1, rel=1e-9)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [({"driven": False}, "no box that a driven body pushed"), ({"turned": 0.5}, "turns or topples")],
)
def test_what_does_not_coast_is_not_measured(pushed, coasting, known, fields, reason):
    """Tell why there is no number: nothing pushed the box, or it turned."""
    with pytest.raises(NotMeasured, match=reason):
        known.value("friction.coast", coasting(**fields), pushed)
