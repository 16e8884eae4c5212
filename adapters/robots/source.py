"""A robot's file as a compiled MuJoCo model: what a scene cannot represent is refused by name before."""

import re
import warnings
from dataclasses import dataclass
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np

from touchstone.adapters.engines.mujoco.model import hear_warnings
from touchstone.adapters.robots.file_faults import MJCF_NUMBERS, URDF_NUMBERS, link_faults, number_faults
from touchstone.adapters.robots.fused_inertia import fuse_inertia, links_and_joints
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.xml_source import Element, found_file, is_text_stl, number, parsed

COLLADA = ".dae"
MESH_SUFFIXES = (".stl", ".obj", ".msh", COLLADA)
"""Meshes of URDF: MuJoCo reads all but the last and STL as text, which are converted."""
REFUSED_JOINTS = {
    "floating": "six degrees of freedom cannot be kept; a tracker places the root of a robot",
    "planar": "three degrees of freedom in a plane cannot be kept",
}
REFUSED_MJCF = {
    "spatial": "a tendon that spans bodies cannot be kept",
    "flex": "deformable bodies cannot be kept",
    "flexcomp": "deformable bodies cannot be kept",
    "composite": "composite bodies cannot be kept",
    "plugin": "plug-ins are not loaded",
    "replicate": "replicated bodies cannot be named",
}
LOOPS = ("connect", "weld", "flex", "distance")
"""Equality constraints that close a loop of bodies."""
PLAIN_WORDS = {
    "inertia must have positive eigenvalues": "its inertia has a moment of zero or less, which no body has",
    "must be larger than mjMINVAL": "joints move it, but it has no mass or no inertia",
    "inertia must satisfy A + B >= C": "a moment of inertia exceeds the sum of the others, as in no body",
}
"""Faults that MuJoCo names by how it computes -> what is wrong in the file."""
FILES = {"mesh": "meshdir", "texture": "texturedir", "hfield": "", "skin": ""}
"""MJCF elements that name a file, and the compiler's attribute with its folder."""


QUARTER_DECIMALS = 4
"""Decimals from which an angle that is quarter turns as far as it is written stands for them: a cylinder that
leans against its axle by 4e-6 rad wobbles, and on a rigid floor runs on one rim at a time."""
DEEPEST_INCLUDE = 20
"""Files that include each other, beyond which MuJoCo says what is wrong."""


@dataclass(frozen=True, slots=True)
class Source:
    """A compiled robot: `urdf` or `mjcf`, its root element, MuJoCo's model, what MuJoCo warned of, and links
    whose shapes turn by exact quarter turns."""

    form: str
    root: Element
    model: Any
    warned: tuple[str, ...]
    turned: tuple[str, ...] = ()


def compiled(path: Path, allow_paths: bool = False) -> Source:
    """Check and compile a robot's file.

    Args:
        allow_paths: whether files outside the robot's folder may be read.
    Raises:
        RobotError: one line per fault: file, line, element, reason.
    """
    root = parsed(path)
    if root.tag == "robot":
        with TemporaryDirectory() as scratch:
            load = _urdf_spec(root, path, allow_paths, Path(scratch))
            turned = _turn_exactly(root)
            return Source("urdf", root, *_compiled(root, load, path), turned)
    if root.tag == "mujoco":
        _check_mjcf(root, path, allow_paths)
        return Source("mjcf", root, *_compiled(root, lambda: _mjcf_spec(root, path), path))
    raise RobotError(f"{path}:{root.line}: found <{root.tag}>, expected <robot> (URDF) or <mujoco> (MJCF)")


