"""A scenario in SAPIEN's Scene on a PhysxCpuSystem: entities with bodies, collision shapes, materials."""

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import (
    FRICTION_IMPULSES,
    NOT_REPORTED,
    Array,
    BodyFacts,
    Scalar,
    Settings,
    Unsupported,
)
from touchstone.adapters.engines.physx.settings import SETTINGS
from touchstone.adapters.material_combine import frictions, mean_factors, restitutions
from touchstone.adapters.posed_drive import Posed
from touchstone.adapters.servo import Drive
from touchstone.scenarios import scenario as shapes
from touchstone.scenarios.scenario import UNMOVED, Body, Piece, Scenario

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # the renderer's, which is not used
    import sapien
from sapien import physx

X_TO_Z = sapien.Pose((0.0, 0.0, 0.0), (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0))
"""Turns the x axis, along which PhysX's capsules, cylinders and normals of planes lie, to the z axis, along
which ours do."""
OF_SCENE = (
    *("bounce_threshold", "enable_pcm", "enable_ccd"),
    *("enable_friction_every_iteration", "enable_enhanced_determinism"),
)
OF_SHAPES = ("contact_offset", "rest_offset")
OF_BODIES = (
    *("solver_position_iterations", "solver_velocity_iterations"),
    *("angular_damping", "max_angular_velocity"),
)
"""Settings of the scene, of shapes and of bodies, as SAPIEN names them."""
SLEEP_THRESHOLD = 0.005
"""SAPIEN's default: kinetic energy over mass below which a body may sleep [J/kg]."""

UNREADABLE: dict[str, Scalar] = {
    # Without getter in SAPIEN; from its physx_engine.h, and PhysX's PxSceneDesc.h for these tolerances.
    "tolerance_length [m]": 0.1,
    "tolerance_speed [m/s]": 0.2,
    "friction_correlation_distance [m]": 0.0025,
    "combine_mode": "mean",
    FRICTION_IMPULSES: NOT_REPORTED,
}


def scene_of(settings: Settings, gravity: tuple[float, ...]) -> tuple[Any, Any]:
    """An empty scene on its PhysX system, with a profile's settings."""
    values = SETTINGS.in_force(settings.profile, settings.changes)
    given = {name: type(getattr(physx.PhysxSceneConfig(), name))(values[name]) for name in OF_SCENE}
    given |= {"enable_tgs": bool(values["solver"]), "cpu_workers": values["cpu_workers"]}
    physx.set_scene_config(gravity=gravity, **given)
    system = physx.PhysxCpuSystem()
    system.timestep = settings.dt
    return sapien.Scene([system]), system


class Pieces:
    """Adds the pieces of bodies to components, with their materials and a profile's settings."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        self._bodies = scenario.bodies
        self._friction = mean_factors("physx", "friction", scenario, frictions(scenario), signed=True)
        self._restitution = mean_factors("physx", "restitution", scenario, restitutions(scenario))
        self._values = SETTINGS.in_force(settings.profile, settings.changes)

    def attach(self, component: Any, k: int, groups: Sequence[int] = ()) -> None:
        """Add the pieces of a body, in SAPIEN's collision groups if some are given."""
        material = physx.PhysxMaterial(self._friction[k], self._friction[k], self._restitution[k])
        for piece in self._bodies[k].pieces:
            shape = _shape(piece, material)
            for name in OF_SHAPES:
                setattr(shape, name, self._values[name])
            if groups:
                shape.set_collision_groups(list(groups))
            component.attach(shape)


def add_bodies(
    scene: Any,
    scenario: Scenario,
    settings: Settings,
    posed: Mapping[int, Posed],
    drives: Sequence[Drive],
    pieces: Pieces,
) -> dict[int, tuple[Any, Any]]:
    """Add all bodies but those with hinges: those of `posed` as kinematic ones at the start of their motion,
    and the roots of `drives` with their ballast, without gravity; SAPIEN's entity and component of each."""
    values = SETTINGS.in_force(settings.profile, settings.changes)
    roots = {drive.links[0]: drive for drive in drives if len(drive.links) == 1}
    added = {}
    for k, body in enumerate(scenario.bodies):
        if body.kind == "driven" and k not in posed and k not in roots:
            continue
        fixed = body.kind in UNMOVED and k not in posed
        component = physx.PhysxRigidStaticComponent() if fixed else physx.PhysxRigidDynamicComponent()
        pieces.attach(component, k)
        entity = sapien.Entity()
        entity.add_component(component)
        if k in posed:
            link = posed[k].links.index(k)
            component.set_kinematic(True)
            entity.set_pose(pose(posed[k].place[link, 0], posed[k].orientation[link, 0]))
        elif k in roots:
            entity.set_pose(pose(roots[k].start_position[0], roots[k].start_orientation[0]))
        else:
            entity.set_pose(pose(body.position, body.orientation))
        scene.add_entity(entity)
        if k in roots:
            component.set_disable_gravity(True)
            _set_motion(component, roots[k].root, roots[k].central_start(), values, 0.0)
        elif not fixed and k not in posed:
            moved = np.array(body.linear_velocity), np.array(body.angular_velocity)
            _set_motion(component, body, moved, values, SLEEP_THRESHOLD if settings.sleeping else 0.0)
        added[k] = entity, component
    return added


