"""The bodies of a scenario in a Bullet client: multibodies of convex pieces, and which of them collide."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import BodyFacts, Settings, Unsupported
from touchstone.adapters.engines.bullet import tables
from touchstone.adapters.engines.bullet.joints import Motors, Tree, start, trees
from touchstone.adapters.engines.bullet.tables import (
    BASE,
    LINK,
    NO_SHAPE,
    UNTURNED,
    Link,
    Links,
    Multibody,
    Part,
    xyzw,
)
from touchstone.adapters.servo import Drive, simulated_masses
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.scenario import (
    IDENTITY,
    ORIGIN,
    TRACKED,
    Body,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Hull,
    Joint,
    Piece,
    RoundedBox,
    RoundedHull,
    Scenario,
    Sphere,
    Vector,
    vector,
)
from touchstone.scenarios.solids import box_inertia, core_vertices, sphere_inertia

INERTIA_TOLERANCE = 1e-12
"""Relative tolerance between a body's inertia and that of its shape: rounding."""
MOST_LINKS = 100
"""Most links of a multibody: pybullet makes no more than 128 degrees of freedom and links."""
MOST_PARTS = 16
"""Most shapes of a compound: pybullet silently leaves out all others."""
PRIMITIVES = {
    Sphere: pybullet.GEOM_SPHERE,
    Box: pybullet.GEOM_BOX,
    Capsule: pybullet.GEOM_CAPSULE,
    Cylinder: pybullet.GEOM_CYLINDER,
    HalfSpace: pybullet.GEOM_PLANE,
}
ROUNDED = (RoundedBox, RoundedHull)
ALONE = (Hull, HalfSpace, *ROUNDED)
"""Shapes that are in no compound."""


class Factors(NamedTuple):
    """Factors of a body's coefficients, by Bullet's names. With the factors f of friction, a pair multiplies
    those of restitution and friction, and rolls and spins under r_a f_b + r_b f_a (btManifoldResult.cpp): a
    length, as moments are bounded by it times the normal impulse."""

    restitution: float
    lateralFriction: float
    rollingFriction: float
    spinningFriction: float


