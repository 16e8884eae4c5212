"""A scenario in Rapier's PhysicsWorld: bodies, colliders, their coefficients, integration parameters."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rapier3d
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
from touchstone.adapters.engines.rapier.settings import SETTINGS
from touchstone.adapters.material_combine import (
    Pairs,
    frictions,
    maximum_factors,
    mean_factors,
    minimum_factors,
    product_factors,
    restitutions,
)
from touchstone.adapters.posed_drive import Posed
from touchstone.adapters.servo import Drive
from touchstone.scenarios import scenario as shapes
from touchstone.scenarios.scenario import ORIGIN, UNMOVED, Body, Piece, Scenario

Rule = tuple[Any, Callable[..., list[float]], Callable[[float, float], float]]
RULES: tuple[Rule, ...] = (
    (rapier3d.CoefficientCombineRule.AVERAGE, mean_factors, lambda f, g: (f + g) / 2),
    (rapier3d.CoefficientCombineRule.MULTIPLY, product_factors, lambda f, g: f * g),
    (rapier3d.CoefficientCombineRule.MIN, minimum_factors, min),
    (rapier3d.CoefficientCombineRule.MAX, maximum_factors, max),
)
"""Rapier's combine rules, its default first: rule, factors per body for it, what it makes of two."""
LINEAR, ANGULAR = ("LIN_X", "LIN_Y", "LIN_Z"), ("ANG_X", "ANG_Y", "ANG_Z")
"""Axes of a joint, as Rapier calls them."""
UNTURNED = (1.0, 0.0, 0.0, 0.0)
Y_TO_Z = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)
"""Turns the y axis, along which Rapier's cylinders and cones lie, to the z axis, along which ours do."""
FRICTION_MODELS = (rapier3d.FrictionModel.SIMPLIFIED, rapier3d.FrictionModel.COULOMB)
SPRINGS = {
    "contact_softness": ("contact_frequency", "contact_damping_ratio"),
    "static_contact_softness": ("static_contact_frequency", "static_contact_damping_ratio"),
}
"""Springs of contacts, and the settings of their frequency and damping ratio."""
OF_BODIES = ("ccd_enabled", "allow_fast_rotation", "gyroscopic_forces")
"""Settings of each body; all others, without those of SPRINGS, are of the world."""
OF_WORLD = tuple(set(SETTINGS) - {"friction_model", "num_threads", *OF_BODIES, *sum(SPRINGS.values(), ())})


def rule_of(kind: str, scenario: Scenario, wanted: Pairs) -> tuple[Rule, list[float]]:
    """The first combine rule by which factors per body give each pair its coefficient, and the factors.

    Raises Unsupported with the pairs that Rapier's default rule misses if there is none.
    """
    refused: list[Unsupported] = []
    for rule in RULES:
        try:
            return rule, rule[1]("rapier", kind, scenario, wanted)
        except Unsupported as error:
            refused.append(error)
    raise refused[0]


def world_of(settings: Settings, gravity: tuple[float, ...]) -> Any:
    """An empty world with the settings of a profile and its changes."""
    world = rapier3d.PhysicsWorld(gravity=gravity)
    values = SETTINGS.in_force(settings.profile, settings.changes)
    world.set_num_threads(values["num_threads"])
    parameters = world.integration_parameters
    parameters.dt = settings.dt
    parameters.friction_model = FRICTION_MODELS[values["friction_model"]]
    for name in OF_WORLD:
        kind = type(getattr(parameters, name))
        setattr(parameters, name, kind(values[name]))
    for name, (frequency, ratio) in SPRINGS.items():
        setattr(parameters, name, rapier3d.SpringCoefficients(values[frequency], values[ratio]))
    return world


