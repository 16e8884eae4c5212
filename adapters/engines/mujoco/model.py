"""Translation of a scenario to a MuJoCo spec: options, bodies, joints and pieces; for contacts see
`contacts.py`."""

import sys
from collections.abc import Callable, Sequence
from typing import Any

import mujoco
import numpy as np

from touchstone.adapters.contract import BodyFacts, Settings, Unsupported
from touchstone.adapters.engines.mujoco.joints import add_trees, inverse, turned
from touchstone.adapters.engines.mujoco.settings import FLAGS, OF_CONTACTS, SETTINGS
from touchstone.adapters.registry import DEFAULT
from touchstone.adapters.servo import Drive
from touchstone.scenarios.body_joints import spanning_trees
from touchstone.scenarios.scenario import (
    UNMOVED,
    Body,
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Piece,
    Scenario,
    Sphere,
)

HEAVY = 1e4
"""Mass of a prescribed body over that of all others together [1]. In a step a contact changes its velocity by
1e-4 of what it changes theirs; rounding of its forces disturbs bodies that are 1e7 times lighter."""


def hear_warnings(
    listener: Callable[[str], object] = lambda text: print(text, file=sys.stderr),
) -> None:
    """Give MuJoCo's warnings to a listener of this process, by default to standard error; without one MuJoCo
    writes them to MUJOCO_LOG.TXT in the current folder."""
    mujoco.set_mju_user_warning(listener)


def set_options(spec: Any, scenario: Scenario, settings: Settings) -> None:
    """Set options explicitly; those not named here keep MuJoCo's default, which the manifest publishes."""
    spec.compiler.degree = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    spec.compiler.balanceinertia = spec.compiler.fusestatic = spec.compiler.alignfree = False
    spec.compiler.boundmass = spec.compiler.boundinertia = 0.0
    spec.option.timestep = settings.dt
    spec.option.gravity = scenario.acting_gravity
    spec.option.density = spec.option.viscosity = 0.0
    spec.option.disableflags = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    values = SETTINGS.in_force(settings.profile, settings.changes)
    values["sleep"] |= settings.sleeping
    if settings.profile != DEFAULT and "friction" in scenario.effects:
        # "elliptic cones correspond more closely to physical reality ... we recommend trying the elliptic
        # cones" ("Modeling: Solver settings")
        values.setdefault("cone", mujoco.mjtCone.mjCONE_ELLIPTIC)
    for name, number in values.items():
        if name in FLAGS:
            spec.option.enableflags |= _flag(name) if number else 0
        elif name not in OF_CONTACTS:
            setattr(spec.option, name, number)


def _flag(name: str) -> int:
    """Bit of a setting in mjOption.enableflags; raises Unsupported for what an older MuJoCo lacks."""
    bit = getattr(mujoco.mjtEnableBit, FLAGS[name], None)
    if bit is None:
        raise Unsupported(f"mujoco: version {mujoco.mj_versionString()} has no flag {name}")
    return int(bit)


def add_bodies(
    spec: Any,
    scenario: Scenario,
    masses: Sequence[Body | BodyFacts],
    settings: Settings,
    posed: bool = False,
) -> dict[int, Any]:
    """Add all bodies with these mass properties; returns the spec's body per scenario index.

    Fixed, free and prescribed bodies come first, then those that joints nest in others, then each tracker's
    tree, or its links as mocap bodies.
    """
    bodies: dict[int, Any] = {}
    nested = {joint.child for joint in spanning_trees(scenario)[0]}
    for index, body in enumerate(scenario.bodies):
        if body.kind != "driven" and body.name not in nested:
            bodies[index] = spec.worldbody.add_body(name=f"{index}", pos=body.position, quat=body.orientation)
            if body.kind in ("simulated", "prescribed"):
                _add_free_joint(bodies[index])
            if body.kind == "prescribed":
                _make_heavy(bodies[index], scenario)
    add_trees(spec, scenario, bodies, settings)
    hinges = {joint.name: joint for joint in scenario.joints}
    driven = [tracker for tracker in scenario.trackers if not scenario.prescribes(tracker)]
    for link in (k for tracker in driven if posed for k in scenario.links(tracker)):
        bodies[link] = spec.worldbody.add_body(name=f"{link}", mocap=True)
    for tracker in driven if not posed else ():
        root, *children = scenario.links(tracker)
        bodies[root] = spec.worldbody.add_body(name=f"{root}", gravcomp=1.0)
        _add_free_joint(bodies[root])
        for child, joint in zip(children, (hinges[name] for name in tracker.joints)):
            parent = bodies[scenario.body_index(joint.parent)]
            bodies[child] = parent.add_body(
                name=f"{child}", pos=joint.position, quat=joint.orientation, gravcomp=1.0
            )
            bodies[child].add_joint(
                name=joint.name,
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=turned(joint.axis, inverse(joint.orientation)),
                limited=mujoco.mjtLimited.mjLIMITED_TRUE,
                range=(joint.lower, joint.upper),
            )
    for index, body in enumerate(scenario.bodies):
        if body.kind not in UNMOVED:
            _set_mass(bodies[index], masses[index])
        for k, piece in enumerate(body.pieces):
            add_piece(spec, bodies[index], piece, f"{index}.{k}")
    return bodies


