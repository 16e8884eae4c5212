"""A scenario as a Newton model: bodies, shapes, friction and restitution per shape."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import newton
import numpy as np
import warp

from touchstone.adapters.contract import BodyFacts, Settings, Unsupported
from touchstone.adapters.engines.mujoco.masks import contact_filter
from touchstone.adapters.engines.newton import ELLIPTIC, KAMINO, MUJOCO, STEEL, XPBD
from touchstone.adapters.engines.newton.settings import SETTINGS
from touchstone.adapters.material_combine import (
    check_range,
    frictions,
    maximum_factors,
    mean_factors,
    restitutions,
)
from touchstone.scenarios import scenario as shapes
from touchstone.scenarios.scenario import UNMOVED, Body, Piece, Scenario
from touchstone.scenarios.solids import outward_faces

RESTITUTION_MAX = 0.3
"""Restitution up to which impacts are played without any by solvers that have none [1]: that of the materials
of Table 1; a body then keeps 9 % of the energy of its approach."""
CONTACTS_PER_SHAPE = 32
"""Room for contacts [1]: four faces of boxes with eight points each."""
STEEL_ROWS = 512
"""Steel's default room for rows of contacts [1]; a contact has three, one of MuJoCo's pyramids four."""
CPU = "cpu"
OF_MUJOCO = (MUJOCO, ELLIPTIC)
INELASTIC = (*OF_MUJOCO, KAMINO)
"""Profiles whose solver has no restitution."""
PRIORITY = "mujoco:geom_priority"
"""Attribute of a shape: of two shapes, the one of higher priority gives the friction."""
WORLD = -1
"""Body to which Newton attaches the shapes of fixed bodies."""


def frictions_of(scenario: Scenario, profile: str) -> tuple[list[float], list[int]]:
    """Friction per body by the combine rule of the profile's solver, and MuJoCo's priority per body, which
    are equal where the larger friction gives each pair its own."""
    wanted, even = frictions(scenario), [0] * len(scenario.bodies)
    if profile not in OF_MUJOCO:
        return mean_factors("newton", "friction", scenario, wanted, signed=True), even
    try:
        return maximum_factors("newton", "friction", scenario, wanted), even
    except Unsupported:
        found = contact_filter(scenario)
        if found.explicit:
            raise
    friction, priority = [0.0] * len(scenario.bodies), even
    for k, geom in found.geoms.items():
        friction[k], priority[k] = geom.coefficients[1], geom.priority
    return friction, priority


def restitutions_of(scenario: Scenario, profile: str) -> list[float]:
    """Restitution per body, by the combine rule of the profile's solver."""
    wanted = restitutions(scenario)
    if profile in INELASTIC:
        check_range("newton", "restitution", scenario, wanted, greatest=RESTITUTION_MAX)
        return [0.0] * len(scenario.bodies)
    return mean_factors("newton", "restitution", scenario, wanted)


def builder_of(scenario: Scenario, profile: str) -> Any:
    """An empty model, to which articulations are added before all other bodies."""
    builder = newton.ModelBuilder(gravity=tuple(scenario.acting_gravity))
    if profile in OF_MUJOCO:
        newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    return builder


def model_of(
    builder: Any,
    scenario: Scenario,
    profile: str,
    masses: Sequence[Body | BodyFacts],
    linked: Mapping[int, int],
    posed: Sequence[int] = (),
    worlds: int = 1,
) -> tuple[Any, list[int], list[int]]:
    """Newton's model with the masses of all bodies, those of `posed` kinematic, in equal worlds; of the first
    Newton's body per body of the scenario (WORLD: fixed), and the body of each shape. `linked` has the bodies
    that the builder has."""
    (friction, priority), restitution = frictions_of(scenario, profile), restitutions_of(scenario, profile)
    bodies, owners = [], []
    for k, body in enumerate(scenario.bodies):
        own = pose(body.position, body.orientation)
        fixed = body.kind in UNMOVED and k not in posed
        config = newton.ModelBuilder.ShapeConfig(
            density=0.0, mu=friction[k], restitution=restitution[k], mu_torsional=0.0, mu_rolling=0.0
        )
        given = {"cfg": config}
        if priority[k]:
            given["custom_attributes"] = {PRIORITY: priority[k]}
        if k in linked:
            bodies.append(linked[k])
        else:
            bodies.append(WORLD if fixed else _add_body(builder, body.name, masses[k], own, k in posed))
        for piece in body.pieces:
            place = pose(piece.position, piece.orientation)
            _add_piece(builder, bodies[k], piece, own * place if fixed else place, given, profile)
            owners.append(k)
    if posed or linked:
        meeting = set(scenario.touching_pairs())
        held = {k for k, body in enumerate(bodies) if body == WORLD}.union(posed)
        for (one, a), (two, b) in combinations(enumerate(owners), 2):
            if (a, b) not in meeting or {a, b} <= held:
                builder.add_shape_collision_filter_pair(one, two)
    whole = builder
    if worlds > 1:
        whole = builder_of(scenario, profile)
        for _ in range(worlds):
            whole.add_world(builder)
    return whole.finalize(device=CPU), bodies, owners