def add_bodies(
    world: Any,
    scenario: Scenario,
    settings: Settings,
    posed: Mapping[int, Posed],
    groups: Mapping[int, Any],
) -> tuple[list[Any], tuple[Rule, Rule]]:
    """Add all bodies, those of `posed` as kinematic ones at the start of their motion, those of `groups` in
    these collision groups.

    Returns their handles, and the combine rules of friction and restitution.
    """
    friction, mu = rule_of("friction", scenario, frictions(scenario))
    restitution, e = rule_of("restitution", scenario, restitutions(scenario))
    handles = []
    for k, body in enumerate(scenario.bodies):
        builder = _builder(body, settings, k in posed)
        place, turn = body.position, body.orientation
        if k in posed:
            link = posed[k].links.index(k)
            place, turn = posed[k].place[link, 0], posed[k].orientation[link, 0]
        parts = [
            _collider(piece)
            .density(0.0)
            .friction(mu[k])
            .friction_combine_rule(friction[0])
            .restitution(e[k])
            .restitution_combine_rule(restitution[0])
            .position(_place(piece))
            .user_data(k)
            .collision_groups(groups.get(k) or rapier3d.InteractionGroups.all())
            for piece in body.pieces
        ]
        handles.append(world.add_body(builder.position(pose(place, turn)), colliders=parts))
        world.rigid_bodies[handles[k]].recompute_mass_properties_from_colliders(world.colliders)
    return handles, (friction, restitution)


