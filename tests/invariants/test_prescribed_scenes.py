"""Every engine on every scene with a prescribed body: loads move by their closed forms, and do not leave."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.adapters.contract import Unsupported
from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics.contacts.overlap import contact_gap, overlap_max
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tagged

SCENES = [scenario.name for scenario in tagged("prescribed")]
FARTHEST = {"reference": 2e-2, "dart": 1e-3, "bullet": 5e-3, "mujoco": 1e-2}
"""Largest distance of a load from its closed form [m]: steps of first order, and soft friction in MuJoCo."""
DEEPEST = 5e-4
"""Depth to which a load may sink into its support [m]: soft contacts; 1e-6 m in the reference."""


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scene", SCENES)
def test_loads_follow_the_closed_form(registry, engine, scene):
    """The load stays near its truth and on its support."""
    try:
        recording = registry.played(scene, engine)
    except Unsupported as reason:
        pytest.skip(str(reason))
    scenario = catalogue()[scene]
    context = Context(recording, scenario)
    ((load, truth),) = context.truths.items()
    away = np.linalg.norm(context.mass_centers[:, load] - truth.position, axis=1)
    assert away.max() < FARTHEST[engine]
    if engine == "reference":
        return
    tracker = scenario.trackers[0]
    support = recording.position[:, scenario.body_index(tracker.root)]
    assert np.abs(support - sample(tracker, recording.time).position).max() < 1e-9
    assert overlap_max(context)[""] < DEEPEST
    # a load that sticks moves with its support, and its gap counts as that of a body at rest
    if scene in ("platform_lift", "platform_stick", "shaker_along"):
        ((pair, gap),) = contact_gap(context).items()
        assert (pair, abs(gap) < DEEPEST) == ("platform-load", True)
