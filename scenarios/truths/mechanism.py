"""Bodies that joints connect, without contact, integrated to rounding in the coordinates of every body.

Conventions: a joint's frame is attached to its parent; its columns u_1, u_2, u_3 have the axis last. r_P and
r_C run from the centres of mass to the joint's points of the parent and the child, d from the parent's point
to the child's; all in the world. Rows of the constraints are u . d' = 0 in the parent's frame and
u . (w_C - w_P) = 0; of a coupling, the row along one joint's axis less its ratio times the other's.

Accelerations follow from Gauss' principle: they differ least from those without constraints, weighted by the
masses, among all that keep the second derivatives of the constraints, M^-1/2 (G M^-1/2)^+ (g - G a_0) more.
The pseudoinverse takes redundant constraints in the least-norm sense. Baumgarte's terms damp drift.

Sources: Udwadia and Kalaba (1992), *A new perspective on constrained motion*; Baumgarte (1972),
*Stabilization of constraints and integrals of motion in dynamical systems*; Hairer, Norsett and Wanner
(1993), *Solving Ordinary Differential Equations I*, for DOP853.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import OdeSolution
from scipy.spatial.transform import Rotation, RotationSpline

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.kinematics import matrix
from touchstone.scenarios.avatar.number_checks import Report
from touchstone.scenarios.avatar.tracking import path, sample
from touchstone.scenarios.body_joints import WORLD, mass_center, mechanisms
from touchstone.scenarios.scenario import (
    HALF_SPACE_REACH,
    IDENTITY,
    ORIGIN,
    UNBOUNDED,
    Body,
    BodyJoint,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    RoundedBox,
    RoundedHull,
    Scenario,
    Shape,
    Sphere,
    Tracker,
)
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.integration import integrated

LONGEST_STEP = 1 / 60
"""Longest step of the integration [s]: its interpolant is then as exact as its ends."""
STABILISATION = 5.0
"""Rate at which drift decays [1/s]: slower than what moves, so that it asks for no shorter steps."""
REDUNDANT = 1e-6
"""Singular value of the constraints over the largest below which a row follows from others [1]: far above
what the stages of a step make of a redundant row, which they leave by rounding."""
NEXT, LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
"""Places of the other two components of a vector."""
Indices = NDArray[np.intp]


class Known:
    """Motion of a parent that no contact moves: the path of its tracker, or where it stands."""

    def __init__(self, body: Body | None, tracker: Tracker | None) -> None:
        self.position = np.array(ORIGIN if body is None else body.position)
        self.turn = matrix(IDENTITY if body is None else body.orientation)
        self.places = path(tracker) if tracker else None
        self.turns = None
        if tracker:
            keys = Rotation.from_quat(np.array(tracker.orientations), scalar_first=True)
            self.turn = keys[0].as_matrix()
            if len(set(tracker.orientations)) > 1:
                self.turns = RotationSpline(tracker.times, keys)

    def at(self, time: float) -> tuple[Array, Array, Array, Array]:
        """Position (3,), rotation (3, 3), velocities (6,) and accelerations (6,)."""
        place, turn, pace, change = self.position, self.turn, np.zeros(6), np.zeros(6)
        if self.places:
            place, pace[:3], change[:3] = (self.places(time, order) for order in range(3))
        if self.turns:
            turned = self.turns(time)
            turn = turned.as_matrix()
            pace[3:], change[3:] = (turned.apply(self.turns(time, order)) for order in (1, 2))
        return place, turn, pace, change


class Rows(NamedTuple):
    """Constraints, or axes, of m joints at a state: their Jacobian, what they add to its product with the
    accelerations, their rate and their error."""

    jacobian: Array  # (rows, bodies, 6)
    bias: Array
    rate: Array
    error: Array


class Mechanism:
    """Bodies of one mechanism and its joints.

    States are (p, q, v, w) of the n bodies' centres of mass, each as (n, 3) or (n, 4), then the angles of the
    hinges. Bodies n and on are parents that no contact moves.
    """

    def __init__(self, scenario: Scenario, joints: Sequence[BodyJoint]) -> None:
        by_name = {body.name: body for body in scenario.bodies}
        ends = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child))
        moved = [name for name in ends if name != WORLD and by_name[name].kind == "simulated"]
        still = [name for name in ends if name not in moved]
        self.names, self.bodies = moved, [by_name[name] for name in moved]
        self.known = [_known(scenario, by_name.get(name)) for name in still]
        self.gravity = np.array(scenario.acting_gravity)
        self.mass = np.array([body.mass for body in self.bodies])
        self.inertia = np.array([body.inertia for body in self.bodies])
        self.inverse = np.linalg.inv(self.inertia)
        moments, axes = np.linalg.eigh(self.inertia)
        self.root = np.einsum("nij,nj,nkj->nik", axes, moments**-0.5, axes)  # I^-1/2, body frame
        index = {name: k for k, name in enumerate([*moved, *still])}
        self.parent = np.array([index[joint.parent] for joint in joints])
        self.child = np.array([index[joint.child] for joint in joints])
        start = self.start_poses()
        anchor = np.array([joint.anchor for joint in joints])
        self.arms = [
            np.einsum("jki,jk->ji", start[1][ends], anchor - start[0][ends])
            for ends in (self.parent, self.child)
        ]
        frames = np.array([_frame(np.array(joint.axis)) for joint in joints])
        self.frames = [np.swapaxes(start[1][ends], 1, 2) @ frames for ends in (self.parent, self.child)]
        type_of = np.array([joint.type for joint in joints])
        self.hinges, self.sliders, self.balls = (
            np.flatnonzero(type_of == kind) for kind in ("hinge", "slider", "ball")
        )
        # rows of constraints, then those of the axes
        self.across = _chosen({"slider": (0, 1)}, (0, 1, 2), type_of) + [
            (j, 2) for j in self.sliders.tolist()
        ]
        self.turning = _chosen({"hinge": (0, 1), "ball": ()}, (0, 1, 2), type_of) + [
            (j, 2) for j in self.hinges.tolist()
        ]
        self.turns_on = (type_of == "hinge")[:, None]
        self.forces = {
            name: np.array([getattr(joint, name) for joint in joints])
            for name in ("stiffness", "damping", "target", "target_rate", "largest_force")
        }
        place = {joints[j].name: k for k, j in enumerate([*self.hinges, *self.sliders])}
        coupled = [joint for joint in joints if joint.mimics]
        self.coupled = np.array([place[joint.name] for joint in coupled], dtype=np.intp)
        self.mimicked = np.array([place[joint.mimics] for joint in coupled], dtype=np.intp)
        self.ratio = np.array([joint.ratio for joint in coupled])

    def start_poses(self) -> tuple[Array, Array]:
        """Centres of mass (b, 3) and rotations (b, 3, 3) of bodies and unmoved parents at the start."""
        known = [one.at(0.0) for one in self.known]
        places = [mass_center(body) for body in self.bodies] + [one[0] for one in known]
        turns = [matrix(body.orientation) for body in self.bodies] + [one[1] for one in known]
        return np.array(places), np.array(turns)

    def start(self) -> Array:
        """State at the start, its velocities changed by the least impulse that keeps the joints together."""
        state = np.concatenate(
            [
                np.concatenate([mass_center(body) for body in self.bodies]),
                *(
                    np.concatenate([getattr(body, field) for body in self.bodies])
                    for field in ("orientation", "linear_velocity", "angular_velocity")
                ),
                np.zeros(len(self.hinges)),
            ]
        )
        n = len(self.bodies)
        places, turns, pace, _ = self.unpacked(0.0, state)
        rows = self.rows(places, turns, pace, state[13 * n :])[0]
        scaled = self.scaled(rows.jacobian, turns)
        state[7 * n : 13 * n] += _by_kind(self.unscaled(_least(scaled, -rows.rate), turns))
        return state

    def unpacked(self, time: float, state: Array) -> tuple[Array, Array, Array, Array]:
        """Places (b, 3), rotations (b, 3, 3) and velocities (b, 6) of bodies and unmoved parents, and
        accelerations (b, 6), 0 of bodies."""
        n = len(self.bodies)
        known = [one.at(time) for one in self.known]
        q = state[3 * n : 7 * n].reshape(n, 4)
        pace = np.column_stack([state[7 * n : 10 * n].reshape(n, 3), state[10 * n : 13 * n].reshape(n, 3)])
        return (
            np.array([*state[: 3 * n].reshape(n, 3), *(one[0] for one in known)]),
            np.array([*_rotations(q), *(one[1] for one in known)]),
            np.array([*pace, *(one[2] for one in known)]),
            np.array([*np.zeros((n, 6)), *(one[3] for one in known)]),
        )

    def rows(self, places: Array, turns: Array, pace: Array, angles: Array) -> tuple[Rows, Rows]:
        """Rows of the constraints, and of the axes of hinges and sliders, whose errors are positions."""
        along, about = self.along(places, turns, pace), self.about(turns, pace)
        n, m = len(along.rate) - len(self.sliders), len(about.rate) - len(self.hinges)
        axes = Rows(*(np.concatenate([y[m:], x[n:]]) for x, y in zip(along, about)))
        axes.error[: len(self.hinges)] = angles
        coupled = (x[self.coupled] - (self.ratio * x[self.mimicked].T).T for x in axes)
        kept = (np.concatenate([x[:n], y[:m], z]) for x, y, z in zip(along, about, coupled))
        return Rows(*kept), axes

    def along(self, places: Array, turns: Array, pace: Array) -> Rows:
        """Rows u . d."""
        j, column = _pairs(self.across)
        a, b = self.parent[j], self.child[j]
        u = _columns(turns[a], self.frames[0][j], column)
        r_a = np.einsum("jik,jk->ji", turns[a], self.arms[0][j])
        r_b = np.einsum("jik,jk->ji", turns[b], self.arms[1][j])
        d = places[b] + r_b - places[a] - r_a
        w_a, w_b = pace[a, 3:], pace[b, 3:]
        spun_a, spun_b, swept = _cross(w_a, r_a), _cross(w_b, r_b), _cross(w_a, u)
        slip = pace[b, :3] + spun_b - pace[a, :3] - spun_a
        jacobian = np.zeros((len(j), len(places), 6))
        rows = np.arange(len(j))
        jacobian[rows, a, :3], jacobian[rows, a, 3:] = -u, -_cross(r_a + d, u)
        jacobian[rows, b, :3], jacobian[rows, b, 3:] = u, _cross(r_b, u)
        bias = _dot(u, _cross(w_b, spun_b) - _cross(w_a, spun_a))
        bias += 2 * _dot(swept, slip) + _dot(_cross(w_a, swept), d)
        return Rows(jacobian, bias, _dot(u, slip) + _dot(swept, d), _dot(u, d))

    def about(self, turns: Array, pace: Array) -> Rows:
        """Rows u . (w_C - w_P).

        The error of a hinge is u . (axis of the parent x that of the child), of others half the sum of such
        products over the three columns: both have the rate of the row where they are small.
        """
        j, column = _pairs(self.turning)
        a, b = self.parent[j], self.child[j]
        frame_a, frame_b = turns[a] @ self.frames[0][j], turns[b] @ self.frames[1][j]
        rows = np.arange(len(j))
        u = frame_a[rows, :, column]
        relative = pace[b, 3:] - pace[a, 3:]
        jacobian = np.zeros((len(j), len(turns), 6))
        jacobian[rows, a, 3:], jacobian[rows, b, 3:] = -u, u
        apart = [_cross(frame_a[:, :, k], frame_b[:, :, k]) for k in range(3)]
        error = _dot(u, np.where(self.turns_on[j], apart[2], (apart[0] + apart[1] + apart[2]) / 2))
        return Rows(jacobian, _dot(_cross(pace[a, 3:], u), relative), _dot(u, relative), error)

    def exerted(self, joint: Indices, position: Array, rate: Array) -> Array:
        """Forces of springs, dampers and motors along the axes of joints [N, N m]."""
        f = {name: values[joint] for name, values in self.forces.items()}
        force = f["stiffness"] * (f["target"] - position) + f["damping"] * (f["target_rate"] - rate)
        return np.clip(force, -f["largest_force"], f["largest_force"])

    def scaled(self, jacobian: Array, turns: Array) -> Array:
        """G M^-1/2 (rows, 6 n) of the moved bodies."""
        n = len(self.bodies)
        moving = jacobian[:, :n, :3] / np.sqrt(self.mass)[:, None]
        turning = np.einsum("rni,nij->rnj", jacobian[:, :n, 3:], turns[:n] @ self.root)
        return np.concatenate([moving, turning], axis=2).reshape(len(jacobian), 6 * n)

    def unscaled(self, change: Array, turns: Array) -> Array:
        """M^-1/2 times (6 n,), as (n, 6)."""
        n = len(self.bodies)
        rows = change.reshape(n, 6)
        turning = np.einsum("nij,nj->ni", turns[:n] @ self.root, rows[:, 3:])
        return np.column_stack([rows[:, :3] / np.sqrt(self.mass)[:, None], turning])

    def rate(self, time: float, state: Array) -> Array:
        n = len(self.bodies)
        places, turns, pace, known = self.unpacked(time, state)
        rows, axes = self.rows(places, turns, pace, state[13 * n :])
        force = self.exerted(np.concatenate([self.hinges, self.sliders]), axes.error, axes.rate)
        applied = np.einsum("r,rbi->bi", force, axes.jacobian)
        for joint in self.balls:
            a, b = self.parent[joint], self.child[joint]
            torque = self.forces["damping"][joint] * (pace[a, 3:] - pace[b, 3:])
            applied[b, 3:] += torque
            applied[a, 3:] -= torque
        w = pace[:n, 3:]
        spin = np.einsum("nij,njk,nlk,nl->ni", turns[:n], self.inertia, turns[:n], w)
        torque = applied[:n, 3:] - _cross(w, spin)
        free = np.column_stack(
            [
                self.gravity + applied[:n, :3] / self.mass[:, None],
                np.einsum("nij,njk,nlk,nl->ni", turns[:n], self.inverse, turns[:n], torque),
            ]
        )
        without = np.concatenate([free, known[n:]])
        asked = -rows.bias - 2 * STABILISATION * rows.rate - STABILISATION**2 * rows.error
        change = _least(
            self.scaled(rows.jacobian, turns), asked - np.einsum("rbi,bi->r", rows.jacobian, without)
        )
        q = state[3 * n : 7 * n].reshape(n, 4)
        turned = np.column_stack([-_dot(q[:, 1:], w), q[:, :1] * w + _cross(w, q[:, 1:])]) / 2
        return np.concatenate(
            [
                state[7 * n : 10 * n],
                turned.ravel(),
                _by_kind(free + self.unscaled(change, turns)),
                axes.rate[: len(self.hinges)],
            ]
        )


def _known(scenario: Scenario, body: Body | None) -> Known:
    """Motion of the world (None), of a fixed or of a prescribed body."""
    prescribed = body is not None and body.kind == "prescribed"
    return Known(body, _tracker(scenario, body.name) if prescribed and body else None)


def _tracker(scenario: Scenario, root: str) -> Tracker:
    return next(tracker for tracker in scenario.trackers if tracker.root == root)


def _frame(axis: Array) -> Array:
    """Right-handed orthonormal columns, the last along a unit vector."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


