"""Translation of a scenario to DART skeletons (bodies, joints, shapes), and choice of a collision detector.

Hulls: dartpy 6.20 binds no ConvexMeshShape, and a MeshShape comes from a file only. The vertices pass through
a temporary OBJ file, deleted at once, and end in single precision. Every detector treats a MeshShape as a
triangle soup, a shell without an interior.

Detector: DART's default, FCL, except in four cases. Two use DART's Bullet detector. First, scenes in which a
sphere can meet a hull, or a capsule anything. FCL 0.7 returns the depth of a sphere against a triangle with
the wrong sign and DART drops contacts of negative depth, so a sphere passes through a hull. DART replaces a
capsule by a ball of 10 cm and only prints an error. The Bullet detector is exact for these shapes, but
enlarges ellipsoids by 1 cm on all sides; a scene that needs both is Unsupported. Second, except in `default`,
scenes in which only spheres, boxes, capsules and cones meet, as DART's maintainers advise (dart issue 1065:
"change the collision detector to BulletCollisionDetector if the collision shapes are all primitive shapes";
issue 1183: it returns up to four contacts per pair, FCL all triangles'). Third, except in `default`,
scenes of primitives with cylinders or half-spaces use DART's ODE detector: a disc of 5 cm that stands on its
cap sinks by 13 mm with FCL, one that slides by 5 mm with Bullet's; a box of 10 cm on a plane falls through it
with FCL, which returns one point, and sinks by 14 mm in 1 s with Bullet's. ODE has no cones: scenes with
these use Bullet's. Fourth, in `recommended`, `equal-step` and `sleeping`, scenes in which only spheres and
boxes meet use DART's own detector, which has these two shapes alone (dart pull request 156): stacks that
explode with Bullet's are stable with it (issue 867), and it is faster than FCL (issue 961). A box that slides
overlaps by 2e-8 m with it, and by 3.4 mm with Bullet's.
"""

import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import dartpy
import numpy as np

from touchstone.adapters.contract import BodyFacts, Scalar, Unsupported
from touchstone.adapters.engines.entry import ACCURATE, DEFAULT
from touchstone.adapters.servo import Drive
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Joint,
    Piece,
    Scenario,
    Shape,
    Sphere,
)
from touchstone.scenarios.solids import outward_faces

ADVICE = "only primitives meet (maintainers' advice, dart issue 1065)"
CAPS = "only primitives meet, and FCL and DART's Bullet detector let cylinders, and bodies on planes, sink"
PRIMITIVES, SINKING = {Sphere, Box, Capsule, Cylinder, HalfSpace}, {Cylinder, HalfSpace}
"""Shapes that DART's ODE detector has, and those for which it is chosen."""
OWN, OWN_SHAPES = "only spheres and boxes meet (dart issue 867)", {Sphere, Box}
"""Shapes that DART's own detector has, and why it is chosen."""
OTHERS = (DEFAULT, ACCURATE)
"""Profiles without DART's own detector; the known failings of `accurate` are not counted with it."""
DETECTORS = {
    "fcl": dartpy.collision.FCLCollisionDetector,
    "bullet": dartpy.collision.BulletCollisionDetector,
    "dart": dartpy.collision.DARTCollisionDetector,
    "ode": dartpy.collision.OdeCollisionDetector,
}
SOLVERS = {
    "dantzig": lambda world_solver: world_solver.getBoxedLcpSolver(),
    "pgs": lambda world_solver: world_solver.getSecondaryBoxedLcpSolver(),
    "nsgs": lambda world_solver: dartpy.constraint.NsgsFrictionSolver(),
    "fbf": lambda world_solver: dartpy.constraint.FbfFrictionSolver(),
}
"""Solvers of a new world's constraint solver; dartpy has no constructors of Dantzig's and PGS."""
OPTION_FIELDS = {
    "pgs": ("mMaxIteration", "mDeltaXThreshold"),
    "nsgs": ("maxSweeps", "tolerance"),
    "fbf": ("maxOuterIterations", "tolerance"),
}
"""Fields of the iterative solvers' options: largest number of sweeps, tolerance."""
HULLS_KEPT = 1024
"""Hulls whose triangles a process keeps."""
ROOT_DOFS = 6
"""Number of coordinates of a free joint; those of the hinges follow in the tracker's order."""


def detector_of(scenario: Scenario, profile: str) -> Any:
    """FCL; Bullet if a sphere can meet a hull or a capsule anything, or if only primitives meet; ODE if
    cylinders or half-spaces are among these, and no cones; DART's own if only spheres and boxes meet."""
    name, reason = detector_choice(scenario, profile)
    if name == "bullet" and any(Ellipsoid in a | b for a, b in _meeting_shapes(scenario)):
        raise Unsupported(f"dart: {reason}, and no detector has both that and true ellipsoids")
    return DETECTORS[name]()


