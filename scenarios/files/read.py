"""Scenes read from a file: TOML, JSON, or Python with functions marked `@scene`."""

import json
import re
import tomllib
from collections.abc import Callable, Collection, Iterable
from dataclasses import asdict, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from pydantic import BaseModel

from touchstone.scenarios.avatar.number_checks import LONGEST
from touchstone.scenarios.files.mass_properties import uniform
from touchstone.scenarios.files.mesh_file import MeshFileError, triangles_of
from touchstone.scenarios.files.safe_paths import PathRefused, allowed, regular
from touchstone.scenarios.files.schema import (
    CORNERS,
    KEYFRAMES,
    SHAPE_TYPES,
    SURFACES,
    UNKNOWN,
    Fault,
    checked,
    model_of,
    shape_type,
)
from touchstone.scenarios.files.text_lines import Path as Place
from touchstone.scenarios.files.text_lines import json_lines, line_of, toml_lines
from touchstone.scenarios.files.tracker_file import TrackerFileError, keyframes
from touchstone.scenarios.scenario import ORIGIN, UNMOVED, Piece, Scenario, ScenarioError, Shape

NAME = re.compile(r"\w[\w .,+=-]{0,99}")
"""Names of scenes in files: they name files of results."""
MOST_BYTES = 10**8
"""Size of a document [bytes]: the largest scenes of ours take less than 1 MB."""
UNIT_INERTIA = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
ARITHMETIC = (ValueError, ArithmeticError, IndexError)
"""Exceptions of the inertia of a body whose mass or shape is wrong."""
MISSING = "missing"
TIMED = ("trackers", "expectations", "truths", "forces", "published")
"""Fields whose checks depend on the duration, gravity or effects of the scene."""
STEP = re.compile(r"\[(\d+)\]|([^.\[\]]+)")
"""An index or a name in the path of a fault."""


class SceneFileError(ValueError):
    """A file holds no valid scene; the message has one line per fault: file, line, field, what is wrong."""


def document(path: Path) -> tuple[dict[str, Any], Callable[[], dict[Place, int]]]:
    """Data of a TOML or JSON file, and a function that finds the line of each value.

    Raises:
        SceneFileError: the file cannot be read or is not of its format.
    """
    try:
        if (size := regular(path).stat().st_size) > MOST_BYTES:
            raise SceneFileError(f"{path}: {size / 1e6:.3g} MB, expected at most {MOST_BYTES / 1e6:g} MB")
        text = path.read_text(encoding="utf-8-sig")  # without the mark that editors on Windows put first
    except OSError as error:
        raise SceneFileError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise SceneFileError(f"{path}: not a text in UTF-8") from error
    try:
        if path.suffix.lower() == ".json":
            data, lines = json.loads(text, object_pairs_hook=_once), lambda: json_lines(text)
        else:
            data, lines = tomllib.loads(text), lambda: toml_lines(text)
    except json.JSONDecodeError as error:
        raise SceneFileError(f"{path}:{error.lineno}: not JSON: {error.msg}") from error
    except tomllib.TOMLDecodeError as error:
        found = re.search(r" \(at line (\d+), column \d+\)| \(at end of document\)", str(error))
        line = found[1] if found and found[1] else text.count("\n") + 1
        raise SceneFileError(f"{path}:{line}: not TOML: {str(error).partition(' (at')[0]}") from error
    except (ValueError, RecursionError) as error:
        raise SceneFileError(f"{path}: {error}") from error
    if not isinstance(data, dict):
        raise SceneFileError(f"{path}:1: expected a table of fields")
    return data, lines


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"not JSON: the field {twice!r} is named twice")
    return found


def data_of_file(path: Path, model: type[BaseModel]) -> tuple[dict[str, Any], list[Fault], Callable]:
    """Checked data of a TOML or JSON file, its faults, and a function for messages about them."""
    data, lines = document(path)
    found, faults = checked(data, model)

    def message_of(all_faults: Iterable[Fault]) -> str:
        found_lines = lines()
        rows = sorted((line_of(found_lines, place), named(place), text) for place, text in all_faults)
        return "\n".join(f"{path}:{line}: {where}: {text}" for line, where, text in rows)

    return found, faults, message_of


