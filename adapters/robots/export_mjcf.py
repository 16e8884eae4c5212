"""A scene as MJCF, for MuJoCo's own viewer: bodies, hinges, servos and friction; all numbers with all digits.

MuJoCo takes no restitution, and one friction per geom: the larger of two holds. Trackers become a keyframe of
the start posture and position servos. Meshes are inside the file; cones and rounded shapes are meshes.
"""

import xml.etree.ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.robots.export_parts import children_of, numbers, pretty
from touchstone.scenarios.scenario import (
    UNMOVED,
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
    Quaternion,
    RoundedBox,
    RoundedHull,
    Scenario,
    Sphere,
    Vector,
)
from touchstone.scenarios.solids import pyramid, shown_piece


def mjcf(scenario: Scenario) -> str:
    """MJCF text of a scene at its start."""
    root = ET.Element("mujoco", model=scenario.name)
    flags = {"angle": "radian", "autolimits": "false", "inertiafromgeom": "false", "balanceinertia": "false"}
    ET.SubElement(root, "compiler", flags)
    ET.SubElement(root, "option", gravity=numbers(scenario.acting_gravity), integrator="implicitfast")
    assets, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0 0 5", dir="0 0 -1", directional="true")
    _Writer(scenario, assets).write(world)
    _add_servos(scenario, root)
    return pretty(root)


class _Writer:
    """Writer of the bodies of a scene, below one another."""

    def __init__(self, scenario: Scenario, assets: ET.Element) -> None:
        self._scenario, self._assets = scenario, assets
        self._joints = {joint.name: joint for joint in scenario.joints}
        self._bodies = {body.name: body for body in scenario.bodies}
        self._below = children_of(scenario)
        self._friction = [
            max((scenario.pair_coefficients(*sorted((k, other)))[1] for other in touching), default=0.0)
            for k, touching in enumerate(_partners(scenario))
        ]

    def write(self, world: ET.Element) -> None:
        roots = {tracker.root: tracker for tracker in self._scenario.trackers}
        for body in self._scenario.bodies:
            if body.name in roots:
                tracker = roots[body.name]
                self._body(world, body, tracker.positions[0], tracker.orientations[0], None)
            elif body.kind != "driven":
                self._body(world, body, body.position, body.orientation, None)

    def _body(
        self, above: ET.Element, body: Body, place: Vector, turn: Quaternion, joint: Joint | None
    ) -> None:
        own = ET.SubElement(above, "body", name=body.name, pos=numbers(place), quat=numbers(turn))
        if joint is not None:
            limits = {"limited": "true", "range": numbers((joint.lower, joint.upper))}
            axis = Rotation.from_quat(joint.orientation, scalar_first=True).inv().apply(joint.axis)
            ET.SubElement(
                own, "joint", {"name": joint.name, "type": "hinge", "axis": numbers(axis), **limits}
            )
        elif body.kind not in UNMOVED:
            ET.SubElement(own, "freejoint", name=f"{body.name}_free")
        if body.kind == "prescribed":
            own.set("mocap", "true")
        if body.kind == "driven":
            own.set("gravcomp", "1")
        if body.kind not in UNMOVED:
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
            inertia = numbers((xx, yy, zz, xy, xz, yz))
            center = numbers(body.center_of_mass)
            ET.SubElement(own, "inertial", pos=center, mass=numbers([body.mass]), fullinertia=inertia)
        for piece in body.pieces:
            self._geom(own, body, piece)
        for name in self._below.get(body.name, ()):
            child = self._joints[name]
            self._body(own, self._bodies[child.child], child.position, child.orientation, child)

    def _geom(self, own: ET.Element, body: Body, piece: Piece) -> None:
        friction = self._friction[self._scenario.body_index(body.name)]
        given = {"name": f"{body.name}.{piece.name}", "friction": numbers((friction, 0.005, 0.0001))}
        given |= {"pos": numbers(piece.position), "quat": numbers(piece.orientation)}
        motion = (*piece.surface_velocity, *piece.surface_angular_velocity)
        given |= {"surfacevel": numbers(motion)} if any(motion) else {}
        if isinstance(piece.shape, RoundedBox | RoundedHull):
            piece = shown_piece(piece)
        match piece.shape:
            case Sphere(radius):
                given |= {"type": "sphere", "size": numbers([radius])}
            case Box(half):
                given |= {"type": "box", "size": numbers(half)}
            case Capsule(radius, half_length):
                given |= {"type": "capsule", "size": numbers((radius, half_length))}
            case Cylinder(radius, half_length):
                given |= {"type": "cylinder", "size": numbers((radius, half_length))}
            case Ellipsoid(half):
                given |= {"type": "ellipsoid", "size": numbers(half)}
            case HalfSpace():
                given |= {"type": "plane", "size": "0 0 1"}
            case Hull() | Cone():
                vertices = piece.shape.vertices if isinstance(piece.shape, Hull) else pyramid(piece.shape)
                given |= {"type": "mesh", "mesh": given["name"]}
                corners = numbers(np.ravel(vertices).tolist())
                ET.SubElement(self._assets, "mesh", name=given["name"], vertex=corners, inertia="convex")
        ET.SubElement(own, "geom", given)


def _partners(scenario: Scenario) -> list[list[int]]:
    """Per body the indices of the bodies that it may touch."""
    found: list[list[int]] = [[] for _ in scenario.bodies]
    for a, b in scenario.touching_pairs():
        found[a].append(b)
        found[b].append(a)
    return found


def _add_servos(scenario: Scenario, root: ET.Element) -> None:
    """Position servos of all hinges, and exclusions of links that may not touch."""
    if not scenario.trackers:
        return
    allowed = set(scenario.touching_pairs())
    groups, contact = scenario.groups(), ET.SubElement(root, "contact")
    for a, one in enumerate(scenario.bodies):
        for b in range(a + 1, len(scenario.bodies)):
            if groups[a] == groups[b] >= 0 and (a, b) not in allowed:
                ET.SubElement(contact, "exclude", body1=one.name, body2=scenario.bodies[b].name)
    servos = ET.SubElement(root, "actuator")
    for tracker in scenario.trackers:
        for name in tracker.joints:
            ET.SubElement(servos, "position", name=name, joint=name, kp="100", dampratio="1")