def pose(position: Any, orientation: Any) -> Any:
    """Newton's pose of a position [m] and a quaternion wxyz; Newton's is xyzw."""
    w, x, y, z = orientation
    return warp.transform(tuple(position), warp.quat(x, y, z, w))


def _add_body(builder: Any, name: str, masses: Body | BodyFacts, own: Any, posed: bool) -> int:
    if not masses.mass > 0:  # a prescribed body; MuJoCo ignores the velocity of one without mass
        masses = BodyFacts.of(1.0, masses.center_of_mass, np.eye(3))
    index: int = builder.add_body(xform=own, label=name, is_kinematic=posed, **_given(masses))
    return index


def add_link(builder: Any, name: str, masses: Body | BodyFacts, own: Any) -> int:
    """Add a body of an articulation with its pose at the start."""
    index: int = builder.add_link(xform=own, label=name, **_given(masses))
    return index


def _given(masses: Body | BodyFacts) -> dict[str, Any]:
    inertia = warp.mat33(np.array(masses.inertia, dtype=np.float32))
    return {
        "com": tuple(masses.center_of_mass),
        "mass": masses.mass,
        "inertia": inertia,
        "lock_inertia": True,
    }


def _add_piece(
    builder: Any, body: int, piece: Piece, place: Any, given: dict[str, Any], profile: str
) -> None:
    given = {"xform": place, **given}
    match piece.shape:
        case shapes.Sphere(radius):
            builder.add_shape_sphere(body, radius=radius, **given)
        case shapes.Box((x, y, z)):
            builder.add_shape_box(body, hx=x, hy=y, hz=z, **given)
        case shapes.Capsule(radius, half_length):
            builder.add_shape_capsule(body, radius=radius, half_height=half_length, **given)
        case shapes.Cylinder(radius, half_length):
            builder.add_shape_cylinder(body, radius=radius, half_height=half_length, **given)
        case shapes.Ellipsoid((x, y, z)):
            builder.add_shape_ellipsoid(body, rx=x, ry=y, rz=z, **given)
        case shapes.Cone(radius, half_length) if profile not in OF_MUJOCO:
            builder.add_shape_cone(body, radius=radius, half_height=half_length, **given)
        case shapes.HalfSpace():
            builder.add_shape_plane(None, body=body, width=0.0, length=0.0, **given)
        case shapes.Hull(vertices):
            faces = outward_faces(np.array(vertices)).astype(np.int32)
            mesh = newton.Mesh(np.array(vertices, dtype=np.float32), faces.ravel())
            builder.add_shape_convex_hull(body, mesh=mesh, **given)
        case _:
            raise Unsupported(f"newton: no shape {type(piece.shape).__name__}")


def solver_of(model: Any, settings: Settings) -> Any:
    """The solver of a profile."""
    iterations = SETTINGS.in_force(settings.profile, settings.changes)["iterations"]
    solvers = newton.solvers
    if settings.profile == XPBD:
        bounces = bool(model.shape_material_restitution.numpy().any())
        return solvers.SolverXPBD(model, iterations=iterations, enable_restitution=bounces)
    if settings.profile == STEEL:
        rows = max(STEEL_ROWS, 3 * CONTACTS_PER_SHAPE * model.shape_count)
        room = {"free_body_constraint_max": rows, "articulation_constraint_max": rows}
        return solvers.SolverSteel(model, iterations=iterations, enable_joint_limits=True, **room)
    if settings.profile == KAMINO:
        config = solvers.SolverKamino.Config.from_model(model)
        config.use_collision_detector = True
        config.padmm.max_iterations = iterations
        return solvers.SolverKamino(model, config=config)
    cone = "elliptic" if settings.profile == ELLIPTIC else "pyramidal"
    most = CONTACTS_PER_SHAPE * max(model.shape_count, 1)
    return solvers.SolverMuJoCo(model, iterations=iterations, cone=cone, nconmax=most, njmax=4 * most)