def named(place: Place) -> str:
    """A path as in messages: bodies[0].mass."""
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in place).removeprefix(".")


def placed(name: str) -> Place:
    """The path of a message."""
    return tuple(int(index) if index else key for index, key in STEP.findall(name))


def read_scene(path: Path, allow_paths: bool = False) -> Scenario:
    """Scene of a TOML or JSON file; a scene without a name is called like its file.

    Args:
        allow_paths: whether trackers and meshes may name files outside the scene's folder.
    Raises:
        SceneFileError: the file is not valid; names all faults at once, each with its line.
    """
    data, faults, message_of = data_of_file(path, model_of(Scenario))
    misspelt = {place[:-1] for place, _ in faults}
    doubtful = {place[:2] for place, text in faults if not text.startswith(UNKNOWN)}
    untimed = any(len(place) == 1 or place[0] not in data for place in doubtful)
    if data:
        data = {"name": path.stem, "summary": "", "tags": (), **data}
        if not NAME.fullmatch(data["name"]):
            text = (
                f"found {data['name'][:100]!r}, expected up to 100 letters, digits and -_ .,+= after a letter"
            )
            faults.append((("name",), text))
        own: list[Fault] = []
        joints = data.get("body_joints", ())
        joined = {name for joint in joints for name in (joint["parent"], joint["child"])}
        for i, body in enumerate(data["bodies"]):
            own += _meshed(body, ("bodies", i, "mesh"), path.parent, allow_paths)
            own += _shaped(body, ("bodies", i), body.get("name") in joined)
            own += _weighed(body, ("bodies", i))
        for i, tracker in enumerate(data.get("trackers", ())):
            own += _tracked(tracker, ("trackers", i), path.parent, allow_paths)
        faults += [
            (where, text)
            for where, text in own
            if where[:2] not in doubtful and (text != MISSING or where[:-1] not in misspelt)
        ]
        try:
            scenario = scenario_of(data)
        except ScenarioError as error:
            # A check of what took the place of a wrong field, an inertia or a tracker's file says nothing.
            doubtful |= {place[:2] for place, _ in own}
            faults += [
                one
                for one in ((placed(where), text) for where, text in error.faults)
                if one[0][:2] not in doubtful
                and not _misspelt(one[0], misspelt, data)
                and not (untimed and one[0][0] in TIMED)
            ]
    if faults:
        raise SceneFileError(message_of(faults))
    return scenario


def _misspelt(place: Place, unknown: Collection[Place], data: Any) -> bool:
    """Whether a fault is of a field that is absent beside an unknown one, which may be meant for it."""
    if place[:-1] not in unknown:
        return False
    for key in place[:-1]:
        data = data[key]
    return place[-1] not in data


def _meshed(body: dict[str, Any], place: Place, folder: Path, allow_paths: bool) -> list[Fault]:
    """Add the triangles of a mesh's file, or take away a mesh that has none; returns the faults."""
    if "mesh" not in body:
        return []
    mesh = body["mesh"]
    name, inline = mesh.pop("file", ""), [field for field in CORNERS if field in mesh]
    faults: list[Fault] = []
    if name and inline:
        faults.append(((*place, "file"), f"found with {', '.join(inline)}: expected one or the other"))
    elif name:
        try:
            mesh |= triangles_of(allowed(folder, name, allow_paths))
        except (MeshFileError, PathRefused) as error:
            faults.append(((*place, "file"), str(error)))
    else:
        faults += [((*place, field), MISSING) for field in CORNERS if field not in mesh]
    if faults:
        del body["mesh"]
        body["pieces"] = ()
    return faults


