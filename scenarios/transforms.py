"""Transformed scenes: mirrored, translated, with permuted bodies, or perturbed.

An engine without a preferred place, side or order gives the same motion, transformed in the same way.

Conventions: the mirror is x -> -x, M = diag(-1, 1, 1). Vectors become M v, rotations M R M, axes and angular
velocities (pseudovectors) -M w. Hinge angles do not change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from touchstone.scenarios.body_joints import mechanisms
from touchstone.scenarios.scenario import (
    TRACKED,
    Arc,
    Body,
    BodyJoint,
    Hull,
    Joint,
    Matrix,
    Piece,
    Quaternion,
    Scenario,
    Tracker,
    Truth,
    Vector,
    vector,
)

Array = NDArray[np.float64]


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

    return replace(
        scenario,
        bodies=tuple(
            b if b.kind in TRACKED else replace(b, position=there(b.position)) for b in scenario.bodies
        ),
        body_joints=tuple(replace(j, anchor=there(j.anchor)) for j in scenario.body_joints),
        trackers=tuple(replace(t, positions=tuple(map(there, t.positions))) for t in scenario.trackers),
        truths=tuple(
            replace(t, arcs=tuple(replace(arc, position=there(arc.position)) for arc in t.arcs))
            for t in scenario.truths
        ),
    )


def mirrored(scenario: Scenario) -> Scenario:
    """Mirror image of a scene, x -> -x, with its truths.

    Raises:
        ValueError: a chain has reach cones, whose swing and twist cannot be mirrored.
    """
    if any(chain.cones for chain in scenario.chains):
        raise ValueError(f"scenario {scenario.name!r}: reach cones have no mirror image here")
    return replace(
        scenario,
        bodies=tuple(map(_mirrored_body, scenario.bodies)),
        joints=tuple(map(_mirrored_joint, scenario.joints)),
        body_joints=tuple(map(_mirrored_body_joint, scenario.body_joints)),
        trackers=tuple(map(_mirrored_tracker, scenario.trackers)),
        gravity=mirror(scenario.gravity),
        truths=tuple(_mirrored_truth(truth) for truth in scenario.truths),
        published=(),
    )


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


def _mirrored_piece(piece: Piece) -> Piece:
    shape = piece.shape
    if isinstance(shape, Hull):
        # All other shapes are their own mirror images.
        shape = Hull(tuple(map(mirror, shape.vertices)))
    return replace(
        piece,
        shape=shape,
        position=mirror(piece.position),
        orientation=mirror_turn(piece.orientation),
        surface_velocity=mirror(piece.surface_velocity),
        surface_angular_velocity=mirror_axis(piece.surface_angular_velocity),
    )


def _mirrored_body(body: Body) -> Body:
    return replace(
        body,
        pieces=tuple(map(_mirrored_piece, body.pieces)),
        center_of_mass=mirror(body.center_of_mass),
        inertia=_mirror_matrix(body.inertia),
        position=mirror(body.position),
        orientation=mirror_turn(body.orientation),
        linear_velocity=mirror(body.linear_velocity),
        angular_velocity=mirror_axis(body.angular_velocity),
    )


def _mirrored_joint(joint: Joint) -> Joint:
    return replace(
        joint,
        position=mirror(joint.position),
        axis=mirror_axis(joint.axis),
        orientation=mirror_turn(joint.orientation),
    )


def _mirrored_body_joint(joint: BodyJoint) -> BodyJoint:
    turn = mirror if joint.type == "slider" else mirror_axis
    return replace(joint, anchor=mirror(joint.anchor), axis=turn(joint.axis))


def _mirrored_tracker(tracker: Tracker) -> Tracker:
    return replace(
        tracker,
        positions=tuple(map(mirror, tracker.positions)),
        orientations=tuple(map(mirror_turn, tracker.orientations)),
    )


def _mirrored_truth(truth: Truth) -> Truth:
    return replace(truth, arcs=tuple(map(_mirrored_arc, truth.arcs)))


def _mirrored_arc(arc: Arc) -> Arc:
    return replace(
        arc,
        position=mirror(arc.position),
        velocity=mirror(arc.velocity),
        acceleration=mirror(arc.acceleration),
        angular_velocity=mirror_axis(arc.angular_velocity),
        angular_acceleration=mirror_axis(arc.angular_acceleration),
    )
