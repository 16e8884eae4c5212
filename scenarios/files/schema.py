"""Schema of a scene file: pydantic models made from the dataclasses of a scenario, and their JSON Schema.

A file has the fields of `Scenario`. Beyond those, a shape has a `type`, a body with a mass needs no inertia
(`mass_properties.py`), and a tracker may name a `file` (`tracker_file.py`).
"""

import difflib
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ConfigDict, Discriminator, Strict, Tag, ValidationError, create_model
from pydantic import Field as ModelField

from touchstone.scenarios.files.text_lines import Path
from touchstone.scenarios.height_field import HeightField
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Body, Scenario, Shape, Tracker, shape_name
from touchstone.scenarios.triangle_mesh import TriangleMesh

SHAPE_TYPES: dict[str, type] = {shape_name(kind): kind for kind in get_args(Shape)}
"""Names of the shapes in files."""
KEYFRAMES = ("times", "positions", "orientations", "angles")
"""Fields of a tracker that its `file` may hold."""
CORNERS = ("vertices", "triangles")
"""Fields of a mesh that its `file` may hold."""
SURFACES: dict[str, type] = {"height_field": HeightField, "mesh": TriangleMesh}
"""Fields of a body in place of its pieces."""
OPTIONAL: dict[type, dict[str, Any]] = {
    Scenario: {"name": "", "summary": "", "tags": ()},
    Body: {"pieces": ()},
    Tracker: {"joints": (), **dict.fromkeys(KEYFRAMES, ())},
    TriangleMesh: dict.fromkeys(CORNERS, ()),
}
"""Fields that a file may omit although the dataclass requires them."""
ADDED: dict[type, dict[str, tuple[Any, Any]]] = {
    Body: {
        name: (kind, ModelField(None, description="a surface, in place of pieces"))
        for name, kind in SURFACES.items()
    },
    Tracker: {"file": (str, ModelField("", description="CSV or NPZ file with the keyframes"))},
    TriangleMesh: {"file": (str, ModelField("", description="OBJ or STL file with the triangles"))},
}
"""Fields of files that the dataclass does not have."""
NUMBER = 1.0
"""Stands for a wrong number that a file must state, so that the other fields can be checked."""
UNKNOWN = "unknown field"
"""Start of the fault of a field that there is not."""
Fault = tuple[Path, str]
"""Path of a field, and what is wrong."""


@cache
def model_of(kind: type) -> type[BaseModel]:
    """Pydantic model of a dataclass: the same fields and defaults, unknown ones refused, numbers strict."""
    hints = get_type_hints(kind)
    given: dict[str, Any] = {
        field.name: (_translated(hints[field.name]), _default(kind, field)) for field in fields(kind)
    }
    name = next((name for name, shape in SHAPE_TYPES.items() if shape is kind), "")
    if name:
        given["type"] = (Literal[name], name)
    given |= {name: (_translated(hint), field) for name, (hint, field) in ADDED.get(kind, {}).items()}
    config = ConfigDict(extra="forbid", allow_inf_nan=True)
    model: type[BaseModel] = create_model(kind.__name__, __config__=config, __doc__=kind.__doc__, **given)
    return model


def _default(kind: type, field: Field[Any]) -> Any:
    if field.name in OPTIONAL.get(kind, {}):
        return OPTIONAL[kind][field.name]
    return ... if field.default is MISSING else field.default


def _translated(hint: Any) -> Any:
    """The type of a model's field for that of a dataclass's field."""
    if hint == Shape:
        tagged = tuple(Annotated[model_of(kind), Tag(name)] for name, kind in SHAPE_TYPES.items())
        return Annotated[Union[tagged], Discriminator(shape_type)]  # noqa: UP007
    if is_dataclass(hint):
        return model_of(hint)  # type: ignore[arg-type]
    if get_origin(hint) is tuple:
        return tuple[tuple(_translated(one) if one is not Ellipsis else one for one in get_args(hint))]  # type: ignore[misc]
    if isinstance(hint, UnionType):
        raise TypeError(f"no schema for the union {hint}")
    return Annotated[hint, Strict()] if hint in (int, float, str) else hint


def shape_type(shape: Any) -> str | None:
    """Name of a shape's type: its `type`, or else the type that has its fields; None if there is none."""
    if isinstance(shape, BaseModel):
        return shape_name(type(shape))
    if not isinstance(shape, dict):
        return None
    if "type" in shape:
        return str(shape["type"])
    shared = {name: len(shape.keys() & _names(kind)) for name, kind in SHAPE_TYPES.items()}
    missed = {name: len(_names(kind) - shape.keys()) for name, kind in SHAPE_TYPES.items()}
    best = max(shared, key=lambda name: (shared[name], -missed[name]))
    return best if shared[best] else None


def _names(kind: type) -> set[str]:
    return {field.name for field in fields(kind)}


def json_schema() -> dict[str, Any]:
    """JSON Schema of a scene file."""
    found = model_of(Scenario).model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found, "title": "touchstone scene"}


