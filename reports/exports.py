"""Recordings in files of other programs: tables, and glTF scenes.

A recording as animated binary glTF 2.0 (GLB), which Blender, Windows, macOS and web viewers open.

glTF has y up; the root node turns our z up. A node per body carries its mesh; bodies that move have a
translation and a rotation per frame, interpolated linearly.
"""

from __future__ import annotations

import json
import struct
from math import pi
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    Hull,
    Piece,
    Scenario,
    Sphere,
)
from touchstone.scenarios.solids import shown_piece

AXES, QUATERNION = ("x", "y", "z"), ("qw", "qx", "qy", "qz")


def bodies(recording: Recording, scenario: Scenario) -> pd.DataFrame:
    """A row per frame and body: time [s], position [m] and orientation of the body's frame, velocity of the
    centre of mass [m/s], angular velocity [rad/s]; world."""
    frames, count = recording.position.shape[:2]
    found: dict[str, object] = {
        "frame": np.repeat(np.arange(frames), count),
        "time": np.repeat(recording.time, count),
        "body": [body.name for body in scenario.bodies] * frames,
    }
    for names, values in (
        (AXES, recording.position),
        (QUATERNION, recording.orientation),
        ([f"v{axis}" for axis in AXES], recording.linear_velocity),
        ([f"w{axis}" for axis in AXES], recording.angular_velocity),
    ):
        found |= dict(zip(names, values.reshape(frames * count, -1).T))
    return pd.DataFrame(found)


def joints(recording: Recording, scenario: Scenario) -> pd.DataFrame:
    """A row per frame and hinge: angle [rad] and rate [rad/s]."""
    names = [name for tracker in scenario.trackers for name in tracker.joints]
    frames = len(recording.time)
    return pd.DataFrame(
        {
            "frame": np.repeat(np.arange(frames), len(names)),
            "time": np.repeat(recording.time, len(names)),
            "joint": names * frames,
            "angle": recording.joint_angle.reshape(-1),
            "rate": recording.joint_rate.reshape(-1),
        }
    )


def contacts(recording: Recording, scenario: Scenario) -> pd.DataFrame:
    """A row per contact point of a native step: time [s], bodies, point [m], normal from a to b, distance [m]
    and impulse on b [N s]."""
    names, rows = [body.name for body in scenario.bodies], recording.contacts
    found: dict[str, object] = {
        "time": rows["time"],
        "body_a": [names[k] for k in rows["body_a"]],
        "body_b": [names[k] for k in rows["body_b"]],
        "distance": rows["distance"],
    }
    for start, field in (("", "position"), ("n", "normal"), ("j", "impulse")):
        found |= {f"{start}{axis}": rows[field][:, k] for k, axis in enumerate(AXES)}
    return pd.DataFrame(found)


TABLES = {"bodies": bodies, "joints": joints, "contacts": contacts}


RINGS, SIDES = 12, 24
"""Rings and sides of a ball [1]: the surface is within 1 % of the radius."""
Mesh = tuple[Array, Array]
"""Corners (3 t, 3) of t triangles, counterclockwise from outside [m], and their normals (3 t, 3)."""


def body_mesh(body: Body) -> Mesh:
    """All pieces of a body that has some, in the body's frame."""
    meshes = [piece_mesh(piece) for piece in body.pieces]
    return np.concatenate([one for one, _ in meshes]), np.concatenate([one for _, one in meshes])


def piece_mesh(piece: Piece) -> Mesh:
    """A piece in its body's frame."""
    piece = shown_piece(piece)
    corners, normals = _shape(piece)
    turned = Rotation.from_quat(piece.orientation, scalar_first=True)
    return turned.apply(corners) + np.array(piece.position), turned.apply(normals)


