"""Recordings of one scene on several engines, packed for the page's player.

A scene becomes a JSON header and, per engine, one deflated block in base64. Layout of a block, little-endian,
f frames and m moving bodies:

    int16 (7, m, f)   position x y z [step] and quaternion w x y z [1/32767], each channel as differences
    uint8 (n, f)      overlap of every body: 0 none, else 1 + 40 log10(depth / 1e-7 m)
    float32 (f,)      deepest overlap [m]
    uint16 (f,)       number of contacts kept in each frame
    int16 (7, c)      contacts: point x y z [step], normal x y z [1/32767], force [log scale]
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.motion_bounds import extent
from touchstone.reports.exports import continuous, hull_mesh
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.scenario import (
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

FINEST_STEP = 1e-4
"""Least step of positions [m]: a tenth of a millimetre covers 6.5 m; scenes of larger extent take more."""
FARTHEST = 25.0
"""Distance from the scene's middle beyond which a body that flew off is shown at the border [m]."""
SHALLOWEST = 1e-7
"""Least depth that is coded [m]."""
ALARM = 1e-3
"""Depth from which a body has the colour of overlap [m]: the limit of the gallery; less is not seen."""
DEPTH_STEPS = 40.0
"""Steps of the coded depth per decade."""
MOST_CONTACTS = 48
"""Contacts shown per frame and engine: those with the largest impulses."""
FORCE_STEPS = 1000.0
"""Steps of the coded force per factor of e; 0 N is code 0."""
INT16 = 32767


def packed(scenario: Scenario, played: Mapping[tuple[str, str], Context]) -> dict[str, Any]:
    """Header and blocks of a scene.

    Args:
        played: (engine, profile) -> recording with its distances; engines in the order of the page.
    Returns:
        A JSON-serializable record that `player.js` reads.
    """
    moving = [k for k, body in enumerate(scenario.bodies) if body.kind != "fixed"]
    middle, extent = _extent(played, moving)
    step = max(FINEST_STEP, extent / INT16)
    return {
        "scene": scenario.name,
        "rate": scenario.frame_rate,
        "middle": middle.tolist(),
        "step": step,
        "size": _size(scenario, played, moving),
        "alarm": int(_coded(np.array([ALARM]))[0]),
        "moving": moving,
        "bodies": [
            {
                "name": body.name,
                "kind": body.kind,
                "at": [*body.position, *body.orientation],
                "pieces": [_piece(piece) for piece in body.pieces],
            }
            for body in scenario.bodies
        ],
        "engines": [_engine(key, context, moving, middle, step) for key, context in played.items()],
        **_disagreement(scenario, played),
    }


def _extent(played: Mapping[tuple[str, str], Context], moving: list[int]) -> tuple[Array, float]:
    """Middle of what moves [m] (3,), and the largest distance from it along an axis [m]."""
    paths = [context.recording.position[:, moving].reshape(-1, 3) for context in played.values()]
    points = np.concatenate([*paths, np.zeros((0, 3))])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return np.zeros(3), 0.0
    middle = np.median(points, axis=0)
    return middle, float(min(FARTHEST, np.abs(points - middle).max()))


def _size(scenario: Scenario, played: Mapping[tuple[str, str], Context], moving: list[int]) -> float:
    """Radius about the middle in which moving bodies mostly are, to their far ends [m], for the camera."""
    first = next(iter(played.values())).recording.position[:, moving].reshape(-1, 3)
    if not len(first):
        return 1.0
    off = np.linalg.norm(first - np.median(first, axis=0), axis=1)
    ends = [max(map(extent, scenario.bodies[k].pieces), default=0.0) for k in moving]
    return float(np.clip(np.percentile(off, 90) + np.median(ends), 0.15, 4.0))


def _piece(piece: Piece) -> dict[str, Any]:
    piece = shown_piece(piece)
    shown: dict[str, Any] = {"at": [*piece.position, *piece.orientation]}
    match piece.shape:
        case Sphere(radius):
            return shown | {"ball": [radius] * 3}
        case Ellipsoid(half):
            return shown | {"ball": list(half)}
        case Box(half):
            return shown | {"box": list(half)}
        case Capsule(radius, half_length):
            return shown | {"capsule": [radius, half_length]}
        case Cylinder(radius, half_length):
            return shown | {"cylinder": [radius, half_length]}
        case Cone(radius, half_length):
            return shown | {"cone": [radius, half_length]}
        case Hull(vertices):
            corners, _ = hull_mesh(np.array(vertices))
            return shown | {"hull": np.round(corners.reshape(-1), 5).tolist()}
    raise TypeError(f"no picture of {type(piece.shape).__name__}")