def checked(data: Any, model: type[BaseModel]) -> tuple[dict[str, Any], list[Fault]]:
    """Plain data of a file, and the faults of its fields, types and choices.

    Unknown fields, and wrong ones that may be omitted, are reported and left out of the data; other wrong
    numbers become NUMBER. Without what other parts refer to, as a name, the data are empty.
    """
    found: list[Fault] = []
    try:
        return model.model_validate(data).model_dump(exclude_unset=True), found
    except ValidationError as error:
        places = [(one, _in_file(one["loc"], data)) for one in error.errors()]
        found += [(path, _message(one, path, model)) for one, path in places]
        sound = [_without(data, path, one["loc"], model) for one, path in places]
    return (checked(data, model)[0] if all(sound) else {}), found


def _in_file(place: tuple[Any, ...], data: Any) -> Path:
    """The path in the file: without the names of shape types, which pydantic adds."""
    path: list[str | int] = []
    for key in place:
        if isinstance(key, str) and isinstance(data, dict) and key not in data and key in SHAPE_TYPES:
            continue
        path.append(key)
        try:
            data = data[key]
        except (KeyError, IndexError, TypeError):
            data = None
    return tuple(path)


def _without(data: Any, path: Path, place: tuple[Any, ...], model: Any) -> bool:
    """Take a faulty value, or the innermost part around it that may be omitted, out of the data, or put
    NUMBER in place of a number; returns whether that leaves everything that other parts refer to."""
    for k in range(len(path), 0, -1):
        *above, name = path[:k]
        inner = _model_at(place, model)
        field = inner.model_fields.get(name) if inner is not None and isinstance(name, str) else None
        if k == 1 and field is not None and _inner_model(field.annotation) is not None:
            return False
        if isinstance(name, str) and (field is None or not field.is_required() or field.annotation is float):
            try:
                for key in above:
                    data = data[key]
            except (KeyError, IndexError):  # taken out with the part around it
                return True
            data.pop(name, None)
            data |= {name: NUMBER} if field is not None and field.is_required() else {}
            return True
        place = place[: len(place) - 1 - place[::-1].index(name)]
    return False


def _message(one: Any, path: Path, model: type[BaseModel]) -> str:
    """What was found and what is expected, from an error of pydantic."""
    match one["type"]:
        case "extra_forbidden":
            inner = _model_at(one["loc"], model)
            valid = list(inner.model_fields) if inner is not None else []
            within = _parts_with(path[-1], _model_at(one["loc"], model))
            return f"{_unknown(path[-1], valid)}{within} (valid: {', '.join(valid)})"
        case "missing":
            return "missing"
        case "union_tag_invalid" | "union_tag_not_found":
            shapes = (f"{name} ({', '.join(sorted(_names(kind)))})" for name, kind in SHAPE_TYPES.items())
            asked = one["input"].get("type") if isinstance(one["input"], dict) else None
            found = f"unknown type {asked!r}" if asked is not None else _no_shape(one["input"])
            return f"{found}{'' if found.endswith('?') else ';'} valid: {', '.join(shapes)}"
        case "tuple_type":
            expected = _list_of(one["loc"], model)
        case "too_long":
            expected = f"at most {plural(one['ctx']['max_length'], 'value')}"
        case "model_type":
            expected = "a table of fields"
        case _:
            said = one["msg"].removeprefix("Input should be ")
            expected = f"{said[:1].lower()}{said[1:]}"
    return f"found {_short(one['input'])}, expected {expected}"


def _list_of(place: tuple[Any, ...], model: Any) -> str:
    """What a field holds whose value is a list: of so many numbers, if the field says how many."""
    inner = _model_at(place, model)
    hint = inner.model_fields[place[-1]].annotation if inner and place[-1] in inner.model_fields else None
    parts = get_args(hint)
    numbers = all(float in (part, *get_args(part)) for part in parts)
    return f"a list of {plural(len(parts), 'number')}" if parts and numbers else "a list"


def _unknown(name: object, valid: list[str]) -> str:
    """An unknown field, and those that it resembles."""
    near = difflib.get_close_matches(str(name), valid, n=3, cutoff=0.5)
    hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
    return f"{UNKNOWN} {name!r}{hint}"


def _parts_with(name: object, model: Any) -> str:
    """The parts of a model that have a field of this name."""
    own = model.model_fields if model is not None else {}
    parts = {part: _inner_model(field.annotation) for part, field in own.items()}
    those = [part for part, inner in parts.items() if inner is not None and name in inner.model_fields]
    return f"; {' and '.join(those)} have it" if those else ""


def _no_shape(found: Any) -> str:
    """That fields are those of no shape, and the first that no shape has."""
    valid = sorted({name for kind in SHAPE_TYPES.values() for name in _names(kind)})
    others = [name for name in found if name not in valid] if isinstance(found, dict) else []
    return f"found no shape: {_unknown(others[0], valid)}" if others else "found no shape"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _model_at(place: tuple[Any, ...], model: Any) -> Any:
    """The model of which the last name of a place is a field."""
    for key in place[:-1]:
        if isinstance(key, int) or model is None:
            continue
        if key in SHAPE_TYPES:
            model = model_of(SHAPE_TYPES[key])
        elif key in model.model_fields:
            model = _inner_model(model.model_fields[key].annotation)
    return model


def _inner_model(hint: Any) -> Any:
    """The model inside a field's type."""
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        return hint
    return next((found for one in get_args(hint) if (found := _inner_model(one)) is not None), None)
