"""Overlap-free posture within joint limits that is nearest to the tracker's, as a reference solution.

Minimizes |q - q_tracker|^2 over the hinges, with the root fixed at its tracked pose, by sequential
linearisation. At each posture pinocchio's Jacobian and coal's distances d give n . J dq >= -d for every near
pair of pieces. The least-distance program over these half-spaces and the limits (Lawson & Hanson, *Solving
Least Squares Problems*, chapter 23) gives the next posture. It finds local minima: the best of many starts is
taken. Reach cones are omitted, which can only lower the minimum.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np
import pinocchio
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.oracles.articulated import Articulated
from touchstone.adapters.oracles.overlap import Pose, coal_shape, signed_distance
from touchstone.adapters.vector_products import cross
from touchstone.scenarios.avatar.kinematics import matrix
from touchstone.scenarios.scenario import Scenario, Tracker

FREE = 1e-6
"""Maximum overlap of a free posture [m]: tolerance of the reference's removal."""
SETTLED = 1e-3
"""Rotation of every hinge below which the iteration has converged [rad]: near a minimum the change of
|q - q_tracker|^2 is of second order, 1e-6 rad^2."""
CONSTRAINT_DISTANCE = 0.1
"""Distance within which pairs give half-spaces [m]: as far as STRIDE moves an elbow."""
STRIDE = 0.3
"""Maximum rotation of a hinge in one linearisation [rad]: the largest whose cosine is 1 within 5 %."""
DEEPEST = 0.03
"""Maximum depth that one linearisation removes [m]: the distance that STRIDE moves a wrist."""
LINEARISATIONS = 40
"""Maximum number of linearisations: 5 to 10 are usual."""
MEMORY, ALIKE = 6, 0.99
"""Number of linearisations for which a half-space is kept, and minimum cosine between its normal and the
pair's newest. The nearest point of a flat side jumps between corners; a single half-space would make it
rock."""
HOPELESS = 1.2
"""Factor over the least |q - q_tracker|^2 found [1]: above it a start is abandoned after MEMORY
linearisations."""
INFEASIBLE = 1e-9
"""Residual below which no posture satisfies all half-spaces [1]: rounding of a hundred rows, relative to
1."""
STARTS = 20
"""Number of starts per posture: the tracker's, the one played, the last optimum, and random ones near
these."""
SPREAD = 0.4
"""Standard deviation of the random starts' hinges [rad]: moves the end of an arm of 0.6 m by 0.2 m."""


