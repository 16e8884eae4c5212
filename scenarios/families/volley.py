"""`volley`: a person's arm hits thrown balls and slides along a wall: inverse kinematics together with
movable bodies."""

from math import pi

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.avatar import HIP_HEIGHT, SHOULDER, avatar_parts
from touchstone.scenarios.avatar.postures import CLEARANCE, LEFT, RIGHT, hanging, person_tracker, reach
from touchstone.scenarios.avatar.tracking import through
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.gallery import NORTH, gallery_scene
from touchstone.scenarios.scenario import GRAVITY, Body, Expectation, Scenario, Tracker, Vector, vector
from touchstone.scenarios.solids import ball

DURATION, FRAME_RATE = 2.2, 60
PLACE = (5.0, NORTH - 0.58)
"""Position of the person, who faces north [m]."""
BALL_RADIUS, BALL_MASS = 0.05, 0.15
"""Radius and mass of a light wooden ball: 290 kg/m^3 [m, kg]."""
LEVEL = SHOULDER[2] - 0.12
"""Height of the hand's middle above the torso's origin [m]."""
FREE, WALL, LEAN = 0.42, 0.475, 0.50
"""Distance of the hand's middle in front of the torso [m]: fingers clear of the wall, on it, and 3 cm in
it."""
WEST, EAST = 0.0, -0.40
"""Ends of a sweep [m], to the left of the torso."""
HAND = (WEST + EAST) / 2
"""Position at which a sweep is fastest [m], to the left of the torso."""
APART = BALL_RADIUS + 0.015
"""Distance from the hand's middle to that of a ball on its flat side [m]."""
HIGH = 0.03
"""Height above the hand's middle at which a ball is aimed [m]: an arm on servos lags, and the ball falls
meanwhile."""
HITS: tuple[tuple[float, Vector, Vector], ...] = (
    # Time of the hit [s], the ball's middle then in the torso's frame [m], and its velocity [m/s, world].
    (0.42, (0.45, HAND + APART, LEVEL + HIGH), (2.4, 0.0, -1.0)),
    (0.80, (0.49, HAND - APART, LEVEL + HIGH), (-1.4, 0.0, -2.4)),
)
"""A ball from the west for a forehand, and one from the east for a backhand."""
SWEEP = 0.34
"""Duration of a sweep [s]: 1.8 m/s in its middle."""


@scene
def volley() -> Scenario:
    """The right hand sweeps west and east; on the way east its fingers slide along the wall."""
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    return gallery_scene(
        "volley",
        "a person's arm hits two thrown balls while its hand slides along a wall",
        avatar_parts(),
        _tracker(times),
        *_balls(),
        expectations=tuple(
            Expectation("meet", f"ball_{k}", "right_hand", hit - 0.05, hit + 0.05)
            for k, (hit, *_) in enumerate(HITS, start=1)
        ),
    )


def _balls() -> tuple[Body, ...]:
    """Balls on the parabolas that lead to their hits."""
    found = []
    pull = np.array((0.0, 0.0, -GRAVITY))
    for k, (time, (ahead, left, up), velocity) in enumerate(HITS, start=1):
        hit = np.array((PLACE[0] - left, PLACE[1] + ahead, HIP_HEIGHT + CLEARANCE + up))
        start = hit - np.multiply(velocity, time) + pull * time**2 / 2
        thrown = velocity - pull * time
        found.append(ball(f"ball_{k}", "wood", BALL_RADIUS, BALL_MASS, vector(start), vector(thrown)))
    return tuple(found)


def _tracker(times: Array) -> Tracker:
    """Tracker: the right hand sweeps to and fro, fastest at each hit, and leans on the wall; the left one
    hangs."""
    stations: list[tuple[float, Vector]] = [(0.0, (FREE, EAST, LEVEL))]
    for (hit, *_), side in zip(HITS, (WEST, EAST)):
        stations.append((hit - SWEEP / 2, stations[-1][1]))
        stations.append((hit + SWEEP / 2, (WALL, side, LEVEL)))
    stations += [(1.1, (LEAN, EAST, LEVEL)), (1.5, (LEAN, EAST, LEVEL)), (2.0, (0.25, EAST, LEVEL - 0.3))]
    path = through(stations, times)
    places = np.tile(PLACE, (len(times), 1))
    return person_tracker(times, places, pi / 2, reach(LEFT, hanging(LEFT, times)), reach(RIGHT, path))