def pose(position: Any, orientation: Any) -> Any:
    """SAPIEN's pose of a position [m] and a quaternion wxyz."""
    return sapien.Pose(tuple(map(float, position)), tuple(map(float, orientation)))


def _set_motion(
    component: Any,
    body: Body | BodyFacts,
    moved: tuple[Array, Array],
    values: Mapping[str, Any],
    threshold: float,
) -> None:
    """Mass, inertia, velocities and settings of a body that PhysX moves."""
    set_mass(component, body)
    component.set_linear_velocity(moved[0])
    component.set_angular_velocity(moved[1])
    component.set_sleep_threshold(threshold)
    for name in OF_BODIES:
        setattr(component, name, values[name])


def set_mass(component: Any, body: Body | BodyFacts) -> None:
    """Mass, mass centre and inertia of a body."""
    moments, axes = np.linalg.eigh(np.array(body.inertia))
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    turn = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    component.set_cmass_local_pose(pose(body.center_of_mass, turn))
    component.set_mass(body.mass)
    component.set_inertia(tuple(moments))


def _shape(piece: Piece, material: Any) -> Any:
    place = pose(piece.position, piece.orientation)
    match piece.shape:
        case shapes.Sphere(radius):
            shape = physx.PhysxCollisionShapeSphere(radius, material)
        case shapes.Box(half):
            shape = physx.PhysxCollisionShapeBox(half, material)
        case shapes.Capsule(radius, half_length):
            shape, place = physx.PhysxCollisionShapeCapsule(radius, half_length, material), place * X_TO_Z
        case shapes.Cylinder(radius, half_length):
            shape, place = physx.PhysxCollisionShapeCylinder(radius, half_length, material), place * X_TO_Z
        case shapes.HalfSpace():
            shape, place = physx.PhysxCollisionShapePlane(material), place * X_TO_Z
        case shapes.Hull(vertices):
            corners = np.array(vertices, dtype=np.float32)
            shape = physx.PhysxCollisionShapeConvexMesh(corners, (1.0, 1.0, 1.0), material)
        case _:
            raise Unsupported(f"physx: no shape {type(piece.shape).__name__}")
    shape.set_local_pose(place)
    return shape


def mass_facts(component: Any) -> BodyFacts:
    """Mass, mass centre and inertia as read from one of SAPIEN's bodies."""
    frame = component.get_cmass_local_pose()
    axes = Rotation.from_quat(frame.q, scalar_first=True).as_matrix()
    return BodyFacts.of(component.mass, frame.p, axes @ np.diag(component.inertia) @ axes.T)


def facts_of(system: Any, components: list[Any]) -> dict[str, Scalar]:
    """Settings as read back from a system and its first moving body and first shape."""
    config = system.config
    facts: dict[str, Scalar] = {
        "physx": physx.version(),
        "solver": "TGS" if config.enable_tgs else "PGS",
        **{name: getattr(config, name) for name in OF_SCENE},
        "gravity": str(config.gravity.tolist()),
        **UNREADABLE,
    }
    moving = [one for one in components if isinstance(one, physx.PhysxRigidDynamicComponent)]
    for one in [each for each in moving if not each.kinematic][:1]:
        names = *OF_BODIES, "linear_damping", "sleep_threshold", "max_linear_velocity"
        facts |= {name: getattr(one, name) for name in (*names, "max_depenetration_velocity")}
    shaped = [shape for one in components for shape in one.collision_shapes]
    for shape in shaped[:1]:
        facts |= {name: getattr(shape, name) for name in OF_SHAPES}
    return facts | {"collision_shapes": len(shaped)}