def _chosen(
    columns: dict[str, tuple[int, ...]], other: tuple[int, ...], types: NDArray[np.str_]
) -> list[tuple[int, int]]:
    """Pairs of a joint and each column of its frame that its type constrains."""
    return [(j, column) for j, one in enumerate(types) for column in columns.get(str(one), other)]


def _pairs(chosen: list[tuple[int, int]]) -> Indices:
    """Joints and columns (2, rows) of chosen rows, of which there may be none."""
    return np.array(chosen, dtype=np.intp).reshape(-1, 2).T


def _columns(turns: Array, frames: Array, column: Indices) -> Array:
    """A column (rows, 3) of each frame in the world."""
    return np.asarray(np.einsum("rik,rk->ri", turns, frames[np.arange(len(column)), :, column]))


def _least(scaled: Array, asked: Array) -> Array:
    """Least change in the masses' metric with the products `asked`: a pseudoinverse of rows of length 1, so
    that light bodies do not make others' rows look redundant."""
    sizes = np.sqrt(_dot(scaled, scaled))
    return np.asarray(np.linalg.lstsq(scaled / sizes[:, None], asked / sizes, rcond=REDUNDANT)[0])


def _by_kind(rows: Array) -> Array:
    """Rows (n, 6) as all linear ones, then all angular ones."""
    return np.concatenate([rows[:, :3].ravel(), rows[:, 3:].ravel()])


