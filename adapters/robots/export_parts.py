"""What both export formats share: meshes of hulls, numbers with all digits, and the trees of a scene."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable

import numpy as np
from scipy.spatial import ConvexHull

from touchstone.scenarios.scenario import Scenario, Vector


def numbers(values: Iterable[float]) -> str:
    """Numbers with all their digits, separated by blanks."""
    return " ".join(repr(float(value)) for value in values)


def pretty(root: ET.Element) -> str:
    """XML text, an element per line."""
    ET.indent(root, " ")
    return ET.tostring(root, encoding="unicode") + "\n"


def triangles(vertices: tuple[Vector, ...]) -> list[tuple[int, int, int]]:
    """Faces of a hull's surface, counterclockwise from outside."""
    points = np.array(vertices)
    hull = ConvexHull(points)
    middle = points.mean(axis=0)
    found = []
    for a, b, c in hull.simplices.tolist():
        normal = np.cross(points[b] - points[a], points[c] - points[a])
        found.append((a, b, c) if normal @ (points[a] - middle) > 0 else (a, c, b))
    return found


def obj_text(vertices: tuple[Vector, ...]) -> str:
    """Wavefront OBJ file of a hull [m]."""
    corners = "".join(f"v {numbers(vertex)}\n" for vertex in vertices)
    return corners + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles(vertices))


def children_of(scenario: Scenario) -> dict[str, list[str]]:
    """Names of the joints that hang on each body, in the order of the trackers."""
    by_name = {joint.name: joint for joint in scenario.joints}
    found: dict[str, list[str]] = {}
    for tracker in scenario.trackers:
        for name in tracker.joints:
            found.setdefault(by_name[name].parent, []).append(name)
    return found
