"""Drake scripts: the plant that the adapter builds, as a plain program."""

from importlib.metadata import version

import numpy as np
from pydrake.math import RigidTransform

from touchstone.adapters.contract import Array, Settings, Unsupported
from touchstone.adapters.engines.drake import CENIC
from touchstone.adapters.engines.drake.engine import DrakeEngine
from touchstone.adapters.engines.drake.model import (
    APPROXIMATIONS,
    MODELS,
    OF_GEOMETRIES,
    SMOOTH,
    harmonic_factors,
    hydroelastic_of,
    start_of,
    transform,
    word_of,
)
from touchstone.adapters.engines.drake.settings import SETTINGS
from touchstone.adapters.material_combine import frictions
from touchstone.adapters.scripts.script import Parts, filled, literal, moving
from touchstone.adapters.servo import Drive, simulated_masses
from touchstone.scenarios import scenario as shapes
from touchstone.scenarios.scenario import Piece, Scenario

IMPORTS = ("import numpy as np", "from pydrake.all import *")
ADD = (
    "def pose(place, turn=np.eye(3)): return RigidTransform(RotationMatrix(np.array(turn)), np.array(place))",
    "def add(name, instance, inertia, mu, pieces):  # inertia: mass, centre, moments; None: a fixed body",
    "    body = plant.world_body()",
    "    if inertia:",
    "        mass, centre, own = inertia[0], np.array(inertia[1]), RotationalInertia(*inertia[2])",
    "        spatial = SpatialInertia.MakeFromCentralInertia(mass, centre, own)",
    "        body = plant.AddRigidBody(name, plant.GetModelInstanceByName(instance), spatial)",
    "    for k, (shape, place) in enumerate(pieces):",
    "        properties = ProximityProperties()",
    "        AddContactMaterial(properties=properties, friction=CoulombFriction(mu, mu))",
)
REGISTER = (
    '        plant.RegisterCollisionGeometry(body, place, shape, f"{name}.{k}", properties)',
    "    return body",
)
APPLY = (
    "def apply(row):  # force and torque on each driven body",
    "    forces = [ExternallyAppliedSpatialForce() for _ in driven]",
    "    for one, name, (fx, fy, fz, *torque) in zip(forces, driven, row.reshape(-1, 6)):",
    "        one.body_index, one.p_BoBq_B = bodies[name].index(), np.zeros(3)",
    "        one.F_Bq_W = SpatialForce(tau=np.array(torque), f=np.array([fx, fy, fz]))",
    "    plant.get_applied_spatial_force_input_port().FixValue(context, AbstractValue.Make(forces))",
)


def settings_lines(scenario: Scenario, settings: Settings) -> list[str]:
    """Calls that set the settings of a plant and of its geometries; raises Unsupported as the adapter."""
    DrakeEngine().build(scenario, settings).close()
    changed = SETTINGS.numbers(settings.changes)
    model, variable = MODELS[word_of(settings, "contact_model")], word_of(settings, "integrator") == CENIC
    found = [f"plant.set_contact_model({model})"]
    if not variable:
        approximation = APPROXIMATIONS[word_of(settings, "approximation")]
        found.append(f"plant.set_discrete_contact_approximation({approximation})")
    for name in ("stiction_tolerance", "sap_near_rigid_threshold"):
        if name in changed:
            found.append(f"plant.set_{name}({literal(changed[name])})")
    own = [f"{name}={literal(changed[name])}" for name in OF_GEOMETRIES if name in changed]
    if own:
        found.append(f"defaults = DefaultProximityProperties({', '.join(own)})")
        found.append("configuration = SceneGraphConfig(default_proximity_properties=defaults)")
        found.append("scene_graph.set_config(configuration)")
    fields = hydroelastic_of(settings)
    if fields is not None:
        found.append(f"AddCompliantHydroelasticProperties({literal(fields)[1:-1]}, properties)")
    if variable:
        accuracy = float(word_of(settings, "accuracy"))
        of_steps = f"accuracy={accuracy!r}, max_step_size={settings.dt!r}"
        found.append(f'config = SimulatorConfig(integration_scheme="{CENIC}", {of_steps})')
        found.append("ApplySimulatorConfig(config, simulator)")
    return found