def _engine(
    key: tuple[str, str], context: Context, moving: list[int], middle: Array, step: float
) -> dict[str, Any]:
    recording = context.recording
    frames = len(recording.time)
    place = np.clip((recording.position[:, moving] - middle) / step, -INT16, INT16)
    pose = np.concatenate([place, continuous(recording.orientation[:, moving]) * INT16], axis=2)
    channels = np.rint(np.nan_to_num(pose)).astype(np.int16).transpose(2, 1, 0)
    depths = _depths(context)
    deepest = depths.max(axis=0) if len(depths) else np.zeros(frames)
    counts, contacts = _contacts(context, middle, step)
    block = b"".join(
        (
            np.diff(channels, axis=2, prepend=np.int16(0)).astype("<i2").tobytes(),
            _coded(depths).tobytes(),
            deepest.astype("<f4").tobytes(),
            counts.astype("<u2").tobytes(),
            contacts.astype("<i2").tobytes(),
        )
    )
    where = _deepest_point(context, int(np.argmax(deepest)))
    return {
        "engine": key[0],
        "profile": key[1],
        "frames": frames,
        "contacts": int(counts.sum()),
        "ended": recording.ended,
        "worst": int(np.argmax(deepest)),
        "worst_at": where,
        "worst_depth": float(deepest.max()),
        "data": base64.b64encode(zlib.compress(block, 9)).decode(),
    }


def _depths(context: Context) -> Array:
    """Overlap of every body with its deepest partner (n, f) [m]; all zero where nothing measures it."""
    found = np.zeros((len(context.scenario.bodies), len(context.recording.time)))
    try:
        distance = context.distances.distance
    except Exception:  # the oracle is missing: the rows of the run say so
        return found
    for pair, values in distance.items():
        for body in pair:
            found[body] = np.maximum(found[body], -values)
    return found


def _coded(depths: Array) -> np.ndarray:
    decades = np.log10(np.maximum(depths, SHALLOWEST) / SHALLOWEST)
    return np.where(depths > SHALLOWEST, np.clip(1 + DEPTH_STEPS * decades, 1, 255), 0).astype(np.uint8)


def _deepest_point(context: Context, frame: int) -> list[float] | None:
    """World point of the deepest overlap of a frame [m]."""
    try:
        distances = context.distances
    except Exception:
        return None
    pair = min(distances.distance, key=lambda p: distances.distance[p][frame], default=None)
    if pair is None or not np.isfinite(distances.point[pair][frame]).all():
        return None
    return [round(float(x), 4) for x in distances.point[pair][frame]]


def _contacts(context: Context, middle: Array, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Number of contacts per frame (f,), and the contacts (7, c) of the last native step of each.

    The force is the impulse over the native step.
    """
    recording, rows = context.recording, context.recording.contacts
    frames = len(recording.time)
    counts = np.zeros(frames, dtype=np.int64)
    if not len(rows):
        return counts, np.zeros((7, 0), dtype=np.int16)
    shown = context.contact_frame + 1  # a contact acts in the step that ends with the frame
    dt = float(recording.facts["dt"])
    last = np.full(frames, -np.inf)
    np.maximum.at(last, shown, np.floor(rows["time"] / dt + 1e-6))
    size = np.linalg.norm(rows["impulse"], axis=1)
    kept = np.flatnonzero(np.floor(rows["time"] / dt + 1e-6) == last[shown])
    kept = kept[np.lexsort((-size[kept], shown[kept]))]
    first = np.searchsorted(shown[kept], np.arange(frames))
    kept = kept[np.arange(len(kept)) - first[shown[kept]] < MOST_CONTACTS]
    np.add.at(counts, shown[kept], 1)
    columns = np.empty((7, len(kept)))
    columns[:3] = ((rows["position"][kept] - middle) / step).T
    columns[3:6] = (rows["normal"][kept] * INT16).T
    columns[6] = FORCE_STEPS * np.log1p(size[kept] / dt)
    return counts, np.rint(np.clip(np.nan_to_num(columns), -INT16, INT16)).astype(np.int16)


def _disagreement(scenario: Scenario, played: Mapping[tuple[str, str], Context]) -> dict[str, Any]:
    """Per frame, the largest distance between two engines' positions of one simulated body [m], and the frame
    and body of the largest of all."""
    free = [k for k, body in enumerate(scenario.bodies) if body.kind == "simulated"]
    frames = min((len(context.recording.time) for context in played.values()), default=0)
    if len(played) < 2 or not free or not frames:
        return {"apart": [], "apart_frame": 0, "apart_body": ""}
    places = np.array([context.recording.position[:frames][:, free] for context in played.values()])
    spread = np.zeros((frames, len(free)))
    for a in range(len(places)):
        for b in range(a):
            spread = np.fmax(spread, np.linalg.norm(places[a] - places[b], axis=2))
    frame, body = np.unravel_index(int(np.argmax(spread)), spread.shape)
    apart = [float(f"{value:.3g}") for value in spread.max(axis=1)]
    return {"apart": apart, "apart_frame": int(frame), "apart_body": scenario.bodies[free[int(body)]].name}
