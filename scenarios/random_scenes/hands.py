"""Driven hand or box that presses loose bodies down or pushes them sideways."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import Body, Joint, Quaternion, Tracker
from touchstone.scenarios.solids import block

HAND_MATERIAL = "human"
HAND_REACH = 0.2
"""Radius of a ball about the palm's origin that contains the hand in any posture [m]."""
FINGER_CLEARANCE = 0.06
"""Height of the palm at which relaxed fingers clear what is below by a centimetre [m]."""
RELAXED = (0.10, 0.15, 0.10)
"""Angles of a finger's three hinges at the start [rad]."""
FLEXED = (0.9, 0.6, 0.4)
"""Maximum additional flexion of a finger's hinges [rad]."""
PALM_AHEAD = 0.06
"""Distance of the palm's origin behind the fingers' middle [m]."""
BOX_HALF = (0.06, 0.06, 0.02)
"""Half extents of the driven box [m]."""
BOX_MASS = 0.4
"""Mass of the driven box, equal to the hand's [kg]: critically damped."""


@dataclass(frozen=True, slots=True)
class Pressing:
    """Driven body and its path: from `start` (3,) to `end` (3,) [m] within `times` (begin, length) [s]."""

    summary: str
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    start: Array
    end: Array
    times: tuple[float, float]
    orientation: Quaternion
    flexion: Array  # (joints,) [rad] rotation of the hinges along the path
    heading: Array  # (3,) unit vector of the path
    sideways: bool

    def tracker(self, duration: float) -> Tracker:
        """Tracker with sixty keyframes per second over `duration` [s]."""
        times = np.arange(round(duration * 60) + 1) / 60
        blend = ease(times, *self.times)
        angles = np.tile(RELAXED, len(self.joints) // 3) + np.outer(blend, self.flexion)
        path = self.start + np.outer(blend, self.end - self.start)
        names = [joint.name for joint in self.joints]
        return keyframed(self.bodies[0].name, times, path, self.orientation, names, angles)


def pressing(rng: Generator, reach: float, top: float) -> Pressing:
    """A hand or a box that moves towards loose bodies within `reach` [m] of the z axis and below `top` [m].

    It starts apart from them: above them, or beside them at the distance of its own reach.
    """
    hinged, sideways = bool(rng.random() < 0.75), bool(rng.random() < 0.4)
    presser = block("presser", HAND_MATERIAL, BOX_HALF, BOX_MASS, kind="driven")
    bodies, joints = hand_parts() if hinged else ((presser,), ())
    own = HAND_REACH if hinged else float(np.linalg.norm(BOX_HALF))
    yaw = float(rng.uniform(-pi, pi))
    turn = Rotation.from_rotvec([0.0, 0.0, yaw])
    heading = turn.apply([1.0, 0.0, 0.0])
    if sideways:
        height = float(rng.uniform(0.03, 0.08)) + (0.02 if hinged else 0.0)
        start = -heading * (reach + own + 0.01) + [0.0, 0.0, height]
        end = start + heading * float(rng.uniform(0.1, 0.35))
    else:
        over = FINGER_CLEARANCE if hinged else BOX_HALF[2] + 0.01
        start = -heading * (PALM_AHEAD if hinged else 0.0) + [0.0, 0.0, top + over]
        end = start - [0.0, 0.0, float(rng.uniform(0.02, 0.1))] + heading * float(rng.choice([0.0, 0.1]))
    flexion = rng.uniform(0.0, 1.0) * np.tile(FLEXED, len(joints) // 3)
    what = "a hand" if hinged else "a driven box"
    return Pressing(
        summary=f"{what} {'pushes' if sideways else 'presses'}",
        bodies=bodies,
        joints=joints,
        start=start,
        end=end,
        times=(0.05, float(rng.uniform(0.2, 0.6))),
        orientation=quaternion(turn),
        flexion=flexion if rng.random() < 0.5 else np.zeros(len(joints)),
        heading=heading,
        sideways=sideways,
    )