class NearestPosture:
    """Search for the nearest free posture of a driven body in its scene."""

    def __init__(self, scenario: Scenario, tracker: Tracker) -> None:
        links = scenario.links(tracker)
        by_name = {joint.name: joint for joint in scenario.joints}
        self._tree = Articulated(scenario, tracker)
        self._lower = np.array([by_name[name].lower for name in tracker.joints])
        self._upper = np.array([by_name[name].upper for name in tracker.joints])
        own = [(link, piece) for link in links for piece in scenario.bodies[link].pieces]
        rest = [
            (k, piece) for k, body in enumerate(scenario.bodies) if k not in links for piece in body.pieces
        ]
        self._body = np.array([body for body, _ in own + rest])
        self._place = [(matrix(piece.orientation), np.array(piece.position)) for _, piece in own + rest]
        self._shapes: list[Any] = [coal_shape(piece.shape) for _, piece in own + rest]
        self._link = np.array([links.index(body) for body, _ in own])
        for shape in self._shapes:
            shape.computeLocalAABB()
        self._radius = np.array([shape.aabb_radius for shape in self._shapes[: len(own)]])
        self._center = np.array([shape.aabb_center for shape in self._shapes])
        self._half = np.array([(s.aabb_local.max_ - s.aabb_local.min_) / 2 for s in self._shapes])
        touching = set(scenario.touching_pairs())
        self._pairs = np.array(
            [
                (p, q)
                for p in range(len(own))
                for q in range(p + 1, len(self._body))
                # No hinge moves pieces of the root.
                if (self._link[p] > 0 or q < len(own))
                and (min(self._body[[p, q]]), max(self._body[[p, q]])) in touching
            ]
        )

    def best(
        self, root: Pose, others: list[Pose], tracked: Array, starts: list[Array], rng: np.random.Generator
    ) -> Array | None:
        """Nearest free posture to `tracked` (j,) [rad] found from STARTS starts, or None.

        Args:
            root: fixed pose of the driven body's root.
            others: poses of all bodies of the scene; links are ignored.
            starts: the first starts [rad]; random ones near each of these in turn complete them.
        """
        rest = range(len(self._link), len(self._body))
        self._root_orientation = Rotation.from_matrix(root[0]).as_quat(scalar_first=True)
        self._root, self._others = root, [_times(others[self._body[k]], self._place[k]) for k in rest]
        best, least = None, inf
        for k in range(STARTS):
            start = starts[k % len(starts)]
            if k >= len(starts):
                start = start + rng.normal(scale=SPREAD, size=len(start))
            posture = self._descend(np.clip(start, self._lower, self._upper), tracked, HOPELESS * least)
            if posture is not None and _apart(posture, tracked) < least:
                best, least = posture, _apart(posture, tracked)
        return best

    def _descend(self, posture: Array, tracked: Array, most: float) -> Array | None:
        """Local minimum from a start; None if no posture is free within LINEARISATIONS, or if
        |q - q_tracker|^2 exceeds `most` after MEMORY of them."""
        kept: list[_Plane] = []
        for number in range(LINEARISATIONS):
            depth, planes = self._near(posture, kept)
            slopes = self._slopes(planes, len(posture))
            low = np.maximum(self._lower, posture - STRIDE)
            high = np.minimum(self._upper, posture + STRIDE)
            distance = np.array([plane.distance for plane in planes])
            heights = np.minimum(-distance, DEEPEST) + slopes @ posture
            goal = _least_distance(tracked, slopes, heights, low, high)
            if goal is None or (number > MEMORY and _apart(goal, tracked) > most):
                return None
            if depth <= FREE and np.abs(goal - posture).max() < SETTLED:
                return posture
            posture, kept = goal, [plane for plane in planes if plane.age < MEMORY]
        return None

    def _near(self, posture: Array, kept: list[_Plane]) -> tuple[float, list[_Plane]]:
        """Depth of the deepest pair [m], and half-spaces of near pairs together with those kept."""
        tree = self._tree
        configuration = tree.posture(self._root[1], self._root_orientation, posture)
        pinocchio.computeJointJacobians(tree.model, tree.data, configuration)
        links = [(link.rotation, link.translation) for link in tree.data.oMi.tolist()[1:]]
        self._origin = np.array([origin for _, origin in links])
        poses = [_times(links[k], own) for k, own in zip(self._link.tolist(), self._place)] + self._others
        depth, planes = 0.0, []
        now: dict[tuple[int, int], Array] = {}
        for p, q in self._candidates(poses):
            value, normal, point = signed_distance(self._shapes[p], poses[p], self._shapes[q], poses[q])
            if value <= CONSTRAINT_DISTANCE:
                now[p, q], depth = normal, max(depth, -value)
                own = (_seen(poses[p], point), _seen(poses[q], point))
                planes.append(_Plane((p, q), normal, *own, value, value, point, point, 0))
        for plane in kept:
            (p, q), normal = plane.pair, plane.normal
            if plane.pair in now and now[p, q] @ normal > ALIKE:
                one, two = _placed(poses[p], plane.own_p), _placed(poses[q], plane.own_q)
                distance = plane.found + float(normal @ (two - one))
                planes.append(plane._replace(distance=distance, point_p=one, point_q=two, age=plane.age + 1))
        return depth, planes

    def _candidates(self, poses: list[Pose]) -> list[tuple[int, int]]:
        """Pairs within CONSTRAINT_DISTANCE, by the ball about a link's piece and the box of the other."""
        rotation, origin = np.array([pose[0] for pose in poses]), np.array([pose[1] for pose in poses])
        center = origin + np.einsum("kij,kj->ki", rotation, self._center)
        p, q = self._pairs.T
        seen = np.einsum("kji,kj->ki", rotation[q], center[p] - center[q])
        gap = np.linalg.norm(np.maximum(0.0, np.abs(seen) - self._half[q]), axis=1)
        near: list[tuple[int, int]] = self._pairs[gap < self._radius[p] + CONSTRAINT_DISTANCE].tolist()
        return near

    def _slopes(self, planes: list[_Plane], hinges: int) -> Array:
        """Derivatives of the half-spaces' distances by the hinges' angles (m, j) [m]."""
        slopes = np.zeros((len(planes), hinges))
        if not planes:
            return slopes
        model, data, axes = self._tree.model, self._tree.data, pinocchio.LOCAL_WORLD_ALIGNED
        normal = np.array([plane.normal for plane in planes])
        count, first = len(self._link), np.array([plane.pair[0] for plane in planes])
        second = np.array([plane.pair[1] for plane in planes])
        sides = (
            (first, np.array([plane.point_p for plane in planes]), -1),
            (second, np.array([plane.point_q for plane in planes]), 1),
        )
        for piece, point, sign in sides:
            rows = np.flatnonzero(piece < count)
            link = self._link[piece[rows]]
            moment = cross(point[rows] - self._origin[link], normal[rows])
            wrench = np.hstack((normal[rows], moment))
            for k in set(link.tolist()):
                mine = link == k
                jacobian = pinocchio.getJointJacobian(model, data, k + 1, axes)[:, 6:]
                slopes[rows[mine]] += sign * wrench[mine] @ jacobian
        return slopes