def _rotations(q: Array) -> Array:
    """Rotation matrices (n, 3, 3) of quaternions wxyz of any length; faster than scipy's for few."""
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), 2, 0)


def _cross(a: Array, b: Array) -> Array:
    """Products of rows (n, 3); faster than numpy's for few."""
    return np.asarray(a.take(NEXT, 1) * b.take(LAST, 1) - a.take(LAST, 1) * b.take(NEXT, 1))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=1))


class Played(NamedTuple):
    """A mechanism and its motion."""

    mechanism: Mechanism
    solution: OdeSolution


@lru_cache(maxsize=32)
def played(scenario: Scenario) -> tuple[Played, ...]:
    """Motion of every mechanism of a scene to one frame after its end.

    Raises:
        RuntimeError: two bodies come so near that they may touch.
    """
    end = scenario.duration + 1 / scenario.frame_rate
    found = []
    for joints in mechanisms(scenario):
        mechanism = Mechanism(scenario, joints)
        run = integrated(mechanism.rate, (0.0, end), mechanism.start(), longest=LONGEST_STEP)
        if run.status:
            raise RuntimeError(
                f"{scenario.name}: the motion is singular near {run.t[-1]:.3g} s: {run.message}"
            )
        found.append(Played(mechanism, run.sol))
    _check_apart(scenario, found, np.arange(scenario.frame_count + 1) / scenario.frame_rate)
    return tuple(found)