class Bodies:
    """The bodies of a scenario in the client `on`.

    Attributes:
        parameters: settings of the profile; `sleep`: those of a base that may sleep.
        masses: mass properties per body.
        moments, axes: principal moments, and principal axes in the body frame (xyzw), per body.
        arm: centres of mass in the body frames (n, 3) [m].
        origin: origins of the link frames in the body frames (n, 3) [m].
        colliders: per body its (id, link) pairs; `body_of` is the inverse.
        rigid: bodies in maximal coordinates; anchored: bodies with friction anchors.
        motors: of the mechanisms' joints.
        free, joined, driven: multibodies; kinematic: id per posed link, prescribed body and moving surface.
    """

    def __init__(
        self,
        scenario: Scenario,
        settings: Settings,
        factors: list[Factors],
        drives: Mapping[int, Drive],
        on: dict[str, int],
    ) -> None:
        """`factors`: of each body; `drives`: by trackers that are coupled."""
        self._scenario, self._factors, self._drives, self._on = scenario, factors, drives, on
        self.parameters = tables.parameters_of(settings.profile, settings.changes)
        self.sleep = tables.ASLEEP if settings.sleeping or self.parameters.sleep else {}
        self.masses = simulated_masses(scenario, list(drives.values()))
        self.moments, axes = zip(*(_principal_axes(body) for body in self.masses))
        self.axes, self.arm = np.array(axes), np.array([body.center_of_mass for body in self.masses])
        self.colliders: dict[int, list[tuple[int, int]]] = {}
        self._trees = trees(scenario)
        self._nested = {body for tree in self._trees for body in tree.bodies}
        self.motors: list[Motors] = []
        self.origin = np.zeros((len(scenario.bodies), 3))
        for tree in self._trees:
            self.origin[list(tree.bodies)] = tree.origins
        plain = [_is_plain(body) and k not in self._nested for k, body in enumerate(scenario.bodies)]
        self.rigid = set(np.flatnonzero(plain).tolist()) if self.parameters.maximal else set()
        groups, moves = scenario.groups(), [surface_moves(body) for body in scenario.bodies]
        posed = [moves[k] if group < 0 else group not in drives for k, group in enumerate(groups)]
        self._weightless = [k for k, weightless in enumerate(posed) if weightless]
        alone = [group < 0 and not posed[k] and k not in self._nested for k, group in enumerate(groups)]
        self._alone = np.flatnonzero(alone).tolist()
        self._carried = {
            k for pair in scenario.touching_pairs() if not {*pair}.isdisjoint(self._weightless) for k in pair
        }
        self.anchored = self._with_anchors()

    def add(self) -> None:
        self.free = [self._add_free(k) for k in self._alone]
        self.joined = [self._add_joined(tree) for tree in self._trees]
        self.driven = [self._add_driven(k) for k in self._drives]
        self.kinematic = {link: self._create((link,), [], ORIGIN, IDENTITY) for link in self._weightless}
        self.body_of = {link: body for body, links in self.colliders.items() for link in links}

    def _with_anchors(self) -> set[int]:
        """Bodies with friction anchors: all, none, or in scenes that start at rest the simulated boxes and
        hulls that rub and meet nothing whose pose each step sets. Bullet keeps the anchor of a point that
        sticks, also while a body rolls on or is put back; what slides with one sinks in by a millimetre."""
        scenario, bodies = self._scenario, self._scenario.bodies
        if self.parameters.anchors is not None:
            return set(range(len(bodies))) if self.parameters.anchors else set()
        if any(any((*body.linear_velocity, *body.angular_velocity)) for body in bodies):
            return set()
        pairs = [pair for pair in scenario.touching_pairs() if scenario.pair_coefficients(*pair)[1] > 0]
        return {
            k
            for k in {k for pair in pairs for k in pair} - self._carried
            if bodies[k].kind == "simulated"
            and all(isinstance(piece.shape, Box | Hull) for piece in bodies[k].pieces)
        }

    def _add_free(self, body: int) -> Multibody:
        given = self._scenario.bodies[body]
        create = self._create_rigid if body in self.rigid else self._create
        number = create((body,), [], given.position, given.orientation)
        pybullet.resetBaseVelocity(number, given.linear_velocity, given.angular_velocity, **self._on)
        return Multibody(number, (body,))

    def _add_joined(self, tree: Tree) -> Multibody:
        based, place = len(tree.bodies) - len(tree.joints), (ORIGIN, IDENTITY)
        if based:
            root = self._scenario.bodies[tree.bodies[0]]
            place = root.position, root.orientation
        number = self._create(tree.bodies, tree.links, *place)
        start(tree, self._scenario, number, self._on)
        self.motors.append(Motors(tree, number, self._on))
        return Multibody(number, tree.bodies, based=based)

    def _add_driven(self, tracker: int) -> Multibody:
        """Add a driven body in its initial state, with hinge limits and without Bullet's default motors."""
        scenario, drive = self._scenario, self._drives[tracker]
        by_name = {joint.name: joint for joint in scenario.joints}
        joints = tuple(by_name[name] for name in scenario.trackers[tracker].joints)
        first = sum(len(other.joints) for other in scenario.trackers[:tracker])
        orientation, first_state, links = drive.start_orientation[0], drive.start, range(len(joints))
        placed = [self._hinge(joint, drive.links) for joint in joints]
        number = self._create(drive.links, placed, drive.start_position[0], orientation)
        for k, joint in enumerate(joints):
            angle, rate = first_state.angle[0, k], first_state.rate[0, k]
            pybullet.resetJointState(number, k, angle, rate, **self._on)
            limits = {"jointLowerLimit": joint.lower, "jointUpperLimit": joint.upper}
            pybullet.changeDynamics(number, k, **limits, **self._on)
        if joints:
            no_force = [0.0] * len(joints)
            pybullet.setJointMotorControlArray(
                number, links, pybullet.VELOCITY_CONTROL, forces=no_force, **self._on
            )
        arm = Rotation.from_quat(orientation, scalar_first=True).apply(self.arm[drive.links[0]])
        omega = first_state.angular_velocity[0]
        velocity = first_state.linear_velocity[0] + np.cross(omega, arm)
        pybullet.resetBaseVelocity(number, velocity.tolist(), omega.tolist(), **self._on)
        return Multibody(number, drive.links, slice(first, first + len(joints)))

    def _hinge(self, joint: Joint, bodies: Links) -> Link:
        rest = Rotation.from_quat(joint.orientation, scalar_first=True)
        return {
            "linkPositions": joint.position,
            "linkOrientations": xyzw(joint.orientation),
            "linkParentIndices": bodies.index(self._scenario.body_index(joint.parent)),
            "linkJointTypes": pybullet.JOINT_REVOLUTE,
            "linkJointAxis": tuple(rest.inv().apply(joint.axis).tolist()),
        }

    def _create(
        self, bodies: Links, links: list[Link], position: Sequence[float], wxyz: Sequence[float]
    ) -> int:
        """Create a multibody: base = first body, or nothing if each body has a link; then `links`, and links
        for further shapes. A fixed body of more shapes is as many multibodies."""
        shapes = [self._add_shapes(body) for body in bodies]
        if sum(map(len, shapes)) <= MOST_LINKS:
            return self._assemble(bodies, links, shapes, position, wxyz)
        root, own = self._scenario.bodies[bodies[0]], shapes[0]
        if root.kind != "fixed" or bodies[0] in self._weightless:
            raise Unsupported(f"bullet: {root.name!r} has more than {MOST_LINKS} shapes")
        first, *_ = (self._assemble(bodies, links, [[shape]], position, wxyz) for shape in own)
        return first

    def _assemble(
        self,
        bodies: Links,
        links: list[Link],
        shapes: list[list[int]],
        position: Sequence[float],
        wxyz: Sequence[float],
    ) -> int:
        based = len(bodies) - len(links)
        parts = [self._part(body, shape[0]) for body, shape in zip(bodies, shapes)]
        base, *parts = parts if based else [Part(0.0, NO_SHAPE), *parts]
        parts = [part._replace(**link) for part, link in zip(parts, links)]
        further = [(k, shape) for k, own in enumerate(shapes) for shape in own[1:]]
        parts += [Part(0.0, shape, linkParentIndices=k + 1 - based) for k, shape in further]
        meeting = any(a in bodies and b in bodies for a, b in self._scenario.touching_pairs())
        number = pybullet.createMultiBody(
            baseMass=base.linkMasses,
            baseCollisionShapeIndex=base.linkCollisionShapeIndices,
            basePosition=position,
            baseOrientation=xyzw(wxyz),
            baseInertialFramePosition=base.linkInertialFramePositions,
            baseInertialFrameOrientation=base.linkInertialFrameOrientations,
            flags=pybullet.URDF_MAINTAIN_LINK_ORDER | (pybullet.URDF_USE_SELF_COLLISION if meeting else 0),
            **dict(zip(Part._fields, zip(*parts))),
            **self._on,
        )
        self._tell(number, (*bodies, *(bodies[k] for k, _ in further)), -based, len(bodies))
        return int(number)

    def _create_rigid(
        self, bodies: Links, _: list[Link], position: Sequence[float], wxyz: Sequence[float]
    ) -> int:
        """Create a body of one shape in maximal coordinates; Bullet computes its inertia from the shape."""
        (body,) = bodies
        (shape,) = self._add_shapes(body)
        number = pybullet.createMultiBody(
            baseMass=self._part(body, shape).linkMasses,
            baseCollisionShapeIndex=shape,
            basePosition=position,
            baseOrientation=xyzw(wxyz),
            useMaximalCoordinates=True,
            **self._on,
        )
        self._tell(number, bodies, BASE, 0)
        return int(number)

    def _tell(self, number: int, bodies: Links, first: int, turned: int) -> None:
        """Set coefficients, damping and activation of a new base and of its links, which from `first` on are
        `bodies`, and moments of inertia of the first `turned` of these."""
        root = self._scenario.bodies[bodies[0]]
        has_hull = any(isinstance(piece.shape, Hull) for piece in root.pieces)
        dynamics = self.parameters.base | (self.parameters.hull if has_hull else {})
        for piece in root.pieces:
            if isinstance(piece.shape, ROUNDED):  # a margin is outside a hull: it rounds it exactly
                dynamics["collisionMargin"] = piece.shape.radius
        # nothing wakes what sleeps on a body whose pose is set: such a body rises through it
        wakeful = root.kind in TRACKED or not self._carried.isdisjoint(bodies)
        dynamics |= {} if wakeful else self.sleep
        pybullet.changeDynamics(number, BASE, **dynamics, **self._on)
        for k, body in enumerate(bodies):
            link = first + k
            if body in self.anchored:
                pybullet.changeDynamics(number, link, frictionAnchor=1, **self._on)
            own = {**LINK, **self._factors[body]._asdict()}
            if k < turned:
                own["localInertiaDiagonal"] = self.moments[body]
            pybullet.changeDynamics(number, link, **own, **self._on)
            self.colliders.setdefault(body, []).append((number, link))

    def _part(self, body: int, shape: int) -> Part:
        given = self._scenario.bodies[body]
        weightless = given.kind == "fixed" or body in self._weightless
        own = self.masses[body]
        center = vector(own.center_of_mass - self.origin[body])
        return Part(0.0 if weightless else own.mass, shape, center, tuple(self.axes[body]))

    def _add_shapes(self, body: int) -> list[int]:
        """Create Bullet's shapes of a body: compounds of primitives, and one per hull or half-space."""
        origin = self.origin[body]
        pieces = [
            replace(piece, position=vector(piece.position - origin))
            for piece in self._scenario.bodies[body].pieces
        ]
        plain = [piece for piece in pieces if not isinstance(piece.shape, ALONE)]
        shapes = [self._add_primitives(plain[k : k + MOST_PARTS]) for k in range(0, len(plain), MOST_PARTS)]
        shapes += [self._add_primitives([p]) for p in pieces if isinstance(p.shape, HalfSpace)]
        shapes += [self._add_hull(p, p.shape.vertices) for p in pieces if isinstance(p.shape, Hull)]
        shapes += [self._add_hull(p, core_vertices(p.shape)) for p in pieces if isinstance(p.shape, ROUNDED)]
        return shapes or [NO_SHAPE]

    def _add_primitives(self, pieces: list[Piece]) -> int:
        shapes = [piece.shape for piece in pieces]
        return pybullet.createCollisionShapeArray(
            shapeTypes=[PRIMITIVES[type(shape)] for shape in shapes],
            radii=[
                shape.radius if isinstance(shape, Sphere | Capsule | Cylinder) else 0.0 for shape in shapes
            ],
            lengths=[
                2 * shape.half_length if isinstance(shape, Capsule | Cylinder) else 0.0 for shape in shapes
            ],
            planeNormals=[(0.0, 0.0, 1.0) for _ in shapes],
            halfExtents=[shape.half_extents if isinstance(shape, Box) else ORIGIN for shape in shapes],
            collisionFramePositions=[piece.position for piece in pieces],
            collisionFrameOrientations=[xyzw(piece.orientation) for piece in pieces],
            **self._on,
        )

    def _add_hull(self, piece: Piece, vertices: tuple[Vector, ...]) -> int:
        return pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=vertices,
            collisionFramePosition=piece.position,
            collisionFrameOrientation=xyzw(piece.orientation),
            **self._on,
        )

    def filter_pairs(self) -> None:
        """Restrict collisions to the scenario's touching pairs."""
        touching = set(self._scenario.touching_pairs())
        for pair in combinations(range(len(self._scenario.bodies)), 2):
            if pair not in touching:
                for (a, link_a), (b, link_b) in product(*(self.colliders[body] for body in pair)):
                    pybullet.setCollisionFilterPair(a, b, link_a, link_b, 0, **self._on)


