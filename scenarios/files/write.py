"""Scenes written as TOML or JSON; reading them back gives an equal scenario, to the bit."""

import json
import re
from dataclasses import MISSING, fields, is_dataclass
from typing import Any, get_args

from touchstone.scenarios.scenario import Scenario, Shape, shape_name

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
WIDTH = 100
"""Longest line on which an array stays."""
UNSAFE = re.compile(r"\x7f")
"""Characters that JSON leaves in strings and TOML forbids."""


def scene_data(scenario: Scenario, complete: bool = True) -> dict[str, Any]:
    """Plain data of a scenario, as in a file: all fields, or those that differ from their defaults."""
    found: dict[str, Any] = _plain(scenario, complete)
    return found


def _plain(value: Any, complete: bool) -> Any:
    if is_dataclass(value):
        found: dict[str, Any] = {}
        if isinstance(value, get_args(Shape)):
            found["type"] = shape_name(type(value))
        for field in fields(value):
            own = getattr(value, field.name)
            # The text of a value tells -0.0 from 0.0.
            if complete or field.default is MISSING or repr(own) != repr(field.default):
                found[field.name] = _plain(own, complete)
        return found
    if isinstance(value, tuple | list):
        return [_plain(one, complete) for one in value]
    if isinstance(value, str):
        return str(value)
    return int(value) if isinstance(value, int) else float(value)


def scene_json(scenario: Scenario) -> str:
    """A scenario as JSON text with all fields, a line per body, joint or other part."""
    lines = []
    for name, value in scene_data(scenario).items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = ",\n".join(f"  {json.dumps(row, allow_nan=False)}" for row in value)
            lines.append(f" {json.dumps(name)}: [\n{rows}\n ]")
        else:
            lines.append(f" {json.dumps(name)}: {json.dumps(value, allow_nan=False)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def scene_toml(scenario: Scenario, comment: str = "") -> str:
    """A scenario as TOML text without fields that have their default; `comment` stands above it."""
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + _table(scene_data(scenario, complete=False), ())


def _table(data: dict[str, Any], path: tuple[str, ...]) -> str:
    """Keys with values, then arrays of tables with headers of their own; shapes stay on one line."""
    text, below = "", ""
    for key, value in data.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            inner = (*path, key)
            header = f"\n[[{'.'.join(map(_key, inner))}]]\n"
            below += "".join(header + _table(one, inner) for one in value)
        else:
            text += f"{_key(key)} = {_value(value)}\n"
    return text + below


def _key(name: str) -> str:
    return name if BARE_KEY.fullmatch(name) else _text(name)


def _text(text: str) -> str:
    return UNSAFE.sub(lambda found: f"\\u{ord(found[0]):04x}", json.dumps(text, ensure_ascii=False))


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        parts = [_value(one) for one in value]
        flat = f"[{', '.join(parts)}]"
        if len(flat) <= WIDTH or not isinstance(value[0], list):
            return flat
        return "[\n" + "".join(f"    {part},\n" for part in parts) + "]"
    return repr(value)