def mechanism_motion(scenario: Scenario, body: Body, times: Array) -> Motion:
    """Motion of a body that joints connect to others, without contact."""
    return _motion(played(scenario), body, times)


def _motion(found: Sequence[Played], body: Body, times: Array) -> Motion:
    one = next(one for one in found if body.name in one.mechanism.names)
    k, n = one.mechanism.names.index(body.name), len(one.mechanism.names)
    states = one.solution(times).T if len(times) else np.zeros((0, 13 * n))
    p, v, w = (states[:, first * n + 3 * k :][:, :3] for first in (0, 7, 10))
    q = states[:, 3 * n + 4 * k :][:, :4]
    return Motion(p, v, q / np.linalg.norm(q, axis=1)[:, None], w)


def _check_apart(scenario: Scenario, found: Sequence[Played], times: Array) -> None:
    """Refuse a motion in which capsules about the pieces of two bodies that may touch meet."""
    ends = [_capsules(scenario, body, found, times) for body in scenario.bodies]
    for a, b in scenario.touching_pairs():
        for first, last, radius in ends[a]:
            for start, end, other in ends[b]:
                near = _segment_distance(first, last, start, end) <= radius + other
                if near.any():
                    names, time = (scenario.bodies[a].name, scenario.bodies[b].name), times[np.argmax(near)]
                    raise RuntimeError(
                        f"{scenario.name}: {names[0]} and {names[1]} may touch at {time:.3g} s, "
                        "which the law mechanism does not cover"
                    )