class _Plane(NamedTuple):
    """A half-space of two pieces: a normal, and the points of both that were nearest when it was created."""

    pair: tuple[int, int]
    normal: Array  # (3,) from the first to the second piece, world
    own_p: Array  # (3,) point in the first piece's frame [m]
    own_q: Array  # (3,) point in the second piece's frame [m]
    found: float  # signed distance at creation [m]
    distance: float  # current signed distance [m]
    point_p: Array  # (3,) current positions of the points, world [m]
    point_q: Array
    age: int  # number of linearisations since creation


def _apart(one: Array, two: Array) -> float:
    return float(np.sum((one - two) ** 2))


def _least_distance(tracked: Array, slopes: Array, heights: Array, low: Array, high: Array) -> Array | None:
    """The q nearest to `tracked` with slopes q >= heights and low <= q <= high; None if there is none."""
    one = np.eye(len(tracked))
    rows = np.vstack((slopes, one, -one))
    wanted = np.concatenate((heights, low, -high)) - rows @ tracked
    if (wanted <= 0).all():
        return tracked
    # min |x| with rows x >= wanted is the residual of a non-negative least-squares problem.
    matrix, right = np.vstack((rows.T, wanted)), np.zeros(len(tracked) + 1)
    right[-1] = 1.0
    try:
        pulls, _ = nnls(matrix, right)
    except RuntimeError:  # iteration limit reached
        return None
    residual = right - matrix @ pulls
    if residual[-1] < INFEASIBLE:
        return None
    moved: Array = tracked - residual[:-1] / residual[-1]
    return moved


def _times(frame: Pose, local: Pose) -> Pose:
    return frame[0] @ local[0], frame[1] + frame[0] @ local[1]


def _placed(frame: Pose, point: Array) -> Array:
    world: Array = frame[1] + frame[0] @ point
    return world


def _seen(frame: Pose, point: Array) -> Array:
    local: Array = (point - frame[1]) @ frame[0]
    return local
