"""Scenes in which a person pushes a box over a bare floor at a constant speed, or stands in a ball's way."""

import numpy as np

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.avatar import HIP_HEIGHT, SHOULDER, avatar_parts
from touchstone.scenarios.avatar.postures import CLEARANCE, LEFT, RIGHT, person_tracker, reach
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, Scenario, Vector
from touchstone.scenarios.solids import ball, block, slab

READY: Vector = (0.40, 0.16, SHOULDER[2] - 0.42)
"""Middle of the left hand, in the torso's frame [m]."""
BOX_HALF: Vector = (0.40, 0.35, 0.55)
BOX_START = 0.55 + BOX_HALF[0]
"""Initial middle of the box [m], the hands are at 0.40 + half a hand."""


def push_scene(speed: float, mass: float, *others: Body, duration: float = 3.0) -> Scenario:
    """A person with both hands ahead glides along x at a speed [m/s], towards a box of a mass [kg]."""
    crate = block("box", "wood", BOX_HALF, mass, (BOX_START, 0.0, BOX_HALF[2]))
    return person_scene(speed, duration, crate, *others)


def ball_scene(mass: float, speed: float) -> Scenario:
    """A ball flies level at the left hand of a person that stands still."""
    ahead, left, up = READY
    start = (ahead + 0.6, left, HIP_HEIGHT + CLEARANCE + up + 9.81 / 2 * (0.5 / speed) ** 2)
    return person_scene(0.0, 2.0, ball("ball", "wood", 0.05, mass, start, (-speed, 0.0, 0.0)))


def person_scene(speed: float, duration: float, *bodies: Body) -> Scenario:
    """A person with both hands ahead glides along x at a speed [m/s] over a floor with other bodies."""
    times = np.arange(round(duration * 60) + 1) / 60
    parts, joints, chains = avatar_parts()
    arms = (reach(side, np.tile(np.multiply(READY, (1, side, 1)), (len(times), 1))) for side in (LEFT, RIGHT))
    places = np.column_stack((speed * times, np.zeros_like(times)))
    tracker = person_tracker(times, places, 0.0, *arms)
    driven = {"joints": joints, "chains": chains, "trackers": (tracker,)}
    return Scenario("pushing", "", (), (slab("floor", "wood"), *parts, *bodies), duration, TABLE_1, **driven)


def play(scene: Scenario, profile: str = "balanced") -> Recording:
    """What the reference does."""
    return record(load("reference"), scene, Settings(profile, ENGINES["reference"].profiles[profile]))


def impulse_on(recording: Recording, scene: Scenario, name: str, since: float) -> np.ndarray:
    """Sum of the impulses that links of the person exert on a body from a time on (3,) [N s]."""
    rows, body = recording.contacts, scene.body_index(name)
    driven = [k for k, group in enumerate(scene.groups()) if group >= 0]
    rows = rows[rows["time"] >= since]
    on_b = np.isin(rows["body_a"], driven) & (rows["body_b"] == body)
    on_a = np.isin(rows["body_b"], driven) & (rows["body_a"] == body)
    return np.asarray(rows["impulse"][on_b].sum(axis=0) - rows["impulse"][on_a].sum(axis=0))


def worst(scene: Scenario, recording: Recording, metric: str) -> float:
    """Largest finite value of a metric."""
    values = METRICS[metric].measure(Context(recording, scene)).values()
    return float(np.nanmax([getattr(value, "value", value) for value in values]))
