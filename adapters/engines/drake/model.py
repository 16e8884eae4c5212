"""A scenario as a Drake plant: bodies, geometries, friction, collision filters, hinges and their servos."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    Capsule,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    DefaultProximityProperties,
    Ellipsoid,
    GeometrySet,
    ProximityProperties,
    SceneGraphConfig,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import ContactModel, CoulombFriction, DiscreteContactApproximation
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, BodyFacts, Scalar, Settings, Unsupported
from touchstone.adapters.engines.drake.settings import SETTINGS
from touchstone.adapters.material_combine import MIX_TOLERANCE, Pairs, restitutions
from touchstone.adapters.servo import Drive
from touchstone.scenarios import scenario as shapes
from touchstone.scenarios.scenario import Body, Joint, Piece, Scenario, Shape

RESTITUTION_MAX = 0.3
"""Restitution up to which impacts are played, all of them inelastic [1]: Drake has no coefficient of
restitution. That of the materials of Table 1; a body then keeps 9 % of the energy of its approach. Above it a
scene is about bounces, and is refused."""
Geometries = dict[int, list[Any]]
"""Ids of the geometries per body."""
Hydroelastic = tuple[float, float] | None
"""Length of edges [m] and modulus [Pa] of pressure fields; None: contacts are points."""
APPROXIMATIONS = {
    "tamsi": DiscreteContactApproximation.kTamsi,
    "sap": DiscreteContactApproximation.kSap,
    "similar": DiscreteContactApproximation.kSimilar,
    "lagged": DiscreteContactApproximation.kLagged,
}
MODELS = {"point": ContactModel.kPoint, "hydroelastic": ContactModel.kHydroelasticWithFallback}
SMOOTH = (shapes.Sphere, shapes.Capsule, shapes.Ellipsoid)
"""Shapes that meet a convex one in a point: they get no pressure field, so that their contacts are points."""
OF_GEOMETRIES = (
    *("hydroelastic_modulus", "resolution_hint"),
    *("point_stiffness", "hunt_crossley_dissipation", "relaxation_time"),
)
"""Settings that are default properties of geometries."""


def word_of(settings: Settings, name: str) -> str:
    """Value of a setting, as text, in a profile with its changes."""
    changed = dict(text.split("=") for text in settings.changes)
    return changed.get(name, SETTINGS[name].profiles[SETTINGS.column(settings.profile)])


def hydroelastic_of(settings: Settings) -> Hydroelastic:
    """Pressure fields of a profile and its changes."""
    if word_of(settings, "contact_model") == "point":
        return None
    return float(word_of(settings, "resolution_hint")), float(word_of(settings, "hydroelastic_modulus"))


def set_contact_model(plant: Any, scene_graph: Any, settings: Settings) -> None:
    """Contact model and approximation of the profile, and the changed settings."""
    changed = SETTINGS.numbers(settings.changes)
    plant.set_contact_model(MODELS[word_of(settings, "contact_model")])
    if plant.time_step() > 0:
        plant.set_discrete_contact_approximation(APPROXIMATIONS[word_of(settings, "approximation")])
    if "stiction_tolerance" in changed:
        plant.set_stiction_tolerance(changed["stiction_tolerance"])
    if "sap_near_rigid_threshold" in changed:
        plant.set_sap_near_rigid_threshold(changed["sap_near_rigid_threshold"])
    properties = DefaultProximityProperties()
    for name in OF_GEOMETRIES:
        if name in changed:
            setattr(properties, name, changed[name])
    scene_graph.set_config(SceneGraphConfig(default_proximity_properties=properties))


def contact_facts(plant: Any, scene_graph: Any, settings: Settings) -> dict[str, Scalar]:
    """Settings of contacts as read back from Drake; it has no getter of the stiction tolerance."""
    properties = scene_graph.get_config().default_proximity_properties
    changed = SETTINGS.numbers(settings.changes)
    tolerance = changed.get("stiction_tolerance", SETTINGS["stiction_tolerance"].profiles[0])
    return {
        "contact_model": str(plant.get_contact_model()),
        "discrete_contact_approximation": str(plant.get_discrete_contact_approximation()),
        "discrete_contact_solver": str(plant.get_discrete_contact_solver()),
        **{name: float(getattr(properties, name)) for name in OF_GEOMETRIES},
        "stiction_tolerance (as set)": float(tolerance),
        "sap_near_rigid_threshold": float(plant.get_sap_near_rigid_threshold()),
        "restitution": "none: Drake has no coefficient of restitution",
    }


def transform(position: Array, orientation: Array) -> RigidTransform:
    """Pose from a position [m] and a quaternion wxyz."""
    axes = Rotation.from_quat(np.array(orientation), scalar_first=True).as_matrix()
    return RigidTransform(RotationMatrix(axes), np.array(position))


def start_of(body: Body) -> tuple[RigidTransform, Array, Array]:
    """Pose, angular velocity [rad/s] and velocity of the origin [m/s] of a simulated body at the start."""
    pose, omega = (
        transform(np.array(body.position), np.array(body.orientation)),
        np.array(body.angular_velocity),
    )
    arm = pose.rotation() @ np.array(body.center_of_mass)
    return pose, omega, np.array(body.linear_velocity) - np.cross(omega, arm)


def check_restitution(scenario: Scenario) -> None:
    """Raise Unsupported for pairs that bounce more than RESTITUTION_MAX."""
    found = [pair for pair, e in restitutions(scenario).items() if e > RESTITUTION_MAX]
    if found:
        a, b = (scenario.bodies[k].name for k in found[0])
        e = restitutions(scenario)[found[0]]
        raise Unsupported(
            f"drake: has no restitution; found {e:g} for the pair {a}-{b} (ignored up to {RESTITUTION_MAX:g})"
        )


def harmonic_factors(scenario: Scenario, wanted: Pairs) -> list[float]:
    """Friction per body with 2 f_a f_b / (f_a + f_b) = the pair's coefficient, Drake's combine rule.

    Linear in the reciprocals. A pair without friction needs a factor of zero, taken from a body all of whose
    pairs have none. Raises Unsupported if no factors exist.
    """
    count = len(scenario.bodies)
    rubbing = {pair: mu for pair, mu in wanted.items() if mu > 0}
    system, sums = np.zeros((len(rubbing), count)), np.zeros(len(rubbing))
    for row, ((a, b), mu) in enumerate(rubbing.items()):
        system[row, [a, b]], sums[row] = 1.0, 2 / mu
    reciprocal = np.linalg.lstsq(system, sums, rcond=None)[0] if len(rubbing) else np.zeros(count)
    used = {k for pair in rubbing for k in pair}
    factors = [1 / reciprocal[k] if k in used and reciprocal[k] > 0 else 0.0 for k in range(count)]
    for (a, b), mu in wanted.items():
        total = factors[a] + factors[b]
        found = 2 * factors[a] * factors[b] / total if total > 0 else 0.0
        if abs(found - mu) > MIX_TOLERANCE:
            names = f"{scenario.bodies[a].name}-{scenario.bodies[b].name}"
            raise Unsupported(f"drake: no friction per body gives the pair {names} its {mu:g}")
    return [float(factor) for factor in factors]


def inertia_of(body: Body | BodyFacts) -> SpatialInertia:
    """Spatial inertia about the body's origin."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
    central = RotationalInertia(xx, yy, zz, xy, xz, yz)
    return SpatialInertia.MakeFromCentralInertia(body.mass, np.array(body.center_of_mass), central)


