"""Boxes and capsules in contact: what tests of manifolds and of resting contact share."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core.conventions import SIMULATED
from touchstone.reference_impl.geometry.contact_manifold import expand_manifolds
from touchstone.scenarios.scenario import Body, Capsule, Piece
from touchstone.scenarios.solids import capsule_inertia

HALF = (0.1, 0.08, 0.05)
G = 9.81
GAP = 2e-7
"""Between touching pieces of the unit tests [m]: inside TOUCH_DISTANCE."""
ROUNDING = 1e-12
"""Of points a metre away, through a frame and back [m]."""


def quaternion(*vector: float) -> tuple[float, ...]:
    """Of a rotation vector."""
    return tuple(Rotation.from_rotvec(vector).as_quat(scalar_first=True).tolist())


def rows_of(lab: SimpleNamespace, *bodies: Body, capacity: int = 8, wide: bool = False) -> np.ndarray:
    """The rows of the touching pairs of a scene; if `wide`, those of a dense substep."""
    world = lab.build(lab.scene(*bodies))
    pairs = world.pairs[:capacity]
    touching, _ = detect(world.of_stages()._replace(pairs=pairs), SIMULATED, 0)
    end = expand_manifolds(world.bodies, world.pieces, world.vertices, pairs, touching, wide, world.state[0])
    return pairs[:end].copy()


def table(lab: SimpleNamespace, half=(0.5, 0.4, 0.3)) -> Body:
    """A fixed box whose top is z = 0; it comes first: A."""
    return lab.block("table", half, (0.0, 0.0, -half[2]), kind="fixed")


def on_table(lab: SimpleNamespace, half, position=(0.0, 0.0), turn=(0.0, 0.0, 0.0)) -> Body:
    """A box whose lowest point hovers GAP over the table."""
    axes = np.abs(Rotation.from_rotvec(turn).as_matrix())
    height = float(axes[2] @ half) + GAP
    return lab.block("box", half, (*position, height), orientation=quaternion(*turn))


def assert_points(rows: np.ndarray, expected: list) -> None:
    """The rows' witnesses are these points of the table's top, in any order, with the gap above them."""
    assert len(rows) == len(expected)
    found = np.array(sorted(np.round(rows["point_a"], 9).tolist()))
    np.testing.assert_allclose(found, sorted((*p, 0.0) for p in np.round(expected, 9).tolist()), atol=2e-9)
    np.testing.assert_allclose(rows["point_b"] - rows["point_a"], [(0, 0, GAP)] * len(rows), atol=ROUNDING)
    np.testing.assert_allclose(rows["distance"], GAP, atol=ROUNDING)
    np.testing.assert_allclose(rows["normal"], [(0, 0, 1)] * len(rows), atol=ROUNDING)
    assert set(rows["manifold"].tolist()) == {0}


def energy(world) -> float:
    """Of all simulated bodies in the scene's gravity [J]."""
    total, g = 0.0, world.state[0]["gravity"]
    for body in world.bodies[world.bodies["kind"] == SIMULATED]:
        spin = body["rotation"].T @ body["omega"]
        moving = body["mass"] * (body["velocity"] @ body["velocity"] / 2 - g @ body["center"])
        total += moving + spin @ body["inertia"] @ spin / 2
    return float(total)


def speed(world) -> float:
    """|v| + |w| of the fastest simulated body."""
    moving = world.bodies[world.bodies["kind"] == SIMULATED]
    return float((np.linalg.norm(moving["velocity"], axis=1) + np.linalg.norm(moving["omega"], axis=1)).max())


def tilt(body) -> float:
    """Angle between a body's z and the vertical [rad]."""
    return float(2 * np.linalg.norm(body["orientation"][1:3]))


def assert_energy_never_rises(energies: list[float], limit: float) -> None:
    """No frame ends with more than `limit` above the one before."""
    assert max(late - early for early, late in pairwise(energies)) < limit


LYING = quaternion(0.0, np.pi / 2, 0.0)
"""A capsule's axis, its own z, turned to the world's x."""


def capsule(position, orientation=LYING, **fields) -> Body:
    """A capsule of 1 kg, radius 5 cm and half length 15 cm."""
    fields |= {"position": position, "orientation": orientation, "inertia": capsule_inertia(1.0, 0.05, 0.15)}
    return Body("capsule", "simulated", "wood", (Piece("capsule", Capsule(0.05, 0.15)),), 1.0, **fields)
