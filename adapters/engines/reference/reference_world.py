"""Translation of a scenario to the reference's arrays."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import frexp, log2, sqrt
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Unsupported, contact_capacity
from touchstone.adapters.engines.reference.mechanisms import with_mechanisms
from touchstone.adapters.engines.reference.support_table import distinct, hull_rows, hull_width
from touchstone.adapters.motion_bounds import extent
from touchstone.adapters.servo import servo_stiffness
from touchstone.reference_impl.core import conventions
from touchstone.reference_impl.core.driver_dtypes import CHAIN_CAPACITY, CONE_CORNERS, DRIVER, JOINT
from touchstone.reference_impl.core.state_dtype import MATERIAL_CAPACITY, STATE
from touchstone.reference_impl.core.world import BODY, CONTACT, PAIR, PIECE, VERTEX, World
from touchstone.scenarios.avatar.chains import hinge_axes
from touchstone.scenarios.avatar.surface_motion import surface_motion, surface_moves
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.relations.changes import heavier, similar
from touchstone.scenarios.scenario import (
    UNMOVED,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Piece,
    RoundedBox,
    RoundedHull,
    Scenario,
    Sphere,
    Vector,
)

KINDS = {
    "fixed": conventions.FIXED,
    "simulated": conventions.SIMULATED,
    "driven": conventions.DRIVEN,
    "prescribed": conventions.DRIVEN,
}
PRESCRIBED_MASS, PRESCRIBED_INERTIA = 1.0, np.eye(3)
"""Mass [kg] and inertia [kg m^2] in the row of a prescribed body, which keep composite inertias finite; its
inverse mass is 0, so that no contact uses them."""
PAIRS_PER_PIECE = 32
"""Pair capacity per piece in large scenes: a sphere among equal spheres has 12 neighbours, which count at the
start and again at the end of a substep."""
PAIRS_AT_LEAST = 4096
HALF_SPACE_WIDTH = 1.0
"""Width of a half-space as that of a slab [m]: how deep a driver may push a body into it scales with it."""
PATCH_POINTS = 4
"""Maximum number of rows for the contact manifold of a pair."""
FRICTION_LEAST = 1e-100
"""Friction coefficient below which friction is off [1]: the square of the cone's radius, mu times the normal
impulse, would underflow and the solver would not converge."""
MASS_RANGE = (1e-30, 1e30)
"""Masses beyond which a scene is computed in another unit of mass [kg]: squares of impulses would underflow
or overflow, and no solve would converge."""
NUMBER = re.compile(r"(\d+)")
"""Numbers in names, by which bodies are sorted."""
RIGID = 1e12
"""Stiffness of a kinematic link's coupling [N/m] and of its hinges' servos per inertia [1/s^2]: a load of
1 kN moves it by 1e-9 m."""
TOUCHED = 64
"""Rows of each array that are in memory before the first frame [1]."""
LARGEST_UNIT = 1022
"""Largest binary exponent of a unit of mass [1]: its reciprocal is a normal number."""
SIZE_RANGE, USUAL_SIZE = (2.0**-8, 2.0**8), 0.1
"""Extent of the smallest body beyond which a scene is computed in another unit of length, and its extent then
[m]: tolerances are lengths and speeds for bodies that a hand can hold."""


class Units(NamedTuple):
    """Units in which a scene is computed, powers of two, which scale exactly. That of length follows from
    gravity, whose number stays (Froude's law)."""

    mass: float = 1.0  # [kg]
    time: float = 1.0  # [s]

    @property
    def length(self) -> float:
        """[m]"""
        return self.time * self.time

    def of(self, scenario: Scenario) -> Scenario:
        """The scene in these units; its frames are shorter where whole ones would not fill its duration."""
        scenario = scenario if self.mass == 1 else heavier(scenario, 1 / self.mass)
        if self.time == 1:
            return scenario
        rate = scenario.frame_rate * max(1, int(self.time))
        return similar(scenario, 1 / self.time, duration=scenario.duration / self.time, frame_rate=rate)


def kinematic(scenario: Scenario) -> Scenario:
    """The scene with links that no load moves off their tracker's poses: the limit of stiff couplings and
    servos. Geometry still keeps them out of fixed bodies."""
    trackers = []
    for tracker in scenario.trackers:
        if not scenario.prescribes(tracker):
            mass = sum(scenario.bodies[link].mass for link in scenario.links(tracker))
            damping = 2 * sqrt(RIGID * mass)
            tracker = replace(tracker, stiffness=RIGID, damping=damping, hinge_frequency=sqrt(RIGID))
        trackers.append(tracker)
    return scenario.reduced(trackers=tuple(trackers))


def units(scenario: Scenario) -> Units:
    """Units of a scene: a mass between the least and the largest one if one of them is beyond MASS_RANGE, and
    a length like that of its smallest body if it is beyond SIZE_RANGE."""
    return Units(_mass_unit(scenario), _time_unit(scenario))


def _mass_unit(scenario: Scenario) -> float:
    masses = [body.mass for body in scenario.bodies if body.kind not in UNMOVED]
    if not masses or (MASS_RANGE[0] <= min(masses) and max(masses) <= MASS_RANGE[1]):
        return 1.0
    middle = (frexp(min(masses))[1] + frexp(max(masses))[1]) // 2
    return 2.0 ** max(-LARGEST_UNIT, min(middle, LARGEST_UNIT))


def _time_unit(scenario: Scenario) -> float:
    bodies = [body for body in scenario.bodies if body.kind != "fixed" and body.pieces]
    sizes = [max(map(extent, body.pieces)) for body in bodies]
    if not sizes or SIZE_RANGE[0] <= min(sizes) <= SIZE_RANGE[1]:
        return 1.0
    return 2.0 ** round(log2(min(sizes) / USUAL_SIZE) / 2)


@lru_cache(maxsize=4096)
def matrix(quaternion: tuple[float, ...]) -> np.ndarray:
    """Rotation matrix of a quaternion wxyz. The result is cached and shared: do not write to it."""
    found = Rotation.from_quat(np.array(quaternion), scalar_first=True).as_matrix()
    found.flags.writeable = False
    return found


def body_order(scenario: Scenario) -> list[int]:
    """Indices of the bodies in the order of the arrays: fixed bodies, links of drivers, simulated bodies.

    Links keep the order of their trackers; other bodies are sorted by name, ball_2 before ball_10. So the
    order of bodies in a scene does not change the motion, not even by rounding.
    """
    places = {link: k for tracker in scenario.trackers for k, link in enumerate(scenario.links(tracker))}
    groups = scenario.groups()

    def key(index: int) -> tuple[int, int, int, list[tuple[int, str]]]:
        body = scenario.bodies[index]
        parts = [(int(part), "") if part.isdecimal() else (-1, part) for part in NUMBER.split(body.name)]
        kind = (conventions.FIXED, conventions.DRIVEN, conventions.SIMULATED).index(KINDS[body.kind])
        return kind, groups[index], places.get(index, 0), parts

    return sorted(range(len(scenario.bodies)), key=key)


def translate(scenario: Scenario) -> World:
    """Arrays of a scenario: driven bodies are posed as their trackers at time 0; settings are left unset."""
    pieces, vertices = _pieces(scenario)
    for row, (body, piece) in zip(pieces, ((b, p) for b in scenario.bodies for p in b.pieces)):
        row["surface_velocity"], row["surface_omega"] = surface_motion(piece, np.array(body.center_of_mass))
    bodies, joints, drivers = _bodies(scenario, pieces), _joints(scenario), _drivers(scenario)
    driven = len(drivers), len(joints)
    if scenario.body_joints:
        joints, drivers = with_mechanisms(scenario, bodies, joints, drivers)
    world = World(
        bodies=bodies,
        pieces=pieces,
        joints=joints,
        drivers=drivers,
        vertices=vertices,
        pairs=np.zeros(pair_capacity(scenario), PAIR),
        contacts=np.zeros(contact_capacity(scenario), CONTACT),
        state=np.zeros(1, STATE),
    )
    _touch(world)
    world.pairs["surface_a"] = world.pairs["surface_b"] = conventions.NO_MOTION
    world.state["random"] = scenario.seed % (conventions.RANDOM_PRIME - 1) + 1
    world.state["self_collision"] = "self_collision" in scenario.effects
    world.state["mechanisms"], world.state["driven_count"] = len(drivers) > driven[0], driven[0]
    world.state["compound"] = bodies["piece_count"].max(initial=0) > 1
    world.state["moving_surfaces"] = any(map(surface_moves, scenario.bodies))
    met = (bodies["kind"] != conventions.DRIVEN) | (world.state["self_collision"] == 1)
    world.state["least_width"] = bodies["width"][met].min(initial=np.inf)
    _set_chains(scenario, world)
    _set_links(scenario, world, driven[1])
    _set_coefficients(scenario, world)
    return world


def _touch(world: World) -> None:
    """Write to the memory that first contacts use: the system provides a page at its first write, which takes
    microseconds, and no frame should wait for it."""
    state = world.state
    world.contacts[:TOUCHED] = 0
    for record in (state, state["solver"]):
        for name in record.dtype.names or ():
            if record[name].ndim > 1:
                record[name][:, :TOUCHED] = 0
    state["depth_cache"] = 0  # a hash table


def pair_capacity(scenario: Scenario) -> int:
    """Number of rows for pairs.

    Small scenes get room for all pairs that can touch, with manifolds at the start of a substep, and twice
    again at its end, where the stops of drivers are found too; large scenes get `PAIRS_PER_PIECE` per piece.
    """
    fixed = sum(len(body.pieces) for body in scenario.bodies if body.kind == "fixed")
    pieces = sum(len(body.pieces) for body in scenario.bodies)
    meeting = (pieces * (pieces - 1) - fixed * (fixed - 1)) // 2
    return min((PATCH_POINTS + 2) * meeting, max(PAIRS_AT_LEAST, PAIRS_PER_PIECE * pieces))


def _bodies(scenario: Scenario, pieces: np.ndarray) -> np.ndarray:
    bodies = np.zeros(len(scenario.bodies), BODY)
    materials = _materials(scenario)
    for row, body, group in zip(bodies, scenario.bodies, scenario.groups()):
        row["kind"] = KINDS[body.kind]
        row["driver"] = group
        row["chain"] = row["hinge"] = row["above"] = row["beside"] = -1
        row["material"] = materials.index(body.material)
        row["mass"] = body.mass
        row["inverse_mass"] = 1 / body.mass if body.kind == "simulated" else 0.0
        row["center_of_mass"], row["inertia"] = body.center_of_mass, body.inertia
        if body.kind == "prescribed":
            row["mass"], row["inertia"] = PRESCRIBED_MASS, PRESCRIBED_INERTIA
        moments, axes = np.linalg.eigh(row["inertia"])
        if body.kind == "simulated" and min(body.mass, moments[0]) < np.finfo(float).tiny:
            raise Unsupported(
                f"reference: mass or inertia of {body.name!r} is too small: its reciprocal overflows"
            )
        row["axis"] = axes[:, 0]
        row["position"], row["orientation"] = body.position, body.orientation
        row["rotation"] = matrix(body.orientation)
        row["center"] = row["position"] + row["rotation"] @ row["center_of_mass"]
        row["velocity"], row["omega"] = body.linear_velocity, body.angular_velocity
    bodies["piece_count"] = [len(body.pieces) for body in scenario.bodies]
    bodies["first_piece"] = np.cumsum(bodies["piece_count"]) - bodies["piece_count"]
    bodies["width"] = np.inf
    np.minimum.at(bodies["width"], pieces["body"], pieces["width"])
    offset = np.linalg.norm(pieces["position"] - bodies["center_of_mass"][pieces["body"]], axis=1)
    np.maximum.at(bodies["reach"], pieces["body"], offset + pieces["reach"])
    return bodies


def _pieces(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    return piece_arrays([(i, piece) for i, b in enumerate(scenario.bodies) for piece in b.pieces])


def piece_arrays(owned: Sequence[tuple[int, Piece]]) -> tuple[np.ndarray, np.ndarray]:
    """Rows of PIECE for pieces with their body's index, and rows of VERTEX; equal hulls share theirs."""
    pieces = np.zeros(len(owned), PIECE)
    hulls: list[np.ndarray] = []
    first: dict[tuple[Vector, ...], int] = {}
    count = 0
    for row, (body, piece) in zip(pieces, owned):
        row["body"] = body
        row["position"], row["rotation"] = piece.position, matrix(piece.orientation)
        match piece.shape:
            case Sphere(radius):
                row["kind"], row["radius"] = conventions.SPHERE, radius
                row["width"] = 2 * radius
            case Box(half_extents):
                row["kind"], row["size"] = conventions.BOX, half_extents
                row["width"], row["reach"] = 2 * min(half_extents), np.linalg.norm(half_extents)
            case Capsule(radius, half_length):
                row["kind"], row["radius"] = conventions.CAPSULE, radius
                row["size"] = (0.0, 0.0, half_length)
                row["width"], row["reach"] = 2 * radius, half_length
            case Cylinder(radius, half_length):
                row["kind"], row["size"] = conventions.CYLINDER, (radius, radius, half_length)
                row["width"], row["reach"] = 2 * min(radius, half_length), np.hypot(radius, half_length)
            case Cone(radius, half_length):
                row["kind"], row["size"] = conventions.CONE, (radius, radius, half_length)
                inscribed = 2 * half_length * radius / (radius + np.hypot(radius, 2 * half_length))
                row["width"], row["reach"] = 2 * inscribed, np.hypot(radius, half_length)
            case HalfSpace():
                row["kind"], row["width"] = conventions.HALF_SPACE, HALF_SPACE_WIDTH
            case Ellipsoid(half_axes):
                row["kind"], row["size"] = conventions.ELLIPSOID, half_axes
                row["width"], row["reach"] = 2 * min(half_axes), max(half_axes)
            case RoundedBox(half_extents, radius):
                row["kind"], row["size"], row["radius"] = conventions.BOX, half_extents, radius
                row["width"], row["reach"] = 2 * (min(half_extents) + radius), np.linalg.norm(half_extents)
            case Hull(given) | RoundedHull(given):
                corners = distinct(given)
                rows, row["cells"], row["size"] = hull_rows(corners)
                if corners not in first:
                    first[corners] = count
                    hulls.append(rows.view(f"V{VERTEX.itemsize}"))
                    count += len(rows)
                row["kind"], row["first_vertex"] = conventions.HULL, first[corners]
                row["vertex_count"] = len(corners)
                row["center"] = np.mean(corners, axis=0)
                row["width"], row["reach"] = hull_width(corners), np.linalg.norm(corners, axis=1).max()
                if isinstance(piece.shape, RoundedHull):
                    row["radius"] = piece.shape.radius
                    row["width"] += 2 * piece.shape.radius
            case _:
                raise Unsupported(f"reference: no shape {type(piece.shape).__name__}")
    return pieces, np.concatenate(hulls).view(VERTEX) if hulls else np.zeros(1, VERTEX)


def _joints(scenario: Scenario) -> np.ndarray:
    by_name = {joint.name: joint for joint in scenario.joints}
    names = [name for tracker in scenario.trackers for name in tracker.joints]
    joints = np.zeros(len(names), JOINT)
    for row, joint in zip(joints, (by_name[name] for name in names)):
        row["parent"], row["child"] = scenario.body_index(joint.parent), scenario.body_index(joint.child)
        row["position"], row["axis"], row["rest"] = joint.position, joint.axis, matrix(joint.orientation)
        row["lower"], row["upper"] = joint.lower, joint.upper
        row["chain"] = row["coordinate"] = -1
    for row in joints:
        row["inner"] = next((k for k, other in enumerate(joints) if other["child"] == row["parent"]), -1)
    for tracker, first in zip(scenario.trackers, _first_joints(scenario)):
        rows = joints[first : first + len(tracker.joints)]
        motion = sample(tracker, np.zeros(1))
        for name in ("angle", "shown_angle", "free_angle", "target_angle", "last_target_angle"):
            rows[name] = motion.angle[0]
        for name in ("rate", "target_rate"):
            rows[name] = motion.rate[0]
        if any(name in tracker.joints for chain in scenario.chains for name in chain.joints):
            rows["servo"] = servo_stiffness(scenario, tracker)
    return joints


def _first_joints(scenario: Scenario) -> list[int]:
    counts = [len(tracker.joints) for tracker in scenario.trackers]
    return [sum(counts[:k]) for k in range(len(counts))]


def _drivers(scenario: Scenario) -> np.ndarray:
    drivers = np.zeros(len(scenario.trackers), DRIVER)
    for row, tracker, first in zip(drivers, scenario.trackers, _first_joints(scenario)):
        links = scenario.links(tracker)
        row["root"], row["first_joint"], row["joint_count"] = links[0], first, len(tracker.joints)
        row["prescribed"] = scenario.prescribes(tracker)
        if row["prescribed"]:
            row["mass"], row["inverse_mass"] = PRESCRIBED_MASS, 0.0
        else:
            row["mass"] = sum(scenario.bodies[link].mass for link in links)
            row["inverse_mass"] = 1 / row["mass"]
        row["stiffness"], row["damping"] = tracker.stiffness, tracker.damping
        row["hinge_frequency"] = tracker.hinge_frequency
        motion = sample(tracker, np.zeros(1))
        for prefix in ("", "target_", "old_target_"):
            row[f"{prefix}position"] = motion.position[0]
            row[f"{prefix}orientation"] = motion.orientation[0]
            row[f"{prefix}velocity"] = motion.linear_velocity[0]
            row[f"{prefix}omega"] = motion.angular_velocity[0]
    return drivers


def _set_chains(scenario: Scenario, world: World) -> None:
    """Set chains as ranges of joints, and reach cones in the axes of their ball joint's hinges."""
    by_name = {joint.name: joint for joint in scenario.joints}
    names = [name for tracker in scenario.trackers for name in tracker.joints]
    for chain in scenario.chains:
        first, count = names.index(chain.joints[0]), len(chain.joints)
        driver = world.drivers[world.bodies[world.joints[first]["child"]]["driver"]]
        if driver["chain_count"] == CHAIN_CAPACITY:
            raise Unsupported(f"reference: more than {CHAIN_CAPACITY} chains in one driven body")
        if count > conventions.CHAIN_JOINTS:
            raise Unsupported(f"reference: {count} joints in a chain, at most {conventions.CHAIN_JOINTS}")
        driver["chains"][driver["chain_count"]] = first, first + count - 1
        world.joints["chain"][first : first + count] = driver["chain_count"]
        hinges = driver["hinge_count"] + count
        if hinges > conventions.HINGE_CAPACITY:
            raise Unsupported(f"reference: more than {conventions.HINGE_CAPACITY} joints in a body's chains")
        world.joints["coordinate"][first : first + count] = np.arange(driver["hinge_count"], hinges)
        driver["chain_count"] += 1
        driver["hinge_count"] = hinges
        driver["inverse_mass"] = 0.0
        for cone in chain.cones:
            if len(cone.swing) > CONE_CORNERS:
                raise Unsupported(f"reference: {len(cone.swing)} corners of a cone, at most {CONE_CORNERS}")
            row = world.joints[names.index(cone.joints[0])]
            axes = hinge_axes(tuple(by_name[name] for name in cone.joints))
            row["cone_count"], row["cone_center"] = len(cone.swing), np.array(cone.center) @ axes
            row["cone"][: len(cone.swing)] = np.array(cone.swing) @ axes
            # Carry the first axis from the bone's rest direction to the cone's centre.
            x, y, z = row["cone_center"]
            row["cone_mark"] = np.array((1.0, 0.0, 0.0)) - x / (1 + z) * np.array((x, y, 1 + z))
            corners = row["cone"][: len(cone.swing)]
            normals = np.cross(corners, np.roll(corners, -1, axis=0))
            heights = normals @ row["cone_center"] / np.linalg.norm(normals, axis=1)
            # The plane of an edge is at least as near as the edge itself.
            row["cone_cap"] = np.sqrt(1 - heights.min() ** 2)
            row["twist_lower"], row["twist_upper"] = cone.twist


def _set_links(scenario: Scenario, world: World, hinges: int) -> None:
    """Set the chain and the hinge that move each link, and its nearest ancestor with pieces."""
    bodies = world.bodies
    parent: dict[int, int] = {}
    for k, joint in enumerate(world.joints[:hinges]):
        link, inner = int(joint["child"]), int(joint["parent"])
        parent[link] = inner
        if joint["chain"] >= 0:
            bodies["chain"][link], bodies["hinge"][link] = joint["chain"], k
        else:
            bodies["chain"][link], bodies["hinge"][link] = bodies["chain"][inner], bodies["hinge"][inner]
        while not scenario.bodies[inner].pieces and inner in parent:
            inner = parent[inner]
        bodies["above"][link] = inner


def _materials(scenario: Scenario) -> list[str]:
    materials = sorted({body.material for body in scenario.bodies})
    if len(materials) > MATERIAL_CAPACITY:
        raise Unsupported(f"reference: {len(materials)} materials in one scene, at most {MATERIAL_CAPACITY}")
    return materials


def _set_coefficients(scenario: Scenario, world: World) -> None:
    materials = _materials(scenario)
    for a, b in scenario.touching_pairs():
        row, column = (materials.index(scenario.bodies[k].material) for k in (a, b))
        restitution, friction = scenario.pair_coefficients(a, b)
        law = scenario.friction_law(a, b)
        for i, j in ((row, column), (column, row)):
            world.state[0]["static_friction"][i, j] = law.static
            world.state[0]["rolling"][i, j], world.state[0]["torsion"][i, j] = law.rolling, law.torsional
            world.state[0]["restitution"][i, j] = restitution
            world.state[0]["friction_coefficient"][i, j] = friction if friction >= FRICTION_LEAST else 0.0
    lengths = world.state[0]["rolling"] + world.state[0]["torsion"]
    world.state[0]["moments"] = lengths.any()
    world.state[0]["statics"] = world.state[0]["static_friction"].any()