def add_servos(spec: Any, joints: Sequence[str], drive: Drive) -> None:
    """Add a position actuator and damping to every hinge: stiffness (set point - q) - damping q'.

    The integrators in use treat joint damping implicitly; Euler does not for actuators' damping (MuJoCo's
    documentation, "Numerical integration").
    """
    for name, stiffness, damping in zip(joints, drive.servo_stiffness, drive.servo_damping):
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=stiffness)
        joint = spec.joint(name)
        # Older versions have the linear coefficient only.
        joint.damping = (damping, 0.0, 0.0) if np.ndim(joint.damping) else damping


def _add_free_joint(body: Any) -> None:
    body.add_joint(type=mujoco.mjtJoint.mjJNT_FREE, align=mujoco.mjtAlignFree.mjALIGNFREE_FALSE)


def prescribed_mass(scenario: Scenario) -> float:
    """Mass [kg] of a prescribed body, and its moments of inertia [kg m^2]: MuJoCo has no infinite ones."""
    return HEAVY * (sum(body.mass for body in scenario.bodies if body.kind not in UNMOVED) or 1.0)


def _make_heavy(target: Any, scenario: Scenario) -> None:
    """Give a prescribed body its mass at its origin, equal moments of inertia, and no gravity."""
    target.gravcomp, target.explicitinertial = 1.0, True
    target.mass = prescribed_mass(scenario)
    target.inertia = (target.mass,) * 3


def _set_mass(target: Any, body: Body | BodyFacts) -> None:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    target.explicitinertial = True
    target.mass, target.ipos, target.fullinertia = body.mass, body.center_of_mass, (xx, yy, zz, xy, xz, yz)


def add_piece(spec: Any, body: Any, piece: Piece, name: str) -> None:
    """Add a geom that touches nothing (contype and conaffinity 0) until contacts are added."""
    geom = body.add_geom(name=name, pos=piece.position, quat=piece.orientation, contype=0, conaffinity=0)
    motion = (*piece.surface_velocity, *piece.surface_angular_velocity)
    if any(motion):
        if not hasattr(geom, "surfacevel"):
            raise Unsupported("mujoco: no moving surfaces before 3.11")
        geom.surfacevel = motion
    kinds = mujoco.mjtGeom
    match piece.shape:
        case Sphere(radius):
            geom.type, geom.size = kinds.mjGEOM_SPHERE, (radius, 0.0, 0.0)
        case Box(half_extents):
            geom.type, geom.size = kinds.mjGEOM_BOX, half_extents
        case Capsule(radius, half_length):
            geom.type, geom.size = kinds.mjGEOM_CAPSULE, (radius, half_length, 0.0)
        case Cylinder(radius, half_length):
            geom.type, geom.size = kinds.mjGEOM_CYLINDER, (radius, half_length, 0.0)
        case Ellipsoid(half_axes):
            geom.type, geom.size = kinds.mjGEOM_ELLIPSOID, half_axes
        case Hull(vertices):
            # MuJoCo stores vertices in single precision, in the mesh's inertial frame
            mesh = spec.add_mesh(name=geom.name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
            mesh.uservert = np.ravel(vertices)
            geom.type, geom.meshname = kinds.mjGEOM_MESH, mesh.name
        case HalfSpace():
            geom.type, geom.size = kinds.mjGEOM_PLANE, (0.0, 0.0, 1.0)
        case _:
            raise Unsupported(f"mujoco: no shape {type(piece.shape).__name__}")