def add_pieces(
    plant: Any, target: Any, body: Body, friction: float, placed: bool, hydroelastic: Hydroelastic
) -> list[Any]:
    """Register the pieces of a body on a Drake body; `placed`: of a fixed body, on the world."""
    base = transform(np.array(body.position), np.array(body.orientation)) if placed else RigidTransform()
    ids = []
    for k, piece in enumerate(body.pieces):
        properties = ProximityProperties()
        AddContactMaterial(properties=properties, friction=CoulombFriction(friction, friction))
        if hydroelastic is not None and not isinstance(piece.shape, SMOOTH):
            AddCompliantHydroelasticProperties(*hydroelastic, properties)
        pose = base @ transform(np.array(piece.position), np.array(piece.orientation))
        name = f"{body.name}.{k}"
        ids.append(plant.RegisterCollisionGeometry(target, pose, _shape(piece), name, properties))
    return ids


def _shape(piece: Piece) -> Any:
    shape: Shape = piece.shape
    match shape:
        case shapes.Sphere(radius):
            return Sphere(radius)
        case shapes.Box(half):
            return Box(*(2 * extent for extent in half))
        case shapes.Capsule(radius, half_length):
            return Capsule(radius, 2 * half_length)
        case shapes.Cylinder(radius, half_length):
            return Cylinder(radius, 2 * half_length)
        case shapes.Ellipsoid(half_axes):
            return Ellipsoid(*half_axes)
        case shapes.Hull(vertices):
            return Convex(points=np.array(vertices).T, label=piece.name)
    raise Unsupported(f"drake: no shape {type(shape).__name__}")


def filter_pairs(plant: Any, scene_graph: Any, scenario: Scenario, geometries: Geometries) -> None:
    """Exclude the pairs of one driven body that may not touch; Drake leaves out those of the world itself."""
    touching = set(scenario.touching_pairs())
    filters = scene_graph.collision_filter_manager()
    for tracker in scenario.trackers:
        links = [k for k in scenario.links(tracker) if geometries[k]]
        for n, a in enumerate(links):
            filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(geometries[a])))
            for b in links[n + 1 :]:
                if (min(a, b), max(a, b)) not in touching:
                    sets = GeometrySet(geometries[a]), GeometrySet(geometries[b])
                    filters.Apply(CollisionFilterDeclaration().ExcludeBetween(*sets))


def add_hinge(plant: Any, bodies: Mapping[str, Any], joint: Joint) -> Any:
    """A revolute joint with its limits; the child's frame at angle 0 has the joint's orientation."""
    parent, child = bodies[joint.parent], bodies[joint.child]
    turn = Rotation.from_quat(np.array(joint.orientation), scalar_first=True)
    # Both frames of the joint coincide at angle 0: the parent's has the parent's axes.
    on_parent = plant.AddFrame(
        FixedOffsetFrame(
            f"{joint.name}.parent", parent.body_frame(), RigidTransform(np.array(joint.position))
        )
    )
    back = RigidTransform(RotationMatrix(turn.inv().as_matrix()), np.zeros(3))
    on_child = plant.AddFrame(FixedOffsetFrame(f"{joint.name}.child", child.body_frame(), back))
    axis = np.array(joint.axis)
    return plant.AddJoint(RevoluteJoint(joint.name, on_parent, on_child, axis, joint.lower, joint.upper, 0.0))


def add_servos(plant: Any, hinges: list[Any], drive: Drive) -> None:
    """Drake's own position servo on each hinge: an actuator with PD gains, solved with the contacts."""
    for hinge, stiffness, damping in zip(hinges, drive.servo_stiffness, drive.servo_damping):
        actuator = plant.AddJointActuator(f"{hinge.name()}.servo", hinge)
        actuator.set_controller_gains(PdControllerGains(p=float(stiffness), d=float(damping)))
