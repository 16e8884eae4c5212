"""Recordings that someone has forged, each in one way: a field's arrays or texts, or the archive."""

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from functools import partial
from math import nan
from pathlib import Path

import numpy as np

Columns = dict[str, np.ndarray]
Change = Callable[[Columns, str], object]
"""Change of a field's array among all."""


def _json(change: Callable[[dict], object]) -> Change:
    def forge(columns: Columns, field: str) -> None:
        data = json.loads(str(columns[field]))
        change(data)
        columns[field] = np.array(json.dumps(data))

    return forge


def _to(value: object) -> Change:
    return lambda columns, field: columns.update({field: np.asarray(value)})


def _array(change: Callable[[np.ndarray], np.ndarray]) -> Change:
    return lambda columns, field: columns.update({field: change(columns[field])})


def _in_place(change: Callable[[np.ndarray], object]) -> Change:
    return lambda columns, field: change(columns[field])


def _cast(kind: object) -> Change:
    return _array(lambda array: array.astype(kind))


def _contact(**values: object) -> Change:
    def forge(columns: Columns, field: str) -> None:
        rows = np.zeros(1, columns["contacts"].dtype)
        for name, value in values.items():
            rows[name] = value
        columns["contacts"] = rows

    return forge


def _per_frame(columns: Columns, field: str, width: int, fewer: int = 0) -> None:
    """Let a field have so many numbers for each frame."""
    columns[field] = np.zeros((len(columns["time"]) - fewer, width))


ARRAYS = (
    "time",
    "position",
    "orientation",
    "joint_angle",
    "driver_work",
    "driver_impulse",
    "time_frame",
    "work",
)
CUT = _array(lambda array: array[..., :-1])
HALF = "\ud800"
"""Half a character."""
BY_FIELD: Mapping[str, Mapping[str, Change]] = {
    "position": {
        "single": _cast("f4"),
        "complex": _cast("c16"),
        "objects": _cast(object),
        "a row less": _array(lambda array: array[1:]),
        "two coordinates": CUT,
        "a body less": _array(lambda array: array[:, 1:]),
        "not finite": _in_place(lambda array: array.fill(np.nan)),
        "too far": _in_place(lambda array: array.__setitem__(-1, 1e308)),
    },
    "orientation": {"vectors": CUT, "not finite": _in_place(lambda array: array.fill(np.inf))},
    "angular_velocity": {"too fast": _in_place(lambda array: array.__setitem__(-1, 1e39))},
    "joint_angle": {"one more": partial(_per_frame, width=9)},
    "driver_work": {"infinite": _in_place(lambda array: array.fill(np.inf))},
    "work": {"not finite": _in_place(lambda array: array.fill(np.nan))},
    "time": {
        "whole numbers": _cast(int),
        "empty": _to(np.zeros(0)),
        "NaN": _in_place(lambda array: array.__setitem__(1, np.nan)),
        "infinite": _in_place(lambda array: array.__setitem__(-1, np.inf)),
        "backwards": _array(lambda array: array[::-1].copy()),
        "far apart": _in_place(lambda array: array.__imul__(1e300)),
        "at once": _in_place(lambda array: array.__imul__(1e-300)),
        "later": _in_place(lambda array: array.__iadd__(1e9)),
        "longer than the scene": _to(np.arange(9999) / 60),
    },
    "time_frame": {"a frame less": CUT, "negative": _in_place(lambda array: array.fill(-1))},
    "stage_seconds": {"a stage more": partial(_per_frame, width=99, fewer=1)},
    "stage_names": {
        "bytes": _to(np.array([b"a"])),
        "half a character": _array(lambda array: np.full_like(array, HALF)),
    },
    "contacts": {
        "plain": _to(np.zeros((3, 25))),
        "before the run": _contact(time=-1),
        "at no time": _contact(time=np.nan),
        "after the run": _contact(time=1e308),
        "nowhere": _contact(position=np.nan),
        "far away": _contact(distance=-1e308),
        "an infinite impulse": _contact(impulse=np.inf),
        "a body too many": _contact(body_b=10**6),
        "a body below 0": _contact(body_a=-1),
    },
    "format_version": {"a text": _to("three"), "several": _to([3, 3]), "NaN": _to(np.nan)},
    "scenario": {
        "empty": _to(""),
        "a list": _to("[1, 2]"),
        "deep": _to("[" * 100_000),
        "no bodies": _json(lambda data: data.pop("bodies")),
        "a body less": _json(lambda data: data["bodies"].pop()),
        "bodies are texts": _json(lambda data: data.update(bodies=["a", "b"])),
        "a mass is a text": _json(lambda data: data["bodies"][0].update(mass="1")),
        "a mass is NaN": _json(lambda data: data["bodies"][-1].update(mass=nan, kind="simulated")),
        "another body": _json(lambda data: data["bodies"][-1].update(name="other")),
        "an unknown field": _json(lambda data: data.update(more=1)),
        "another folder": _json(lambda data: data.update(name="../../elsewhere")),
        "no frame rate": _json(lambda data: data.update(frame_rate=0)),
        "half a character": _json(lambda data: data.update(summary=HALF)),
        "endless": _json(lambda data: data.update(duration=1e308)),
    },
    "manifest": {
        "no JSON": _to("{"),
        "a list": _to("[]"),
        "no engine": _json(lambda data: data.pop("engine")),
        "no profile": _json(lambda data: data.pop("profile")),
        "a step of 0": _json(lambda data: data.update(dt=0)),
        "a step is a text": _json(lambda data: data.update(dt="1/60")),
        "a step is NaN": _json(lambda data: data.update(dt=nan)),
        "a step beyond numbers": _json(lambda data: data.update(dt=10**400)),
        "half a character": _json(lambda data: data.update(engine=HALF)),
        "an effect is a number": _json(lambda data: data["effects"].update(contact=1)),
        "another body": _json(lambda data: data["bodies"].update(other={})),
        "effects are a list": _json(lambda data: data.update(effects=[1])),
    },
    "ended": {"half a character": _to(HALF), "several": _to(["a", "b"])},
}
"""Field -> what is wrong with it, and how to forge that."""
CHANGES: Mapping[str, tuple[str, Change]] = {
    **{f"no {name}": (name, dict.pop) for name in ("scenario", "contacts", "work")},
    **{f"{name}: texts": (name, _to(["a"])) for name in ARRAYS},
    **{f"{name}: a number": (name, _to(1.0)) for name in (*ARRAYS, "contacts", "stage_names", "ended")},
    **{f"{name}: {way}": (name, change) for name, ways in BY_FIELD.items() for way, change in ways.items()},
}
"""Way to forge -> the field, and the change."""


