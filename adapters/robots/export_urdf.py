"""The bodies of a scene as URDF, a file for each tree of links: URDF knows one robot and no surroundings.

URDF has no ellipsoids, cones, capsules, hulls, rounded shapes or half-spaces: a capsule becomes a cylinder
and two spheres, a hull a mesh with its own corners, a half-space a slab, the others meshes. Friction,
restitution and moving surfaces have no standard element and are left out.
"""

import re
import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.robots.export_parts import children_of, numbers, obj_text, pretty
from touchstone.scenarios.scenario import (
    UNMOVED,
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Hull,
    Piece,
    Quaternion,
    Scenario,
    Sphere,
    Vector,
)
from touchstone.scenarios.solids import elliptic_hull, pyramid, shown_piece

UNSAFE = re.compile(r"[^A-Za-z0-9_.-]+")
"""Characters that file names do without."""


def urdf_files(scenario: Scenario) -> dict[str, str]:
    """File name -> text: a URDF per tree of links or other body, and an OBJ per hull or ellipsoid."""
    files: dict[str, str] = {}
    joints = {joint.name: joint for joint in scenario.joints}
    bodies = {body.name: body for body in scenario.bodies}
    below = children_of(scenario)
    roots = {tracker.root for tracker in scenario.trackers}
    for body in scenario.bodies:
        if body.kind == "driven" and body.name not in roots:
            continue
        robot = ET.Element("robot", name=body.name)
        waiting = [body.name]
        while waiting:
            name = waiting.pop(0)
            _add_link(robot, bodies[name], files)
            for hinge in (joints[one] for one in below.get(name, ())):
                waiting.append(hinge.child)
                own = ET.SubElement(robot, "joint", name=hinge.name, type="revolute")
                ET.SubElement(own, "parent", link=hinge.parent)
                ET.SubElement(own, "child", link=hinge.child)
                _add_origin(own, hinge.position, hinge.orientation)
                turn = Rotation.from_quat(hinge.orientation, scalar_first=True)
                ET.SubElement(own, "axis", xyz=numbers(turn.inv().apply(hinge.axis)))
                limits = {"lower": numbers([hinge.lower]), "upper": numbers([hinge.upper])}
                ET.SubElement(own, "limit", limits | {"effort": "1000", "velocity": "100"})
        files[f"{_safe(body.name)}.urdf"] = pretty(robot)
    return files


def _safe(name: str) -> str:
    return UNSAFE.sub("_", name)


def _add_origin(own: ET.Element, place: Vector, turn: Quaternion) -> None:
    """Pose by roll, pitch and yaw: rotations about the fixed x, y and z."""
    angles = Rotation.from_quat(turn, scalar_first=True).as_euler("xyz")
    ET.SubElement(own, "origin", xyz=numbers(place), rpy=numbers(angles))


def _add_link(robot: ET.Element, body: Body, files: dict[str, str]) -> None:
    link = ET.SubElement(robot, "link", name=body.name)
    if body.kind not in UNMOVED:
        inertial = ET.SubElement(link, "inertial")
        ET.SubElement(inertial, "origin", xyz=numbers(body.center_of_mass), rpy="0 0 0")
        ET.SubElement(inertial, "mass", value=numbers([body.mass]))
        names = zip("xyz", np.array(body.inertia).tolist())
        upper = {
            f"i{row}{column}": numbers([value])
            for row, values in names
            for column, value in zip("xyz", values)
            if row <= column
        }
        ET.SubElement(inertial, "inertia", upper)
    for piece in body.pieces:
        for kind in ("visual", "collision"):
            _add_shape(link, kind, body, piece, files)


def _add_shape(link: ET.Element, kind: str, body: Body, piece: Piece, files: dict[str, str]) -> None:
    """Geometry of a piece: one element, or three of a capsule."""
    turn = Rotation.from_quat(piece.orientation, scalar_first=True)
    parts: list[tuple[Vector, str, dict[str, str]]] = []
    piece = shown_piece(piece)
    match piece.shape:
        case Sphere(radius):
            parts = [((0.0, 0.0, 0.0), "sphere", {"radius": numbers([radius])})]
        case Box(half):
            parts = [((0.0, 0.0, 0.0), "box", {"size": numbers(2 * np.array(half))})]
        case Capsule(radius, half_length):
            middle = {"radius": numbers([radius]), "length": numbers([2 * half_length])}
            parts = [((0.0, 0.0, 0.0), "cylinder", middle)]
            parts += [((0.0, 0.0, s * half_length), "sphere", {"radius": numbers([radius])}) for s in (-1, 1)]
        case Cylinder(radius, half_length):
            given = {"radius": numbers([radius]), "length": numbers([2 * half_length])}
            parts = [((0.0, 0.0, 0.0), "cylinder", given)]
        case Hull() | Ellipsoid() | Cone():
            corners = _corners(piece.shape)
            name = f"{_safe(body.name)}.{_safe(piece.name)}.obj"
            files[name] = obj_text(corners)
            parts = [((0.0, 0.0, 0.0), "mesh", {"filename": name})]
    for offset, shape, given in parts:
        own = ET.SubElement(link, kind)
        x, y, z = (np.array(piece.position) + turn.apply(offset)).tolist()
        _add_origin(own, (x, y, z), piece.orientation)
        ET.SubElement(ET.SubElement(own, "geometry"), shape, given)


def _corners(shape: Hull | Ellipsoid | Cone) -> tuple[Vector, ...]:
    match shape:
        case Hull(vertices):
            return vertices
        case Ellipsoid(half_axes):
            return elliptic_hull(half_axes)
        case Cone():
            return pyramid(shape)