def friction_solver(world_solver: Any, name: str, iterations: int | None, tolerance: float | None) -> Any:
    """A solver of contacts of a new world, with its options; those that are None keep DART's defaults.

    Raises:
        Unsupported: Dantzig's solver is direct and takes neither.
    """
    solver = SOLVERS[name](world_solver)
    if name == "dantzig":
        if iterations is not None or tolerance is not None:
            raise Unsupported("dart: iterations and tolerance need an iterative solver: pgs, nsgs or fbf")
        return solver
    option = dartpy.constraint.PgsBoxedLcpSolverOption() if name == "pgs" else solver.getOptions()
    count, size = OPTION_FIELDS[name]
    if iterations is not None:
        setattr(option, count, iterations)
    if tolerance is not None:
        setattr(option, size, tolerance)
    solver.setOption(option) if name == "pgs" else solver.setOptions(option)
    return solver


def solver_options(solver: Any) -> dict[str, Scalar]:
    """Options of a solver, read back; none of Dantzig's, and dartpy has no getter of those of PGS."""
    if not hasattr(solver, "getOptions"):
        return {}
    found, fields = solver.getOptions(), OPTION_FIELDS["fbf" if "Fbf" in solver.getType() else "nsgs"]
    return {f"lcp_{name}": getattr(found, field) for name, field in zip(("iterations", "tolerance"), fields)}


def _meeting_shapes(scenario: Scenario) -> list[tuple[set[type], set[type]]]:
    """Shape types of the two bodies of each touching pair."""
    kinds = [{type(piece.shape) for piece in body.pieces} for body in scenario.bodies]
    return [(kinds[a], kinds[b]) for a, b in scenario.touching_pairs()]


def fault_of_fcl(scenario: Scenario) -> str:
    """What DART's default detector computes wrongly in a scene, or ""."""
    pairs = _meeting_shapes(scenario)
    if any(Capsule in a | b for a, b in pairs):
        return "capsules meet"
    spheres_on_hulls = any((Sphere in a and Hull in b) or (Hull in a and Sphere in b) for a, b in pairs)
    return "spheres meet hulls" if spheres_on_hulls else ""


def detector_choice(scenario: Scenario, profile: str) -> tuple[str, str]:
    """Name of the detector that a scene uses, and why."""
    meeting = [a | b for a, b in _meeting_shapes(scenario)]
    plain = profile != DEFAULT and all(shapes <= PRIMITIVES | {Cone} for shapes in meeting)
    if (
        plain
        and all(shapes <= PRIMITIVES for shapes in meeting)
        and any(shapes & SINKING for shapes in meeting)
    ):
        return "ode", CAPS
    if profile not in OTHERS and meeting and all(shapes <= OWN_SHAPES for shapes in meeting):
        return "dart", OWN
    fault = fault_of_fcl(scenario)
    if fault:
        return "bullet", fault
    return ("bullet", ADVICE) if plain else ("fcl", "DART's default")


def isometry(position: Any, orientation: Any) -> Any:
    """Pose from a position [m] and a quaternion wxyz."""
    return dartpy.math.Isometry3(dartpy.math.Quaternion(*orientation), np.array(position, dtype=float))


def set_mass(node: Any, body: Body | BodyFacts) -> None:
    """Set our mass properties instead of the shapes'."""
    center = np.array(body.center_of_mass)
    node.setInertia(dartpy.dynamics.Inertia(body.mass, center, np.array(body.inertia)))


def body_facts(node: Any) -> BodyFacts:
    """Mass properties of a node."""
    return BodyFacts.of(node.getMass(), node.getLocalCOM(), node.getInertia().getMoment())


def add_body(world: Any, body: Body) -> Any:
    """Add a fixed or free body as its own skeleton."""
    skeleton = dartpy.dynamics.Skeleton(body.name)
    if body.kind == "fixed":
        joint, node = skeleton.createWeldJointAndBodyNodePair()
        joint.setTransformFromParentBodyNode(isometry(body.position, body.orientation))
    else:
        node = add_free(skeleton, body)
    world.addSkeleton(skeleton)
    return node


def add_free(skeleton: Any, body: Body) -> Any:
    """Add a free body to a skeleton."""
    joint, node = skeleton.createFreeJointAndBodyNodePair()
    pose = isometry(body.position, body.orientation)
    joint.setTransform(pose)
    omega = np.array(body.angular_velocity)
    arm = pose.rotation() @ np.array(body.center_of_mass)
    joint.setAngularVelocity(omega)
    joint.setLinearVelocity(np.array(body.linear_velocity) - np.cross(omega, arm))
    return node


def add_kinematic(world: Any, body: Body) -> Any:
    """Add a driven link or a prescribed body as its own skeleton with prescribed velocity."""
    skeleton = dartpy.dynamics.Skeleton(body.name)
    joint, node = skeleton.createFreeJointAndBodyNodePair()
    joint.setActuatorType(dartpy.dynamics.ActuatorType.VELOCITY)
    node.setGravityMode(False)
    world.addSkeleton(skeleton)
    return node