def _shaped(body: dict[str, Any], place: Place, joined: bool) -> list[Fault]:
    """Give a body the pieces of its surface, or none if it is `joined` and has neither; returns faults."""
    found = [name for name in SURFACES if name in body]
    if not found:
        asked = "pieces" not in body and not joined
        body.setdefault("pieces", ())
        return [((*place, "pieces"), MISSING)] if asked else []
    name, *more = found
    surface, where = built(SURFACES[name], body.pop(name)), (*place, name)
    faults: list[Fault] = [((*where, *placed(field)), text) for field, text in surface.faults()]
    if body["kind"] not in UNMOVED:
        faults.append((where, f"found on a {body['kind']} body, expected a fixed or prescribed one"))
    for other in (*more, *(["pieces"] if body.get("pieces") else [])):
        body.pop(other)
        faults.append((where, f"found with {other}: expected one or the other"))
    body["pieces"] = () if faults else [asdict(piece) for piece in surface.pieces()]
    return faults


def _weighed(body: dict[str, Any], place: Place) -> list[Fault]:
    """Add the inertia of a body that states a mass only; returns the faults."""
    if body["kind"] in UNMOVED or "mass" not in body or "inertia" in body or not body["pieces"]:
        return []
    faults: list[Fault] = []
    if "center_of_mass" in body:
        faults.append(((*place, "inertia"), "missing: a body with a centre of mass needs it"))
    try:
        pieces = tuple(built(Piece, piece) for piece in body["pieces"])
        with np.errstate(all="ignore"):
            center, inertia = uniform(pieces, body["mass"])
        sound = bool((np.abs(center) <= LONGEST).all() and np.isfinite(inertia).all())
    except ARITHMETIC:
        sound = False
    # the checks of the scenario name the mass or shape that is wrong
    body["center_of_mass"], body["inertia"] = (center, inertia) if sound else (ORIGIN, UNIT_INERTIA)
    return faults


def _tracked(tracker: dict[str, Any], place: Place, folder: Path, allow_paths: bool) -> list[Fault]:
    """Add the keyframes of a tracker's file; returns the faults."""
    faults: list[Fault] = []
    name, inline = tracker.pop("file", ""), [field for field in KEYFRAMES if field in tracker]
    joints = tracker.setdefault("joints", ())
    if name and inline:
        faults.append(((*place, "file"), f"found with {', '.join(inline)}: expected one or the other"))
    elif name:
        try:
            tracker |= keyframes(allowed(folder, name, allow_paths), joints)
        except (TrackerFileError, PathRefused) as error:
            faults.append(((*place, "file"), str(error)))
    elif not joints:
        tracker.setdefault("angles", ((),) * len(tracker.get("times", ())))
    missing = [field for field in KEYFRAMES if field not in tracker]
    if missing and not name:
        faults.append((place, f"no {', '.join(missing)}: expected these or a file"))
    tracker |= dict.fromkeys(missing, ())
    return faults


def scenario_of(data: dict[str, Any]) -> Scenario:
    """The scenario of checked data, such as the JSON text in a recording; raises ScenarioError."""
    scenario: Scenario = built(Scenario, data)
    return scenario


_hints: Callable[[Any], dict[str, Any]] = cache(get_type_hints)


def built(kind: Any, data: Any) -> Any:
    """A value of a dataclass's field from plain data: dataclasses from tables, tuples from arrays."""
    if kind == Shape:
        name = shape_type(data)
        return built(SHAPE_TYPES[str(name)], {key: value for key, value in data.items() if key != "type"})
    if is_dataclass(kind):
        hints = _hints(kind)
        return kind(**{name: built(hints[name], value) for name, value in data.items()})  # type: ignore[operator]
    if get_origin(kind) is tuple:
        inner = get_args(kind)
        if len(inner) == 2 and inner[1] is Ellipsis:
            return tuple(built(inner[0], one) for one in data)
        return tuple(built(one, value) for one, value in zip(inner, data))
    return float(data) if kind is float else data
