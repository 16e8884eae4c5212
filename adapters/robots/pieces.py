"""Pieces of a scene from the colliding geometry of a compiled robot."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.robots.hulls import Approximation, mesh_hull
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.scenarios.height_field import HeightField
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Piece,
    Quaternion,
    Shape,
    Sphere,
    vector,
)
from touchstone.scenarios.triangle_mesh import TriangleMesh

TYPE = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")): name
    for name in ("plane", "hfield", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "sdf")
}
SLAB = (10.0, 10.0, 0.5)
"""Half extents of the box in place of a plane [m]."""


def collides(model: Any, geom: int) -> bool:
    """Whether a geom can touch anything; others are drawn only."""
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def geoms_of(model: Any, body: int) -> list[int]:
    """Colliding geoms of a body."""
    first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
    return [geom for geom in range(first, first + count) if collides(model, geom)]


def may_touch(model: Any, a: int, b: int) -> bool:
    """Whether two geoms of links that no joint connects are meant to collide."""
    links = [int(model.body_weldid[model.geom_bodyid[geom]]) for geom in (a, b)]
    above = [int(model.body_weldid[model.body_parentid[link]]) for link in links]
    beside = links[0] == links[1] or links[0] == above[1] or links[1] == above[0]
    return not beside and masks_allow(model, a, b)


def masks_allow(model: Any, a: int, b: int) -> bool:
    """Whether two geoms collide by their masks, and no exclusion names their bodies."""
    # MuJoCo's signature of an excluded pair of bodies
    pair = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    if (pair[0] << 16) + pair[1] in set(model.exclude_signature.tolist()):
        return False
    masks = model.geom_contype, model.geom_conaffinity
    return bool(masks[0][a] & masks[1][b] or masks[0][b] & masks[1][a])


def surface_velocity(model: Any, geom: int) -> Array:
    """Velocity [m/s] and angular velocity [rad/s] of the material of a geom's surface (6,), in its frame; 0
    if its body can move, as that of a scene may not."""
    stands = model.body_weldid[model.geom_bodyid[geom]] == 0 and hasattr(model, "geom_surfacevel")
    return np.array(model.geom_surfacevel[geom]) if stands else np.zeros(6)


def mesh_triangles(model: Any, mesh: int) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (n, 3) [m] and triangles (m, 3) of a mesh, anticlockwise as seen from outside."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return vertices, model.mesh_face[first : first + count]


def _height_field(model: Any, field: int) -> HeightField:
    """A height field of the model, whose rows are along y."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    x, y, top, depth = model.hfield_size[field].tolist()
    first = int(model.hfield_adr[field])
    heights = top * model.hfield_data[first : first + rows * columns].reshape(rows, columns).T.astype(float)
    spacing = 2 * x / (columns - 1), 2 * y / (rows - 1)
    return HeightField(tuple(map(tuple, heights.tolist())), spacing, -depth)