def _urdf_spec(root: Element, path: Path, allow_paths: bool, scratch: Path) -> Any:
    """A function that makes the spec of a URDF file; `scratch` holds converted meshes until then."""
    faults: list[str] = []
    for joint in (one for one in root.children if one.tag == "joint"):
        reason = REFUSED_JOINTS.get(joint.attributes.get("type", ""))
        if reason:
            faults.append(joint.named(f"type {joint.attributes['type']}: {reason}"))
        for limit in (one for one in joint.children if one.tag == "limit"):
            lower, upper = (number(limit, name) for name in ("lower", "upper"))
            if lower > upper:
                faults.append(joint.named(f"limits from {lower:g} to {upper:g} are inverted"))
    root.children = [one for one in root.children if one.tag in ("link", "joint", "mujoco")]
    for link in (one for one in root.children if one.tag == "link"):
        link.children = [one for one in link.children if one.tag != "visual"]
    for mesh in (one for one in root.walk() if one.tag == "mesh"):
        try:
            file = found_file(mesh, path.parent, mesh.attributes.get("filename", ""), allow_paths)
            if file.suffix.lower() not in MESH_SUFFIXES:
                raise RobotError(
                    mesh.named(f"{file.name}: found {file.suffix}, expected {', '.join(MESH_SUFFIXES)}")
                )
            if file.suffix.lower() == COLLADA or is_text_stl(file):
                file = _converted(mesh, file, scratch)
            mesh.attributes["filename"] = str(file)
        except RobotError as error:
            faults.append(str(error))
    faults += [*link_faults(root), *number_faults(root, URDF_NUMBERS)]
    faults += [] if faults else _massless(root)
    if faults:
        raise RobotError("\n".join(faults))
    fuse_inertia(root)

    def load() -> Any:
        spec = mujoco.MjSpec.from_string(root.text())
        # a link without <inertial> has no mass, whatever shape it has
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
        for mesh in spec.meshes:  # its hull is what collides; an open mesh has no volume of its own
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        return spec

    return load


def _turn_exactly(root: Element) -> tuple[str, ...]:
    """Turn collision shapes by exact quarter turns where their angles are these as far as written; names the
    links whose shapes that changes."""
    turned: dict[str, None] = {}
    for link in (one for one in root.children if one.tag == "link"):
        for collision in (one for one in link.children if one.tag == "collision"):
            for origin in (one for one in collision.children if "rpy" in one.attributes):
                words = origin.attributes["rpy"].split()
                exact = [_exact_angle(word) for word in words]
                if [float(word) for word in words] != [float(word) for word in exact]:
                    turned[link.attributes.get("name", "")] = None
                origin.attributes["rpy"] = " ".join(exact)
    return tuple(turned)


def _exact_angle(word: str) -> str:
    """The quarter turns that an angle stands for, rounded or cut off, or the angle as it is written."""
    decimals, quarters = len(word.partition(".")[2]), round(float(word) * 2 / pi) * pi / 2
    near = abs(float(word) - quarters) < 10.0**-decimals
    return repr(quarters) if near and decimals >= QUARTER_DECIMALS else word


def _converted(mesh: Element, file: Path, scratch: Path) -> Path:
    """A mesh that MuJoCo does not read, as OBJ in `scratch` with the same name; raises RobotError."""
    from touchstone.adapters.oracles.collada import obj_of

    target = scratch / file.relative_to(file.anchor).with_suffix(".obj")
    if not target.exists():
        try:
            text = obj_of(file)
        except ValueError as error:
            raise RobotError(mesh.named(f"{file.name}: {error}")) from error
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="ascii")
    return target


def _has_inertia(link: Element) -> bool:
    """Whether a link has a mass and moments, or what MuJoCo will refuse as numbers."""
    found = {one.tag: one for one in link.walk()}
    if "mass" not in found or "inertia" not in found:
        return False
    moments = [number(found["inertia"], name) for name in ("ixx", "iyy", "izz")]
    return number(found["mass"], "value") != 0 and any(moments)


def _massless(root: Element) -> list[str]:
    """Links that a joint moves although neither they nor what is fixed to them have mass and inertia."""
    links, joints = links_and_joints(root)
    fixed = [ends for joint, *ends in joints if joint.attributes.get("type") == "fixed"]
    heavy = {name for name, link in links.items() if _has_inertia(link)}
    for _ in fixed:  # one more level at a time
        heavy |= {parent for parent, child in fixed if child in heavy}
    moved = [(joint, child) for joint, _, child in joints if joint.attributes.get("type") != "fixed"]
    return [
        links[child].named(
            f"joint {joint.attributes.get('name')!r} moves it, but it has no mass or no inertia"
        )
        for joint, child in moved
        if child in links and child not in heavy
    ]


def _check_mjcf(root: Element, path: Path, allow_paths: bool) -> None:
    """Refuse elements that cannot be kept; included files become part of the tree."""
    faults = _include(root, path, allow_paths)
    faults += number_faults(root, MJCF_NUMBERS)
    folders: dict[str, str] = {}
    for compiler in (one for one in root.walk() if one.tag == "compiler"):
        folders |= {key: value for key, value in compiler.attributes.items() if key.endswith("dir")}
    for element in root.walk():
        if element.tag in REFUSED_MJCF:
            faults.append(element.named(REFUSED_MJCF[element.tag]))
        elif element.tag == "equality":
            loops = (one for one in element.children if one.tag in LOOPS)
            faults += [one.named("a closed loop cannot be kept") for one in loops]
        name = element.attributes.get("file")
        if element.tag in FILES and name:
            below = folders.get(FILES[element.tag]) or folders.get("assetdir", "")
            try:
                found_file(element, path.parent, str(Path(below) / name), allow_paths)
            except RobotError as error:
                faults.append(str(error))
    if faults:
        raise RobotError("\n".join(faults))


