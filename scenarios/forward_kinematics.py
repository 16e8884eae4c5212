"""Where a tracker's posture puts the links of its driven body, in plain NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenarios.scenario import Scenario, Tracker
from scenarios.tracking import sample


def tracked_poses(
    scenario: Scenario, tracker: Tracker, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Poses of all links when root and hinges are where the tracker has them.

    Args:
        times: (f,) [s].
    Returns:
        Positions (f, l, 3) [m] of the links' origins and orientations (f, l, 4) wxyz, in the world, in the
        order of `scenario.links(tracker)`.
    """
    motion = sample(tracker, times)
    joints = {joint.name: joint for joint in scenario.joints}
    turn = {tracker.root: Rotation.from_quat(motion.orientation, scalar_first=True)}
    place = {tracker.root: motion.position}
    for column, name in enumerate(tracker.joints):
        joint = joints[name]
        hinge = Rotation.from_rotvec(motion.angle[:, [column]] * np.array(joint.axis))
        own = Rotation.from_quat(joint.orientation, scalar_first=True)
        place[joint.child] = place[joint.parent] + turn[joint.parent].apply(joint.position)
        turn[joint.child] = turn[joint.parent] * hinge * own
    names = [scenario.bodies[k].name for k in scenario.links(tracker)]
    return (
        np.stack([place[name] for name in names], axis=1),
        np.stack([turn[name].as_quat(scalar_first=True) for name in names], axis=1),
    )
