"""Two bodies of one piece each that move over a step: what tests of the sweep share."""

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.reference_world import piece_arrays
from touchstone.reference_impl.continuous.free_rotation import rotate_freely
from touchstone.reference_impl.continuous.time_of_impact import MovingPair, distance_at, time_of_impact
from touchstone.reference_impl.core.conventions import (
    HULL,
    IMPACT_SLACK,
    IMPACT_TARGET,
    SIMULATED,
)
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import BODY, PAIR
from touchstone.scenarios.scenario import Piece, Shape

NEAR = IMPACT_TARGET + IMPACT_SLACK
"""Gap at which an impact may be reported [m]."""
ROUNDING = 1e-12
"""Rounding of a distance or of a way, in scenes of metres [m]."""
CLOSE = 1e-9
"""Rounding of a measured distance at a gap of 5e-7 m: the normal is good to 1e-16 / 5e-7 [m]."""


Found = tuple[float, int, bool]


class Scene:
    """Two bodies of one piece each, and how they move over one step."""

    def __init__(self, one: Shape, two: Shape) -> None:
        self.bodies = np.zeros(2, BODY)
        self.bodies["kind"] = SIMULATED
        self.pieces, self.vertices = piece_arrays([(0, Piece("one", one)), (1, Piece("two", two))])
        self.pairs, self.state = np.zeros(1, PAIR), np.zeros(1, STATE)
        self.bodies["moves"], self.bodies["old_orientation"] = 1, (1.0, 0.0, 0.0, 0.0)
        self.pairs["piece_b"] = self.pairs["body_b"] = 1

    def move(self, body: int, center=(0, 0, 0), travel=(0, 0, 0), turn=(0, 0, 0), **more: object) -> "Scene":
        """Set a body's motion; `more`: `posture` (scipy), `travel_bend` and `turn_bend` (square terms)."""
        row = self.bodies[body]
        row["old_center"], row["travel"], row["turn"] = center, travel, turn
        row["travel_bend"], row["turn_bend"] = more.get("travel_bend", 0.0), more.get("turn_bend", 0.0)
        posture = more.get("posture", Rotation.identity())
        row["old_orientation"] = posture.as_quat(scalar_first=True)
        return self

    def spin_freely(self, body: int, inertia: np.ndarray, omega: np.ndarray) -> "Scene":
        """Let a body that was given its motion rotate without torque from `omega` [rad per step]."""
        row = self.bodies[body]
        row["inertia"], row["old_omega"] = inertia, omega
        row["rotation"] = Rotation.from_quat(row["old_orientation"], scalar_first=True).as_matrix()
        rotate_freely(row, 1.0)
        return self

    def moving_pair(self) -> MovingPair:
        """The pair as the kernels take it."""
        offset = self.pieces["position"] - self.bodies["center_of_mass"]
        self.bodies["reach"] = np.linalg.norm(offset, axis=1) + self.pieces["reach"]
        return MovingPair(*self.bodies, *self.pieces, self.vertices, self.pairs[0], self.state[0])

    def impact(self, start=0.0, until=1.0, target=IMPACT_TARGET, slack=IMPACT_SLACK) -> Found:
        """(fraction, iterations, converged) of the sweep."""
        return time_of_impact(self.moving_pair(), start, until, target, slack)

    def distance(self, s: float) -> float:
        """Signed distance at a fraction: that of two witness points, so never less than the true one."""
        distance_at(self.moving_pair(), s)
        return float(self.pairs[0]["distance"])

    def corners(self, k: int) -> np.ndarray:
        """World vertices of the box or hull where it was last posed."""
        row = self.pieces[k]
        signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        first = row["first_vertex"]
        hull = self.vertices["position"][first : first + row["vertex_count"]]
        local = hull if row["kind"] == HULL else signs * row["size"]
        return local @ row["world_rotation"].T + row["world_position"]


def assert_true(scene: Scene, found: Found, fractions: np.ndarray) -> None:
    """No sample before the fraction is nearer than the target, and an impact is as near as it claims."""
    fraction, _, converged = found
    assert converged
    for s in fractions[fractions < fraction]:
        assert scene.distance(s) >= IMPACT_TARGET - CLOSE
    if fraction < 1:
        assert scene.distance(fraction) <= NEAR + CLOSE
