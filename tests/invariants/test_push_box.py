"""`push_box`: hands push a box at their own speed, and friction alone stops it once they let go."""

from functools import cache

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.metrics.contacts.forces import friction_coast
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.families.push_box import STOP

PUSHED = (1.1, STOP - 0.1)
"""From where hands meet the box until they withdraw [s]."""


@cache
def without_chains() -> Recording:
    """The scene on the reference with limbs in no chain: posed as tracked, whatever they meet."""
    scene = catalogue()["push_box"].reduced(chains=())
    return record(load("reference"), scene, Settings("balanced", ENGINES["reference"].profiles["balanced"]))


def pushed_way(recording: Recording) -> tuple[float, float]:
    """How far box and walker go along x while the box is pushed [m]."""
    scene = catalogue()["push_box"]
    first, last = (int(np.searchsorted(recording.time, moment - 1e-9)) for moment in PUSHED)
    box = recording.position[[first, last], scene.body_index("box"), 0]
    walker = sample(scene.trackers[0], recording.time[[first, last]]).position[:, 0]
    return float(np.diff(box)[0]), float(np.diff(walker)[0])


@pytest.mark.parametrize(
    ("engine", "profile"),
    [
        ("bullet", "recommended"),
        *(("reference", profile) for profile in ("balanced", "accurate", "paper")),
    ],
)
def test_hands_push_the_box_as_fast_as_they_walk(registry, engine, profile):
    """Move the box as far as the walker goes, within a tenth: servos give way, and it bounces at first."""
    box, walker = pushed_way(registry.played("push_box", engine, profile))
    assert box == pytest.approx(walker, rel=0.1)


def test_limbs_in_no_chain_push_the_box_too():
    """Push the box as far with rigid limbs of the whole person's mass."""
    box, walker = pushed_way(without_chains())
    assert box == pytest.approx(walker, rel=0.1)


@pytest.mark.parametrize(("engine", "profile"), [("bullet", "recommended"), ("reference", "balanced")])
def test_friction_stops_the_box(registry, engine, profile):
    """Let it coast for v^2 / (2 mu g) after the last push, within 5 %."""
    context = Context(registry.played("push_box", engine, profile), catalogue()["push_box"])
    assert abs(friction_coast(context)["box"]) < 0.05


def test_a_box_that_slides_flat_coasts_as_the_closed_form_says():
    """Within 1 % on the reference without chains: the box turns a little, and is let go within a frame."""
    context = Context(without_chains(), catalogue()["push_box"])
    assert abs(friction_coast(context)["box"]) < 0.01
