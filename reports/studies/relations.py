"""The study `relations`: truths that need no answer, on every scene and engine.

Each scene is changed in a way whose effect on the motion is known (`scenarios.relations`). The rows hold the
deviation over the scene's size. It is judged, for the reference, over the scene's amplification: what an
engine makes of a perturbation of 1e-9 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import nan
from pathlib import Path

import altair as alt
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings
from touchstone.adapters.knobs import Range
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import settings_of
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.metrics.motion.joints import joint_motion
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.runner.tasks import Task, played, tasks_of
from touchstone.reports.studies.study import Column, failures, kept, missing_rows
from touchstone.reports.views.pictures import log_axis, rule, save, strips
from touchstone.reports.views.render import Part
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.relations.changes import bare
from touchstone.scenarios.relations.table import RELATIONS
from touchstone.scenarios.scenario import UNBOUNDED, BodyJoint, Scenario, ScenarioError, vector
from touchstone.scenarios.transforms import perturbed

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
AXES = np.eye(3)
ARM = 0.05
"""Distance of the body-fixed points that are compared from their body's origin [m]: orientations count."""


@dataclass(frozen=True, slots=True)
class Deviations:
    """Deviation of every relation over the scene's size [1], NaN with a reason where it does not apply.

    `amplification` is the largest distance of motions after perturbations, over these [1]; `size` is
    the extent of the motion [m].
    """

    deviations: dict[str, float]
    reasons: dict[str, str]
    amplification: float = nan
    size: float = nan


def compare(engine: Engine, task: Task) -> Deviations:
    """Play the scene and all its changes in this process."""
    plain = bare(task.scenario)
    first = record(engine, plain, task.settings)
    points = _points(first, plain)
    size = max(ARM, float(np.linalg.norm(points - points[0], axis=-1).max()))  # the largest path of a point
    found: dict[str, float] = {}
    reasons: dict[str, str] = {}
    for name in NAMES:
        try:
            found[name] = _deviation(engine, task, plain, first, name) / size
        except (AdapterError, ScenarioError, _NotApplied) as error:
            found[name], reasons[name] = nan, str(error)
    return Deviations(found, reasons, _amplification(engine, task, plain, points), size)


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
    ours = _points(first, plain)
    if relation.wait and _distance(theirs[:1], ours[:1]) > STILL:
        raise _NotApplied("bodies move while the trackers wait")
    way = np.outer(other.time, relation.speed) + np.outer(other.time**2 / 2, relation.push) + relation.offset
    back = (theirs - way[: len(theirs), None, None]) @ relation.matrix / relation.scale
    return _distance(back, ours)


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
    joints = tuple(_restarted(first, plain, joint, half) for joint in plain.body_joints)
    left = (plain.frame_count - half) / plain.frame_rate
    rest = replace(plain, bodies=bodies, body_joints=joints, duration=left)
    second = record(engine, rest, task.settings)
    return _distance(_points(second, plain), _points(first, plain)[half:])


def _restarted(first: Recording, plain: Scenario, joint: BodyJoint, frame: int) -> BodyJoint:
    """A joint whose position counts from where it is in a displayed frame."""
    motion = joint_motion(first, plain, joint)
    q = float(motion.position[frame])
    axis = motion.axis[frame] / np.linalg.norm(motion.axis[frame])
    moved = replace(joint, anchor=vector(motion.anchor[frame]), axis=vector(axis))
    if not q:
        return moved
    return replace(
        moved,
        # rounding may leave the joint beyond a limit
        lower=min(0.0, joint.lower - q) if joint.lower > -UNBOUNDED else joint.lower,
        upper=max(0.0, joint.upper - q) if joint.upper < UNBOUNDED else joint.upper,
        target=joint.target - q if joint.stiffness else joint.target,
    )


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
        found.append(_distance(_points(other, plain), points) / PERTURBATION)
    return max(found)


def _points(recording: Recording, scenario: Scenario, own: Array = AXES, scale: float = 1.0) -> Array:
    """World positions of three body-fixed points of every body (f, n, 3, 3) [m]; zero for fixed bodies."""
    frames, count = recording.position.shape[:2]
    turn = Rotation.from_quat(recording.orientation.reshape(-1, 4), scalar_first=True).as_matrix()
    arms = scale * ARM * own  # columns: the images of the axes
    found = recording.position[:, :, None] + (turn @ arms).reshape(frames, count, 3, 3).swapaxes(2, 3)
    return np.asarray(found)


def _distance(one: Array, two: Array) -> float:
    frames = min(len(one), len(two))
    return float(np.linalg.norm(one[:frames] - two[:frames], axis=-1).max())