def _capsules(
    scenario: Scenario, body: Body, found: Sequence[Played], times: Array
) -> list[tuple[Array, Array, float]]:
    """Ends (n, 3) of a segment in each piece of a body at n times, and the radius about it that holds the
    piece."""
    if body.kind == "simulated":
        motion = _motion(found, body, times)
        turn = Rotation.from_quat(motion.orientation, scalar_first=True)
        origin = motion.position - turn.apply(body.center_of_mass)
    elif body.kind == "prescribed":
        shown = sample(_tracker(scenario, body.name), times)
        turn, origin = Rotation.from_quat(shown.orientation, scalar_first=True), shown.position
    else:
        turn, origin = Rotation.from_quat(body.orientation, scalar_first=True), np.array(body.position)
    capsules = []
    for piece in body.pieces:
        half, radius = _capsule(piece.shape)
        along = Rotation.from_quat(piece.orientation, scalar_first=True).apply(half)
        ends = [origin + turn.apply(piece.position + sign * along) for sign in (-1, 1)]
        first, last = (np.broadcast_to(end, (len(times), 3)) for end in ends)
        capsules.append((first, last, radius))
    return capsules


def _capsule(shape: Shape) -> tuple[Array, float]:
    """Half a segment (3,) in the frame of a piece, and the radius about it that holds the piece."""
    match shape:
        case Sphere(radius):
            return np.zeros(3), radius
        case Capsule(radius, half_length) | Cylinder(radius, half_length) | Cone(radius, half_length):
            return np.array([0.0, 0.0, half_length]), radius
        case Hull(vertices):
            return np.zeros(3), float(np.linalg.norm(vertices, axis=1).max())
        case Box(half) | Ellipsoid(half):
            longest = int(np.argmax(half))
            return np.eye(3)[longest] * half[longest], float(np.linalg.norm(np.delete(half, longest)))
        case RoundedBox() | RoundedHull():
            core = Box(shape.half_extents) if isinstance(shape, RoundedBox) else Hull(shape.vertices)
            segment, around = _capsule(core)
            return segment, around + shape.radius
        case HalfSpace():
            return np.zeros(3), HALF_SPACE_REACH