def _shape(piece: Piece) -> Mesh:
    match piece.shape:
        case Sphere(radius):
            return _ball(np.full(3, radius), 0.0)
        case Ellipsoid(half):
            return _ball(np.array(half), 0.0)
        case Capsule(radius, half_length):
            return _ball(np.full(3, radius), half_length)
        case Cylinder(radius, half_length):
            return _cylinder(radius, half_length, radius)
        case Cone(radius, half_length):
            return _cylinder(radius, half_length, 0.0)
        case Box(half):
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return hull_mesh(signs * np.array(half))
        case Hull(vertices):
            return hull_mesh(np.array(vertices))
    raise TypeError(f"no mesh of {type(piece.shape).__name__}")


def hull_mesh(vertices: Array) -> Mesh:
    """Triangles of a hull, with flat normals."""
    hull = ConvexHull(vertices)
    faces, normals = vertices[hull.simplices], hull.equations[:, :3]
    across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    inward = np.einsum("ij,ij->i", across, normals) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces.reshape(-1, 3), np.repeat(normals, 3, axis=0)


def _cylinder(radius: float, half_length: float, top: float) -> Mesh:
    """Prism or pyramid of SIDES sides whose side has the normals of a cylinder or, if the radius `top` of its
    upper cap is 0, of a cone."""
    turns = 2 * pi * np.arange(SIDES) / SIDES
    around = np.column_stack((np.cos(turns), np.sin(turns)))
    lower = np.column_stack((radius * around, np.full(SIDES, -half_length)))
    upper = np.column_stack((top * around, np.full(SIDES, half_length)))
    corners, normals = hull_mesh(np.vstack((lower, upper if top else upper[:1])))
    side = np.abs(normals[:, 2]) < 1 - 1e-9
    # at an apex, the normal of the triangle
    off = np.hypot(corners[:, 0], corners[:, 1])
    side &= off > 0
    slant = np.hypot(radius - top, 2 * half_length)
    normals[side, :2] = corners[side, :2] / off[side, None] * 2 * half_length / slant
    normals[side, 2] = (radius - top) / slant
    return corners, normals