STUDY = "relations"
AMPLIFICATION = f"{STUDY}.amplification"
METRICS = (*(f"{STUDY}.{name}" for name in NAMES), AMPLIFICATION)
HELD = 1e-9
"""Largest deviation of a relation that holds, over the scene's size and its amplification [1]: rounding."""
MOST_BODIES = 16
"""Largest number of bodies of a default scene: eleven runs of a larger one take DART minutes."""
QUICK = ("fall", "slide", "stack", "bounce_e05", "collide_oblique", "roll", "double_pendulum")


def default_scenes() -> list[Scenario]:
    """The probes and mechanisms of up to MOST_BODIES bodies."""
    scenes = (*tagged("probe"), *tagged("joints"))
    return [scene for scene in scenes if len(scene.bodies) <= MOST_BODIES]


def run(columns: Sequence[Column], scenes: Sequence[Scenario], out: Path, progress: Progress) -> pd.DataFrame:
    """Play all tasks; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        asked = tasks_of(scenes, columns)
        found = played(compare, asked, folder / "output", progress)
        rows = missing_rows(STUDY, columns)
        for task, one in zip(asked, found):
            rows += rows_of_task(task, one)
        facts = {"study": STUDY, "scenes": [scene.name for scene in scenes]}
        return kept(rows, folder, facts, {"relations.png": deviations_picture})


def rows_of_task(task: Task, found: Deviations | Ended) -> list[Row]:
    """Rows of a scene on an engine: one per relation, and the amplification."""
    key = (STUDY, task.scenario.name, task.engine, task.settings.label, task.settings.dt)
    if isinstance(found, Ended):
        return [Row(*key, "run", verdict="error", reason=found.reason)]
    rows = [Row(*key, AMPLIFICATION, found.amplification, "1")]
    for name in NAMES:
        value, verdict, limit = found.deviations[name], "", float("nan")
        if name in found.reasons:
            verdict = "skipped"
        elif task.engine == "reference":
            limit = HELD * found.amplification
            verdict = "pass" if value <= limit else "fail"
        reason = found.reasons.get(name, "")
        rows.append(Row(*key, f"{STUDY}.{name}", value, "1", limit=limit, verdict=verdict, reason=reason))
    return rows


NOTES = (
    "scenes in which a relation holds to 1e-9 of their size times their amplification, of those to which it",
    "applies; then the median and the largest deviation over size and amplification [1].",
)
LISTED = 12


def report(frame: pd.DataFrame) -> list[Part]:
    """Per relation and column in how many scenes it holds and by how much it does not."""
    rows, lines = scaled(frame), []
    columns = list(dict.fromkeys(zip(rows.engine, rows.profile)))
    for name in NAMES:
        mine = rows[rows.relation == name].set_index(["engine", "profile"]).scaled
        lines.append([name, *(_cell(mine[mine.index == column]) for column in columns)])
    heads = ["relation", *map(" ".join, columns)]
    failed = frame[frame.verdict.isin(["fail", "error"])][:LISTED]
    meanings = [f"{one.name}: {one.summary}" for one in RELATIONS.values()]
    notes = (*NOTES, *meanings, f"{SPLIT}: a run in two parts, the second from the state in the middle")
    return [Part("relations: changed scenes", heads, lines, notes), failures(failed)]


def _cell(part: pd.Series) -> str:
    if part.empty:
        return ""
    return f"{int((part <= HELD).sum())} of {len(part)}  {part.median():.0e} {part.max():.0e}"


FLOOR, CEILING = 1e-18, 10.0
"""Smaller and larger deviations are drawn at these values [1]."""


def deviations_picture(frame: pd.DataFrame, path: Path) -> None:
    """Draw one row of markers per relation that applies to a scene, and engine."""
    rows = scaled(frame).rename(columns={"relation": "row"})
    names = [name for name in NAMES if name in set(rows["row"])]
    text = "deviation over the scene's size and its amplification [1]; dotted: limit; left edge: 0"
    drawn = strips(names, rows, log_axis(alt.X, "scaled", text, (FLOOR / 3, CEILING))) + rule(x=HELD)
    save(drawn, path, "Changed scenes: how far motions are from where they must be")


def scaled(frame: pd.DataFrame) -> pd.DataFrame:
    """Rows of relations that apply, with their name and the deviation over the amplification."""
    key = ["scenario", "engine", "profile"]
    amplified = frame[frame.metric == "relations.amplification"].set_index(key).value
    rows = frame[frame.metric.isin([f"relations.{name}" for name in NAMES]) & frame.value.notna()].copy()
    rows["relation"] = rows.metric.str.removeprefix("relations.")
    factors = [float(amplified.get(tuple(one), 1.0)) for one in rows[key].to_numpy().tolist()]
    rows["scaled"] = rows.value / np.maximum(1.0, np.nan_to_num(factors, nan=1.0))
    return rows