def _include(root: Element, path: Path, allow_paths: bool, seen: tuple[Path, ...] = ()) -> list[str]:
    """Put the files that elements include below these; returns what is wrong."""
    faults: list[str] = []
    for element in [one for one in root.walk() if one.tag == "include"]:
        try:
            file = found_file(element, path.parent, element.attributes.get("file", ""), allow_paths)
            if file not in seen and len(seen) < DEEPEST_INCLUDE:
                element.children = [parsed(file)]
                faults += _include(element.children[0], path, allow_paths, (*seen, file))
        except RobotError as error:
            faults.append(str(error))
    return faults


def _mjcf_spec(root: Element, path: Path) -> Any:
    """Spec of an MJCF file whatever its suffix: MuJoCo opens .xml alone by its name."""
    if path.suffix == ".xml":
        return mujoco.MjSpec.from_file(str(path))
    included = {
        one.attributes["file"]: one.children[0].file.read_bytes()
        for one in root.walk()
        if one.tag == "include" and one.children
    }
    spec = mujoco.MjSpec.from_string(path.read_text("utf-8"), include=included)
    spec.modelfiledir = str(path.parent)
    return spec


def _compiled(root: Element, load: Any, path: Path) -> tuple[Any, tuple[str, ...]]:
    """The model, and MuJoCo's warnings; raises RobotError with the line of the element that MuJoCo names."""
    warned: dict[str, None] = {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            hear_warnings(lambda text: warned.setdefault(" ".join(text.split())))
            spec = load()
            spec.compiler.fusestatic = False
            model = spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        text = " ".join(str(error).split()).removeprefix("XML Error: ").removeprefix("Error: ")
        found = re.search(r"Element name '([^']*)'", text)
        line = re.search(r"line (\d+)", text)
        tag = re.search(r"Element '([^']*)'", text)
        element = _named(root, found[1]) if found else _at(root, path, line, tag)
        reason = re.sub(r",? ?(Element (name )?'[^']*'(, (id|line) -?\d+)?|line \d+)", "", text).strip()
        reason = next((plain for words, plain in PLAIN_WORDS.items() if words in reason), reason)
        if element is not None:
            given = element.attributes.get(re.sub(r".* attribute:? '(.*)'.*", r"\1", reason))
            raise RobotError(element.named(f"{reason}: found {given!r}" if given else reason)) from error
        place = f"{path}:{line[1]}" if line else f"{path}"
        reason = f"{tag[1]}: {reason}" if tag and line else reason
        raise RobotError(f"{place}: {reason}") from error
    faults: list[tuple[str, str, str]] = []
    for body in range(model.nbody):
        own = [getattr(model, f"body_{name}")[body] for name in ("mass", "inertia", "ipos", "pos")]
        turns = [np.linalg.norm(getattr(model, f"body_{name}")[body]) for name in ("iquat", "quat")]
        if not (np.isfinite(np.hstack(own)).all() and np.allclose(turns, 1)):
            faults.append(("body", model.body(body).name, "its mass, inertia or pose is not finite"))
    for joint in np.flatnonzero(~np.isclose(np.linalg.norm(model.jnt_axis, axis=1), 1)):
        faults.append(("joint", model.joint(joint).name, "its axis is not finite"))
    for kind, name, reason in faults:
        element = _named(root, name)
        raise RobotError(element.named(reason) if element else f"{path}: {kind} {name!r}: {reason}")
    return model, tuple(warned)


def _at(root: Element, path: Path, line: re.Match[str] | None, tag: re.Match[str] | None) -> Element | None:
    """The element of a tag in a line of the robot's own file."""
    asked = (path, int(line[1]), tag[1]) if line and tag else None
    return next((one for one in root.walk() if (one.file, one.line, one.tag) == asked), None)


def _named(root: Element, name: str) -> Element | None:
    return next((one for one in root.walk() if one.attributes.get("name") == name), None)
