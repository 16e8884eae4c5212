"""Motion of one body over a floor, both turned as a whole."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import GRAVITY, Body, PairCoefficients, Scenario, vector


def end_of(floor: Body, body: Body, turn: Rotation, duration: float) -> np.ndarray:
    """Positions (frames, 3) of a body over a floor, all turned, with gravity; turned back [m]."""

    def turned(one: Body) -> Body:
        own = Rotation.from_quat(one.orientation, scalar_first=True)
        return replace(
            one,
            position=vector(turn.apply(one.position)),
            orientation=quaternion(turn * own),
            linear_velocity=vector(turn.apply(one.linear_velocity)),
            angular_velocity=vector(turn.apply(one.angular_velocity)),
        )

    pairs, down = (PairCoefficients("wood", "wood", 0.3, 0.5),), vector(turn.apply((0.0, 0.0, -GRAVITY)))
    scene = Scenario("test", "a test", (), (turned(floor), turned(body)), duration, pairs, gravity=down)
    recording = record(load("reference"), scene, Settings("balanced", 1 / 60))
    return turn.inv().apply(recording.position[:, 1])
