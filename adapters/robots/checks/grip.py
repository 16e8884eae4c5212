"""Grippers: two links on one parent whose joints close them on each other, and what their drives hold."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from math import inf
from typing import Any

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.robots.checks.drives import drive_range, followers
from touchstone.adapters.robots.checks.finding import FAULT, NOTE, Finding
from touchstone.adapters.robots.checks.posture import Posture, axial_joints, colliding, name_of, posture
from touchstone.adapters.robots.checks.shapes import distance
from touchstone.adapters.robots.source import Source

STEPS = 20
"""Positions of the fingers between open and closed."""
CLOSING = 0.5
"""Share of its opening to which two links must come for them to be a gripper [1]."""
MOST_JOINTS = 2
"""Joints of a finger, its tip's included: legs have more."""
GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class _Finger:
    """A joint, its body, the geoms below, and its weight [N]."""

    joint: int
    body: int
    geoms: tuple[int, ...]
    weight: float


def grips(source: Source, start: Posture) -> Iterator[Finding]:
    """What each gripper opens to, presses with and holds."""
    model = source.model
    fingers = list(_fingers(model))
    for a, b in combinations(fingers, 2):
        above = [int(model.body_weldid[model.body_parentid[finger.body]]) for finger in (a, b)]
        if above[0] == above[1]:
            yield from _pair(source, start, a, b)


def _fingers(model: Any) -> Iterator[_Finger]:
    """Links with a limited joint, shapes, and few joints below."""
    shapes = colliding(model)
    for joint in axial_joints(model):
        body = int(model.jnt_bodyid[joint])
        below = [other for other in range(model.nbody) if _hangs_on(model, other, body)]
        geoms = tuple(geom for geom in shapes if model.geom_bodyid[geom] in below)
        joints = sum(int(model.body_jntnum[other]) for other in below)
        if geoms and model.jnt_limited[joint] and joints <= MOST_JOINTS and model.body_jntnum[body] == 1:
            yield _Finger(joint, body, geoms, GRAVITY * float(model.body_mass[below].sum()))


def _hangs_on(model: Any, body: int, root: int) -> bool:
    while body > root:
        body = int(model.body_parentid[body])
    return body == root


def _pair(source: Source, start: Posture, a: _Finger, b: _Finger) -> Iterator[Finding]:
    model = source.model
    coupled = followers(source)
    ends = [tuple(model.jnt_range[finger.joint].tolist()) for finger in (a, b)]
    master = next((x for x, y in ((a, b), (b, a)) if _follows(coupled, model, y, x)), None)
    choices = [(one, two) for one, two in product(*ends)]
    both_ends = np.sum(ends, axis=1)
    if master is not None:
        factor = coupled[model.joint((b if master is a else a).joint).name][1]
        own = ends[0] if master is a else ends[1]
        choices = [(end, factor * end) if master is a else (factor * end, end) for end in own]
        both_ends = np.sum(choices, axis=0)
    open_at = max(choices, key=lambda at: _gap(start, a, b, at)[0])
    closed_at = both_ends - np.array(open_at)
    path = [np.array(open_at) + t * np.subtract(closed_at, open_at) for t in np.linspace(0, 1, STEPS + 1)]
    gaps = [_gap(start, a, b, at)[0] for at in path]
    opening, least = gaps[0], min(gaps)
    if opening <= 0 or least > CLOSING * opening:
        return
    half = next(at for at, gap in zip(path, gaps) if gap <= max(least, opening / 2))
    force = _force(start, (a, b), half, (a, b).index(master) if master is not None else -1)
    if force is None:
        return
    subject = f"{name_of(model, 'body', a.body)} and {name_of(model, 'body', b.body)}"
    friction = min(float(model.geom_friction[list(finger.geoms), 0].max()) for finger in (a, b))
    yield _verdict(subject, opening, max(0.0, least), force, friction, min(a.weight, b.weight))


def _verdict(subject: str, opening: float, least: float, force: float, mu: float, weight: float) -> Finding:
    reach = f"open to {opening * 1e3:.3g} mm, close to {least * 1e3:.3g} mm"
    if force == inf:
        text, remedy = f"{reach}; nothing bounds their force", "bound it by effort or forcerange"
        return Finding("grip", subject, text, remedy, NOTE)
    held = 2 * mu * force
    text = f"{reach}, press with {force:.3g} N and hold {held / GRAVITY:.3g} kg at a friction of {mu:.3g}"
    if held < weight:
        return Finding(
            "grip",
            subject,
            f"{text}, less than a finger's own {weight / GRAVITY:.3g} kg",
            "allow the drive more force, or give the fingers friction",
            FAULT,
        )
    return Finding("grip", subject, text, "heavier things slip out", NOTE)


def _follows(coupled: dict[str, tuple[str, float]], model: Any, one: _Finger, other: _Finger) -> bool:
    names = [model.joint(finger.joint).name for finger in (one, other)]
    return coupled.get(names[0], ("", 0.0))[0] == names[1]


def _moved(start: Posture, a: _Finger, b: _Finger, at: Array | tuple[float, ...]) -> Posture:
    model = start.model
    qpos = start.qpos.copy()
    for finger, own in zip((a, b), at):
        qpos[model.jnt_qposadr[finger.joint]] = own
    return posture(model, start.maker, start.name, qpos)


def _gap(start: Posture, a: _Finger, b: _Finger, at: Array | tuple[float, ...]) -> tuple[float, Array, Array]:
    """Distance of two fingers [m], its direction from a to b, and its middle."""
    moved = _moved(start, a, b, at)
    pairs = product(a.geoms, b.geoms)
    found = (distance(moved.piece(one), moved.piece(two)) for one, two in pairs)
    return min(found, key=lambda one: one[0])


def _force(start: Posture, pair: tuple[_Finger, _Finger], at: Array, master: int) -> float | None:
    """Force with which both fingers press on a thing between them [N]; None if they do not oppose.

    Args:
        master: index of the finger that the other one follows, or -1: a follower shares its drive.
    """
    a, b = pair
    moved = _moved(start, a, b, at)
    _, normal, middle = _gap(start, a, b, at)
    levers = [moved.lever(f.joint, f.body, middle, way) for f, way in ((a, normal), (b, -normal))]
    if min(map(abs, levers)) < 1e-9:
        return None
    forces = []
    for finger, lever, position in zip(pair, levers, at):
        low, high = drive_range(start.model, finger.joint, float(position))
        most = high if lever > 0 else -low
        forces.append(max(0.0, most) / abs(lever))
    if master >= 0:
        drive = forces[master] * abs(levers[master])
        return drive / sum(map(abs, levers))
    return min(forces)
