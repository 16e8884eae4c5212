"""Triangle meshes in files of their own: OBJ, whose polygons become fans, and STL as text or binary [m]."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from touchstone.scenarios.avatar.number_checks import number_of
from touchstone.scenarios.files.safe_paths import regular

STL_HEADER = 84
"""Size of what precedes the triangles of a binary STL file [bytes]: 80 of text, then their count."""
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
STL_VERTEX = re.compile(r"^\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s*$", re.MULTILINE)


class MeshFileError(ValueError):
    """The file holds no triangle mesh; the message says where and why."""


def triangles_of(path: Path) -> dict[str, Any]:
    """Fields `vertices` and `triangles` of a mesh.

    Raises:
        MeshFileError: the file cannot be read, or holds something else.
    """
    read = {".obj": _of_obj, ".stl": _of_stl}.get(path.suffix.lower())
    if read is None:
        raise MeshFileError(f"{path.name}: expected a file .obj or .stl")
    try:
        vertices, triangles = read(regular(path).read_bytes(), path.name)
    except OSError as error:
        raise MeshFileError(f"{path.name}: {error.strerror or error}") from error
    if not triangles:
        raise MeshFileError(f"{path.name}: no triangles")
    return {"vertices": tuple(map(tuple, vertices)), "triangles": tuple(map(tuple, triangles))}


def _of_obj(data: bytes, name: str) -> tuple[list[Any], list[Any]]:
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), start=1):
        kind, *words = line.split() or [""]
        try:
            if kind == "v":
                x, y, z = map(number_of, words[:3])
                vertices.append([x, y, z])
            elif kind == "f":
                corners = [int(word.partition("/")[0]) for word in words]
                first, *others = [k - 1 if k > 0 else len(vertices) + k for k in corners]
                triangles += [(first, *pair) for pair in pairwise(others)]
        except ValueError as error:
            raise MeshFileError(f"{name}:{number}: found {line.strip()[:60]!r}, expected numbers") from error
    return vertices, triangles


def _of_stl(data: bytes, name: str) -> tuple[list[Any], list[Any]]:
    count = int.from_bytes(data[STL_HEADER - 4 : STL_HEADER], "little")
    if len(data) == STL_HEADER + count * STL_TRIANGLE.itemsize:
        corners = np.frombuffer(data, STL_TRIANGLE, offset=STL_HEADER)["corners"].astype(float)
    else:
        try:
            numbers = [number_of(x) for row in STL_VERTEX.findall(data.decode("ascii")) for x in row]
            corners = np.array(numbers).reshape(-1, 3, 3)
        except ValueError as error:
            raise MeshFileError(f"{name}: no STL file, neither text nor binary") from error
    return corners.reshape(-1, 3).tolist(), np.arange(3 * len(corners)).reshape(-1, 3).tolist()