def parts(scenario: Scenario, settings: Settings) -> Parts:
    """The parts of a scene's script; raises Unsupported if Drake cannot play it, or hinges are driven."""
    if any(tracker.joints for tracker in scenario.trackers):
        raise Unsupported("drake: no script is written for driven bodies with hinges")
    lines = settings_lines(scenario, settings)
    drives = [Drive(scenario, tracker, settings.dt, settings.drive) for tracker in scenario.trackers]
    of_plant = [
        line for line in lines if line.startswith(("plant", "defaults", "configuration", "scene_graph"))
    ]
    of_geometries = [line for line in lines if line.startswith("AddCompliant")]
    of_simulator = [line for line in lines if line.startswith(("config =", "Apply"))]
    step = 0.0 if of_simulator else settings.dt
    smooth = ", ".join(one.__name__ for one in SMOOTH)
    driven = [scenario.bodies[drive.links[0]].name for drive in drives]
    instances = [f"driven {k}" for k in range(len(drives))]
    return Parts(
        f"drake=={version('drake')}",
        [*(["import base64", "import zlib", ""] if drives else []), *IMPORTS],
        [
            "builder = DiagramBuilder()",
            f"plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step={step!r})",
            *of_plant,
            f"plant.mutable_gravity_field().set_gravity_vector({literal(list(scenario.acting_gravity))})",
            *(f"plant.set_gravity_enabled(plant.AddModelInstance({one!r}), False)" for one in instances),
            'plant.AddModelInstance("simulated")',
            *ADD,
            *([f"        if not isinstance(shape, ({smooth})):"] if of_geometries else []),
            *(f"            {line}" for line in of_geometries),
            *REGISTER,
        ],
        lambda width: [
            "bodies = {row[0]: add(*row) for row in [",
            *filled(_added(scenario, drives), width),
            "]}",
            *("plant.Finalize()", "diagram = builder.Build()", "root = diagram.CreateDefaultContext()"),
            "context = plant.GetMyMutableContextFromRoot(root)",
            "for name, place, omega, velocity in [",
            *filled(_started(scenario, drives), width),
            "]:",
            "    plant.SetFreeBodyPose(context, bodies[name], place)",
            "    motion = SpatialVelocity(np.array(omega), np.array(velocity))",
            "    plant.SetFreeBodySpatialVelocity(context, bodies[name], motion)",
            *("simulator = Simulator(diagram, root)", *of_simulator),
            *([f"driven = {driven!r}", *APPLY] if drives else []),
        ],
        [*(["apply(row)"] if drives else []), f"simulator.AdvanceTo((step + 1) * {settings.dt!r})"],
        {scenario.bodies[k].name: f"bodies[{scenario.bodies[k].name!r}]" for k in moving(scenario)},
        "plant.EvalBodyPoseInWorld(context, body).translation().tolist()",
        commands=_commands(scenario, settings) if drives else None,
        start=[*(["apply(commands[0])"] if drives else []), "simulator.Initialize()"],
    )


def _added(scenario: Scenario, drives: list[Drive]) -> list[str]:
    factors, masses = harmonic_factors(scenario, frictions(scenario)), simulated_masses(scenario, drives)
    groups, found = scenario.groups(), []
    for k, body in enumerate(scenario.bodies):
        fixed = body.kind == "fixed"
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = masses[k].inertia
        inertia = (masses[k].mass, masses[k].center_of_mass, (xx, yy, zz, xy, xz, yz))
        base = transform(np.array(body.position), np.array(body.orientation)) if fixed else RigidTransform()
        pieces = "".join(f"({_shape(piece)}, {_pose(base @ _placed(piece))})," for piece in body.pieces)
        instance = f"driven {groups[k]}" if groups[k] >= 0 else "simulated"
        numbers = "None" if fixed else literal(inertia)
        found.append(f"({body.name!r}, {instance!r}, {numbers}, {literal(factors[k])}, ({pieces}))")
    return found


def _placed(piece: Piece) -> RigidTransform:
    return transform(np.array(piece.position), np.array(piece.orientation))


def _started(scenario: Scenario, drives: list[Drive]) -> list[str]:
    found = [_start(body.name, *start_of(body)) for body in scenario.bodies if body.kind == "simulated"]
    for drive in drives:
        pose = transform(drive.start_position[0], drive.start_orientation[0])
        motion = drive.start.angular_velocity[0], drive.start.linear_velocity[0]
        found.append(_start(scenario.bodies[drive.links[0]].name, pose, *motion))
    return found


def _start(name: str, pose: RigidTransform, omega: Array, velocity: Array) -> str:
    return f"({name!r}, {_pose(pose)}, {literal(omega)}, {literal(velocity)})"


def _pose(pose: RigidTransform) -> str:
    turn, place = pose.rotation().matrix(), literal(pose.translation())
    return f"pose({place})" if np.array_equal(turn, np.eye(3)) else f"pose({place}, {literal(turn)})"


def _shape(piece: Piece) -> str:
    match piece.shape:
        case shapes.Sphere(radius):
            return f"Sphere({literal(radius)})"
        case shapes.Box(half):
            return f"Box({', '.join(literal(2 * extent) for extent in half)})"
        case shapes.Capsule(radius, half_length):
            return f"Capsule({literal(radius)}, {literal(2 * half_length)})"
        case shapes.Cylinder(radius, half_length):
            return f"Cylinder({literal(radius)}, {literal(2 * half_length)})"
        case shapes.Ellipsoid(half_axes):
            return f"Ellipsoid({', '.join(map(literal, half_axes))})"
        case shapes.Hull(vertices):
            return f"Convex(points=np.array({literal(vertices)}).T, label={piece.name!r})"
    raise Unsupported(f"drake: no shape {type(piece.shape).__name__}")


def _commands(scenario: Scenario, settings: Settings) -> Array:
    """Force and torque on each driven body in each step (s, 6 d), as the adapter applies them."""
    world, rows = DrakeEngine().build(scenario, settings), []
    for step in range(round(scenario.duration / settings.dt)):
        world.drive(step)
        rows.append(world.applied())
        world.step()
    world.close()
    return np.array(rows)
