"""Transformed scenes: mirrored, translated, with permuted bodies, or perturbed.

An engine without a preferred place, side or order gives the same motion, transformed in the same way.

Conventions: the mirror is x -> -x, M = diag(-1, 1, 1). Vectors become M v, rotations M R M, axes and angular
velocities (pseudovectors) -M w. Hinge angles do not change.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.body_joints import mechanisms
from touchstone.scenarios.scenario import (
    TRACKED,
    BodyJoint,
    Matrix,
    Quaternion,
    Scenario,
    Vector,
    vector,
)


def shifted(scenario: Scenario, shift: Array) -> Scenario:
    """Scene with its simulated bodies, or the paths of its trackers if it has none, moved by (n, 3) [m];
    without truths and expectations, which hold for the original only. Bodies that joints connect move as one
    of them does, with their joints."""
    moves = iter(shift)
    fields: dict[str, object] = {}
    simulated = [body.name for body in scenario.bodies if body.kind == "simulated"]
    if simulated:
        move = dict(zip(simulated, shift))
        for joints in mechanisms(scenario):
            names = {name for joint in joints for name in (joint.parent, joint.child)} & move.keys()
            move |= dict.fromkeys(names, move[min(names)])
        fields["bodies"] = tuple(
            replace(body, position=vector(body.position + move[body.name])) if body.name in move else body
            for body in scenario.bodies
        )
        fields["body_joints"] = tuple(
            replace(joint, anchor=vector(joint.anchor + move[joint.child])) for joint in scenario.body_joints
        )
    else:
        fields["trackers"] = tuple(
            replace(tracker, positions=tuple(map(vector, np.array(tracker.positions) + next(moves))))
            for tracker in scenario.trackers
        )
    return replace(scenario, truths=(), forces=(), published=(), expectations=(), **fields)  # type: ignore[arg-type]


def perturbed(scenario: Scenario, size: float, seed: int) -> Scenario:
    """Scene with each simulated body, or each tracker if it has none, moved by `size` [m] in a seeded random
    direction. Touching bodies may then overlap by up to twice that."""
    rng = np.random.default_rng(seed)
    count = sum(body.kind == "simulated" for body in scenario.bodies) or len(scenario.trackers)
    moves = rng.normal(size=(count, 3))
    return shifted(scenario, size * moves / np.linalg.norm(moves, axis=1, keepdims=True))


def permuted(scenario: Scenario, order: Sequence[int]) -> Scenario:
    """Scene with its bodies in another order: body k of the result is body `order[k]` of the original.

    Raises:
        ValueError: `order` does not name every body once.
    """
    if sorted(order) != list(range(len(scenario.bodies))):
        raise ValueError(f"order {list(order)}: expected each of 0 to {len(scenario.bodies) - 1} once")
    return replace(scenario, bodies=tuple(scenario.bodies[k] for k in order))


def translated(scenario: Scenario, offset: Vector) -> Scenario:
    """Scene with bodies, trackers and truths moved by `offset` [m]."""

    def there(place: Vector) -> Vector:
        return vector(np.add(place, offset))

    bodies = tuple(
        b if b.kind in TRACKED else replace(b, position=there(b.position)) for b in scenario.bodies
    )
    changes: Changes = {
        **dict.fromkeys(("position", "anchor"), there),
        "positions": each(there),
        **dict.fromkeys(("bodies", "joints"), tuple),
    }
    found: Scenario = mapped(scenario, changes, bodies=bodies)
    return found


def mirrored(scenario: Scenario) -> Scenario:
    """Mirror image of a scene, x -> -x, with its truths.

    Raises:
        ValueError: a chain has reach cones, whose swing and twist cannot be mirrored.
    """
    if any(chain.cones for chain in scenario.chains):
        raise ValueError(f"scenario {scenario.name!r}: reach cones have no mirror image here")
    return replace(mapped(scenario, MIRRORED), published=())


def mirror(v: Vector) -> Vector:
    """Mirror image of a position, a velocity or a force."""
    return (-v[0], v[1], v[2])


def mirror_axis(w: Vector) -> Vector:
    """Mirror image of a rotation axis, an angular velocity or a torque."""
    return (w[0], -w[1], -w[2])


def mirror_turn(q: Quaternion) -> Quaternion:
    """Mirror image of an orientation, wxyz."""
    return (q[0], q[1], -q[2], -q[3])


def _mirror_matrix(m: Matrix) -> Matrix:
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    return ((xx, -xy, -xz), (-yx, yy, yz), (-zx, zy, zz))


def _mirror_joint(joint: BodyJoint) -> BodyJoint:
    turn = mirror if joint.type == "slider" else mirror_axis
    return replace(joint, anchor=mirror(joint.anchor), axis=turn(joint.axis))


def each(change: Callable[[Any], Any]) -> Callable[[Sequence[Any]], tuple[Any, ...]]:
    """The change of each element of a field."""
    return lambda values: tuple(map(change, values))


Changes = Mapping[str, Callable[[Any], Any]]
"""Field of any part of a scene -> what its value becomes."""
MIRRORED: Changes = {
    **dict.fromkeys(("position", "center_of_mass", "gravity", "acceleration"), mirror),
    **dict.fromkeys(("velocity", "linear_velocity", "surface_velocity"), mirror),
    **dict.fromkeys(("axis", "angular_velocity", "angular_acceleration"), mirror_axis),
    "surface_angular_velocity": mirror_axis,
    "orientation": mirror_turn,
    "inertia": _mirror_matrix,
    "positions": each(mirror),
    "orientations": each(mirror_turn),
    "vertices": each(mirror),
    "body_joints": each(_mirror_joint),
}


def mapped(part: Any, changes: Changes, **others: Any) -> Any:
    """A part of a scene, or a scene, with its fields and those of its parts changed, and with `others`."""
    found = {}
    for field in fields(part):
        value = getattr(part, field.name)
        if field.name in changes:
            found[field.name] = changes[field.name](value)
        elif is_dataclass(value):
            found[field.name] = mapped(value, changes)
        elif isinstance(value, tuple) and value and is_dataclass(value[0]):
            found[field.name] = tuple(mapped(one, changes) for one in value)
    return replace(part, **found | others)