def _principal_axes(body: Body | BodyFacts) -> tuple[list[float], Sequence[float]]:
    """Principal moments of a body, and the quaternion xyzw of its principal axes in the body frame."""
    inertia = np.array(body.inertia)
    if not np.any(inertia - np.diag(np.diagonal(inertia))):
        return np.diagonal(inertia).tolist(), UNTURNED
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.linalg.det(axes)  # makes the axes right-handed
    return moments.tolist(), Rotation.from_matrix(axes).as_quat().tolist()


def _is_plain(body: Body) -> bool:
    """Whether maximal coordinates can represent a body.

    It must be a fixed body of one shape, or a simulated ball or box whose inertia is that of its shape:
    Bullet accepts no other (`changeDynamics` of a rigid body's inertia gives NaN).
    """
    if body.kind in TRACKED or surface_moves(body) or not body.pieces:
        return False
    alone = sum(isinstance(piece.shape, ALONE) for piece in body.pieces)
    if body.kind == "fixed":
        return (alone == 0 and len(body.pieces) <= MOST_PARTS) or len(body.pieces) == 1
    piece = body.pieces[0]
    centred = (piece.position, piece.orientation, body.center_of_mass) == (ORIGIN, IDENTITY, ORIGIN)
    if len(body.pieces) > 1 or not centred:
        return False
    match piece.shape:
        case Sphere(radius):
            inertia = sphere_inertia(body.mass, radius)
        case Box(half_extents):
            inertia = box_inertia(body.mass, half_extents)
        case _:
            return False
    return bool(np.allclose(inertia, body.inertia, rtol=INERTIA_TOLERANCE, atol=0.0))
