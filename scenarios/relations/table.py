"""Table of the relations: how a scene is changed, and how its motion must change with it.

A point p of the original is at `scale` A p + `offset` + `speed` t + `push` t^2 / 2 in the changed scene,
after `scale`^(1/2) as much time and `wait` frames. Body-fixed points change by `scale` L, L the mirror for
the mirror image and 1 otherwise.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.relations import changes
from touchstone.scenarios.relations.decomposition import decomposed, is_divisible
from touchstone.scenarios.scenario import Box, Scenario, Vector
from touchstone.scenarios.transforms import mirrored, permuted, translated

YAW = Rotation.from_rotvec((0.0, 0.0, 0.7))
TURN = Rotation.from_rotvec((0.4, -0.9, 1.3))
"""A rotation about the vertical, and one about an axis of no symmetry [rad]."""
OFFSET = (0.37, -1.21, 0.53)
"""Translation [m]."""
SPEED, PUSH = (0.7, -0.4, 0.2), (0.3, 0.5, 0.8)
"""Velocity [m/s] and acceleration [m/s^2] of fixed bodies."""
FACTOR, TIMES = 8.0, 0.5
"""Factor of masses, and of times in Froude's law; powers of two scale floats exactly."""
WAIT = 30
"""Displayed frames by which a scene starts later [1]."""


def _identity() -> Array:
    return np.eye(3)


@dataclass(frozen=True, slots=True)
class Relation:
    """One change. `applies` tells whether it changes a scene at all."""

    name: str
    summary: str
    change: Callable[[Scenario], Scenario]
    matrix: Array = field(default_factory=_identity)
    own: Array = field(default_factory=_identity)
    offset: Vector = (0.0, 0.0, 0.0)
    speed: Vector = (0.0, 0.0, 0.0)
    push: Vector = (0.0, 0.0, 0.0)
    scale: float = 1.0
    times: float = 1.0
    wait: int = 0
    applies: Callable[[Scenario], bool] = lambda scenario: True


MIRROR = np.diag((-1.0, 1.0, 1.0))


RELATIONS: dict[str, Relation] = {
    one.name: one
    for one in (
        Relation("yaw", "turned about z", lambda s: changes.rotated(s, YAW), YAW.as_matrix()),
        Relation(
            "rotation",
            "turned about an axis of no symmetry, gravity too",
            lambda s: changes.rotated(s, TURN),
            TURN.as_matrix(),
        ),
        Relation(
            "mirror",
            "its mirror image",
            lambda s: changes.bare(mirrored(changes.bare(s))),
            MIRROR,
            MIRROR,
            applies=lambda s: not any(chain.cones for chain in s.chains),
        ),
        Relation("translation", "moved", lambda s: changes.bare(translated(s, OFFSET)), offset=OFFSET),
        Relation(
            "uniform",
            "on fixed bodies that move uniformly",
            lambda s: changes.carried(s, SPEED),
            speed=SPEED,
            applies=changes.can_be_carried,
        ),
        Relation(
            "accelerated",
            "on fixed bodies that accelerate, in the gravity that this is equal to",
            lambda s: changes.carried(s, (0.0, 0.0, 0.0), PUSH),
            push=PUSH,
            applies=lambda s: "gravity" in s.effects and changes.can_be_carried(s),
        ),
        Relation(
            "bodies",
            "bodies in reverse order",
            lambda s: changes.bare(permuted(s, range(len(s.bodies))[::-1])),
            applies=lambda s: not s.joints,  # links have an order
        ),
        Relation(
            "piece_order",
            "pieces in reverse order",
            changes.pieces_reversed,
            applies=lambda s: any(len(body.pieces) > 1 for body in s.bodies),
        ),
        Relation(
            "pieces",
            "boxes cut in two across an axis, hulls by a plane, both at random",
            decomposed,
            applies=lambda s: any(map(is_divisible, s.bodies)),
        ),
        Relation(
            "hulls",
            "boxes as hulls",
            changes.with_hulls,
            applies=lambda s: any(
                isinstance(p.shape, Box) for body in s.bodies if body.kind != "fixed" for p in body.pieces
            ),
        ),
        Relation("masses", "all masses times 8", lambda s: changes.heavier(s, FACTOR)),
        Relation(
            "froude",
            "lengths a quarter, times a half, and settings in metres and seconds with them",
            lambda s: changes.rescaled(s, TIMES),
            scale=TIMES**2,
            times=TIMES,
            applies=lambda s: "gravity" in s.effects,
        ),
        Relation(
            "later",
            "trackers wait half a second before they move",
            lambda s: changes.later(s, WAIT),
            wait=WAIT,
            applies=changes.starts_at_rest,
        ),
        Relation("stranger", "one more body that nothing meets", changes.with_stranger),
    )
}
"""Relations by name; `split` (a run in two parts) is no change of a scene and has no row here."""