def add_coupling(world: Any, drive: Drive, handle: Any) -> tuple[Any, Any]:
    """Put the root of a driver at its start, without gravity, and tie it by motors to two kinematic bodies,
    which are returned: one has the position of its tracker and does not turn, the other its orientation.

    With one for both, the motors would damp the motion relative to the turning tracker.
    """
    root, place, turn = world.rigid_bodies[handle], drive.start_position[0], drive.start_orientation[0]
    root.position = pose(place, turn)
    root.gravity_scale = 0.0
    velocity, omega = drive.central_start()
    root.linvel, root.angvel = tuple(velocity.tolist()), tuple(omega.tolist())
    moments, axes = np.linalg.eigh(drive.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    linear = [(drive.stiffness, drive.damping)] * 3
    angular = [(moment * drive.frequency**2, 2 * moment * drive.frequency) for moment in moments.tolist()]
    principal = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    given = ((LINEAR, linear, place, UNTURNED, UNTURNED), (ANGULAR, angular, ORIGIN, turn, principal))
    anchors = []
    for names, gains, position, orientation, frame in given:
        own = pose(ORIGIN, frame)
        joint = (
            rapier3d.GenericJoint.builder(rapier3d.JointAxesMask.empty()).local_frame1(own).local_frame2(own)
        )
        for name, (stiffness, damping) in zip(names, gains):
            axis = getattr(rapier3d.JointAxis, name)
            joint = joint.motor(axis, 0.0, 0.0, stiffness, damping)
            joint = joint.motor_model(axis, rapier3d.MotorModel.FORCE_BASED)
        one = rapier3d.RigidBody.kinematic_position_based().position(pose(position, orientation))
        anchors.append(world.add_body(one))
        world.impulse_joints.insert(anchors[-1], handle, joint.build())
    return world.rigid_bodies[anchors[0]], world.rigid_bodies[anchors[1]]


def pose(position: Any, orientation: Any) -> Any:
    """Rapier's pose of a position [m] and a quaternion wxyz."""
    turn = rapier3d.Rotation3.from_quaternion(*map(float, orientation))
    return rapier3d.Isometry3(tuple(map(float, position)), turn)


def wxyz(turn: Any) -> tuple[float, float, float, float]:
    """Quaternion of one of Rapier's rotations, which it gives as xyzw."""
    x, y, z, w = turn.to_tuple()
    return w, x, y, z


def _builder(body: Body, settings: Settings, posed: bool) -> Any:
    if posed:
        builder = rapier3d.RigidBody.kinematic_position_based()
    elif body.kind in UNMOVED:
        builder = rapier3d.RigidBody.fixed()
    else:
        values = SETTINGS.in_force(settings.profile, settings.changes)
        builder = rapier3d.RigidBody.dynamic().additional_mass_properties(mass_of(body))
        builder = builder.linvel(tuple(body.linear_velocity)).angvel(tuple(body.angular_velocity))
        for name in OF_BODIES:
            builder = getattr(builder, name)(bool(values[name]))
    return builder.can_sleep(settings.sleeping)


def mass_of(body: Body) -> Any:
    """Mass, mass centre and inertia; Rapier has the principal moments and their axes."""
    moments, axes = np.linalg.eigh(np.array(body.inertia))
    if np.linalg.det(axes) < 0:
        axes[:, 0] = -axes[:, 0]
    turn = rapier3d.Rotation3.from_quaternion(*Rotation.from_matrix(axes).as_quat(scalar_first=True))
    return rapier3d.MassProperties(tuple(body.center_of_mass), body.mass, tuple(moments), turn)


def mass_facts(body: Any) -> BodyFacts:
    """Mass, mass centre and inertia as read from one of Rapier's bodies."""
    given = body.mass_properties
    axes = Rotation.from_quat(given.principal_inertia_local_frame.to_tuple()).as_matrix()
    inertia = axes @ np.diag(given.principal_inertia.to_tuple()) @ axes.T
    return BodyFacts.of(given.mass, given.local_com.to_tuple(), inertia)


def _place(piece: Piece) -> Any:
    own = pose(piece.position, piece.orientation)
    return own * pose(ORIGIN, Y_TO_Z) if isinstance(piece.shape, shapes.Cylinder | shapes.Cone) else own


def _collider(piece: Piece) -> Any:
    make = rapier3d.Collider
    match piece.shape:
        case shapes.Sphere(radius):
            return make.ball(radius)
        case shapes.Box(half):
            return make.cuboid(*half)
        case shapes.Capsule(radius, half_length):
            return make.capsule_z(half_length, radius)
        case shapes.Hull(vertices):
            return make.convex_hull(np.array(vertices, dtype=np.float32))
        case shapes.Cylinder(radius, half_length):
            return make.cylinder(half_length, radius)
        case shapes.Cone(radius, half_length):
            return make.cone(half_length, radius)
        case shapes.RoundedBox(half, radius):
            return make.round_cuboid(*half, radius)
        case shapes.RoundedHull(vertices, radius):
            return make.round_convex_hull(np.array(vertices, dtype=np.float32), radius)
        case shapes.HalfSpace():
            return make.halfspace((0.0, 0.0, 1.0))
    raise Unsupported(f"rapier: no shape {type(piece.shape).__name__}")


def facts_of(world: Any, settings: Settings, rules: Any) -> dict[str, Scalar]:
    """Settings as read back from a world."""
    parameters, build = world.integration_parameters, rapier3d.build_features()
    values = SETTINGS.in_force(settings.profile, settings.changes)
    facts: dict[str, Scalar] = {name: getattr(parameters, name) for name in sorted(OF_WORLD)}
    for name, (frequency, ratio) in SPRINGS.items():
        spring = getattr(parameters, name)
        facts |= {f"{frequency} [Hz]": spring.natural_frequency, ratio: spring.damping_ratio}
    if parameters.friction_model == rapier3d.FrictionModel.SIMPLIFIED:
        facts[FRICTION_IMPULSES] = NOT_REPORTED
    return facts | {
        "friction_model": str(parameters.friction_model),
        "friction_rule": str(rules[0][0]),
        "restitution_rule": str(rules[1][0]),
        "normalized_max_linear_velocity [m/s]": parameters.normalized_max_linear_velocity,
        **{f"{name} (as set)": bool(values[name]) for name in OF_BODIES},
        "gravity": str(np.array(world.gravity.to_tuple()).tolist()),
        "threads": world.num_threads,
        "build": str(build.profile),
        "sleeping": settings.sleeping,
        "collision_shapes": len(world.colliders),
    }


def tangents_of(direction: Array) -> tuple[Array, Array]:
    """Rapier's axes of friction (n, 3) to directions of normal impulses on body 1 (n, 3): the basis of Duff
    et al. (2017), which depends on the direction alone."""
    x, y, z = direction.T
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    first = np.stack([x * y * a, sign + y * y * a, -y], axis=1)
    return first, np.cross(direction, first)