class PieceMaker:
    """Pieces from geoms; `notes` names each hull of a mesh with its error."""

    def __init__(self, model: Any, notes: list[str]) -> None:
        self.model, self._notes = model, notes
        self._hulls: dict[int, Approximation] = {}

    def piece(self, geom: int, place: Array, turn: Array) -> Piece:
        """Piece of a geom whose body is at `place` in the link's frame, its axes as the columns of `turn`."""
        model, name = self.model, self._name(geom)
        (at, turned), shape = self._pose(geom, place, turn), self._shape(geom, name)
        velocity, spin = np.split(surface_velocity(model, geom), 2)
        if TYPE[int(model.geom_type[geom])] == "plane":
            # the upper face of the slab is the plane, its middle the point next to the origin
            below = turned.inv().apply(-at) * (1.0, 1.0, 0.0) + (0.0, 0.0, -SLAB[2])
            at, velocity = at + turned.apply(below), velocity + np.cross(spin, below)
        return Piece(name, shape, vector(at), quaternion(turned), vector(velocity), vector(spin))

    def standing(self, geom: int, place: Array, turn: Array) -> tuple[Piece, ...]:
        """Pieces of a geom that cannot move: of the triangles of a height field, or of a closed mesh that
        is not convex."""
        surface = self._surface(geom)
        try:
            pieces = () if surface is None else surface.pieces()
        except ValueError as error:
            raise RobotError(f"geom {self._name(geom)!r}: {error}") from error
        at, turned = self._pose(geom, place, turn)
        velocity, spin = map(vector, np.split(surface_velocity(self.model, geom), 2))
        return tuple(
            replace(
                piece,
                name=f"{self._name(geom)}_{piece.name}",
                position=vector(at),
                orientation=quaternion(turned),
                surface_velocity=velocity,
                surface_angular_velocity=spin,
            )
            for piece in pieces
        ) or (self.piece(geom, place, turn),)

    def _surface(self, geom: int) -> HeightField | TriangleMesh | None:
        """Terrain of a geom; None if its piece is convex."""
        model, name = self.model, self._name(geom)
        kind, data = TYPE.get(int(model.geom_type[geom])), int(model.geom_dataid[geom])
        if kind == "hfield":
            return _height_field(model, data)
        if kind != "mesh" or not self.mesh(data, name).fills_hollows:
            return None
        vertices, faces = mesh_triangles(model, data)
        surface = TriangleMesh(tuple(map(vector, vertices)), tuple(map(tuple, faces.tolist())))
        label = f"mesh {model.mesh(data).name!r}"
        if fault := next(surface.faults(), None):
            self._notes.append(f"{label}: not its triangles, but its hull: {': '.join(fault)}")
            return None
        self._notes.append(
            f"{label} of a fixed body: its {len(faces)} triangles, of which MuJoCo plays the hull"
        )
        return surface

    def _name(self, geom: int) -> str:
        model = self.model
        return model.geom(geom).name or f"{model.body(model.geom_bodyid[geom]).name or 'geom'}_{geom}"

    def _pose(self, geom: int, place: Array, turn: Array) -> tuple[Array, Rotation]:
        inner = Rotation.from_quat(self.model.geom_quat[geom], scalar_first=True)
        return place + turn @ self.model.geom_pos[geom], Rotation.from_matrix(turn) * inner

    def _shape(self, geom: int, name: str) -> Shape:
        model = self.model
        x, y, z = model.geom_size[geom].tolist()
        match TYPE.get(int(model.geom_type[geom]), ""):
            case "sphere":
                return Sphere(x)
            case "capsule":
                return Capsule(x, y)
            case "ellipsoid":
                return Ellipsoid((x, y, z))
            case "box":
                return Box((x, y, z))
            case "plane":
                return Box(SLAB)
            case "cylinder":
                return Cylinder(x, y)
            case "mesh":
                return self.mesh(int(model.geom_dataid[geom]), name).hull
            case other:
                raise RobotError(f"geom {name!r}: no shape for type {other or 'unknown'}")

    def mesh(self, mesh: int, name: str) -> Approximation:
        """Hull of a mesh, computed once; `name` of the geom or mesh in messages."""
        if mesh not in self._hulls:
            model = self.model
            try:
                self._hulls[mesh] = mesh_hull(*mesh_triangles(model, mesh))
            except ValueError as error:
                raise RobotError(f"mesh {model.mesh(mesh).name!r}: {error}") from error
            found = self._hulls[mesh]
            self._notes.append(
                f"mesh {model.mesh(mesh).name!r}: convex hull of {len(found.hull.vertices)} corners, "
                f"cuts off {found.cut * 1e3:.2g} mm, fills hollows of {found.filled * 1e3:.2g} mm, "
                f"at a size of {found.size * 1e3:.3g} mm"
            )
        return self._hulls[mesh]


def quaternion(turned: Rotation) -> Quaternion:
    """Unit quaternion wxyz."""
    w, x, y, z = (turned.as_quat(scalar_first=True) / np.linalg.norm(turned.as_quat())).tolist()
    return (w, x, y, z)
