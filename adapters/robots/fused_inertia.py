"""Inertia of links of a URDF that are fixed to each other: they are one body, and MuJoCo checks each.

Files give a sensor or the base a mass without moments, or moments that no body has: what moves is their sum.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.robots.links import MassProperties, combined
from touchstone.adapters.robots.xml_source import Element, number

WORLD_LINK = "world"
"""Link that MuJoCo takes as the world: what is fixed to it keeps its mass."""
LEAST_MOMENT = 1e-14
"""Moment up to which MuJoCo takes it as none [kg m^2]."""


def links_and_joints(root: Element) -> tuple[dict[str | None, Element], list[tuple[Element, Any, Any]]]:
    """Links by name, and each joint with the names of its parent and child."""
    links = {one.attributes.get("name"): one for one in root.children if one.tag == "link"}
    joints = [
        (joint, _end(joint, "parent"), _end(joint, "child"))
        for joint in root.children
        if joint.tag == "joint"
    ]
    return links, joints


def _end(joint: Element, tag: str) -> Any:
    return next((end.attributes.get("link") for end in joint.children if end.tag == tag), None)


def fuse_inertia(root: Element) -> None:
    """Give a link the inertia of all that is fixed to it, where that of one of them is none of a body's and
    their sum is."""
    links, joints = links_and_joints(root)
    below: dict[Any, list[tuple[Element, Any]]] = {}
    hanging: set[Any] = set()  # with one parent each, so that what hangs on a top ends
    for joint, parent, child in joints:
        fixed = joint.attributes.get("type") == "fixed" and parent != WORLD_LINK
        if fixed and child in links and child not in hanging:
            hanging.add(child)
            below.setdefault(parent, []).append((joint, child))
    for top in below:
        if top in hanging or top not in links:
            continue
        members = list(_members(links, below, top, np.zeros(3), np.eye(3)))
        given = [mass for _, mass in members if mass is not None and (mass.mass or mass.inertia.any())]
        whole = combined(given)
        if all(_of_a_body(mass) for mass in given) or not _of_a_body(whole):
            continue
        for link, _ in members:
            link.children = [one for one in link.children if one.tag != "inertial"]
        links[top].children.append(_inertial(links[top], whole))


def _members(
    links: dict[Any, Element],
    below: dict[Any, list[tuple[Element, Any]]],
    name: Any,
    place: Array,
    turn: Array,
) -> Iterator[tuple[Element, MassProperties | None]]:
    """A link at a pose and what is fixed to it, with their mass properties in the frame of the first."""
    own = _mass_properties(links[name])
    yield links[name], own and own.moved(place, turn)
    for joint, child in below.get(name, ()):
        at, axes = _origin(joint)
        yield from _members(links, below, child, place + turn @ at, turn @ axes)


def _mass_properties(link: Element) -> MassProperties | None:
    """What <inertial> says, in the link's frame; None if it is absent."""
    inertial = next((one for one in link.children if one.tag == "inertial"), None)
    if inertial is None:
        return None
    found = {one.tag: one for one in inertial.children}
    nothing = Element("", {}, link.file, link.line)
    xx, yy, zz, xy, xz, yz = (
        number(found.get("inertia", nothing), name) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    )
    inertia = np.array(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)))
    place, turn = _origin(inertial)
    mass = number(found.get("mass", nothing), "value")
    return MassProperties(mass, np.zeros(3), inertia).moved(place, turn)


def _origin(element: Element) -> tuple[Array, Array]:
    """Position [m] and axes as columns of an element's <origin>; NaN where it is no pose."""
    origin = next((one.attributes for one in element.children if one.tag == "origin"), {})
    try:
        place, angles = (
            np.array([float(word) for word in origin.get(name, "0 0 0").split()]) for name in ("xyz", "rpy")
        )
        return place.reshape(3), Rotation.from_euler("xyz", angles).as_matrix()
    except ValueError:
        return np.full(3, np.nan), np.eye(3)


def _of_a_body(found: MassProperties) -> bool:
    """Whether a body with such a mass and such moments exists."""
    if not np.isfinite([found.mass, *found.center, *found.inertia.flat]).all():
        return False
    low, middle, high = np.linalg.eigvalsh(found.inertia)
    return bool(found.mass > 0 and low > LEAST_MOMENT and high <= low + middle)


def _inertial(link: Element, found: MassProperties) -> Element:
    """Element with mass properties in the link's frame."""
    matrix = found.inertia
    moments = {f"i{'xyz'[a]}{'xyz'[b]}": repr(float(matrix[a, b])) for a in range(3) for b in range(a, 3)}
    origin = {"xyz": " ".join(repr(float(value)) for value in found.center)}
    parts = [("origin", origin), ("mass", {"value": repr(float(found.mass))}), ("inertia", moments)]
    inner = [Element(tag, attributes, link.file, link.line) for tag, attributes in parts]
    return Element("inertial", {}, link.file, link.line, inner)