def _claiming(shape: str) -> Callable[[Path], None]:
    """Let `position` claim a shape that the file does not hold."""

    def forge(path: Path) -> None:
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (1,)})
        text = (
            head.getvalue().replace(b"(1,)", shape.encode()).replace(b" " * (len(shape) - 4) + b"\n", b"\n")
        )
        _rewritten(path, {"position.npy": text + bytes(64)})

    return forge


def _rewritten(path: Path, members: Mapping[str, bytes]) -> None:
    with zipfile.ZipFile(path) as archive:
        kept = {name: archive.read(name) for name in archive.namelist()} | members
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in kept.items():
            archive.writestr(name, data)


FILES: Mapping[str, tuple[str, Callable[[Path], None]]] = {
    "a huge shape": ("position", _claiming("(99999999999999,)")),
    "a shape beyond integers": ("position", _claiming(f"({10**30},)")),
    "a negative shape": ("position", _claiming("(-5,)")),
    "no array": ("position", lambda path: _rewritten(path, {"position.npy": b"no array"})),
    "half a file": (
        "",
        lambda path: path.write_bytes(path.read_bytes()[: path.stat().st_size // 2]) and None,
    ),
    "an empty archive": ("", lambda path: zipfile.ZipFile(path, "w").close()),
    "a bare array": ("", lambda path: path.write_bytes(b"\x93NUMPY\x01\x00") and None),
}
"""Way to forge a file -> what the message names, and the change of the file."""
WAYS = (*CHANGES, *FILES)


def forge(path: Path, way: str) -> str:
    """Forge a recording in one way; returns what a message names."""
    if way in FILES:
        named, change_file = FILES[way]
        change_file(path)
        return named
    field, change = CHANGES[way]
    rewrite(path, lambda columns: change(columns, field))
    return field.replace("format_version", "format version")


def rewrite(path: Path, change: Callable[[Columns], object]) -> None:
    """Change the arrays of a file."""
    with np.load(path) as archive:
        columns = {name: archive[name].copy() for name in archive.files}
    change(columns)
    np.savez(path, **columns)  # type: ignore[arg-type]
