"""Collada meshes and STL as text as OBJ, which MuJoCo reads: by Coal's loader, in m."""

import re
from pathlib import Path

import coal
import numpy as np

UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']+)[\"']")
"""Size of the file's unit [m], which Coal's loader leaves out."""


def obj_of(path: Path) -> str:
    """OBJ text of a mesh file, in m; raises ValueError if it holds no triangles or cannot be read."""
    try:
        unit = UNIT.search(path.read_bytes())
        mesh = coal.MeshLoader().load(str(path), np.full(3, float(unit[1]) if unit else 1.0))
        vertices, faces = mesh.vertices(), [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    except (RuntimeError, ValueError) as error:
        said = str(error).partition("message: ")[2].splitlines()
        reasons = [line for line in said if line and not line.startswith(("Could not load", "Hint"))]
        raise ValueError(reasons[0] if reasons else "cannot be read") from error
    if not faces:
        raise ValueError("holds no triangles")
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {face[0] + 1} {face[1] + 1} {face[2] + 1}" for face in faces]
    return "\n".join(lines) + "\n"