def add_driven(world: Any, scenario: Scenario, drive: Drive, hinges: list[Joint]) -> dict[int, Any]:
    """Add a driven body as one skeleton without gravity, posed at time 0; returns its nodes by scenario
    index."""
    skeleton = dartpy.dynamics.Skeleton(scenario.bodies[drive.links[0]].name)
    free, root = skeleton.createFreeJointAndBodyNodePair()
    free.setTransform(isometry(drive.start_position[0], drive.start_orientation[0]))
    free.setAngularVelocity(drive.start.angular_velocity[0])
    free.setLinearVelocity(drive.start.linear_velocity[0])
    nodes = {drive.links[0]: root}
    for link, hinge in zip(drive.links[1:], hinges):
        parent = nodes[scenario.body_index(hinge.parent)]
        joint, nodes[link] = skeleton.createRevoluteJointAndBodyNodePair(parent)
        # pose of the child = position, rotation(axis, q), orientation
        joint.setTransformFromParentBodyNode(isometry(hinge.position, (1.0, 0.0, 0.0, 0.0)))
        joint.setTransformFromChildBodyNode(isometry((0.0, 0.0, 0.0), hinge.orientation).inverse())
        joint.setAxis(np.array(hinge.axis))
        joint.setActuatorType(dartpy.dynamics.ActuatorType.FORCE)
        joint.setPositionLowerLimit(0, hinge.lower)
        joint.setPositionUpperLimit(0, hinge.upper)
        joint.setLimitEnforcement(True)
    dofs = range(ROOT_DOFS, ROOT_DOFS + len(hinges))
    skeleton.setPositions(dofs, drive.start.angle[0])
    skeleton.setVelocities(dofs, drive.start.rate[0])
    for node in nodes.values():
        node.setGravityMode(False)
    if "self_collision" in scenario.effects:
        skeleton.enableSelfCollisionCheck()
    world.addSkeleton(skeleton)
    return nodes


def add_servos(skeleton: Any, drive: Drive) -> None:
    """Add a spring and a damper to every hinge, which DART integrates implicitly (Tan, Liu & Turk 2011,
    "Stable proportional-derivative controllers", as in DART's tutorials); the rest position is the set
    point."""
    for number, (stiffness, damping) in enumerate(zip(drive.servo_stiffness, drive.servo_damping), start=1):
        skeleton.getJoint(number).setSpringStiffness(0, stiffness)
        skeleton.getJoint(number).setDampingCoefficient(0, damping)


def add_piece(node: Any, piece: Piece, name: str, restitution: float, friction: float) -> None:
    shape = node.createShapeNode(_shape(piece.shape), name)
    shape.setRelativeTransform(isometry(piece.position, piece.orientation))
    shape.createCollisionAspect()
    shape.createDynamicsAspect()
    # Sets both friction directions.
    shape.getDynamicsAspect().setFrictionCoeff(friction)
    shape.getDynamicsAspect().setRestitutionCoeff(restitution)


def _shape(shape: Shape) -> Any:
    """DART's shape; a hull is a MeshShape of its outward triangles."""
    kinds = dartpy.dynamics
    match shape:
        case Sphere(radius):
            return kinds.SphereShape(radius)
        case Box(half_extents):
            return kinds.BoxShape(2 * np.array(half_extents))
        case Capsule(radius, half_length):
            return kinds.CapsuleShape(radius, 2 * half_length)
        case Cylinder(radius, half_length):
            return kinds.CylinderShape(radius, 2 * half_length)
        case Ellipsoid(half_axes):
            return kinds.EllipsoidShape(2 * np.array(half_axes))
        case Cone(radius, half_length):
            return kinds.ConeShape(radius, 2 * half_length)
        case HalfSpace():
            return kinds.PlaneShape(np.array((0.0, 0.0, 1.0)), 0.0)
        case Hull():
            return mesh_shape(_outward_triangles(shape))
    raise Unsupported(f"dart: no shape {type(shape).__name__}")


def mesh_shape(obj: str) -> Any:
    """A MeshShape of an OBJ file's text, through a file that is deleted at once."""
    with tempfile.NamedTemporaryFile("w", suffix=".obj", encoding="utf-8") as file:
        file.write(obj)
        file.flush()
        mesh = f'<mesh filename="{Path(file.name).as_uri()}"/>'
        link = f'<link name="l"><collision><geometry>{mesh}</geometry></collision></link>'
        urdf = f'<robot name="r">{link}</robot>'
        loaded = dartpy.utils.DartLoader().parseSkeletonString(urdf, dartpy.common.Uri(""))
        return loaded.getBodyNode(0).getShapeNode(0).getShape()


@lru_cache(HULLS_KEPT)
def _outward_triangles(shape: Hull) -> str:
    """A hull's triangles as an OBJ file, each counter-clockwise seen from outside."""
    lines = ["v {!r} {!r} {!r}".format(*vertex) for vertex in shape.vertices]
    lines += ["f {} {} {}".format(*(face + 1)) for face in outward_faces(np.array(shape.vertices))]
    return "\n".join(lines) + "\n"
