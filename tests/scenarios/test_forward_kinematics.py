"""Tracked poses against a second opinion: pinocchio's kinematics of the same tree."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapters.oracles.articulated import Articulated
from scenarios.catalogue import catalogue
from scenarios.forward_kinematics import tracked_poses
from scenarios.tracking import sample


@pytest.mark.parametrize("scene", ["ball_snip", "table_slide", "wall_push", "arms_cross"])
def test_links_are_where_pinocchio_puts_them(scene):
    """Positions and orientations of all links agree to rounding at ten times of the scene."""
    scenario = catalogue()[scene]
    tracker = scenario.trackers[0]
    times = np.linspace(0.0, scenario.duration, 10)
    position, orientation = tracked_poses(scenario, tracker, times)
    motion, tree = sample(tracker, times), Articulated(scenario, tracker)
    for f in range(len(times)):
        posture = tree.posture(motion.position[f], motion.orientation[f], motion.angle[f])
        for k, (place, turned) in enumerate(zip(*tree.poses(posture))):
            np.testing.assert_allclose(position[f, k], place, atol=1e-12)
            mine = Rotation.from_quat(orientation[f, k], scalar_first=True).as_matrix()
            np.testing.assert_allclose(mine, turned, atol=1e-12)