def _segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distances (n,) of segments from a to b and from c to d (n, 3): of interior points, or of an end and the
    nearest point of the other segment (Ericson, *Real-Time Collision Detection*, 5.1.9)."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = _dot(u, u), _dot(u, v), _dot(v, v), _dot(u, w), _dot(v, w)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.clip(np.nan_to_num((uv * vw - vv * uw) / (uu * vv - uv * uv)), 0, 1)
        t = np.clip(np.nan_to_num((uv * s + vw) / vv), 0, 1)
        s = np.clip(np.nan_to_num((uv * t - uw) / uu), 0, 1)
    return np.asarray(np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1))


def check_mechanism(scenario: Scenario, body: Body, path: str, report: Report) -> None:
    """Report what the law does not cover: limits, free bodies, paths whose accelerations jump."""
    joined = {name for joint in scenario.body_joints for name in (joint.parent, joint.child)}
    if body.name not in joined:
        report(path, f"{body.name!r} is in no joint between bodies, as the law mechanism asks")
    for other in scenario.bodies:
        if other.kind == "driven" or (other.kind == "simulated" and other.name not in joined):
            report(
                path, f"{other.name!r} is {other.kind} and in no joint: the law mechanism knows no contact"
            )
    for joint in scenario.body_joints:
        if min(-joint.lower, joint.upper) < UNBOUNDED:
            report(path, f"{joint.name!r} has limits, which the law mechanism does not cover")
    for tracker in scenario.trackers:
        if tracker.root in joined and tracker.interpolation != "cubic":
            report(
                path, f"{tracker.root!r} moves by {tracker.interpolation}, expected cubic: smooth velocities"
            )
