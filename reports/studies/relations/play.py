"""Plays a scene on an engine, changed by every relation, and compares the motions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import nan

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings
from touchstone.adapters.knobs import Range
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import settings_of
from touchstone.scenarios.relations.changes import bare
from touchstone.scenarios.relations.table import RELATIONS
from touchstone.scenarios.scenario import Scenario, vector
from touchstone.scenarios.transforms import perturbed

PATIENCE = 600.0
"""Time without an answer after which the process is terminated [s]."""
SPLIT = "split"
"""Relation of a run with one that starts from its state in the middle."""
NAMES = (*RELATIONS, SPLIT)
PERTURBATION = 1e-9
"""Displacement of each body by which the amplification is measured [m]."""
DIRECTIONS = 4
"""Random directions of that displacement [1]: where a collapse depends on the order of impacts, some
directions grow a thousand times as far as others."""
POWERS = {"m": 2, "m/s": 1, "s": 1}
"""Power of the ratio of times with which a setting of this unit grows in Froude's law."""
STILL = 1e-6
"""Distance that a body may move while trackers wait [m]."""
ARM = 0.05
"""Distance of the body-fixed points that are compared from their body's origin [m]: orientations count."""


@dataclass(frozen=True, slots=True)
class Task:
    """A scene on an engine."""

    scenario: Scenario
    engine: str
    settings: Settings


@dataclass(frozen=True, slots=True)
class Compared:
    """Deviation of every relation over the scene's size [1], NaN with a reason where it does not apply.

    `amplification` is the largest distance of motions after perturbations, over these [1]; `size` is
    the extent of the motion [m].
    """

    deviations: dict[str, float]
    reasons: dict[str, str]
    amplification: float = nan
    size: float = nan
    failure: str = ""


def compare(engine: Engine, task: Task) -> Compared:
    """Play the scene and all its changes in this process."""
    plain = bare(task.scenario)
    try:
        first = record(engine, plain, task.settings)
    except AdapterError as error:
        return Compared({}, {}, failure=str(error))
    points = _points(first, plain, np.eye(3), 1.0)
    size = _size(points)
    found: dict[str, float] = {}
    reasons: dict[str, str] = {}
    for name in NAMES:
        try:
            found[name] = _deviation(engine, task, plain, first, name) / size
        except (AdapterError, _NotApplied) as error:
            found[name], reasons[name] = nan, str(error)
    return Compared(found, reasons, _amplification(engine, task, plain, points), size)


class _NotApplied(Exception):
    """The relation does not apply to the scene; the message says why."""


def _deviation(engine: Engine, task: Task, plain: Scenario, first: Recording, name: str) -> float:
    """Largest distance of a point from where the relation says that it is [m]."""
    if name == SPLIT:
        return _split(engine, task, plain, first)
    relation = RELATIONS[name]
    if not relation.applies(plain):
        raise _NotApplied("does not apply to this scene")
    changed = relation.change(plain)
    rescaled = _rescaled(task, relation.times) if relation.times != 1 else task.settings
    other = record(engine, changed, rescaled)
    names = [body.name for body in changed.bodies]
    order = [names.index(body.name) for body in plain.bodies]
    theirs = _points(other, changed, relation.own, relation.scale)[relation.wait :, order]
    if relation.wait and _distance(theirs[:1], _points(first, plain, np.eye(3), 1.0)[:1]) > STILL:
        raise _NotApplied("bodies move while the trackers wait")
    back = (theirs - np.array(relation.offset)) @ relation.matrix / relation.scale
    return _distance(back, _points(first, plain, np.eye(3), 1.0))


def _rescaled(task: Task, times: float) -> Settings:
    """Settings of a run whose times are `times` as long and lengths `times`^2, those in m, m/s and s too."""
    settings, known = task.settings, settings_of(task.engine)
    given = dict(text.split("=", 1) for text in settings.changes)
    for name, setting in known.items():
        text = given.get(name, setting.profiles[known.column(settings.profile)])
        if isinstance(setting, Range) and setting.unit in POWERS and text:
            given[name] = repr(float(text) * times ** POWERS[setting.unit])
    changes = known.changes(settings.profile, [f"{name}={value}" for name, value in given.items()])
    return replace(settings, dt=settings.dt * times, changes=changes)


def _split(engine: Engine, task: Task, plain: Scenario, first: Recording) -> float:
    """Distance of the second half of a run from a run that starts from its middle [m]."""
    if plain.trackers:
        raise _NotApplied("trackers start at time 0")
    half = plain.frame_count // 2
    bodies = tuple(
        replace(
            body,
            position=vector(first.position[half, k]),
            orientation=_unit(first.orientation[half, k]),
            linear_velocity=vector(first.linear_velocity[half, k]),
            angular_velocity=vector(first.angular_velocity[half, k]),
        )
        if body.kind == "simulated"
        else body
        for k, body in enumerate(plain.bodies)
    )
    left = (plain.frame_count - half) / plain.frame_rate
    second = record(engine, replace(plain, bodies=bodies, duration=left), task.settings)
    ones = np.eye(3)
    return _distance(_points(second, plain, ones, 1.0), _points(first, plain, ones, 1.0)[half:])


def _unit(q: Array) -> tuple[float, float, float, float]:
    w, x, y, z = (float(value) for value in q / np.linalg.norm(q))
    return (w, x, y, z)


def _amplification(engine: Engine, task: Task, plain: Scenario, points: Array) -> float:
    """Largest distance of a perturbed motion over the perturbation, at least 1 [1]."""
    found = [1.0]
    for seed in range(DIRECTIONS):
        try:
            other = record(engine, perturbed(plain, PERTURBATION, seed), task.settings)
        except AdapterError:
            return nan
        found.append(_distance(_points(other, plain, np.eye(3), 1.0), points) / PERTURBATION)
    return max(found)


def _points(recording: Recording, scenario: Scenario, own: Array, scale: float) -> Array:
    """World positions of three body-fixed points of every body (f, n, 3, 3) [m]; zero for fixed bodies."""
    frames, count = recording.position.shape[:2]
    turn = Rotation.from_quat(recording.orientation.reshape(-1, 4), scalar_first=True).as_matrix()
    arms = scale * ARM * own  # columns: the images of the axes
    found = recording.position[:, :, None] + (turn @ arms).reshape(frames, count, 3, 3).swapaxes(2, 3)
    return np.asarray(found)


def _distance(one: Array, two: Array) -> float:
    frames = min(len(one), len(two))
    return float(np.linalg.norm(one[:frames] - two[:frames], axis=-1).max())


def _size(points: Array) -> float:
    """Extent of the motion [m]: the largest path of a point, or ARM where nothing moves."""
    return max(ARM, float(np.linalg.norm(points - points[0], axis=-1).max()))