def _ball(half: Array, half_length: float) -> Mesh:
    """Ellipsoid with half axes [m]; its halves are `half_length` away from the middle along z [m]."""
    polar = np.linspace(0, pi, RINGS + 1)
    upper = polar[: RINGS // 2 + 1]
    rings = np.r_[upper, polar[RINGS // 2 :]] if half_length else polar
    shift = np.where(np.arange(len(rings)) < len(upper), half_length, -half_length)
    round_ = np.linspace(0, 2 * pi, SIDES + 1)
    unit = np.stack(
        [np.outer(np.sin(rings), np.cos(round_)), np.outer(np.sin(rings), np.sin(round_)),
         np.outer(np.cos(rings), np.ones(SIDES + 1))], axis=-1,
    )  # fmt: skip
    points = unit * half
    points[..., 2] += shift[:, None]
    normals = unit / half
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    quads = [(slice(0, -1), slice(0, -1)), (slice(1, None), slice(0, -1)), (slice(1, None), slice(1, None)),
             (slice(0, -1), slice(1, None))]  # fmt: skip
    a, b, c, d = (points[k] for k in quads)
    na, nb, nc, nd = (normals[k] for k in quads)
    # The triangles at both poles have no area on one side.
    corners = np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 3, 3)
    upright = np.stack([na, nb, nc, na, nc, nd], axis=-2).reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept = area > 1e-9 * area.max()
    return corners[kept].reshape(-1, 3), upright[kept].reshape(-1, 3)


FLOAT, ARRAY_BUFFER = 5126, 34962
MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
"""Numbers of the glTF 2.0 specification."""
Z_UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
"""Rotation from z up to y up, xyzw."""
COLORS = {
    "fixed": [0.75, 0.75, 0.72, 1.0],
    "driven": [0.93, 0.72, 0.55, 1.0],
    "prescribed": [0.6, 0.5, 0.75, 1.0],
    "simulated": [0.0, 0.45, 0.7, 1.0],
}


class _Buffer:
    """Binary chunk with its views and accessors."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: np.ndarray, kind: str, vertices: bool = False) -> int:
        """Append an array as float32; returns its accessor."""
        floats = np.ascontiguousarray(values, "<f4")
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": floats.nbytes}
        self.views.append(view | ({"target": ARRAY_BUFFER} if vertices else {}))
        self.data += floats.tobytes()
        table = floats.reshape(len(floats), -1)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": FLOAT,
                "count": len(floats),
                "type": kind,
                "min": [float(x) for x in table.min(axis=0)],
                "max": [float(x) for x in table.max(axis=0)],
            }
        )
        return len(self.accessors) - 1


def glb(recording: Recording, scenario: Scenario) -> bytes:
    """The recording of a scene as a GLB file; a frame beyond single precision ends the animation."""
    buffer = _Buffer()
    poses = np.concatenate([recording.position, recording.orientation], axis=2)
    with np.errstate(over="ignore"):
        finite: np.ndarray = np.isfinite(poses.astype("<f4")).all(axis=(1, 2))
    # a quaternion of zeros is no orientation
    finite &= (np.linalg.norm(recording.orientation, axis=2) > 0).all(axis=1)
    frames = len(poses) if finite.all() else int(np.argmin(finite))
    times = buffer.add(recording.time[:frames], "SCALAR")
    kinds = list(COLORS)
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    samplers: list[dict[str, Any]] = []
    for k, body in enumerate(scenario.bodies):
        node: dict[str, Any] = {"name": body.name}
        if body.pieces:
            corners, normals = body_mesh(body)
            kept = (buffer.add(values, "VEC3", True) for values in (corners, normals))
            attributes = dict(zip(("POSITION", "NORMAL"), kept))
            node["mesh"] = len(meshes)
            primitive = {"attributes": attributes, "material": kinds.index(body.kind)}
            meshes.append({"name": body.name, "primitives": [primitive]})
        place = recording.position[:frames, k]
        turn = continuous(recording.orientation[:frames, k])[:, [1, 2, 3, 0]]
        turn = turn / np.linalg.norm(turn, axis=1, keepdims=True)
        if body.kind == "fixed":
            place, turn = place[:1], turn[:1]
        if len(place):
            node |= {"translation": place[0].tolist(), "rotation": turn[0].tolist()}
        nodes.append(node)
        for path, values, kind in (("translation", place, "VEC3"), ("rotation", turn, "VEC4")):
            if body.kind != "fixed" and frames:
                output = buffer.add(values, kind)
                samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})
                channels.append({"sampler": len(samplers) - 1, "target": {"node": k, "path": path}})
    nodes.append({"name": scenario.name, "rotation": Z_UP, "children": list(range(len(nodes)))})
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "touchstone"},
        "scene": 0,
        "scenes": [{"nodes": [len(nodes) - 1]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [
            {"name": kind, "pbrMetallicRoughness": {"baseColorFactor": color, "metallicFactor": 0.0}}
            for kind, color in COLORS.items()
        ],
        "buffers": [{"byteLength": len(buffer.data)}],
        "bufferViews": buffer.views,
        "accessors": buffer.accessors,
    }
    if channels:
        name = f"{scenario.name}, {recording.facts['engine']} {recording.facts['profile']}"
        document["animations"] = [{"name": name, "channels": channels, "samplers": samplers}]
    text, data = json.dumps(document, allow_nan=False).encode(), bytes(buffer.data)
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), JSON_CHUNK) + text
    chunks += struct.pack("<II", len(data), BINARY_CHUNK) + data
    return struct.pack("<III", MAGIC, VERSION, 12 + len(chunks)) + chunks


def continuous(quaternions: Array) -> Array:
    """Quaternions (f, ..., 4) with signs such that each is nearest to the one before."""
    dots = np.einsum("f...i,f...i->f...", quaternions[1:], quaternions[:-1])
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., None]])
